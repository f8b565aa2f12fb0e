//! Real ray aiming, several rays at a time: finds the launch points of rays through given points of the stop.

use pulp::{Simd, WithSimd};

use super::frame;
use super::general;
use super::rays::{Rays, Tangent};
use super::surface::{bend, meet, push_forward, slopes};
use crate::lanes::{Lanes, Mask, V3, along, dot, scaled, width};
use crate::lens::ObjectDistance;
use crate::trace::fate::NOT_AIMED;
use crate::trace::launch::{launch, launch_axes, starts_across};
use crate::trace::ray::RayBundle;
use crate::trace::sequence::Sequence;
use petzval_base::simd::dispatch;

/// Evaluations allowed; a well-posed ray needs four or five.
const MAX_EVALUATIONS: usize = 60;

/// Largest miss from which one more Newton step reaches rounding, mm: the method squares the miss.
const LAST_MISS_MM: f64 = 1e-7;

/// Largest miss of an aimed ray, mm.
const AIMED_MM: f64 = 1e-9;

/// Share of its miss that a step of [`Newton::Direct`] may leave.
///
/// Newton's method that leaves h / 2 of its first miss, with h <= 1/2 (Kantorovich's condition), converges, and its root is
/// the only one near the guess.
const DIRECT_SHARE: f64 = 0.25;

/// Least share of a step of [`Newton::Damped`].
const LEAST_SHARE: f64 = 1e-6;

/// How far Newton's method may go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Newton {
    /// Full steps that each leave at most a quarter of the miss: this finds the root next to the guess.
    Direct,
    /// A step that loses a ray or increases its miss is halved: this may find any root.
    Damped,
}

impl Newton {
    /// Share of the miss that a step may leave, and the least share of a step.
    fn limits(self) -> (f64, f64) {
        match self {
            Self::Direct => (DIRECT_SHARE, 1.0),
            Self::Damped => (1.0, LEAST_SHARE),
        }
    }
}

/// Rays aimed at points of the stop. Arrays are padded as a [`RayBundle`] is.
#[derive(Clone, Debug)]
pub struct AimedRays {
    /// Field angle, rad.
    pub field_rad: f64,
    /// Launch coordinates x, y on the launch plane of the field, see [`launch`], mm.
    pub launch_mm: [Vec<f64>; 2],
    /// d(stop x, stop y) / d(launch x, launch y), row by row.
    pub(super) stop_by_launch: [[Vec<f64>; 2]; 2],
    /// d(direction in front of the stop) / d(launch x) and / d(launch y), 1/mm.
    pub(super) direction_by_launch: [[Vec<f64>; 3]; 2],
    not_aimed: Vec<f64>,
    rays: usize,
}

impl AimedRays {
    /// Aims the rays of a field at the points `target_mm` of the stop by Newton's method from `guess_mm`, both (x, y)
    /// per ray. A step that loses a ray or increases its miss is halved. A ray that is not found keeps the guess as its
    /// launch point and has the fate `NotAimed`.
    ///
    /// Several rays of a field can pass the same point of the stop. From a far guess the method may find one outside the beam.
    /// [`aim_at_pupil`](crate::pupil::aim_at_pupil) avoids this: it follows the beam from the axis.
    pub fn new(sequence: &Sequence, field_rad: f64, target_mm: &[[f64; 2]], guess_mm: &[[f64; 2]]) -> Self {
        Self::by(Newton::Damped, sequence, field_rad, target_mm, guess_mm)
    }

    /// [`AimedRays::new`] with full steps only, each of which leaves at most a quarter of the miss. A ray that is found is
    /// the one next to its guess; others have the fate `NotAimed` after one or two steps.
    pub(crate) fn direct(
        sequence: &Sequence,
        field_rad: f64,
        target_mm: &[[f64; 2]],
        guess_mm: &[[f64; 2]],
    ) -> Self {
        Self::by(Newton::Direct, sequence, field_rad, target_mm, guess_mm)
    }

