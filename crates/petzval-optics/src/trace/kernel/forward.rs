//! Traces bundles of rays forward through a lens, to the image plane.

use pulp::{Simd, WithSimd};

use super::frame;
use super::rays::Rays;
use super::surface::{meet, redirect};
use crate::lanes::{Lanes, Mask, V3, along, width};
use crate::trace::fate::{Loss, clipped_at};
use crate::trace::ray::RayBundle;
use crate::trace::sequence::{Sequence, SurfaceAtWavelength};
use crate::trace::soft_edge::soft_edge;
use petzval_base::simd::dispatch;

/// The crossing of one surface by rays, recorded for the backward sweep.
#[derive(Clone, Copy)]
pub(super) struct Crossing<S: Simd> {
    /// Direction in front of the surface.
    pub direction: V3<S>,
    /// Point on the surface; like the direction, in the surface's own coordinates.
    pub point: V3<S>,
    /// Path travelled to it.
    pub path: Lanes<S>,
}

impl<S: Simd> Crossing<S> {
    /// The rays in front of the surface, where their path begins, in the surface's coordinates.
    #[inline(always)]
    pub fn entry(&self) -> Rays<S> {
        Rays { position: along(self.point, -self.path, self.direction), direction: self.direction }
    }
}

/// Rays at the image plane.
pub(super) struct Arrival<S: Simd> {
    pub ray: Rays<S>,
    /// Run from the last vertex plane of the ray to the image plane, along the ray.
    pub run: Lanes<S>,
    pub transmission: Lanes<S>,
    /// Fate codes.
    pub fate: Lanes<S>,
    /// Optical path from the launch.
    pub optical_path: Lanes<S>,
}

/// Transmission of a clear aperture at `u = r^2`, and its derivative by r over r; `None` where every ray passes well inside.
#[inline(always)]
pub(super) fn aperture<S: Simd>(s: &SurfaceAtWavelength, u: Lanes<S>) -> Option<(Lanes<S>, Lanes<S>)> {
    let edge = soft_edge(u, s.semi_diameter_mm)?;
    Some((edge.transmission, edge.by_radius / edge.radius_mm))
}

/// Moves failed rays onto the axis, so that their numbers stay finite, and records the reason.
#[inline(always)]
fn lose<S: Simd>(ray: &mut Rays<S>, fate: &mut Lanes<S>, ok: Mask<S>, loss: Loss, surface: usize) {
    if ok.all() {
        return;
    }
    // A ray keeps its first reason.
    let zero = fate.constant(0.0);
    let before = is_dead(*fate);
    let newly = ok.not().and(before.not());
    *fate = newly.select(fate.constant(loss.code(surface)), *fate);
    for value in ray.position.iter_mut().chain(&mut ray.direction[..2]) {
        *value = ok.select(*value, zero);
    }
    ray.direction[2] = ok.select(ray.direction[2], zero.constant(1.0));
}

/// Whether rays do not reach the image; clipped rays do.
#[inline(always)]
pub(super) fn is_dead<S: Simd>(fate: Lanes<S>) -> Mask<S> {
    fate.lt(fate.constant(0.0))
}

