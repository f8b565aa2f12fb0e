//! The adjoint of tracing: pulls cotangents of rays at the image back to the numbers of every surface.
//!
//! Cotangents (names in `_bar`) are derivatives of the loss; they are propagated against the light. At a surface with
//! gradient `N = (-z_x, -z_y, 1)`, entry point p, path t and point q:
//!
//! - refraction `d' = mu d + b N` is differentiated directly ([`Bend`](super::surface::Bend));
//! - intersection: `q = p + t d` with `N.dq = z_theta dtheta`, so `alpha = q_bar.d / N.d` gives `p_bar = q_bar - alpha N`,
//!   `d_bar += t p_bar`, `theta_bar += alpha z_theta`.
//!
//! Rays that are aimed at points of the stop get new launch points when the lens changes. Let `Q = dq/ds` and
//! `D = dd/ds` be the derivatives at the stop by the launch point s. The multiplier
//! `l = -Q^-T (s_bar + Q^T q_bar + D^T d_bar)` holds `q = R p` there. It is added to `q_bar` when the sweep passes the
//! stop, and makes the cotangent of the launch zero. Apertures before the stop add cotangents after the sweep has
//! passed it; a second, shorter sweep re-aims for them.

use pulp::{Simd, WithSimd};

use super::aim::{AimedRays, launched_rays};
use super::forward::{Arrival, Crossing, SquaredHeights, aperture, is_dead, load, trace_rays};
use super::frame::{self, FrameSums};
use super::general::{self, OwnBars, Pulled};
use super::rays::{Rays, Tangent};
use super::surface::{Slopes, bend, redirect, slopes};
use crate::gradient::LensGradient;
use crate::lanes::{Lanes, V3, along, dot, scaled, width};
use crate::number::Number;
use crate::trace::ray::RayBundle;
use crate::trace::sequence::{Frame, Sequence, SurfaceAtWavelength};
use petzval_base::simd::dispatch;

/// Cotangents of each ray of a bundle: derivatives of the loss; padded as the bundle is.
#[derive(Clone, Debug, Default)]
pub struct Seeds {
    /// By x on the image plane, 1/mm.
    pub image_x: Vec<f64>,
    /// By y on the image plane, 1/mm.
    pub image_y: Vec<f64>,
    /// By the transmission.
    pub transmission: Vec<f64>,
    /// By squared heights at surfaces, 1/mm^2.
    pub heights: Vec<SquaredHeights>,
    /// By the wavefront; `None` if the loss depends only on positions.
    pub wave: Option<WaveSeeds>,
}

/// Cotangents of the optical path and of the direction of each ray at the image; padded as the bundle is.
#[derive(Clone, Debug)]
pub struct WaveSeeds {
    /// By the optical path from the launch to the image plane, 1/mm.
    pub optical_path: Vec<f64>,
    /// By the direction cosines l, m, n at the image, each with the others fixed.
    pub direction: [Vec<f64>; 3],
}

impl WaveSeeds {
    /// All-zero cotangents for a bundle of `rays`.
    pub fn zero(rays: usize) -> Self {
        let zero = || vec![0.0; RayBundle::padded(rays)];
        Self { optical_path: zero(), direction: [zero(), zero(), zero()] }
    }
}

impl Seeds {
    /// All-zero cotangents for a bundle of `rays`.
    pub fn zero(rays: usize) -> Self {
        let zero = || vec![0.0; RayBundle::padded(rays)];
        Self { image_x: zero(), image_y: zero(), transmission: zero(), heights: Vec::new(), wave: None }
    }
}

/// Cotangents of launch points that follow the lens, because the rays are aimed at points of the stop.
pub struct Reaim<'a> {
    /// How the rays were aimed.
    pub aimed: &'a AimedRays,
    /// By the launch coordinates x and y, 1/mm; padded.
    pub launch_bar: [&'a [f64]; 2],
}

