//! Forward mode: how rays move at the image when the numbers of the lens move in one given direction.

use pulp::{Simd, WithSimd};

use super::aim::{AimedRays, launched_rays};
use super::forward::{Crossing, aperture, is_dead, load, trace_rays};
use super::frame::{self, FrameChange};
use super::general;
use super::rays::{Rays, Tangent};
use super::surface::{OwnTangent, Slopes, bend, push_forward, redirect, slopes};
use crate::gradient::LensGradient;
use crate::lanes::{Lanes, along, dot, width};
use crate::lens::ASPHERE_TERMS;
use crate::number::Number;
use crate::trace::ray::RayBundle;
use crate::trace::sequence::{Frame, Sequence, SurfaceAtWavelength};
use petzval_base::simd::dispatch;

/// How the rays of a bundle move; padded as the bundle is.
#[derive(Clone, Debug, Default)]
pub struct RayTangents {
    /// Change of x on the image plane, mm.
    pub image_x: Vec<f64>,
    /// Change of y on the image plane, mm.
    pub image_y: Vec<f64>,
    /// Change of the transmission.
    pub transmission: Vec<f64>,
    /// Change of the optical path from the launch, mm.
    pub optical_path: Vec<f64>,
    /// Change of the direction cosines at the image.
    pub direction: [Vec<f64>; 3],
}

/// How sag, slope and index ratio of surface `i` change at the points where rays meet it, when its own numbers change.
#[inline(always)]
fn own<S: Simd>(
    s: &SurfaceAtWavelength,
    slope: &Slopes<S>,
    change: &LensGradient,
    i: usize,
    mu: f64,
) -> OwnTangent<S> {
    let (c, u, w, per_w) = (s.shape.curvature, slope.u, slope.w, slope.per_w);
    let (curvature, conic) = (change[(i, Number::Curvature)], change[(i, Number::Conic)]);
    let per_w3 = per_w * per_w * per_w;
    let per_sum = per_w / (w + 1.0);
    let cube = 0.25 * c * c * c * conic;
    let mut sag = u * per_sum * curvature + u * u * per_sum * per_sum * w * (2.0 * cube);
    let mut first = per_w3 * (0.5 * curvature) + u * per_w3 * cube;
    let mut power = u.constant(1.0);
    for j in 0..ASPHERE_TERMS {
        let a = change[(i, Number::Asphere(j))];
        first += power * ((j + 1) as f64 * a);
        power = power * u;
        sag += power * a;
    }
    OwnTangent { sag, first, mu: u.constant(mu) }
}

/// Change of the signed index behind a surface.
fn index_change(sequence: &Sequence, change: &LensGradient, i: usize) -> f64 {
    sequence.index_change(i, |glass| change[(glass, Number::Index)])
}

/// Change of `n_before / n_after` at a surface.
fn mu_change(sequence: &Sequence, change: &LensGradient, i: usize) -> f64 {
    let s = &sequence.surfaces[i];
    let before = if i > 0 { index_change(sequence, change, i - 1) } else { 0.0 };
    (before - s.n_before / s.n_after * index_change(sequence, change, i)) / s.n_after
}

/// How the frame of surface `i` moves.
fn frame_change(frame: &Frame, change: &LensGradient, i: usize) -> FrameChange {
    let mut omega = [0.0; 3];
    for (k, by) in frame::omegas(frame).iter().enumerate() {
        for axis in 0..3 {
            omega[axis] += by[axis] * change[(i, Number::Tilt(k))];
        }
    }
    FrameChange { decenter: [0, 1].map(|axis| change[(i, Number::Decenter(axis))]), omega }
}

/// A tangent carried along a tape to behind the last of its surfaces, in the coordinates of that surface, and the relative
/// change of the transmission and the change of the optical path.
#[inline(always)]
fn carry<S: Simd>(
    sequence: &Sequence,
    change: &LensGradient,
    tape: &[Crossing<S>],
    start: Tangent<S>,
) -> (Tangent<S>, Lanes<S>, Lanes<S>) {
    let mut tangent = start;
    let zero = tape[0].path.constant(0.0);
    let (mut light, mut optical_path) = (zero, zero);
    for (i, crossing) in tape.iter().enumerate() {
        let surface = &sequence.surfaces[i];
        if i > 0 {
            tangent = to_axis(sequence, change, i - 1, &tape[i - 1], &tangent);
            tangent.position[2] = tangent.position[2] - change[(i - 1, Number::Thickness)];
        }
        let ([x, y, _], d) = (crossing.point, crossing.direction);
        if let Some(frame) = &surface.frame {
            let change = frame_change(frame, change, i);
            tangent = frame::enter_tangent(frame, &crossing.entry(), &tangent, Some(&change));
        }
        let entered = along(tangent.position, crossing.path, tangent.direction);
        if surface.is_general {
            let change = general::Change {
                numbers: change.of_surface(i),
                mu: mu_change(sequence, change, i),
                n_after: index_change(sequence, change, i),
            };
            optical_path += general::added_path_change(surface, crossing.point, d, change.numbers);
            tangent =
                general::push_forward(surface, crossing.point, d, crossing.path, &tangent, Some(change));
        } else {
            let slope = slopes(surface, crossing.point);
            let b = bend(surface, slope.normal, d);
            let own = own(surface, &slope, change, i, mu_change(sequence, change, i));
            tangent = push_forward(&slope, &b, crossing.path, [x, y], d, &tangent, Some(own));
        }
        let moved = along(tangent.position, zero.constant(-1.0), entered);
        optical_path += dot(moved, d) * surface.n_before;
        if i > 0 {
            optical_path += crossing.path * index_change(sequence, change, i - 1);
        }
        if surface.is_general {
            let [by_x, by_y] = general::added_path_slope(surface, crossing.point);
            optical_path += by_x * tangent.position[0] + by_y * tangent.position[1];
        }
        let u = x.mul_add(x, y * y);
        if i != sequence.stop
            && let Some((share, by_radius)) = aperture(surface, u)
        {
            // by_radius is dT/dr / r.
            let outward = x * tangent.position[0] + y * tangent.position[1]
                - u.sqrt() * change[(i, Number::SemiDiameter)];
            let through = zero.lt(share);
            light += through.select(by_radius * outward / through.select(share, zero.constant(1.0)), zero);
        }
    }
    (tangent, light, optical_path)
}

