//! Sequential real-ray tracing in f64: forward, and backward by the adjoint.
//!
//! A [`Sequence`] is a lens at one wavelength. [`trace_ray`] and [`aim_at_stop`] take one ray and are the reference;
//! [`trace`], [`push_change`], [`pull_back`] and [`AimedRays`] take bundles, several rays at a time. A failed ray is data ([`Fate`]),
//! never an error.

mod aim;
mod fate;
mod forward;
mod kernel;
mod launch;
mod ray;
mod sequence;
mod soft_edge;
mod surface_step;
mod symmetry;

pub use crate::vector::Vec3;
pub use aim::{AimedRay, aim_at_stop};
pub use fate::Fate;
pub use forward::{Path, trace_ray};
pub use kernel::{
    AimedRays, LandingJacobian, RayTangents, Reaim, Seeds, SquaredHeights, WaveSeeds, landing_jacobian,
    pull_back, push_change, push_change_with_heights, trace, trace_with_heights,
};
pub use launch::{ACROSS_FROM_RAD, Launch, launch, launch_axes, starts_across};
pub use ray::{Ray, RayBundle};
pub(crate) use sequence::Bending;
pub use sequence::{Sequence, SurfaceAtWavelength};
pub use soft_edge::{SOFT_EDGE_MM, aperture_transmission};
pub(crate) use soft_edge::{SoftEdge, soft_edge};
pub use surface_step::Passage;