/// Cotangents of the numbers of a surface, summed over rays.
///
/// The sums of a tilt are those of the torque about the same axis of the surface; [`Sums::by_tilt`] turns it into that of a tilt.
#[derive(Clone)]
pub(super) struct Sums<S: Simd> {
    /// Sums of the numbers that every surface has, by slot.
    plain: [Lanes<S>; Number::PLAIN],
    /// Sums of the other slots; empty for a plain surface.
    special: Vec<Lanes<S>>,
}

impl<S: Simd> Sums<S> {
    /// Zeros for every surface.
    #[inline(always)]
    pub fn of(sequence: &Sequence, zero: Lanes<S>) -> Vec<Self> {
        let mut all = Vec::with_capacity(sequence.surfaces.len());
        for s in &sequence.surfaces {
            let special = if s.is_general || s.frame.is_some() { Number::COUNT - Number::PLAIN } else { 0 };
            all.push(Self { plain: [zero; Number::PLAIN], special: vec![zero; special] });
        }
        all
    }

    /// Sets all sums to zero.
    #[inline(always)]
    pub fn clear(&mut self, zero: Lanes<S>) {
        self.plain.fill(zero);
        self.special.fill(zero);
    }

    /// The sum of a number; zero for one that the surface does not have.
    #[inline(always)]
    pub fn get(&self, number: Number, zero: Lanes<S>) -> Lanes<S> {
        match number.slot() {
            slot @ 0..Number::PLAIN => self.plain[slot],
            slot => self.special.get(slot - Number::PLAIN).copied().unwrap_or(zero),
        }
    }

    /// Adds to the sum of a number that the surface has.
    #[inline(always)]
    pub fn add(&mut self, number: Number, value: Lanes<S>) {
        match number.slot() {
            slot @ 0..Number::PLAIN => self.plain[slot] += value,
            slot => self.special[slot - Number::PLAIN] += value,
        }
    }

    /// The cotangent of a tilt of the frame: `omega . torque`.
    #[inline(always)]
    pub fn by_tilt(&self, frame: &Frame, axis: usize, zero: Lanes<S>) -> Lanes<S> {
        let omega = frame::omegas(frame)[axis];
        let mut sum = zero;
        for (k, omega) in omega.into_iter().enumerate() {
            sum += self.get(Number::Tilt(k), zero) * omega;
        }
        sum
    }
}

/// Re-aiming of the rays of one vector.
pub(super) struct ReaimLanes<S: Simd> {
    /// dq/ds at the stop, row by row.
    q: [[Lanes<S>; 2]; 2],
    /// dd/ds in front of the stop, by launch x and by launch y.
    d: [V3<S>; 2],
    launch_bar: [Lanes<S>; 2],
}

/// Cotangents of the point and the direction at the last surface, and of its thickness, from those of x and y at the image
/// and of the run to it.
#[inline(always)]
pub(super) fn from_image<S: Simd>(
    arrival: &Arrival<S>,
    [x, y]: [Lanes<S>; 2],
    run_bar: Option<Lanes<S>>,
) -> (V3<S>, V3<S>, Lanes<S>) {
    // Differentiate x = p_x + s d_x with the run s = (thickness - p_z) / d_z.
    let d = arrival.ray.direction;
    let mut run_total_bar = x * d[0] + y * d[1];
    if let Some(bar) = run_bar {
        run_total_bar += bar;
    }
    let by_run = run_total_bar / d[2];
    ([x, y, -by_run], [arrival.run * x, arrival.run * y, -(by_run * arrival.run)], by_run)
}

impl<S: Simd> ReaimLanes<S> {
    /// Loads the rays of one vector.
    #[inline(always)]
    pub fn load(simd: S, reaim: &Reaim, at: usize) -> Self {
        let aimed = reaim.aimed;
        let [[a, b], [c, d]] = &aimed.stop_by_launch;
        let [by_x, by_y] = &aimed.direction_by_launch;
        let [bar_x, bar_y] = reaim.launch_bar;
        Self {
            q: [
                [Lanes::load(simd, &a[at..]), Lanes::load(simd, &b[at..])],
                [Lanes::load(simd, &c[at..]), Lanes::load(simd, &d[at..])],
            ],
            d: [load3(simd, by_x, at), load3(simd, by_y, at)],
            launch_bar: [Lanes::load(simd, &bar_x[at..]), Lanes::load(simd, &bar_y[at..])],
        }
    }

