//! From light to digital numbers: an EMVA 1288 sensor with a Bayer mosaic.
//!
//! Per pixel of colour `c`, with linear gain `g` and exposure time `t`:
//!
//! ```text
//! lambda = white_e s_c E + mu_I t            [e-]  E relative irradiance, s_c relative quantum efficiency
//! n  ~ Poisson(lambda), n = min(n, FWC)      [e-]  shot noise and dark current, full well
//! e  = n + mu_r + sigma_r z1                 [e-]  read noise; no clip at zero
//! v  = K g e + BL + mu_el + sigma_el z2      [DN]  gain, electronics noise, black level
//! y  = clip(round(v), 0, 2^bits - 1)         [DN]  analog-to-digital converter
//! ```
//!
//! so `E y = K g (lambda + mu_r) + BL + mu_el` and `Var y = (K g)^2 (lambda + sigma_r^2) + sigma_el^2 + 1/12` away from
//! the limits. Source: EMVA 1288 release 4.0 (linear camera model).

mod capture;
mod cfa;
mod expose;
mod model;
mod noise;
mod nonuniformity;
mod quantum_efficiency;

pub use capture::{Capture, Exposure, Raw, SensorError};
pub use cfa::{CfaPattern, Colour, UnknownPattern};
pub(crate) use expose::{check_capture, expose_checked};
pub use expose::{expose, expose_with_tape};
pub use model::{Electronics, OutOfRange, SensorModel};
pub use noise::{Noise, NoiseMode};
pub use nonuniformity::NonUniformity;
pub use quantum_efficiency::QuantumEfficiency;

#[cfg(test)]
mod tests;
