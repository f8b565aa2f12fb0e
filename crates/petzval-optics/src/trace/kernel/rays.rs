//! Several rays in vector registers, their intersections with a surface, and their tangents.

use pulp::Simd;

use crate::lanes::{Lanes, Mask, V3};

/// Rays: points and unit directions.
#[derive(Clone, Copy)]
pub(super) struct Rays<S: Simd> {
    pub position: V3<S>,
    pub direction: V3<S>,
}

/// Intersections of rays with a surface.
#[derive(Clone, Copy)]
pub(super) struct Meeting<S: Simd> {
    pub point: V3<S>,
    pub path: Lanes<S>,
    pub ok: Mask<S>,
}

/// A tangent of rays: the change of points and directions per unit change of one quantity.
#[derive(Clone, Copy)]
pub(super) struct Tangent<S: Simd> {
    pub position: V3<S>,
    pub direction: V3<S>,
}
