//! Forward mode: the change of rays at the image for a given change of the numbers of the lens.

use pulp::{Simd, WithSimd};

use super::aim::{AimedRays, launched_rays};
use super::forward::{Crossing, SquaredHeights, aperture, is_dead, load, trace_rays};
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

/// Changes of the rays of a bundle; padded as the bundle is.
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
    /// Change of the launch coordinates, mm; zero for rays that keep their launch.
    pub launch_mm: [Vec<f64>; 2],
    /// Change of the squared heights at some surfaces, mm^2.
    pub heights: Vec<SquaredHeights>,
}

/// Changes of the sag, of its slope dz/du and of `mu` at the points of rays, for a change of the own numbers of surface `i`.
#[inline(always)]
fn own<S: Simd>(
    s: &SurfaceAtWavelength,
    slope: &Slopes<S>,
    change: &LensGradient,
    i: usize,
    mu: f64,
) -> OwnTangent<S> {
    // The conic: derivatives of sag and slope by curvature and conic constant.
    let (c, u, w, per_w) = (s.shape.curvature, slope.u, slope.w, slope.per_w);
    let (curvature, conic) = (change[(i, Number::Curvature)], change[(i, Number::Conic)]);
    let per_w3 = per_w * per_w * per_w;
    let per_sum = per_w / (w + 1.0);
    let cube = 0.25 * c * c * c * conic;
    let mut sag = u * per_sum * curvature + u * u * per_sum * per_sum * w * (2.0 * cube);
    let mut first = per_w3 * (0.5 * curvature) + u * per_w3 * cube;
    // The polynomial: each term a_j u^j adds u^j to the sag and j u^(j-1) to the slope.
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

/// Change of the frame of surface `i`.
fn frame_change(frame: &Frame, change: &LensGradient, i: usize) -> FrameChange {
    let mut omega = [0.0; 3];
    for (k, by) in frame::omegas(frame).iter().enumerate() {
        for axis in 0..3 {
            omega[axis] += by[axis] * change[(i, Number::Tilt(k))];
        }
    }
    FrameChange { decenter: [0, 1].map(|axis| change[(i, Number::Decenter(axis))]), omega }
}

/// Carries a tangent along a tape to behind its last surface, in the coordinates of that surface. Also returns the relative
/// change of the transmission and the change of the optical path. `heights` receives the changes of squared heights.
#[inline(always)]
fn carry<S: Simd>(
    sequence: &Sequence,
    change: &LensGradient,
    tape: &[Crossing<S>],
    start: Tangent<S>,
    heights: &mut [(usize, Lanes<S>)],
) -> (Tangent<S>, Lanes<S>, Lanes<S>) {
    let mut tangent = start;
    let zero = tape[0].path.constant(0.0);
    let (mut light, mut optical_path) = (zero, zero);
    for (i, crossing) in tape.iter().enumerate() {
        let surface = &sequence.surfaces[i];
        // Go to the coordinates of this vertex, which moves with the thickness in front, then to those of the surface.
        if i > 0 {
            tangent = to_axis(sequence, change, i - 1, &tape[i - 1], &tangent);
            tangent.position[2] = tangent.position[2] - change[(i - 1, Number::Thickness)];
        }
        let ([x, y, _], d) = (crossing.point, crossing.direction);
        if let Some(frame) = &surface.frame {
            let change = frame_change(frame, change, i);
            tangent = frame::enter_tangent(frame, &crossing.entry(), &tangent, Some(&change));
        }
        // Carry the tangent to the point on the surface and through the bend, with the changes of the surface's own
        // numbers.
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
        // Add the changes of the optical path: of the path length, of the index in front, and of the point on a thin
        // lens or a diffractive structure.
        let moved = along(tangent.position, zero.constant(-1.0), entered);
        optical_path += dot(moved, d) * surface.n_before;
        if i > 0 {
            optical_path += crossing.path * index_change(sequence, change, i - 1);
        }
        if surface.is_general {
            let [by_x, by_y] = general::added_path_slope(surface, crossing.point);
            optical_path += by_x * tangent.position[0] + by_y * tangent.position[1];
        }
        for (_, change) in heights.iter_mut().filter(|(surface, _)| *surface == i) {
            *change = (x * tangent.position[0] + y * tangent.position[1]) * 2.0;
        }
        // Add the relative change of the transmission of the clear aperture.
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

/// Transforms a tangent to the coordinates of the axis behind a surface.
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
        let mut heights = Vec::with_capacity(out.heights.len());
        for h in &out.heights {
            heights.push((h.surface, zero));
        }
        for at in (0..launched.len()).step_by(width::<S>()) {
            // Trace the rays, and record the crossings.
            let read = |from: &[f64]| Lanes::load(simd, &from[at..]);
            let fate = read(&launched.fate);
            let arrival = trace_rays::<S, true>(sequence, load(simd, launched, at), fate, &mut tape);
            // Changes of failed rays are zero.
            let dead = is_dead(arrival.fate);
            let alive = |v: Lanes<S>| dead.select(zero, v);
            let mut start = Tangent { position: [zero; 3], direction: [zero; 3] };
            if let Some((aimed, stop_growth)) = aimed {
                // Re-aim: carry a zero tangent to the stop, and move the launch point so that the point there changes by
                // dR/R q: Q ds + dq(lens) = dR/R q.
                let (moved, ..) = carry(sequence, change, &tape[..=stop], start, &mut []);
                let [qx, qy, _] = tape[stop].point;
                let miss = [qx * stop_growth - moved.position[0], qy * stop_growth - moved.position[1]];
                let [[a, b], [c, d]] =
                    aimed.stop_by_launch.each_ref().map(|row| row.each_ref().map(|v| read(v)));
                let per_det = zero.constant(1.0) / (a * d - b * c);
                let ds = [(d * miss[0] - b * miss[1]) * per_det, (a * miss[1] - c * miss[0]) * per_det];
                for (ds, to) in ds.into_iter().zip(&mut out.launch_mm) {
                    alive(ds).store(&mut to[at..]);
                }
                let (_, by) =
                    launched_rays(sequence, aimed.field_rad, [read(&launched.x), read(&launched.y)]);
                start = Tangent {
                    position: along([ds[0] * by[0].position[0], zero, zero], ds[1], by[1].position),
                    direction: along([0, 1, 2].map(|k| ds[0] * by[0].direction[k]), ds[1], by[1].direction),
                };
            }
            // Carry the tangent through the whole lens.
            let (end, light, mut optical_path) = carry(sequence, change, &tape, start, &mut heights);
            let end = to_axis(sequence, change, last, &tape[last], &end);
            // Differentiate the run to the image plane: x = p_x + s d_x with s = (thickness - p_z) / d_z.
            let d = arrival.ray.direction;
            let moved = along(end.position, arrival.run, end.direction);
            let run = (zero.constant(change[(last, Number::Thickness)]) - moved[2]) / d[2];
            alive(run.mul_add(d[0], moved[0])).store(&mut out.image_x[at..]);
            alive(run.mul_add(d[1], moved[1])).store(&mut out.image_y[at..]);
            alive(light * arrival.transmission).store(&mut out.transmission[at..]);
            let n_image = sequence.surfaces[last].n_after;
            optical_path += run * n_image + arrival.run * index_change(sequence, change, last);
            alive(optical_path).store(&mut out.optical_path[at..]);
            for (by, to) in end.direction.into_iter().zip(&mut out.direction) {
                alive(by).store(&mut to[at..]);
            }
            for ((_, by), to) in heights.iter().zip(&mut out.heights) {
                alive(*by).store(&mut to.values[at..]);
            }
        }
    }
}

/// Pushes a change of the lens's numbers forward through the trace: the transpose of [`pull_back`](super::pull_back).
///
/// `change` holds the change of every number of the lens. With `aimed` = (the aimed rays, relative growth of the stop
/// radius), launch points follow the lens; without, rays keep their launch.
pub fn push_change(
    sequence: &Sequence,
    launched: &RayBundle,
    change: &LensGradient,
    aimed: Option<(&AimedRays, f64)>,
) -> RayTangents {
    push_change_with_heights(sequence, launched, change, aimed, &[])
}

/// [`push_change`], with the changes of the squared heights of the rays at some surfaces.
pub fn push_change_with_heights(
    sequence: &Sequence,
    launched: &RayBundle,
    change: &LensGradient,
    aimed: Option<(&AimedRays, f64)>,
    surfaces: &[usize],
) -> RayTangents {
    let zero = || vec![0.0; RayBundle::padded(launched.len())];
    let mut out = RayTangents {
        image_x: zero(),
        image_y: zero(),
        transmission: zero(),
        optical_path: zero(),
        direction: [zero(), zero(), zero()],
        launch_mm: [zero(), zero()],
        heights: surfaces.iter().map(|s| SquaredHeights::zero(*s, launched.len())).collect(),
    };
    dispatch(PushForward { sequence, launched, change, aimed, out: &mut out });
    out
}
