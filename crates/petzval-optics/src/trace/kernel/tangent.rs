//! Forward mode: how rays move at the image when the numbers of the lens move in one given direction.

use pulp::{Simd, WithSimd};

use super::aim::{AimedRays, launched_rays};
use super::forward::{Crossing, aperture, is_dead, load, trace_rays};
use super::surface::{OwnTangent, Slopes, Tangent, bend, push_forward, slopes};
use crate::gradient::{LensGradient, SurfaceGradient};
use crate::lanes::{Lanes, along, dispatch, width};
use crate::trace::ray::RayBundle;
use crate::trace::sequence::{Sequence, SurfaceAtWavelength};

/// How the rays of a bundle move; padded as the bundle is.
#[derive(Clone, Debug, Default)]
pub struct RayTangents {
    /// Change of x on the image plane, mm.
    pub image_x: Vec<f64>,
    /// Change of y on the image plane, mm.
    pub image_y: Vec<f64>,
    /// Change of the transmission.
    pub transmission: Vec<f64>,
}

/// What a change of one surface's own numbers does at the points where rays meet it.
#[inline(always)]
fn own<S: Simd>(
    s: &SurfaceAtWavelength,
    slope: &Slopes<S>,
    change: &SurfaceGradient,
    mu: f64,
) -> OwnTangent<S> {
    let (c, u, w, per_w) = (s.shape.curvature, slope.u, slope.w, slope.per_w);
    let per_w3 = per_w * per_w * per_w;
    let per_sum = per_w / (w + 1.0);
    let cube = 0.25 * c * c * c * change.conic;
    let mut sag = u * per_sum * change.curvature + u * u * per_sum * per_sum * w * (2.0 * cube);
    let mut first = per_w3 * (0.5 * change.curvature) + u * per_w3 * cube;
    let mut power = u.constant(1.0);
    for (j, a) in change.asphere.iter().enumerate() {
        first += power * ((j + 1) as f64 * a);
        power = power * u;
        sag += power * *a;
    }
    OwnTangent { sag, first, mu: u.constant(mu) }
}

/// Change of `n_before / n_after` at a surface.
fn mu_change(sequence: &Sequence, change: &LensGradient, i: usize) -> f64 {
    let s = &sequence.surfaces[i];
    let before = if i > 0 { change.surfaces[i - 1].index } else { 0.0 };
    (before - s.n_before / s.n_after * change.surfaces[i].index) / s.n_after
}

/// A tangent carried along a tape to the last of its surfaces: point there, direction in front, direction behind, and the
/// relative change of the transmission.
#[inline(always)]
fn carry<S: Simd>(
    sequence: &Sequence,
    change: &LensGradient,
    tape: &[Crossing<S>],
    start: Tangent<S>,
) -> (Tangent<S>, Lanes<S>) {
    let mut tangent = start;
    let zero = tape[0].path.constant(0.0);
    let mut light = zero;
    for (i, crossing) in tape.iter().enumerate() {
        let surface = &sequence.surfaces[i];
        if i > 0 {
            tangent.position[2] = tangent.position[2] - change.surfaces[i - 1].thickness;
        }
        let ([x, y, _], d) = (crossing.point, crossing.direction);
        let slope = slopes(surface, crossing.point);
        let b = bend(surface, slope.normal, d);
        let own = own(surface, &slope, &change.surfaces[i], mu_change(sequence, change, i));
        tangent = push_forward(&slope, &b, crossing.path, [x, y], d, &tangent, Some(own));
        if i != sequence.stop
            && let Some((share, by_radius)) = aperture(surface, slope.u)
        {
            // by_radius is dT/dr / r.
            let outward = x * tangent.position[0] + y * tangent.position[1]
                - slope.u.sqrt() * change.surfaces[i].semi_diameter;
            let through = zero.lt(share);
            light += through.select(by_radius * outward / through.select(share, zero.constant(1.0)), zero);
        }
    }
    (tangent, light)
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
                let (moved, _) = carry(sequence, change, &tape[..=stop], start);
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
            let (end, light) = carry(sequence, change, &tape, start);
            // x = p_x + s d_x with the run s = (thickness - p_z) / d_z.
            let d = arrival.ray.direction;
            let moved = along(end.position, arrival.run, end.direction);
            let run = (zero.constant(change.surfaces[last].thickness) - moved[2]) / d[2];
            let dead = is_dead(arrival.fate);
            let alive = |v: Lanes<S>| dead.select(zero, v);
            alive(run.mul_add(d[0], moved[0])).store(&mut out.image_x[at..]);
            alive(run.mul_add(d[1], moved[1])).store(&mut out.image_y[at..]);
            alive(light * arrival.transmission).store(&mut out.transmission[at..]);
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
    let mut out = RayTangents { image_x: zero(), image_y: zero(), transmission: zero() };
    dispatch(PushForward { sequence, launched, change, aimed, out: &mut out });
    out
}
