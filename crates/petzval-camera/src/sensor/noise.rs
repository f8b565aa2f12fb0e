//! Randomness of a frame: the noise modes, their random streams, and the derivative of shot noise in each mode.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Capture;
use petzval_base::random::{PoissonScratch, Stage, Stream, poisson, poisson_row};

/// How shot noise is drawn, and the derivative of a draw with respect to the rate `lambda` (mean electrons).
///
/// The mean of `f(N)` over Poisson counts has a derivative, `E[f(N+1) - f(N)]`, but a single count has none. Each mode uses
/// a substitute, whose bias depends on the following function `f`. The biases given here are those of
/// `E f'(x) dx/dlambda`, relative to the exact derivative, for `f = sqrt(N + 1)` at 0.3, 3 and 40 electrons. They are exact
/// sums for `Dequantised`, and means of 2 million draws of NumPy's generator for the other modes. The book's page on the
/// sensor lists more of them; the tests check all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseMode {
    /// Whole Poisson electrons. For evaluation: the draw has no derivative and the tape holds zeros.
    Exact,
    /// `x = N + t - 1/2` with `t` uniform in [0, 1]: mean lambda, variance lambda + 1/12. The derivative
    /// `dx/dlambda = t + (1 - t) N / lambda` is unbiased for the mean of `f(x)` (implicit reparameterisation of the
    /// interpolated Poisson distribution function). Bias against the derivative for whole counts: +1.5 %, +0.4 %, 0.0 %.
    ///
    /// Below `r = 0.05` electrons a rare count would have the weight `1 / lambda`. There the derivative is
    /// `t + (1 - t) (N + r - lambda) / r`. Its mean is still 1, so a linear `f` has no bias. A curved `f` has the bias
    /// `-(1 - lambda / r) E (1 - t) (f'(x + 1) - f'(x))`, about half of `f''` at lambda = 0.
    Dequantised,
    /// `x = N + 1/2`, `dx/dlambda := 1`. Bias -1.2 %, -0.3 %, 0.0 %; the spread is small at low rates. The half electron
    /// places the derivative between the counts N and N + 1. It also makes the frame brighter by half an electron
    /// (K g / 2 DN), so losses are those of a slightly brighter frame.
    HalfStep,
    /// As `Exact`, with `dN/dlambda := 1` in the backward pass. Biased: +18.7 %, +8.1 %, +0.6 %.
    StraightThrough,
    /// `x = lambda + sqrt(lambda) z` with `z` standard normal: mean and variance lambda, but a normal distribution, which is
    /// sometimes negative. The derivative `1 + z / (2 sqrt(lambda))` is unbiased for the mean of `f(x)`. Bias against the
    /// derivative for counts: -6.8 %, +1.0 %, 0.0 %. Below `r = 0.05` electrons the division uses r, with the bias
    /// `-(1 - sqrt(lambda / r)) / 2 E f''`.
    Gaussian,
    /// The mean signal without noise and rounding. Full well, converter limits and the specimen's fixed pattern remain.
    Off,
}

/// Noise of a series of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noise {
    /// How noise is drawn.
    pub mode: NoiseMode,
    /// The same seed, frame and sensor pixel give the same noise, for any crop and number of threads.
    pub seed: u64,
}

/// Smallest rate, electrons, by which the backward pass divides. Lower rates would be noisy: the spread of `N / lambda` is
/// `1 / sqrt(lambda)`.
pub(super) const RATE_FLOOR_E: f64 = 0.05;

/// The random streams of one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameStreams {
    pub mode: NoiseMode,
    pub read: Stream,
    pub row: Stream,
    pub column: Stream,
    shot: Stream,
    dither: Stream,
}

impl FrameStreams {
    /// The streams of the capture's frame.
    pub fn new(noise: &Noise, capture: &Capture) -> Self {
        let stream = |stage| Stream::new(noise.seed, capture.frame, stage);
        Self {
            mode: noise.mode,
            read: stream(Stage::Read),
            row: stream(Stage::Row),
            column: stream(Stage::Column),
            shot: stream(Stage::Shot),
            dither: stream(Stage::Dither),
        }
    }

    /// Whether the mode draws noise.
    #[inline(always)]
    pub fn noisy(&self) -> bool {
        self.mode != NoiseMode::Off
    }

    /// Electrons of one pixel from its rate (e-, >= 0), and their derivative with respect to it.
    pub fn electrons(&self, rate: f64, place: u32) -> (f64, f64) {
        let count = || poisson(rate, self.shot, place);
        match self.mode {
            NoiseMode::Exact => (count(), 0.0),
            NoiseMode::Dequantised => dequantise(rate, count(), self.dither.uniforms(place, 0)[0]),
            NoiseMode::HalfStep => (count() + 0.5, 1.0),
            NoiseMode::StraightThrough => (count(), 1.0),
            NoiseMode::Gaussian => spread(rate, self.shot.normals(place)[0]),
            NoiseMode::Off => (rate, 1.0),
        }
    }

    /// [`Self::electrons`] of consecutive pixels of a row, from `first` on.
    #[inline(always)]
    pub fn electrons_row(
        &self,
        rates: &[f64],
        first: u32,
        scratch: &mut ShotScratch,
        electrons: &mut [f64],
        d_rate: &mut [f64],
    ) {
        let ShotScratch { poisson, a, b } = scratch;
        match self.mode {
            NoiseMode::Gaussian => {
                a.resize(rates.len(), 0.0);
                b.resize(rates.len(), 0.0);
                self.shot.normals_row(first, a, b);
                for (((x, d), &rate), &z) in electrons.iter_mut().zip(d_rate).zip(rates).zip(&*a) {
                    (*x, *d) = spread(rate, z);
                }
                return;
            }
            NoiseMode::Off => electrons.copy_from_slice(rates),
            _ => poisson_row(rates, self.shot, first, poisson, electrons),
        }
        match self.mode {
            NoiseMode::Dequantised => {
                a.resize(rates.len(), 0.0);
                b.resize(rates.len(), 0.0);
                self.dither.uniforms_row(first, a, b);
                for (((x, d), &rate), &t) in electrons.iter_mut().zip(d_rate).zip(rates).zip(&*a) {
                    (*x, *d) = dequantise(rate, *x, t);
                }
            }
            NoiseMode::HalfStep => {
                electrons.iter_mut().for_each(|x| *x += 0.5);
                d_rate.fill(1.0);
            }
            NoiseMode::Exact => d_rate.fill(0.0),
            NoiseMode::StraightThrough | NoiseMode::Gaussian | NoiseMode::Off => d_rate.fill(1.0),
        }
    }
}

/// Working memory of [`FrameStreams::electrons_row`], reused for the next row.
#[derive(Debug, Default)]
pub(super) struct ShotScratch {
    poisson: PoissonScratch,
    a: Vec<f64>,
    b: Vec<f64>,
}

/// A count dithered over the unit interval about it by `t` in (0, 1), and its derivative with respect to the rate. The mean
/// of the derivative is 1.
#[inline(always)]
fn dequantise(rate: f64, count: f64, t: f64) -> (f64, f64) {
    let divisor = rate.max(RATE_FLOOR_E);
    (count + t - 0.5, t + (1.0 - t) * (count + (divisor - rate)) / divisor)
}

/// Normal electrons with mean and variance `rate`, and their derivative with respect to the rate.
#[inline(always)]
fn spread(rate: f64, z: f64) -> (f64, f64) {
    (rate + rate.sqrt() * z, 1.0 + z / (2.0 * rate.max(RATE_FLOOR_E).sqrt()))
}
