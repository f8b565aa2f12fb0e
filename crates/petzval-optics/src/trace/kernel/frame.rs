//! Coordinate changes at surfaces that are shifted or turned, several rays at a time.
//!
//! The vector omega of `R_dot^T R`, in surface coordinates, describes a small turn of the surface: seen from the
//! surface, points and directions in front move by `omega x p`. The transpose of this is a torque:
//! `p x p_bar + d x d_bar`.

use pulp::Simd;

use super::rays::{Rays, Tangent};
use crate::lanes::{Lanes, V3};
use crate::lens::Axis;
use crate::trace::sequence::Frame;
use crate::vector::{Matrix3, Vec3, half_turned, transposed};

/// `M v`.
#[inline(always)]
fn times<S: Simd>(m: &Matrix3, v: V3<S>) -> V3<S> {
    let mut out = v;
    for (to, row) in out.iter_mut().zip(m) {
        *to = v[0] * row[0] + v[1] * row[1] + v[2] * row[2];
    }
    out
}

#[inline(always)]
fn cross<S: Simd>(a: V3<S>, b: V3<S>) -> V3<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The rotation from surface coordinates to those of the axis behind; `None` if they are the same.
#[inline(always)]
fn behind(frame: &Frame) -> Option<Matrix3> {
    match frame.placement.axis {
        Axis::Returns => Some(frame.rotation),
        Axis::Follows => None,
        Axis::Bends => Some(half_turned(&frame.rotation)),
    }
}

/// Transforms rays to the coordinates of the surface.
#[inline(always)]
pub(super) fn enter<S: Simd>(frame: &Frame, ray: &Rays<S>) -> Rays<S> {
    let to_surface = transposed(&frame.rotation);
    let [dx, dy] = frame.placement.decenter_mm;
    let [x, y, z] = ray.position;
    Rays { position: times(&to_surface, [x - dx, y - dy, z]), direction: times(&to_surface, ray.direction) }
}

/// Transforms rays to the coordinates of the axis behind the surface.
#[inline(always)]
pub(super) fn leave<S: Simd>(frame: &Frame, ray: &Rays<S>) -> Rays<S> {
    let Some(m) = behind(frame) else { return *ray };
    let (mut position, direction) = (times(&m, ray.position), times(&m, ray.direction));
    if frame.placement.axis == Axis::Returns {
        position[0] = position[0] + frame.placement.decenter_mm[0];
        position[1] = position[1] + frame.placement.decenter_mm[1];
    }
    Rays { position, direction }
}

/// A change of a frame: its decentre, and its turn as the vector omega.
#[derive(Clone, Copy)]
pub(super) struct FrameChange {
    pub decenter: [f64; 2],
    pub omega: Vec3,
}

/// The vector omega for a unit change of each tilt.
pub(super) fn omegas(frame: &Frame) -> [Vec3; 3] {
    frame.placement.rotation_by_tilt().map(|by| {
        // Omega = by^T R is antisymmetric; its entries (2, 1), (0, 2) and (1, 0) are the vector.
        let entry = |i: usize, j: usize| (0..3).map(|k| by[k][i] * frame.rotation[k][j]).sum();
        [entry(2, 1), entry(0, 2), entry(1, 0)]
    })
}

/// Transforms a tangent to the coordinates of the surface; `ray` are the entering rays in these coordinates.
#[inline(always)]
pub(super) fn enter_tangent<S: Simd>(
    frame: &Frame,
    ray: &Rays<S>,
    tangent: &Tangent<S>,
    change: Option<&FrameChange>,
) -> Tangent<S> {
    let to_surface = transposed(&frame.rotation);
    let [mut x, mut y, z] = tangent.position;
    if let Some(change) = change {
        x = x - change.decenter[0];
        y = y - change.decenter[1];
    }
    let mut out =
        Tangent { position: times(&to_surface, [x, y, z]), direction: times(&to_surface, tangent.direction) };
    if let Some(change) = change {
        let omega = constant(ray.position[0], change.omega);
        add(&mut out.position, cross(omega, ray.position), 1.0);
        add(&mut out.direction, cross(omega, ray.direction), 1.0);
    }
    out
}