    /// Cotangent of launch coordinate j, given those of the point in the stop, whose normal is `n`, and of the direction in
    /// front of it.
    #[inline(always)]
    fn launch_cotangent(&self, j: usize, point_bar: V3<S>, before_bar: V3<S>, n: V3<S>) -> Lanes<S> {
        let (qx, qy) = (self.q[0][j], self.q[1][j]);
        let qz = -(n[0] * qx + n[1] * qy);
        self.launch_bar[j] + dot(point_bar, [qx, qy, qz]) + dot(before_bar, self.d[j])
    }

    /// The multiplier `l = -Q^-T s_bar` that holds the point in the stop, with `s_bar` the cotangent of the launch.
    #[inline(always)]
    fn multiplier(&self, [by_x, by_y]: [Lanes<S>; 2]) -> [Lanes<S>; 2] {
        let [[a, b], [c, e]] = self.q;
        let per_det = by_x.constant(-1.0) / (a * e - b * c);
        [(e * by_x - c * by_y) * per_det, (a * by_y - b * by_x) * per_det]
    }
}

#[inline(always)]
fn load3<S: Simd>(simd: S, from: &[Vec<f64>; 3], at: usize) -> V3<S> {
    [Lanes::load(simd, &from[0][at..]), Lanes::load(simd, &from[1][at..]), Lanes::load(simd, &from[2][at..])]
}

/// The result of a sweep.
pub(super) struct Swept<S: Simd> {
    /// Cotangents of the launch.
    launch: Tangent<S>,
    /// `-l.q` of the rays: the cotangent of the stop radius times this radius.
    pub stop_bar: Lanes<S>,
    /// True if surfaces before the stop added cotangents, after the re-aiming at the stop.
    cotangents_before_stop: bool,
}

/// Start of a backward sweep.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum From {
    /// Behind the last surface of the tape, in the coordinates of the axis.
    Behind,
    /// On it, in its own coordinates.
    Surface,
}

