//! Verbs on sensors, PSFs, ISPs and pictures.

#[path = "../common/mod.rs"]
mod common;

mod characterize;
mod isp;
mod psf;
mod psf_calibrate;
mod raw;
mod simulate;
mod spectral;
