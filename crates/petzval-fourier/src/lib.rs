//! Plans of fast Fourier transforms.
//!
//! rustfft is generic over the number type: every crate that makes a plan compiles all of its transforms again. Optics, camera and
//! lab take their plans from here, as trait objects, so they are compiled once.
//!
//! No transform is normalised: a forward and an inverse one of length `n` multiply by `n`.

use std::sync::Arc;

use realfft::RealFftPlanner;
use rustfft::FftPlanner;

pub use realfft::{ComplexToReal, RealToComplex};
pub use rustfft::Fft;
pub use rustfft::num_complex::{Complex32, Complex64};

/// The forward transform of `length` numbers, `X[k] = sum_j x[j] exp(-2 pi i j k / length)`.
pub fn forward(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_forward(length)
}

/// The inverse transform of `length` numbers, `x[j] = sum_k X[k] exp(2 pi i j k / length)`.
pub fn inverse(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_inverse(length)
}

/// Makes plans in single precision. Plans of one planner share the parts that they have in common.
pub struct Planner32 {
    real: RealFftPlanner<f32>,
    complex: FftPlanner<f32>,
}

impl Default for Planner32 {
    fn default() -> Self {
        Self { real: RealFftPlanner::new(), complex: FftPlanner::new() }
    }
}

impl Planner32 {
    /// The forward transform of `length` complex numbers.
    pub fn forward(&mut self, length: usize) -> Arc<dyn Fft<f32>> {
        self.complex.plan_fft_forward(length)
    }

    /// The inverse transform of `length` complex numbers.
    pub fn inverse(&mut self, length: usize) -> Arc<dyn Fft<f32>> {
        self.complex.plan_fft_inverse(length)
    }

    /// The forward transform of `length` real numbers: `length / 2 + 1` complex ones.
    pub fn real_forward(&mut self, length: usize) -> Arc<dyn RealToComplex<f32>> {
        self.real.plan_fft_forward(length)
    }

    /// The inverse of [`Self::real_forward`]: from `length / 2 + 1` complex numbers to `length` real ones.
    pub fn real_inverse(&mut self, length: usize) -> Arc<dyn ComplexToReal<f32>> {
        self.real.plan_fft_inverse(length)
    }
}
