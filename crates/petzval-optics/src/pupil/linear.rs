//! Small fixed matrices that are applied often.

use pulp::{Simd, WithSimd};

use petzval_base::simd::dispatch;

/// Columns are padded with zeros to a multiple of this, the widest vector.
const WIDEST: usize = 8;

/// Vectors of a result that are summed together, in registers.
const BLOCK: usize = 4;

/// A dense matrix, stored so that both its product and that of its transpose run along memory.
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    rows: usize,
    columns: usize,
    /// Length of a stored column.
    stride: usize,
    /// Column by column.
    values: Vec<f64>,
}

struct Apply<'a> {
    matrix: &'a Matrix,
    x: &'a [f64],
    y: &'a mut [f64],
}

/// Sums N vectors of the result, from vector `first` of each column.
#[inline(always)]
fn block<S: Simd, const N: usize>(simd: S, matrix: &Matrix, x: &[f64], y: &mut [S::f64s], first: usize) {
    let mut sums = [simd.splat_f64s(0.0); N];
    for (column, x) in matrix.values.chunks_exact(matrix.stride).zip(x) {
        let (column, _) = S::as_simd_f64s(column);
        let column = &column[first..first + N];
        let factor = simd.splat_f64s(*x);
        for n in 0..N {
            sums[n] = simd.mul_add_e_f64s(factor, column[n], sums[n]);
        }
    }
    y[first..first + N].copy_from_slice(&sums);
}

impl WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { matrix, x, y } = self;
        let (y, _) = S::as_mut_simd_f64s(y);
        let mut first = 0;
        while first + BLOCK <= y.len() {
            block::<S, BLOCK>(simd, matrix, x, y, first);
            first += BLOCK;
        }
        while first < y.len() {
            block::<S, 1>(simd, matrix, x, y, first);
            first += 1;
        }
    }
}

struct ApplyTransposed<'a> {
    matrix: &'a Matrix,
    y: &'a [f64],
    x: &'a mut [f64],
}

impl WithSimd for ApplyTransposed<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { matrix, y, x } = self;
        let (y, _) = S::as_simd_f64s(y);
        for (column, x) in matrix.values.chunks_exact(matrix.stride).zip(x) {
            let (column, _) = S::as_simd_f64s(column);
            let mut sum = simd.splat_f64s(0.0);
            for (a, y) in column.iter().zip(y) {
                sum = simd.mul_add_e_f64s(*a, *y, sum);
            }
            *x += simd.reduce_sum_f64s(sum);
        }
    }
}

impl Matrix {
    /// A matrix by its elements (row, column).
    pub fn new(rows: usize, columns: usize, element: impl Fn(usize, usize) -> f64) -> Self {
        let stride = rows.next_multiple_of(WIDEST);
        let mut values = vec![0.0; stride * columns];
        for (c, column) in values.chunks_exact_mut(stride).enumerate() {
            for (r, value) in column[..rows].iter_mut().enumerate() {
                *value = element(r, c);
            }
        }
        Self { rows, columns, stride, values }
    }

    /// `A x`; entries of x beyond the columns are not read.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        debug_assert!(x.len() >= self.columns);
        let mut y = vec![0.0; self.stride];
        dispatch(Apply { matrix: self, x: &x[..self.columns], y: &mut y });
        y.truncate(self.rows);
        y
    }

    /// Adds `A^T y` to the first entries of x.
    pub fn add_transposed(&self, y: &[f64], x: &mut [f64]) {
        debug_assert!(y.len() == self.rows && x.len() >= self.columns);
        let mut padded = y.to_vec();
        padded.resize(self.stride, 0.0);
        dispatch(ApplyTransposed { matrix: self, y: &padded, x: &mut x[..self.columns] });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn product_and_transpose_agree_with_loops() {
        let element = |r: usize, c: usize| ((r * 7 + c * 13) % 11) as f64 - 5.0;
        let a = Matrix::new(13, 9, element);
        let x: Vec<f64> = (0..9).map(|i| f64::from(i) - 3.5).collect();
        let y: Vec<f64> = (0..13).map(|i| f64::from(i * i % 7)).collect();
        let ax = a.apply(&x);
        let mut aty = vec![1.0; 9];
        a.add_transposed(&y, &mut aty);
        for r in 0..13 {
            let expected: f64 = (0..9).map(|c| element(r, c) * x[c]).sum();
            assert!((ax[r] - expected).abs() < 1e-12);
        }
        for c in 0..9 {
            let expected: f64 = 1.0 + (0..13).map(|r| element(r, c) * y[r]).sum::<f64>();
            assert!((aty[c] - expected).abs() < 1e-12);
        }
    }
}