/// The backward sweep from the last surface of `tape`, given cotangents of the point on it and of the direction behind it;
/// adds to `sums`.
#[inline(always)]
pub(super) fn sweep<S: Simd>(
    sequence: &Sequence,
    tape: &[Crossing<S>],
    from: From,
    (mut point_bar, mut direction_bar): (V3<S>, V3<S>),
    transmission_bar: Option<Lanes<S>>,
    heights_bar: &[(usize, Lanes<S>)],
    optical_path_bar: Option<Lanes<S>>,
    reaim: Option<&ReaimLanes<S>>,
    sums: &mut [Sums<S>],
) -> Swept<S> {
    let zero = point_bar[0].constant(0.0);
    let (mut stop_bar, mut cotangents_before_stop) = (zero, false);
    for i in (0..tape.len()).rev() {
        let (surface, crossing) = (&sequence.surfaces[i], &tape[i]);
        let ([x, y, _], d) = (crossing.point, crossing.direction);
        // Transform the cotangents from the axis behind to the coordinates of the surface.
        if let Some(frame) = &surface.frame
            && (i + 1 < tape.len() || from == From::Behind)
        {
            let after = Rays { position: crossing.point, direction: redirect(surface, crossing.point, d).0 };
            let behind = Tangent { position: point_bar, direction: direction_bar };
            let mut frame_bar = FrameSums { decenter: [zero; 2], torque: [zero; 3] };
            let on = frame::pull_back_leave(frame, &after, &behind, &mut frame_bar);
            (point_bar, direction_bar) = (on.position, on.direction);
            add_frame(&frame_bar, &mut sums[i]);
        }
        let u = x.mul_add(x, y * y);

        // Differentiate the soft clear aperture: the transmission falls with the ray's radius, and rises with the
        // semi-diameter.
        if let Some(bar) = transmission_bar
            && i != sequence.stop
            && let Some((share, by_radius)) = aperture(surface, u)
        {
            let through = zero.lt(share);
            let g = through.select(bar / through.select(share, zero.constant(1.0)) * by_radius, zero);
            point_bar[0] += g * x;
            point_bar[1] += g * y;
            sums[i].plain[Number::SemiDiameter.slot()] -= g * u.sqrt();
            cotangents_before_stop |= i < sequence.stop;
        }

        // Add the cotangents of the squared height x^2 + y^2.
        for (_, bar) in heights_bar.iter().filter(|(surface, _)| *surface == i) {
            let twice = *bar + *bar;
            point_bar[0] += twice * x;
            point_bar[1] += twice * y;
            cotangents_before_stop |= i < sequence.stop;
        }

        // Differentiate the optical path of a thin lens or a diffractive structure, which depends on the point.
        if surface.is_general
            && let Some(bar) = optical_path_bar
        {
            let [by_x, by_y] = general::added_path_slope(surface, crossing.point);
            point_bar[0] += bar * by_x;
            point_bar[1] += bar * by_y;
        }

        // Differentiate Snell's law by the direction in front, by mu and by the normal, which turns with the slopes of
        // the sag.
        let mut before_bar;
        let (n, approach);
        let own;
        if surface.is_general {
            let pulled = general::pull_back(surface, crossing.point, d, direction_bar);
            add_indices(&pulled.mu, Some(&pulled.n_after), surface, i, sums);
            for axis in 0..3 {
                point_bar[axis] += pulled.point[axis];
            }
            (n, approach) = (pulled.normal, pulled.approach);
            before_bar = pulled.before;
            own = OwnCotangent::General(pulled);
        } else {
            let slope = slopes(surface, crossing.point);
            n = slope.normal;
            let b = bend(surface, n, d);
            let (mu, g) = (zero.constant(b.mu), b.g);
            let root_bar = dot(direction_bar, n) * b.per_q;
            let by_root = root_bar * b.per_root;
            let g_bar = by_root * g * (b.mu * b.mu) - root_bar * mu;
            let q_bar = by_root * (0.5 * (1.0 - b.mu * b.mu)) - root_bar * b.b;
            let mu_bar = dot(direction_bar, d) - root_bar * g + by_root * mu * (g * g - b.q);
            before_bar = along(scaled(mu, direction_bar), g_bar, n);
            let n_bar = along(along(scaled(b.b, direction_bar), g_bar, d), q_bar + q_bar, n);
            add_indices(&mu_bar, None, surface, i, sums);
            // Pass the cotangent of the normal on to the point: z_x = 2 x z'(u), z_y = 2 y z'(u).
            let (slope_x_bar, slope_y_bar) = (-n_bar[0], -n_bar[1]);
            let first_bar = (slope_x_bar * x + slope_y_bar * y) * 2.0;
            let by_radius = first_bar * slope.second * 2.0;
            let twice = slope.first + slope.first;
            point_bar[0] += twice.mul_add(slope_x_bar, by_radius * x);
            point_bar[1] += twice.mul_add(slope_y_bar, by_radius * y);
            approach = g;
            own = OwnCotangent::Plain(slope, first_bar);
        }

        // Re-aim: add the multiplier that holds the point in the stop.
        if i == sequence.stop
            && let Some(reaim) = reaim
        {
            let launch_bar = [
                reaim.launch_cotangent(0, point_bar, before_bar, n),
                reaim.launch_cotangent(1, point_bar, before_bar, n),
            ];
            let multiplier = reaim.multiplier(launch_bar);
            point_bar[0] += multiplier[0];
            point_bar[1] += multiplier[1];
            stop_bar -= multiplier[0] * x + multiplier[1] * y;
        }

        // Differentiate the intersection: alpha is the cotangent of the sag. The path also enters the optical path.
        let mut along_path = dot(point_bar, d);
        if let Some(bar) = optical_path_bar {
            along_path += bar * surface.n_before;
            if i > 0 {
                sums[i - 1].plain[Number::Index.slot()] += bar * crossing.path;
            }
        }
        cotangents_before_stop |= optical_path_bar.is_some() && i <= sequence.stop;
        let alpha = along_path / approach;
        let mut entry_bar = along(point_bar, -alpha, n);
        before_bar = along(before_bar, crossing.path, entry_bar);

        // Add the cotangents of the surface's own numbers, which change its sag (alpha) and its slope.
        match &own {
            OwnCotangent::Plain(slope, first_bar) => {
                add_plain(surface, slope, alpha, *first_bar, &mut sums[i])
            }
            OwnCotangent::General(pulled) => {
                let bars = general::own_bars(surface, crossing.point, d, pulled, alpha, optical_path_bar);
                add_general(&bars, alpha.simd(), &mut sums[i]);
            }
        }

        // Transform the cotangents to the axis in front, and collect those of decentre and tilt.
        if let Some(frame) = &surface.frame {
            let bar = Tangent { position: entry_bar, direction: before_bar };
            let mut frame_bar = FrameSums { decenter: [zero; 2], torque: [zero; 3] };
            let on_axis = frame::pull_back_enter(frame, &crossing.entry(), &bar, &mut frame_bar);
            (entry_bar, before_bar) = (on_axis.position, on_axis.direction);
            add_frame(&frame_bar, &mut sums[i]);
        }

        // Go back to the vertex before: p = q_previous - (0, 0, thickness).
        if i > 0 {
            sums[i - 1].plain[Number::Thickness.slot()] -= entry_bar[2];
        }
        point_bar = entry_bar;
        direction_bar = before_bar;
    }
    let launch = Tangent { position: point_bar, direction: direction_bar };
    Swept { launch, stop_bar, cotangents_before_stop }
}