    fn by(
        newton: Newton,
        sequence: &Sequence,
        field_rad: f64,
        target_mm: &[[f64; 2]],
        guess_mm: &[[f64; 2]],
    ) -> Self {
        let rays = target_mm.len();
        let padded = RayBundle::padded(rays);
        // Padding repeats the first ray.
        let column = |from: &[[f64; 2]], axis: usize| -> Vec<f64> {
            (0..padded).map(|i| from.get(i).or(from.first()).map_or(0.0, |p| p[axis])).collect()
        };
        let zero = || vec![0.0; padded];
        let mut aimed = Self {
            field_rad,
            launch_mm: [column(guess_mm, 0), column(guess_mm, 1)],
            stop_by_launch: [[zero(), zero()], [zero(), zero()]],
            direction_by_launch: [[zero(), zero(), zero()], [zero(), zero(), zero()]],
            not_aimed: zero(),
            rays,
        };
        let target = [column(target_mm, 0), column(target_mm, 1)];
        dispatch(Aim { newton, sequence, target, aimed: &mut aimed });
        aimed
    }

    /// Launch point of a ray, mm.
    pub fn launch_of(&self, ray: usize) -> [f64; 2] {
        [self.launch_mm[0][ray], self.launch_mm[1][ray]]
    }

    /// Whether a ray was aimed.
    pub fn is_aimed(&self, ray: usize) -> bool {
        self.not_aimed[ray] == 0.0
    }

    /// Launch area per stop area at a ray, from the exact derivatives.
    pub fn launch_per_stop_area(&self, ray: usize) -> f64 {
        let [[a, b], [c, d]] = &self.stop_by_launch;
        1.0 / (a[ray] * d[ray] - b[ray] * c[ray])
    }

    /// d(stop x, stop y) / d(launch x, launch y) of a ray, row by row; the unit matrix if it was not aimed.
    pub fn stop_by_launch_of(&self, ray: usize) -> [[f64; 2]; 2] {
        self.stop_by_launch.each_ref().map(|row| row.each_ref().map(|column| column[ray]))
    }

    /// Replaces a ray by one of other rays of the same field.
    pub(crate) fn replace(&mut self, ray: usize, others: &Self, other: usize) {
        for axis in 0..2 {
            self.launch_mm[axis][ray] = others.launch_mm[axis][other];
            for row in 0..2 {
                self.stop_by_launch[row][axis][ray] = others.stop_by_launch[row][axis][other];
            }
            for k in 0..3 {
                self.direction_by_launch[axis][k][ray] = others.direction_by_launch[axis][k][other];
            }
        }
        self.not_aimed[ray] = others.not_aimed[other];
    }

    /// Marks a ray as not aimed.
    pub(crate) fn lose(&mut self, ray: usize) {
        for axis in 0..2 {
            for row in 0..2 {
                self.stop_by_launch[row][axis][ray] = if row == axis { 1.0 } else { 0.0 };
            }
            for of_axis in &mut self.direction_by_launch[axis] {
                of_axis[ray] = 0.0;
            }
        }
        self.not_aimed[ray] = NOT_AIMED;
    }

    /// The rays as they are launched.
    pub fn bundle(&self, sequence: &Sequence) -> RayBundle {
        let mut bundle = RayBundle::new(self.rays);
        if sequence.object == ObjectDistance::Infinity && !starts_across(sequence, self.field_rad) {
            let [_, m, n] = launch(sequence, self.field_rad, [0.0; 2]).ray.direction;
            let rays = self.rays;
            bundle.x[..rays].copy_from_slice(&self.launch_mm[0][..rays]);
            bundle.y[..rays].copy_from_slice(&self.launch_mm[1][..rays]);
            bundle.m[..rays].fill(m);
            bundle.n[..rays].fill(n);
        } else {
            for i in 0..self.rays {
                bundle.set(i, launch(sequence, self.field_rad, self.launch_of(i)).ray);
            }
        }
        bundle.fate[..self.rays].copy_from_slice(&self.not_aimed[..self.rays]);
        bundle
    }
}

/// Points of rays in the stop, and their derivatives by the launch point.
#[derive(Clone, Copy)]
struct AtStop<S: Simd> {
    hit: [Lanes<S>; 2],
    /// Tangents of the point and of the direction in front, by launch x and y.
    by: [Tangent<S>; 2],
    ok: Mask<S>,
}

