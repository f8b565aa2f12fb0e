//! From light to digital numbers: an EMVA 1288 sensor with any colour filter array.
//!
//! Per pixel of colour `c` in row `i` and column `j`, with linear gain `g` and exposure time `t`:
//!
//! ```text
//! lambda = white_e s_c E P + (mu_I + h) t    [e-]  E relative irradiance, s_c relative quantum efficiency, P = PRNU
//! n  ~ Poisson(lambda), n = min(n, FWC)      [e-]  shot noise and dark current (h of hot pixels), full well
//! e  = n + mu_r + D + r_i + c_j + sigma_r z1 [e-]  read noise; D = DSNU, noise of row and column; no clip at zero
//! v  = K g e + BL + mu_el + sigma_el z2      [DN]  gain, electronics noise, black level
//! y  = clip(round(v), 0, 2^bits - 1)         [DN]  analog-to-digital converter
//! ```
//!
//! On a sensor of equal pixels and away from the limits this gives `E y = K g (lambda + mu_r) + BL + mu_el` and
//! `Var y = (K g)^2 (lambda + sigma_r^2) + sigma_el^2 + 1/12`. Source: EMVA 1288 release 4.0 (linear camera model).
//!
//! [`expose_pixel`] is the readable reference for one pixel; [`expose()`] computes a frame with the same bits.

mod capture;
mod cfa;
mod error;
mod expose;
mod fixed_pattern;
mod model;
mod noise;
mod nonuniformity;
mod pixel;
mod quantum_efficiency;
mod saturation;

pub use capture::{Capture, Exposure, Raw};
pub use cfa::{CfaPattern, Colour, UnknownPattern};
pub use error::{OutOfRange, SensorError};
pub(crate) use expose::{check_capture, expose_checked, expose_tracked};
pub use expose::{expose, expose_with_tape};
pub use fixed_pattern::FixedPattern;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub(crate) use fixed_pattern::shared_lines;
pub use model::{Electronics, SensorModel};
pub use noise::{Noise, NoiseMode};
pub use nonuniformity::NonUniformity;
pub use pixel::{PixelReading, expose_pixel};
pub use quantum_efficiency::QuantumEfficiency;

#[cfg(test)]
mod tests;
