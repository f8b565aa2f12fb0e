//! Randomness of a frame: which noise, from which stream, and what the derivative of shot noise means.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Capture;
use petzval_base::random::{PoissonScratch, Stage, Stream, poisson, poisson_row};

/// How shot noise is drawn, and what derivative by the rate `lambda` (mean electrons) a draw has.
///
/// Counting has no derivative: the mean of `f(N)` over Poisson counts has one, `E[f(N+1) - f(N)]`, but a single count has
/// not. What stands in for it, in each mode, is biased or not according to the `f` that follows. Biases here are of
/// `E f'(x) dx/dlambda` over the exact derivative for `f = sqrt(N + 1)` at 0.3, 3 and 40 electrons: exact sums for
/// `Dequantised`, 2 million draws of NumPy's generator for the others. The book's page on the sensor has more, the tests
/// all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseMode {
    /// Whole Poisson electrons. For evaluation: the draw has no derivative and the tape holds zeros.
    Exact,
    /// `x = N + t - 1/2` with `t` uniform in [0, 1]: mean lambda, variance lambda + 1/12. The derivative
    /// `dx/dlambda = t + (1 - t) N / lambda` is unbiased for the mean of what is drawn (implicit reparameterisation of the
    /// Poisson distribution function, interpolated). Against the derivative for whole counts: +1.5 %, +0.4 %, 0.0 %.
    ///
    /// Below `r = 0.05` electrons, where a rare count would weigh `1 / lambda`, it is `t + (1 - t) (N + r - lambda) / r`. Its mean
    /// is still 1, so a straight `f` has no bias; a curved one has `-(1 - lambda / r) E (1 - t) (f'(x + 1) - f'(x))`, about half
    /// of `f''` without light.
    Dequantised,
    /// `x = N + 1/2`, `dx/dlambda := 1`. Bias -1.2 %, -0.3 %, 0.0 %, and little spread at low rates. What follows
    /// sees half an electron too many (K g / 2 DN), because its derivative is wanted between the counts N and N + 1:
    /// losses of this mode are those of a slightly brighter frame.
    HalfStep,
    /// As `Exact`, with `dN/dlambda := 1` in the backward pass. Biased: +18.7 %, +8.1 %, +0.6 %.
    StraightThrough,
    /// `x = lambda + sqrt(lambda) z` with `z` standard normal: mean and variance lambda, but of another shape, and negative at
    /// times. Its derivative `1 + z / (2 sqrt(lambda))` is unbiased for the mean of what is drawn; against the derivative
    /// for counts -6.8 %, +1.0 %, 0.0 %. Below `r = 0.05` electrons the division uses r: the bias is
    /// `-(1 - sqrt(lambda / r)) / 2 E f''`.
    Gaussian,
    /// The mean signal: no noise, no rounding; full well, converter limits and the specimen's fixed pattern stay.
    Off,
}

/// Noise of a series of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noise {
    /// How noise is drawn.
    pub mode: NoiseMode,
    /// Same seed, frame and sensor pixel: same noise, whatever the crop and the number of threads.
    pub seed: u64,
}

/// Rate in electrons below which the backward pass does not divide by it: the spread of `N / lambda` is
/// `1 / sqrt(lambda)`.
pub(super) const RATE_FLOOR_E: f64 = 0.05;

/// What the pixels of one frame draw their noise from.
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

    /// Whether anything is random.
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

/// Memory of [`FrameStreams::electrons_row`], to be used again for the next row.
#[derive(Debug, Default)]
pub(super) struct ShotScratch {
    poisson: PoissonScratch,
    a: Vec<f64>,
    b: Vec<f64>,
}

/// A count spread over the unit interval about it by `t` in (0, 1), and its derivative by the rate, whose mean is 1.
#[inline(always)]
fn dequantise(rate: f64, count: f64, t: f64) -> (f64, f64) {
    let divisor = rate.max(RATE_FLOOR_E);
    (count + t - 0.5, t + (1.0 - t) * (count + (divisor - rate)) / divisor)
}

/// Normal noise of the variance of the rate, and its derivative by the rate.
#[inline(always)]
fn spread(rate: f64, z: f64) -> (f64, f64) {
    (rate + rate.sqrt() * z, 1.0 + z / (2.0 * rate.max(RATE_FLOOR_E).sqrt()))
}
