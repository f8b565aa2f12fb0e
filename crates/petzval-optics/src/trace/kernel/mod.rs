//! The fast path: several rays at a time in vector registers, with the instruction set chosen at run time.
//!
//! The readable reference is [`trace_ray`](super::trace_ray), one ray at a time; tests hold the two together.

mod aim;
mod backward;
mod forward;
mod frame;
mod general;
mod jacobian;
mod rays;
mod surface;
mod tangent;

pub use aim::AimedRays;
pub use backward::{Reaim, Seeds, WaveSeeds, pull_back};
pub use forward::{SquaredHeights, trace, trace_with_heights};
pub use jacobian::{LandingJacobian, landing_jacobian};
pub use tangent::{RayTangents, push_change, push_change_with_heights};
