//! How far a quantity may be off, and how often it is how far.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Freedom;

/// How a quantity is spread between minus and plus its tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Distribution {
    /// Everything within is as likely.
    Uniform,
    /// Normal with half the tolerance as its standard deviation, cut at the tolerance.
    #[default]
    Normal,
    /// `3 t^2 / 2` over the tolerance: parts near the limits are the likeliest, as when a maker stops as soon as a part passes.
    Parabolic,
}

impl Distribution {
    /// Mean square, as a share of the squared tolerance.
    pub fn variance(self) -> f64 {
        match self {
            Self::Uniform => 1.0 / 3.0,
            // With a = 2 and q = 2 pdf(a) / (cdf(a) - cdf(-a)): 1 - a q.
            Self::Normal => 0.25 * (1.0 - 2.0 * CUT),
            Self::Parabolic => 3.0 / 5.0,
        }
    }

    /// Mean fourth power, as a share of that of the tolerance.
    pub fn fourth_moment(self) -> f64 {
        match self {
            Self::Uniform => 1.0 / 5.0,
            // 3 - (a^3 + 3 a) q
            Self::Normal => (3.0 - 14.0 * CUT) / 16.0,
            Self::Parabolic => 3.0 / 7.0,
        }
    }

    /// One draw within -1 ... 1.
    fn draw(self, generator: &mut ChaCha8Rng) -> f64 {
        let mut symmetric = || 2.0 * generator.random::<f64>() - 1.0;
        match self {
            Self::Uniform => symmetric(),
            Self::Parabolic => symmetric().cbrt(),
            Self::Normal => loop {
                // A normal number by Box and Muller's transform, drawn again where it is cut off.
                let radius = (-2.0 * (1.0 - generator.random::<f64>()).ln()).sqrt();
                let t = 0.5 * radius * (TAU * generator.random::<f64>()).cos();
                if t.abs() <= 1.0 {
                    break t;
                }
            },
        }
    }
}

/// `2 pdf(2) / (cdf(2) - cdf(-2))` of the standard normal distribution.
const CUT: f64 = 0.113_129_348_225_038_4;

/// A freedom with its tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// What is off.
    pub freedom: Freedom,
    /// How far at most to either side, in the unit of the quantity; positive.
    pub tolerance: f64,
    /// How often it is how far.
    pub distribution: Distribution,
}

impl Perturbation {
    /// Standard deviation, in the unit of the quantity.
    pub fn sigma(&self) -> f64 {
        self.tolerance * self.distribution.variance().sqrt()
    }
}

/// What each quantity is off by in a trial, in its unit.
///
/// Random numbers are keyed by (seed, trial) and the place in the list, and come from no shared state: a trial can be made again
/// by itself, on any thread.
pub fn draw(perturbations: &[Perturbation], seed: u64, trial: u64) -> Vec<f64> {
    let mut key = [0_u8; 32];
    for (part, value) in key.chunks_exact_mut(8).zip([seed, trial, KEY]) {
        part.copy_from_slice(&value.to_le_bytes());
    }
    let one = |(i, p): (usize, &Perturbation)| {
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(i as u64);
        p.tolerance * p.distribution.draw(&mut generator)
    };
    perturbations.iter().enumerate().map(one).collect()
}

/// Tells these random numbers from those of other stages under the same seed.
const KEY: u64 = u64::from_le_bytes(*b"tolernce");