/// Rays of a field at launch points, and their tangents by launch x and y.
#[inline(always)]
pub(super) fn launched_rays<S: Simd>(
    sequence: &Sequence,
    field_rad: f64,
    at: [Lanes<S>; 2],
) -> (Rays<S>, [Tangent<S>; 2]) {
    let zero = at[0].constant(0.0);
    let one = at[0].constant(1.0);
    let mut position = [at[0], at[1], zero];
    let mut axes: [V3<S>; 2] = [[one, zero, zero], [zero, one, zero]];
    match sequence.object {
        ObjectDistance::Infinity => {
            let direction = [zero, zero.constant(field_rad.sin()), zero.constant(field_rad.cos())];
            let still = [zero; 3];
            if starts_across(sequence, field_rad) {
                let [_, [_, y, z]] = launch_axes(sequence, field_rad);
                axes[1] = [zero, zero.constant(y), zero.constant(z)];
                position = [at[0], at[1] * y, at[1] * z];
            }
            let by = [
                Tangent { position: axes[0], direction: still },
                Tangent { position: axes[1], direction: still },
            ];
            (Rays { position, direction }, by)
        }
        ObjectDistance::Finite(distance) => {
            let v = [at[0], at[1] + distance * field_rad.tan(), zero.constant(distance)];
            // Light goes from a real object, and to a virtual one.
            let per_length = one.constant(distance.signum()) / dot(v, v).sqrt();
            let direction = scaled(per_length, v);
            // d(v / l) = (e - d (d.e)) / l with l = +-|v|
            let turns = [
                scaled(per_length, along(axes[0], -direction[0], direction)),
                scaled(per_length, along(axes[1], -direction[1], direction)),
            ];
            let by = [
                Tangent { position: axes[0], direction: turns[0] },
                Tangent { position: axes[1], direction: turns[1] },
            ];
            (Rays { position, direction }, by)
        }
    }
}

/// Traces rays from launch points to the stop, together with their tangents by launch x and y.
#[inline(always)]
fn to_stop<S: Simd>(sequence: &Sequence, field_rad: f64, at: [Lanes<S>; 2]) -> AtStop<S> {
    let (mut ray, mut by) = launched_rays(sequence, field_rad, at);
    let zero = at[0].constant(0.0);
    let mut ok = zero.lt(zero).not();
    let mut hit = at;
    for (i, surface) in sequence.surfaces[..=sequence.stop].iter().enumerate() {
        // Enter the coordinates of the surface and find the points on it.
        if let Some(frame) = &surface.frame {
            ray = frame::enter(frame, &ray);
            by = [
                frame::enter_tangent(frame, &ray, &by[0], None),
                frame::enter_tangent(frame, &ray, &by[1], None),
            ];
        }
        let meeting = meet(surface, &ray);
        ok = ok.and(meeting.ok);
        let ([x, y, _], d) = (meeting.point, ray.direction);
        // Bend the rays, and carry the tangents to the points and through the bend.
        let before = by;
        let direction = if surface.is_general {
            let (after, through) = general::redirect(surface, meeting.point, d);
            ok = ok.and(through);
            by = [
                general::push_forward(surface, meeting.point, d, meeting.path, &before[0], None),
                general::push_forward(surface, meeting.point, d, meeting.path, &before[1], None),
            ];
            after
        } else {
            let slope = slopes(surface, meeting.point);
            let b = bend(surface, slope.normal, d);
            by = [
                push_forward(&slope, &b, meeting.path, [x, y], d, &before[0], None),
                push_forward(&slope, &b, meeting.path, [x, y], d, &before[1], None),
            ];
            along(scaled(zero.constant(b.mu), d), b.b, slope.normal)
        };
        if i == sequence.stop {
            // Record the point in the stop, and the direction in front of it.
            hit = [x, y];
            by[0].direction = before[0].direction;
            by[1].direction = before[1].direction;
            break;
        }
        // Go on to the coordinates of the next vertex. From here on, a totally reflected ray has NaN coordinates.
        ray = Rays { position: meeting.point, direction };
        if let Some(frame) = &surface.frame {
            by = [
                frame::leave_tangent(frame, &ray, &by[0], None),
                frame::leave_tangent(frame, &ray, &by[1], None),
            ];
            ray = frame::leave(frame, &ray);
        }
        ray.position[2] = ray.position[2] - surface.thickness_mm;
    }
    AtStop { hit, by, ok }
}

struct Aim<'a> {
    newton: Newton,
    sequence: &'a Sequence,
    target: [Vec<f64>; 2],
    aimed: &'a mut AimedRays,
}