/// Intermediate results of a sweep for the numbers of a surface.
#[expect(clippy::large_enum_variant, reason = "one at a time, on the stack")]
enum OwnCotangent<S: Simd> {
    /// The slopes of the sag, and the cotangent of dz/du.
    Plain(Slopes<S>, Lanes<S>),
    /// Cotangents by the general formulas.
    General(Pulled<S>),
}

/// Adds the cotangents of `mu = n_before / n_after` and of the index behind to those of the indices on both sides.
#[inline(always)]
fn add_indices<S: Simd>(
    mu_bar: &Lanes<S>,
    n_after_bar: Option<&Lanes<S>>,
    surface: &SurfaceAtWavelength,
    i: usize,
    sums: &mut [Sums<S>],
) {
    let mu = surface.n_before / surface.n_after;
    sums[i].plain[Number::Index.slot()] -= *mu_bar * (mu / surface.n_after);
    if let Some(bar) = n_after_bar {
        sums[i].plain[Number::Index.slot()] += *bar;
    }
    if i > 0 {
        sums[i - 1].plain[Number::Index.slot()] += *mu_bar * (1.0 / surface.n_after);
    }
}

/// Adds the cotangents of the numbers of a conic with an even polynomial, from those of its sag (alpha) and of dz/du.
#[inline(always)]
fn add_plain<S: Simd>(
    surface: &SurfaceAtWavelength,
    slope: &Slopes<S>,
    alpha: Lanes<S>,
    first_bar: Lanes<S>,
    sums: &mut Sums<S>,
) {
    let sums = &mut sums.plain;
    let (c, u, w) = (surface.shape.curvature, slope.u, slope.w);
    let per_w = slope.per_w;
    let per_w3 = per_w * per_w * per_w;
    let per_sum = per_w / (w + 1.0);
    sums[Number::Curvature.slot()] += alpha * u * per_sum + first_bar * per_w3 * 0.5;
    if c != 0.0 {
        // z_k = c^3 u^2 / (2 w (1 + w)^2), z'_k = c^3 u / (4 w^3).
        let by_sag = alpha * u * per_sum * per_sum * w * 2.0;
        sums[Number::Conic.slot()] += (by_sag + first_bar * per_w3) * u * (0.25 * c * c * c);
    }
    // The term a_j u^j contributes u^j to the sag and j u^(j-1) to dz/du.
    let (mut by_sag, mut by_slope) = (alpha * u, first_bar);
    for (j, sum) in sums[Number::Asphere(0).slot()..].iter_mut().enumerate() {
        *sum += by_slope.mul_add(u.constant((j + 1) as f64), by_sag);
        by_sag = by_sag * u;
        by_slope = by_slope * u;
    }
}