/// A tangent in the coordinates of the axis behind a surface.
#[inline(always)]
fn to_axis<S: Simd>(
    sequence: &Sequence,
    change: &LensGradient,
    i: usize,
    crossing: &Crossing<S>,
    tangent: &Tangent<S>,
) -> Tangent<S> {
    let surface = &sequence.surfaces[i];
    let Some(frame) = &surface.frame else { return *tangent };
    let direction = redirect(surface, crossing.point, crossing.direction).0;
    let ray = Rays { position: crossing.point, direction };
    frame::leave_tangent(frame, &ray, tangent, Some(&frame_change(frame, change, i)))
}

struct PushForward<'a> {
    sequence: &'a Sequence,
    launched: &'a RayBundle,
    change: &'a LensGradient,
    aimed: Option<(&'a AimedRays, f64)>,
    out: &'a mut RayTangents,
}

impl WithSimd for PushForward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sequence, launched, change, aimed, out } = self;
        let zero = Lanes::splat(simd, 0.0);
        let stop = sequence.stop;
        let last = sequence.surfaces.len() - 1;
        let mut tape = Vec::with_capacity(last + 1);
        for at in (0..launched.len()).step_by(width::<S>()) {
            let read = |from: &[f64]| Lanes::load(simd, &from[at..]);
            let fate = read(&launched.fate);
            let arrival = trace_rays::<S, true>(sequence, load(simd, launched, at), fate, &mut tape);
            let mut start = Tangent { position: [zero; 3], direction: [zero; 3] };
            if let Some((aimed, stop_growth)) = aimed {
                // Launch points follow: Q ds + (what the lens does to q) = dR/R q.
                let (moved, ..) = carry(sequence, change, &tape[..=stop], start);
                let [qx, qy, _] = tape[stop].point;
                let miss = [qx * stop_growth - moved.position[0], qy * stop_growth - moved.position[1]];
                let [[a, b], [c, d]] =
                    aimed.stop_by_launch.each_ref().map(|row| row.each_ref().map(|v| read(v)));
                let per_det = zero.constant(1.0) / (a * d - b * c);
                let ds = [(d * miss[0] - b * miss[1]) * per_det, (a * miss[1] - c * miss[0]) * per_det];
                let (_, by) =
                    launched_rays(sequence, aimed.field_rad, [read(&launched.x), read(&launched.y)]);
                start = Tangent {
                    position: along([ds[0] * by[0].position[0], zero, zero], ds[1], by[1].position),
                    direction: along([0, 1, 2].map(|k| ds[0] * by[0].direction[k]), ds[1], by[1].direction),
                };
            }
            let (end, light, mut optical_path) = carry(sequence, change, &tape, start);
            let end = to_axis(sequence, change, last, &tape[last], &end);
            // x = p_x + s d_x with the run s = (thickness - p_z) / d_z.
            let d = arrival.ray.direction;
            let moved = along(end.position, arrival.run, end.direction);
            let run = (zero.constant(change[(last, Number::Thickness)]) - moved[2]) / d[2];
            let dead = is_dead(arrival.fate);
            let alive = |v: Lanes<S>| dead.select(zero, v);
            alive(run.mul_add(d[0], moved[0])).store(&mut out.image_x[at..]);
            alive(run.mul_add(d[1], moved[1])).store(&mut out.image_y[at..]);
            alive(light * arrival.transmission).store(&mut out.transmission[at..]);
            let n_image = sequence.surfaces[last].n_after;
            optical_path += run * n_image + arrival.run * index_change(sequence, change, last);
            alive(optical_path).store(&mut out.optical_path[at..]);
            for (by, to) in end.direction.into_iter().zip(&mut out.direction) {
                alive(by).store(&mut to[at..]);
            }
        }
    }
}

/// Pushes a change of the lens's numbers forward through the trace: the transpose of [`pull_back`](super::pull_back).
///
/// `change` holds how much every number of the lens moves. With `aimed` = (how the rays were aimed, relative growth of the
/// stop's radius), launch points follow the lens; without, rays keep their launch.
pub fn push_change(
    sequence: &Sequence,
    launched: &RayBundle,
    change: &LensGradient,
    aimed: Option<(&AimedRays, f64)>,
) -> RayTangents {
    let zero = || vec![0.0; RayBundle::padded(launched.len())];
    let mut out = RayTangents {
        image_x: zero(),
        image_y: zero(),
        transmission: zero(),
        optical_path: zero(),
        direction: [zero(), zero(), zero()],
    };
    dispatch(PushForward { sequence, launched, change, aimed, out: &mut out });
    out
}
