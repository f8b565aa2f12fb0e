//! The best linear restoration, frequency by frequency.
//!
//! A filter array repeats every few pixels, so a frame mixes each frequency with its aliases alone: f + k, with k the M frequencies of the
//! array's own grid. For one such group, let x hold the colours of the scene at the M frequencies (3 M numbers) and y the frame at them (M
//! numbers). Then `y = A x + n`, with
//!
//! `A[j, (l, c)] = m_c(f_j - f_l) i_c K_c(f_l)`,
//!
//! where m_c is the transform of the share of colour c in the pixels of one period, i_c the relative illumination, and K_c the transform of
//! the kernel. The covariance S of x is that of [`NaturalScenes`], and N, that of n, the transform of the noise variances of the pixels.
//! The restoration of least error is `W = S A' (A S A' + N)^-1` (' is the conjugate transpose), and the error that it leaves is the
//! diagonal of `S - W A S`.
//!
//! At the best W a change of W changes nothing, so with W held `dE = -2 Re tr(W dA S (1 - W A)') + Re tr(W dN W')`.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use petzval_fourier::Complex64;

use super::NaturalScenes;
use crate::image::CHANNELS;
use crate::sensor::CfaPattern;

type Matrix = DMatrix<Complex64>;

/// How pixels mix colours, and their noise.
#[derive(Clone, Debug)]
pub(super) struct Mosaic {
    rows: usize,
    cols: usize,
    /// Share of each colour in the pixels of a period, which sum to one.
    shares: Vec<[f64; CHANNELS]>,
    /// Electrons of white in the pixels of a period.
    white_e: Vec<f64>,
    /// Variance of every pixel in the dark, e^2.
    dark_e2: f64,
}

/// The error at one place of the sensor.
#[derive(Clone, Debug, Default)]
pub(super) struct PatchLimit {
    /// By colour, in squares of white.
    pub mean_square: [f64; CHANNELS],
    /// Derivatives of the sum over the colours by the spectra of the kernels: `dE = Re sum by(f) dK(f)`; empty if they were not requested.
    pub by_spectra: Vec<Vec<Complex64>>,
    /// By the kernels.
    pub by_kernels: Vec<f64>,
    /// By the relative illumination of each colour.
    pub by_illumination: [f64; CHANNELS],
}

impl Mosaic {
    /// The mosaic of a filter array. At white its pixels collect `white_e` electrons times the sum of their responses.
    pub fn new(
        cfa: CfaPattern,
        response: impl Fn(usize, usize) -> [f64; CHANNELS],
        white_e: f64,
        dark_e2: f64,
    ) -> Self {
        let (rows, cols) = (cfa.rows(), cfa.cols());
        let pixels: Vec<[f64; CHANNELS]> = (0..rows * cols).map(|p| response(p / cols, p % cols)).collect();
        let sums: Vec<f64> = pixels.iter().map(|r| r.iter().sum()).collect();
        let shares = pixels.iter().zip(&sums).map(|(r, sum)| r.map(|v| v / sum)).collect();
        Self { rows, cols, shares, white_e: sums.iter().map(|sum| sum * white_e).collect(), dark_e2 }
    }

    /// The least side from `least` on that holds whole periods.
    pub fn fitting_side(&self, least: usize) -> usize {
        (least..).find(|n| n.is_multiple_of(self.rows) && n.is_multiple_of(self.cols)).unwrap_or(least)
    }

    /// `1/M sum_p values(p) exp(-2 pi i k.p)` over a period, at its own frequencies k.
    fn transform(&self, values: impl Fn(usize) -> f64) -> Vec<Complex64> {
        let count = self.rows * self.cols;
        let phase = |k: usize, p: usize| {
            let down = (k / self.cols * (p / self.cols)) as f64 / self.rows as f64;
            let right = (k % self.cols * (p % self.cols)) as f64 / self.cols as f64;
            Complex64::cis(-TAU * (down + right))
        };
        let at = |k: usize| (0..count).map(|p| phase(k, p) * values(p)).sum::<Complex64>() / count as f64;
        (0..count).map(at).collect()
    }

    /// The difference of two of the period's frequencies.
    fn difference(&self, j: usize, l: usize) -> usize {
        let down = (j / self.cols + self.rows - l / self.cols) % self.rows;
        let right = (j % self.cols + self.cols - l % self.cols) % self.cols;
        down * self.cols + right
    }

    /// A matrix over pairs of the period's frequencies, from the transform of a function with that period.
    fn between(&self, transform: &[Complex64]) -> Matrix {
        let count = self.rows * self.cols;
        Matrix::from_fn(count, count, |j, l| transform[self.difference(j, l)])
    }