/// Adds the cotangents of the numbers of any shape, of a diffractive structure and of a thin lens.
#[inline(always)]
fn add_general<S: Simd>(bars: &OwnBars, simd: S, sums: &mut Sums<S>) {
    for (number, bar) in &bars.shape {
        sums.add(*number, Lanes::load(simd, bar));
    }
    for (k, bar) in bars.phase.iter().enumerate() {
        sums.add(Number::Phase(k), Lanes::load(simd, bar));
    }
    sums.add(Number::Power, Lanes::load(simd, &bars.power));
}

/// Adds the cotangents of a frame.
#[inline(always)]
fn add_frame<S: Simd>(bars: &FrameSums<S>, sums: &mut Sums<S>) {
    for (k, bar) in bars.torque.into_iter().enumerate() {
        sums.add(Number::Tilt(k), bar);
    }
    for (k, bar) in bars.decenter.into_iter().enumerate() {
        sums.add(Number::Decenter(k), bar);
    }
}

struct PullBack<'a> {
    sequence: &'a Sequence,
    launched: &'a RayBundle,
    seeds: &'a Seeds,
    reaim: Option<&'a Reaim<'a>>,
    gradient: &'a mut LensGradient,
}

impl WithSimd for PullBack<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { sequence, launched, seeds, gradient, .. } = self;
        let zero = Lanes::splat(simd, 0.0);
        let last = sequence.surfaces.len() - 1;
        let mut sums = Sums::of(sequence, zero);
        let mut tape = Vec::with_capacity(last + 1);
        let mut heights_bar = Vec::with_capacity(seeds.heights.len());
        let mut stop_bar = zero;
        for at in (0..launched.len()).step_by(width::<S>()) {
            // Trace forward again, and record the crossings.
            let fate = Lanes::load(simd, &launched.fate[at..]);
            let arrival = trace_rays::<S, true>(sequence, load(simd, launched, at), fate, &mut tape);
            // Load the cotangents at the image; those of failed rays are zero.
            let dead = is_dead(arrival.fate);
            let x = dead.select(zero, Lanes::load(simd, &seeds.image_x[at..]));
            let y = dead.select(zero, Lanes::load(simd, &seeds.image_y[at..]));
            let light_bar = dead.select(zero, Lanes::load(simd, &seeds.transmission[at..]));
            let transmission_bar = light_bar * arrival.transmission;
            let (mut optical_path_bar, mut run_bar) = (None, None);
            if let Some(wave) = &seeds.wave {
                let bar = dead.select(zero, Lanes::load(simd, &wave.optical_path[at..]));
                sums[last].plain[Number::Index.slot()] += bar * arrival.run;
                (optical_path_bar, run_bar) = (Some(bar), Some(bar * sequence.surfaces[last].n_after));
            }
            // Pull them back from the image plane to the last surface.
            let (point_bar, mut direction_bar, thickness_bar) = from_image(&arrival, [x, y], run_bar);
            sums[last].plain[Number::Thickness.slot()] += thickness_bar;
            if let Some(wave) = &seeds.wave {
                for (bar, seeds) in direction_bar.iter_mut().zip(&wave.direction) {
                    *bar += dead.select(zero, Lanes::load(simd, &seeds[at..]));
                }
            }
            let wants_light = transmission_bar.lt(zero).or(zero.lt(transmission_bar)).any();
            // Sweep back to the launch. (A closure would be compiled without the vector instructions.)
            #[expect(clippy::manual_map, reason = "closures do not inherit target features")]
            let reaim = match self.reaim {
                Some(reaim) => Some(ReaimLanes::load(simd, reaim, at)),
                None => None,
            };
            heights_bar.clear();
            for h in &seeds.heights {
                heights_bar.push((h.surface, dead.select(zero, Lanes::load(simd, &h.values[at..]))));
            }
            let light = wants_light.then_some(transmission_bar);
            let swept = sweep(
                sequence,
                &tape,
                From::Behind,
                (point_bar, direction_bar),
                light,
                &heights_bar,
                optical_path_bar,
                reaim.as_ref(),
                &mut sums,
            );
            stop_bar += swept.stop_bar;
            // Re-aim for cotangents in front of the stop: turn those left at the launch into a second multiplier at the
            // stop.
            if let (Some(aim), true) = (&reaim, swept.cotangents_before_stop) {
                let at = [Lanes::load(simd, &launched.x[at..]), Lanes::load(simd, &launched.y[at..])];
                let field_rad = self.reaim.map_or(0.0, |r| r.aimed.field_rad);
                let (_, by) = launched_rays(sequence, field_rad, at);
                let (p, d) = (swept.launch.position, swept.launch.direction);
                let left = [
                    dot(p, by[0].position) + dot(d, by[0].direction) + aim.launch_bar[0],
                    dot(p, by[1].position) + dot(d, by[1].direction) + aim.launch_bar[1],
                ];
                let [lx, ly] = aim.multiplier(left);
                let stop = sequence.stop;
                let [qx, qy, _] = tape[stop].point;
                stop_bar -= lx * qx + ly * qy;
                let nothing = [zero; 3];
                let bars = ([lx, ly, zero], nothing);
                sweep(sequence, &tape[..=stop], From::Surface, bars, None, &[], None, None, &mut sums);
            }
        }
        // Add the sums over rays to the gradient of the lens.
        let mut index_bar = Vec::with_capacity(last + 1);
        for sums in &sums {
            index_bar.push(sums.plain[Number::Index.slot()].sum());
        }
        for (i, sums) in sums.iter().enumerate() {
            add(sums, &sequence.surfaces[i], gradient.of_surface_mut(i));
            gradient[(i, Number::Index)] += sequence.glass_index_bar(i, |j| index_bar[j]);
        }
        stop_bar.sum()
    }
}

