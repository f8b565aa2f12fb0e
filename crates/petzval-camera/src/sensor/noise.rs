//! Randomness of a frame: which noise, from which stream, and what the derivative of shot noise means.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson};
use serde::{Deserialize, Serialize};

/// How noise is drawn and what gradient the draw has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseMode {
    /// Whole Poisson electrons. For evaluation: the draw has no derivative and the tape holds zeros.
    Exact,
    /// As `Exact`, with `dN/dlambda := 1` in the backward pass. Biased: +19 % for `sqrt(N+1)` at 0.3 electrons.
    StraightThrough,
    /// `x = N + t - 1/2` with `t` uniform in [0, 1]: mean lambda, variance lambda + 1/12. The derivative
    /// `dx/dlambda = t + (1 - t) N / lambda` is unbiased (implicit reparameterisation of the interpolated Poisson
    /// distribution) but for lambda below 0.05 electrons, where the division uses 0.05.
    Dequantised,
    /// The mean signal: no noise, no rounding; full well and converter limits stay.
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

/// Rate in electrons below which the backward pass of `Dequantised` does not divide.
const RATE_FLOOR_E: f64 = 0.05;

/// Electrons from a Poisson rate `lambda` (e-, >= 0) and the derivative with respect to it: `(x, dx/dlambda)`.
pub(super) fn shot_noise(mode: NoiseMode, lambda: f64, shot: &mut ChaCha8Rng, dither: f64) -> (f64, f64) {
    if mode == NoiseMode::Off {
        return (lambda, 1.0);
    }
    // No photon comes at rate zero; beyond the sampler's range (1e19 e-) the spread is below the precision.
    let n = match Poisson::new(lambda) {
        Ok(distribution) => distribution.sample(shot),
        Err(_) => lambda.max(0.0),
    };
    match mode {
        NoiseMode::StraightThrough => (n, 1.0),
        NoiseMode::Dequantised => (n + dither - 0.5, dither + (1.0 - dither) * n / lambda.max(RATE_FLOOR_E)),
        NoiseMode::Exact | NoiseMode::Off => (n, 0.0),
    }
}

/// Independent streams of random numbers for one sensor row of one frame.
///
/// The generator is ChaCha with 8 rounds; the key is (seed, frame, stage), the stream is the row, and each pixel owns a
/// fixed place in the stream, so its draws do not depend on what is drawn around it.
pub(super) struct RowStreams {
    shot: ChaCha8Rng,
    dark: ChaCha8Rng,
    dither: ChaCha8Rng,
}

/// 32-bit words of the shot stream that a pixel owns; one sample needs a few, 40 for a rate of 11 electrons.
const SHOT_WORDS: u128 = 256;

impl RowStreams {
    /// Streams of sensor row `row`, placed at sensor column `first_col`.
    pub fn new(seed: u64, frame: u64, row: usize, first_col: usize) -> Self {
        let stream = |stage: u64, words: u128| {
            let mut key = [0u8; 32];
            for (part, value) in key.chunks_exact_mut(8).zip([seed, frame, stage]) {
                part.copy_from_slice(&value.to_le_bytes());
            }
            let mut rng = ChaCha8Rng::from_seed(key);
            rng.set_stream(row as u64);
            rng.set_word_pos(first_col as u128 * words);
            rng
        };
        Self { shot: stream(1, SHOT_WORDS), dark: stream(2, 4), dither: stream(3, 2) }
    }

    /// The shot-noise stream at the place of sensor column `col`.
    pub fn shot(&mut self, col: usize) -> &mut ChaCha8Rng {
        self.shot.set_word_pos(col as u128 * SHOT_WORDS);
        &mut self.shot
    }

    /// The next pixel's standard normal numbers for read and electronics noise: the two halves of a Box-Muller pair,
    /// which are independent.
    pub fn next_normal_pair(&mut self) -> (f64, f64) {
        let radius = (-2.0 * (1.0 - self.dark.random::<f64>()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.dark.random::<f64>()).sin_cos();
        (radius * cos, radius * sin)
    }

    /// The next pixel's uniform number in [0, 1).
    pub fn next_dither(&mut self) -> f64 {
        self.dither.random()
    }
}