impl WithSimd for Aim<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { newton, sequence, target, aimed } = self;
        for at in (0..aimed.not_aimed.len()).step_by(width::<S>()) {
            let target = [Lanes::load(simd, &target[0][at..]), Lanes::load(simd, &target[1][at..])];
            let guess =
                [Lanes::load(simd, &aimed.launch_mm[0][at..]), Lanes::load(simd, &aimed.launch_mm[1][at..])];
            let (launch, found, ok) = aim(newton, sequence, aimed.field_rad, target, guess);
            let zero = target[0].constant(0.0);
            for axis in 0..2 {
                ok.select(launch[axis], guess[axis]).store(&mut aimed.launch_mm[axis][at..]);
                for row in 0..2 {
                    // Give rays that were not aimed the unit matrix, which can be inverted.
                    let unit = zero.constant(if row == axis { 1.0 } else { 0.0 });
                    let to = &mut aimed.stop_by_launch[row][axis];
                    ok.select(found.by[axis].position[row], unit).store(&mut to[at..]);
                }
                for k in 0..3 {
                    let to = &mut aimed.direction_by_launch[axis][k];
                    ok.select(found.by[axis].direction[k], zero).store(&mut to[at..]);
                }
            }
            ok.select(zero, zero.constant(NOT_AIMED)).store(&mut aimed.not_aimed[at..]);
        }
    }
}

/// Vector and distance by which rays miss their targets.
#[inline(always)]
fn miss<S: Simd>(hit: [Lanes<S>; 2], target: [Lanes<S>; 2]) -> ([Lanes<S>; 2], Lanes<S>) {
    let e = [hit[0] - target[0], hit[1] - target[1]];
    (e, (e[0] * e[0] + e[1] * e[1]).sqrt())
}

/// Newton's method: launch points of rays through `target`, their points and derivatives at the stop, and whether each was
/// found.
#[inline(always)]
fn aim<S: Simd>(
    newton: Newton,
    sequence: &Sequence,
    field_rad: f64,
    target: [Lanes<S>; 2],
    guess: [Lanes<S>; 2],
) -> ([Lanes<S>; 2], AtStop<S>, Mask<S>) {
    let one = target[0].constant(1.0);
    let (left_share, least_share) = newton.limits();
    let mut launch = guess;
    let mut found = to_stop(sequence, field_rad, launch);
    let (mut error, mut distance) = miss(found.hit, target);
    // Trace the guess. A ray that fails here cannot be aimed.
    let infinite = one * f64::INFINITY;
    let start_ok = found.ok.and(distance.lt(infinite));
    let mut share = one;
    for _ in 0..MAX_EVALUATIONS {
        // Stop after this step if every ray has a small miss, has failed, or can no longer be improved.
        let nearly = distance.lt(one * LAST_MISS_MM);
        let lost = share.lt(one * least_share);
        let last = nearly.or(lost).or(start_ok.not()).all();
        let open = start_ok.and(lost.not());
        // Newton step: the miss times the inverse of d(stop)/d(launch).
        let (a, c) = (found.by[0].position[0], found.by[0].position[1]);
        let (b, d) = (found.by[1].position[0], found.by[1].position[1]);
        let scale = share / (a * d - b * c);
        let step = [(d * error[0] - b * error[1]) * scale, (a * error[1] - c * error[0]) * scale];
        let next = [launch[0] - step[0], launch[1] - step[1]];
        let tried = to_stop(sequence, field_rad, next);
        let (next_error, next_distance) = miss(tried.hit, target);
        // Accept the step if the miss decreases enough. Within the aiming tolerance rounding may increase it.
        let nearer = next_distance.lt(distance * left_share).or(distance.lt(one * AIMED_MM));
        let accept = open.and(tried.ok).and(nearer).and(next_distance.lt(infinite));
        for axis in 0..2 {
            launch[axis] = accept.select(next[axis], launch[axis]);
            error[axis] = accept.select(next_error[axis], error[axis]);
            found.hit[axis] = accept.select(tried.hit[axis], found.hit[axis]);
            for k in 0..3 {
                let (to, from) = (&mut found.by[axis], &tried.by[axis]);
                to.position[k] = accept.select(from.position[k], to.position[k]);
                to.direction[k] = accept.select(from.direction[k], to.direction[k]);
            }
        }
        distance = accept.select(next_distance, distance);
        // Halve the next step of rays whose step was not accepted.
        share = accept.select(one, share * 0.5);
        if last {
            break;
        }
    }
    let ok = start_ok.and(distance.lt(one * AIMED_MM));
    (launch, found, ok)
}
