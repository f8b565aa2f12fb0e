//! Diffraction: the wavefront of a point of light behind a lens, and its interference at the image.
//!
//! A beam at one wavelength is a complex amplitude over the direction cosines of its rays at the image: the wavefront
//! aberration is its phase, the light of the rays its squared modulus (`map.rs`). The amplitude in the image plane is
//! its Fourier transform ([`psf`](crate::psf)). [`huygens_psf`] is the readable reference, which adds spherical
//! wavelets from a reference sphere.

mod fit;
mod huygens;
mod map;
mod matrix;
mod no_waves;
mod nodes;
mod opd;
mod otf;
mod overlap;
mod phase;
mod psf;
mod sampled;
mod strehl;
mod transform;

pub use huygens::huygens_psf;
pub use no_waves::NoWaves;
pub use opd::{Opd, PupilPlane, opd, opd_about};
pub(crate) use otf::{LineSpread, PupilWave, Section};
pub(crate) use overlap::Overlap;
pub(crate) use psf::{ImageGrid, Shown, WaveChannel};
pub(crate) use sampled::SampledWave;
