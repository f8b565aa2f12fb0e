//! Glass, lens, exact differentiable ray tracing, point-spread functions.
//!
//! The modules follow the light. [`glass`] gives every medium its index, and [`lens`] places surfaces on the axis. [`trace`] sends rays
//! through them and back (the adjoint). [`paraxial`] computes the first-order properties; [`spot`], [`psf`] and [`wave`] compute the image
//! of a point. [`analysis`] computes the figures that lens designers look at. Every number of a surface has a name ([`number`]). It indexes
//! a [`gradient`], and a [`design_space`] lists by it what may move. A [`merit`] judges a lens and a [`constraint`] limits it, for
//! [`optimize`] and [`tolerance`].
//!
//! # Conventions
//!
//! Right-handed axes, light travels along +z, fields lie in the y-z plane. Lengths in mm, except
//! where a name ends in `_um`; wavelengths in um; angles in radians, except where a name ends in
//! `_deg`. A radius is positive when its centre of curvature lies to the right of the vertex.
//! Positions on a surface are local: z is measured from the surface's own vertex.
//!
//! A ray never raises: its fate is data ([`trace::Fate`]). This crate reads no file, starts no
//! thread of its own and knows no tensor framework.

// Tests inside the crate share lenses with those outside.
#[cfg(test)]
extern crate self as petzval_optics;

#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;

pub mod analysis;
pub mod constraint;
pub mod design_space;
pub mod glass;
pub mod gradient;
mod jet;
mod lanes;
pub mod lens;
pub mod merit;
pub mod number;
pub mod optimize;
pub mod paraxial;
mod powers;
pub mod psf;
pub mod pupil;
pub mod seidel;
pub mod solve;
pub mod spot;
pub mod tolerance;
pub mod trace;
mod vector;
pub mod wave;