/// Adds the sums of a surface, except that of the index, to its derivatives by slot.
#[inline(always)]
fn add<S: Simd>(sums: &Sums<S>, surface: &SurfaceAtWavelength, to: &mut [f64]) {
    for (slot, sum) in sums.plain.iter().enumerate() {
        // Indices belong to glasses, which mirrors share with the surface in front.
        if slot != Number::Index.slot() {
            to[slot] += sum.sum();
        }
    }
    if sums.special.is_empty() {
        return;
    }
    let mut all = [0.0; Number::COUNT];
    for (to, sum) in all[Number::PLAIN..].iter_mut().zip(&sums.special) {
        *to = sum.sum();
    }
    let torque = Number::Tilt(0).slot();
    for slot in Number::PLAIN..torque {
        to[slot] += all[slot];
    }
    if let Some(frame) = &surface.frame {
        for (to, omega) in to[torque..].iter_mut().zip(frame::omegas(frame)) {
            *to += (0..3).map(|k| omega[k] * all[torque + k]).sum::<f64>();
        }
    }
}

/// Pulls the cotangents of the rays of a bundle back through the lens and adds the derivatives by its numbers to
/// `gradient`.
///
/// `launched` is the bundle as it was launched, in the coordinates of the first vertex. With `reaim`, launch points follow
/// the lens; the result is the derivative by the stop radius times that radius, mm. Without, rays keep their launch.
pub fn pull_back(
    sequence: &Sequence,
    launched: &RayBundle,
    seeds: &Seeds,
    reaim: Option<&Reaim>,
    gradient: &mut LensGradient,
) -> f64 {
    dispatch(PullBack { sequence, launched, seeds, reaim, gradient })
}