/// Transforms a tangent to the coordinates of the axis behind; `ray` are the rays behind the surface, in its coordinates.
#[inline(always)]
pub(super) fn leave_tangent<S: Simd>(
    frame: &Frame,
    ray: &Rays<S>,
    tangent: &Tangent<S>,
    change: Option<&FrameChange>,
) -> Tangent<S> {
    let Some(m) = behind(frame) else { return *tangent };
    let mut moved = *tangent;
    if let Some(change) = change {
        let omega = constant(ray.position[0], turned_omega(frame, change.omega));
        add(&mut moved.position, cross(omega, ray.position), -1.0);
        add(&mut moved.direction, cross(omega, ray.direction), -1.0);
    }
    let mut out = Tangent { position: times(&m, moved.position), direction: times(&m, moved.direction) };
    if let (Some(change), Axis::Returns) = (change, frame.placement.axis) {
        out.position[0] = out.position[0] + change.decenter[0];
        out.position[1] = out.position[1] + change.decenter[1];
    }
    out
}

/// Omega of the rotation behind the surface. A bent axis includes half a turn about z, which reverses x and y.
fn turned_omega(frame: &Frame, [x, y, z]: Vec3) -> Vec3 {
    match frame.placement.axis {
        Axis::Bends => [-x, -y, z],
        _ => [x, y, z],
    }
}

/// Cotangents of a frame: by its decentre and by its turn (a torque in surface coordinates).
pub(super) struct FrameSums<S: Simd> {
    pub decenter: [Lanes<S>; 2],
    pub torque: V3<S>,
}

/// The transpose of [`enter_tangent`].
#[inline(always)]
pub(super) fn pull_back_enter<S: Simd>(
    frame: &Frame,
    ray: &Rays<S>,
    bar: &Tangent<S>,
    sums: &mut FrameSums<S>,
) -> Tangent<S> {
    add(&mut sums.torque, cross(ray.position, bar.position), 1.0);
    add(&mut sums.torque, cross(ray.direction, bar.direction), 1.0);
    let out = Tangent {
        position: times(&frame.rotation, bar.position),
        direction: times(&frame.rotation, bar.direction),
    };
    sums.decenter[0] -= out.position[0];
    sums.decenter[1] -= out.position[1];
    out
}

/// The transpose of [`leave_tangent`].
#[inline(always)]
pub(super) fn pull_back_leave<S: Simd>(
    frame: &Frame,
    ray: &Rays<S>,
    bar: &Tangent<S>,
    sums: &mut FrameSums<S>,
) -> Tangent<S> {
    let Some(m) = behind(frame) else { return *bar };
    if frame.placement.axis == Axis::Returns {
        sums.decenter[0] += bar.position[0];
        sums.decenter[1] += bar.position[1];
    }
    let back = transposed(&m);
    let out = Tangent { position: times(&back, bar.position), direction: times(&back, bar.direction) };
    let [x, y, z] = {
        let mut torque = cross(ray.position, out.position);
        add(&mut torque, cross(ray.direction, out.direction), 1.0);
        torque
    };
    let sign = if frame.placement.axis == Axis::Bends { -1.0 } else { 1.0 };
    add(&mut sums.torque, [x * sign, y * sign, z], -1.0);
    out
}

#[inline(always)]
fn constant<S: Simd>(like: Lanes<S>, v: Vec3) -> V3<S> {
    [like.constant(v[0]), like.constant(v[1]), like.constant(v[2])]
}

/// Adds `factor v`.
#[inline(always)]
fn add<S: Simd>(to: &mut V3<S>, v: V3<S>, factor: f64) {
    for (to, v) in to.iter_mut().zip(v) {
        *to += v * factor;
    }
}