    /// The error behind kernels of these spectra, `[colour][row * side + column]`; `side` holds whole periods.
    pub fn limit(
        &self,
        scenes: &NaturalScenes,
        side: usize,
        spectra: &[Vec<Complex64>],
        illumination: [f64; CHANNELS],
        with_gradient: bool,
    ) -> PatchLimit {
        let count = self.rows * self.cols;
        let mixing: Vec<Matrix> =
            (0..CHANNELS).map(|c| self.between(&self.transform(|p| self.shares[p][c]))).collect();
        // The noise of a pixel grows with its light.
        let light = |p: usize| self.shares[p].iter().zip(illumination).map(|(s, i)| s * i).sum::<f64>();
        let variance =
            |p: usize| (scenes.mean * light(p) * self.white_e[p] + self.dark_e2) / self.white_e[p].powi(2);
        let noise = self.between(&self.transform(variance));
        let by_light: Vec<Matrix> = (0..CHANNELS)
            .map(|c| self.between(&self.transform(|p| scenes.mean * self.shares[p][c] / self.white_e[p])))
            .collect();
        let colours = scenes.colours();
        let per_frequency = 1.0 / (side * side) as f64;
        let mut limit = PatchLimit::default();
        if with_gradient {
            limit.by_spectra = vec![vec![Complex64::default(); side * side]; CHANNELS];
        }
        let (down, right) = (side / self.rows, side / self.cols);
        for group in 0..down * right {
            let (row, col) = (group / right, group % right);
            // The scene is real: a group and its mirror image are conjugates. One of the two stands for both.
            let mirror = (down - row) % down * right + (right - col) % right;
            if mirror < group {
                continue;
            }
            let twice = if mirror == group { 1.0 } else { 2.0 };
            let at: Vec<usize> = (0..count)
                .map(|l| (row + l / self.cols * down) * side + col + l % self.cols * right)
                .collect();
            let power: Vec<f64> =
                at.iter().map(|i| scenes.spectrum(frequency(*i, side), 0.5 / side as f64)).collect();
            let a = Matrix::from_fn(count, CHANNELS * count, |j, x| {
                let (l, c) = (x / CHANNELS, x % CHANNELS);
                mixing[c][(j, l)] * spectra[c][at[l]] * illumination[c]
            });
            // A S, and the covariance of the frame.
            let scaled = Matrix::from_fn(count, CHANNELS * count, |j, x| {
                let (l, c) = (x / CHANNELS, x % CHANNELS);
                (0..CHANNELS).map(|b| a[(j, CHANNELS * l + b)] * colours[b][c]).sum::<Complex64>() * power[l]
            });
            let covariance = &scaled * a.adjoint() + &noise;
            let Some(factor) = covariance.cholesky() else {
                // A frame without light and noise says nothing.
                for x in 0..CHANNELS * count {
                    limit.mean_square[x % CHANNELS] += twice * per_frequency * power[x / CHANNELS];
                }
                continue;
            };
            // W' = (A S A' + N)^-1 A S
            let restoration = factor.solve(&scaled);
            for x in 0..CHANNELS * count {
                let explained: Complex64 = restoration.column(x).dotc(&scaled.column(x));
                limit.mean_square[x % CHANNELS] +=
                    twice * per_frequency * (power[x / CHANNELS] - explained.re);
            }
            if !with_gradient {
                continue;
            }
            // The covariance S (1 - W A)' of what stays unknown, times W.
            let unexplained = Matrix::from_fn(CHANNELS * count, CHANNELS * count, |x, y| {
                let own = if x / CHANNELS == y / CHANNELS {
                    power[x / CHANNELS] * colours[x % CHANNELS][y % CHANNELS]
                } else {
                    0.0
                };
                Complex64::from(own)
            }) - scaled.adjoint() * &restoration;
            let pull = unexplained * restoration.adjoint();
            for (l, place) in at.iter().enumerate() {
                for c in 0..CHANNELS {
                    let by: Complex64 = (0..count)
                        .map(|j| pull[(CHANNELS * l + c, j)] * mixing[c][(j, l)])
                        .sum::<Complex64>()
                        * -2.0;
                    let by = by * (twice * per_frequency);
                    limit.by_spectra[c][*place] += by * illumination[c];
                    limit.by_illumination[c] += (by * spectra[c][*place]).re;
                }
            }
            let gram = &restoration * restoration.adjoint();
            for c in 0..CHANNELS {
                let by: Complex64 = (0..count * count)
                    .map(|i| by_light[c][(i / count, i % count)] * gram[(i % count, i / count)])
                    .sum();
                limit.by_illumination[c] += twice * per_frequency * by.re;
            }
        }
        limit
    }
}

/// The frequency of an element of a transform, cycles per pixel.
fn frequency(i: usize, side: usize) -> f64 {
    let folded = |k: usize| k.min(side - k) as f64 / side as f64;
    folded(i / side).hypot(folded(i % side))
}
