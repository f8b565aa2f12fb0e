//! Two-dimensional real FFTs of one tile size, split into row and column passes. Weights are applied between the passes.

use std::collections::BTreeMap;
use std::sync::Arc;

use petzval_fourier::{Complex32, ComplexToReal, Fft, Planner32, RealToComplex};

/// Rows and columns of a transform.
pub(super) type TransformSize = (usize, usize);

/// The plans of one transform size. Half spectra are stored transposed, `[column bin][row]`, so that the column pass
/// runs over contiguous memory.
pub(super) struct TilePlan {
    pub rows: usize,
    pub cols: usize,
    pub bins: usize,
    row_forward: Arc<dyn RealToComplex<f32>>,
    row_inverse: Arc<dyn ComplexToReal<f32>>,
    col_forward: Arc<dyn Fft<f32>>,
    col_inverse: Arc<dyn Fft<f32>>,
}

/// Buffers of one worker.
#[derive(Default)]
pub(super) struct Scratch {
    line: Vec<f32>,
    block: Vec<Complex32>,
    fft: Vec<Complex32>,
}

/// Rows transposed together, one cache line of complex numbers.
const BLOCK: usize = 8;

/// Smallest even length with no prime factor above 5 that holds `n` samples.
pub(super) fn fast_len(n: usize) -> usize {
    let smooth = |mut m: usize| {
        for p in [2, 3, 5] {
            while m.is_multiple_of(p) {
                m /= p;
            }
        }
        m == 1
    };
    (n.max(2)..).find(|&m| m.is_multiple_of(2) && smooth(m)).unwrap_or(n)
}

/// One plan for each size in `sizes`.
pub(super) fn plans(sizes: impl Iterator<Item = TransformSize>) -> BTreeMap<TransformSize, TilePlan> {
    let mut planner = Planner32::default();
    let mut plans = BTreeMap::new();
    for (rows, cols) in sizes {
        plans.entry((rows, cols)).or_insert_with(|| TilePlan {
            rows,
            cols,
            bins: cols / 2 + 1,
            row_forward: planner.real_forward(cols),
            row_inverse: planner.real_inverse(cols),
            col_forward: planner.forward(rows),
            col_inverse: planner.inverse(rows),
        });
    }
    plans
}

impl TilePlan {
    /// Values of one half spectrum.
    pub fn len(&self) -> usize {
        self.bins * self.rows
    }

    /// Row pass of the forward transform: `fill(row, line)` writes each row of `first..first + count`; the others are zero.
    pub fn rows_forward(
        &self,
        first: usize,
        count: usize,
        spectrum: &mut Vec<Complex32>,
        scratch: &mut Scratch,
        mut fill: impl FnMut(usize, &mut [f32]),
    ) {
        spectrum.clear();
        spectrum.resize(self.len(), Complex32::default());
        scratch.line.resize(self.cols, 0.0);
        scratch.block.resize(BLOCK * self.bins, Complex32::default());
        scratch.fft.resize(self.row_forward.get_scratch_len(), Complex32::default());
        for block in (first..first + count).step_by(BLOCK) {
            let n = BLOCK.min(first + count - block);
            for k in 0..n {
                scratch.line.fill(0.0);
                fill(block + k, &mut scratch.line);
                let out = &mut scratch.block[k * self.bins..(k + 1) * self.bins];
                self.row_forward
                    .process_with_scratch(&mut scratch.line, out, &mut scratch.fft)
                    .expect("buffers have the planned lengths");
            }
            // Transpose the block into the columns of the spectrum.
            for (bin, column) in spectrum.chunks_exact_mut(self.rows).enumerate() {
                for k in 0..n {
                    column[block + k] = scratch.block[k * self.bins + bin];
                }
            }
        }
    }

    /// Column pass of the forward transform, in place.
    pub fn cols_forward(&self, spectrum: &mut [Complex32], scratch: &mut Scratch) {
        scratch.fft.resize(self.col_forward.get_inplace_scratch_len(), Complex32::default());
        self.col_forward.process_with_scratch(spectrum, &mut scratch.fft);
    }

    /// Column pass of the inverse transform, in place, not normalised.
    pub fn cols_inverse(&self, spectrum: &mut [Complex32], scratch: &mut Scratch) {
        scratch.fft.resize(self.col_inverse.get_inplace_scratch_len(), Complex32::default());
        self.col_inverse.process_with_scratch(spectrum, &mut scratch.fft);
    }

    /// Row pass of the inverse transform, normalised: `take(row, line)` receives each row of `first..first + count`.
    pub fn rows_inverse(
        &self,
        first: usize,
        count: usize,
        spectrum: &[Complex32],
        scratch: &mut Scratch,
        mut take: impl FnMut(usize, &[f32]),
    ) {
        let scale = 1.0 / (self.rows * self.cols) as f32;
        scratch.line.resize(self.cols, 0.0);
        scratch.block.resize(BLOCK * self.bins, Complex32::default());
        scratch.fft.resize(self.row_inverse.get_scratch_len(), Complex32::default());
        for block in (first..first + count).step_by(BLOCK) {
            let n = BLOCK.min(first + count - block);
            for (bin, column) in spectrum.chunks_exact(self.rows).enumerate() {
                for k in 0..n {
                    scratch.block[k * self.bins + bin] = column[block + k] * scale;
                }
            }
            for k in 0..n {
                let line = &mut scratch.block[k * self.bins..(k + 1) * self.bins];
                // The first and last bins of a real signal are real: remove their round-off.
                line[0].im = 0.0;
                line[self.bins - 1].im = 0.0;
                self.row_inverse
                    .process_with_scratch(line, &mut scratch.line, &mut scratch.fft)
                    .expect("buffers have the planned lengths");
                take(block + k, &scratch.line);
            }
        }
    }
}

/// Forward transform of an image region of `height` rows, zero-padded to the plan.
pub(super) fn forward(
    plan: &TilePlan,
    height: usize,
    scratch: &mut Scratch,
    fill: impl FnMut(usize, &mut [f32]),
) -> Vec<Complex32> {
    let mut spectrum = Vec::new();
    plan.rows_forward(0, height, &mut spectrum, scratch, fill);
    plan.cols_forward(&mut spectrum, scratch);
    spectrum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_lengths() {
        assert_eq!([1, 31, 201, 305].map(fast_len), [2, 32, 216, 320]);
    }

    #[test]
    fn inverse_undoes_forward() {
        let plans = plans([(12, 10)].into_iter());
        let (plan, mut scratch) = (&plans[&(12, 10)], Scratch::default());
        let value = |r: usize, c: usize| ((r * 7 + c * 3) % 11) as f32;
        let mut s = forward(plan, 12, &mut scratch, |r, line| (0..10).for_each(|c| line[c] = value(r, c)));
        plan.cols_inverse(&mut s, &mut scratch);
        plan.rows_inverse(0, 12, &s, &mut scratch, |r, line| {
            (0..10).for_each(|c| assert!((line[c] - value(r, c)).abs() < 1e-5));
        });
    }
}
