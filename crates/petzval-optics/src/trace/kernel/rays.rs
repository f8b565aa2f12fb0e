//! Several rays in vector registers, where they meet a surface, and how they change.

use pulp::Simd;

use crate::lanes::{Lanes, Mask, V3};

/// Rays: points and unit directions.
#[derive(Clone, Copy)]
pub(super) struct Rays<S: Simd> {
    pub position: V3<S>,
    pub direction: V3<S>,
}

/// Where rays meet a surface.
#[derive(Clone, Copy)]
pub(super) struct Meeting<S: Simd> {
    pub point: V3<S>,
    pub path: Lanes<S>,
    pub ok: Mask<S>,
}

/// How points and directions move when something moves: a tangent of rays.
#[derive(Clone, Copy)]
pub(super) struct Tangent<S: Simd> {
    pub position: V3<S>,
    pub direction: V3<S>,
}
