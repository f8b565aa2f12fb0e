//! Sequential real-ray tracing in f64: forward, and backward by the adjoint.
//!
//! A [`Sequence`] is a lens at one wavelength. Bundles are structures of arrays, so that the kernels
//! can take several rays at a time. A failed ray is data ([`Fate`]), never an error.

mod adjoint;
mod aim;
mod forward;
mod launch;
mod ray;
mod sequence;
mod surface_step;

pub(crate) use adjoint::pull_back_from;
pub use adjoint::{RayCotangent, pull_back};
pub use aim::{AimedRay, aim_at_stop};
pub(crate) use forward::retrace;
pub use forward::{Path, trace, trace_ray};
pub use launch::{Launch, launch};
pub use ray::{Fate, Ray, RayBundle, Vec3};
pub use sequence::{Sequence, SurfaceAtWavelength};
pub use surface_step::{Passage, SOFT_EDGE_MM, aperture_transmission};