/// Traces rays to the image plane; `tape`, if given, receives one crossing per surface.
#[inline(always)]
pub(super) fn trace_rays<S: Simd, const TAPE: bool>(
    sequence: &Sequence,
    mut ray: Rays<S>,
    mut fate: Lanes<S>,
    tape: &mut Vec<Crossing<S>>,
) -> Arrival<S> {
    let zero = fate.constant(0.0);
    let mut transmission = is_dead(fate).select(zero, zero.constant(1.0));
    let mut optical_path = zero;
    tape.clear();
    for (i, surface) in sequence.surfaces.iter().enumerate() {
        // Find the points on the surface, in its own coordinates, and add the optical path to them.
        if let Some(frame) = &surface.frame {
            ray = frame::enter(frame, &ray);
        }
        let meeting = meet(surface, &ray);
        let (mut point, mut before) = (meeting.point, ray.direction);
        optical_path = meeting.path.mul_add(zero.constant(surface.n_before), optical_path);
        // Multiply by the transmission of the clear aperture. The stop does not clip: rays are aimed inside it.
        if i != sequence.stop {
            let u = point[0].mul_add(point[0], point[1] * point[1]);
            if let Some((share, _)) = aperture(surface, u) {
                transmission = transmission * share;
                let newly = zero.lt(share).not().and(fate.abs().lt(zero.constant(0.5)));
                fate = newly.select(zero.constant(clipped_at(i)), fate);
            }
        }
        // Refract, reflect or diffract, and add the optical path of a thin lens or a diffractive structure.
        let (direction, refracted) = redirect(surface, point, before);
        if surface.is_general {
            optical_path += surface.added_path_mm([point[0], point[1]]);
        }
        let mut after = Rays { position: point, direction };
        let ok = meeting.ok.and(refracted);
        // Take rays that miss the surface or are totally reflected out of the bundle.
        if !ok.all() {
            lose(&mut after, &mut fate, meeting.ok, Loss::Missed, i);
            lose(&mut after, &mut fate, refracted, Loss::TotalReflection, i);
            transmission = ok.select(transmission, zero);
            for axis in 0..3 {
                point[axis] = ok.select(point[axis], zero);
                before[axis] = ok.select(before[axis], after.direction[axis]);
            }
        }
        if TAPE {
            tape.push(Crossing { direction: before, point, path: ok.select(meeting.path, zero) });
        }
        // Go on to the coordinates of the next vertex.
        if let Some(frame) = &surface.frame {
            after = frame::leave(frame, &after);
        }
        after.position[2] = after.position[2] - surface.thickness_mm;
        ray = after;
    }
    // Run to the image plane, z = 0 of the last coordinates.
    let run = -ray.position[2] / ray.direction[2];
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    optical_path = run.mul_add(zero.constant(n_image), optical_path);
    ray.position = along(ray.position, run, ray.direction);
    Arrival { ray, run, transmission, fate, optical_path }
}

/// Loads rays of a bundle.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, bundle: &RayBundle, at: usize) -> Rays<S> {
    let [x, y, z] = [&bundle.x[at..], &bundle.y[at..], &bundle.z[at..]];
    let [l, m, n] = [&bundle.l[at..], &bundle.m[at..], &bundle.n[at..]];
    Rays {
        position: [Lanes::load(simd, x), Lanes::load(simd, y), Lanes::load(simd, z)],
        direction: [Lanes::load(simd, l), Lanes::load(simd, m), Lanes::load(simd, n)],
    }
}

struct Trace<'a> {
    sequence: &'a Sequence,
    bundle: &'a mut RayBundle,
    heights: &'a mut [SquaredHeights],
}

impl WithSimd for Trace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sequence, bundle, heights } = self;
        let mut tape = Vec::new();
        for at in (0..bundle.len()).step_by(width::<S>()) {
            let fate = Lanes::load(simd, &bundle.fate[at..]);
            let ray = load(simd, bundle, at);
            let arrival = if heights.is_empty() {
                trace_rays::<S, false>(sequence, ray, fate, &mut tape)
            } else {
                trace_rays::<S, true>(sequence, ray, fate, &mut tape)
            };
            let ([x, y, z], [l, m, n]) = (arrival.ray.position, arrival.ray.direction);
            for (value, to) in [
                (x, &mut bundle.x),
                (y, &mut bundle.y),
                (z, &mut bundle.z),
                (l, &mut bundle.l),
                (m, &mut bundle.m),
                (n, &mut bundle.n),
                (arrival.transmission, &mut bundle.transmission),
                (arrival.fate, &mut bundle.fate),
                (arrival.optical_path, &mut bundle.optical_path),
            ] {
                value.store(&mut to[at..]);
            }
            for h in heights.iter_mut() {
                let [x, y, _] = tape[h.surface].point;
                x.mul_add(x, y * y).store(&mut h.values[at..]);
            }
        }
    }
}

/// A number per ray at one surface: the square of its height there, mm^2, or the cotangent of this square, 1/mm^2.
#[derive(Clone, Debug)]
pub struct SquaredHeights {
    /// Surface, from 0.
    pub surface: usize,
    /// One per ray; padded.
    pub values: Vec<f64>,
}

impl SquaredHeights {
    /// Zeros for a number of rays.
    pub fn zero(surface: usize, rays: usize) -> Self {
        Self { surface, values: vec![0.0; RayBundle::padded(rays)] }
    }
}

/// Traces as [`trace`], and records the squared heights of the rays at some surfaces.
pub fn trace_with_heights(sequence: &Sequence, bundle: &mut RayBundle, heights: &mut [SquaredHeights]) {
    dispatch(Trace { sequence, bundle, heights });
}

/// Traces a bundle, given in the coordinates of the first vertex, to the image plane.
pub fn trace(sequence: &Sequence, bundle: &mut RayBundle) {
    trace_with_heights(sequence, bundle, &mut []);
}
