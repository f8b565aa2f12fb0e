//! The general formulas for surfaces of any shape that refract, reflect or diffract, from jets of the sag.
//!
//! With `N = (-z_x, -z_y, 1)` and `v = mu d + grad W / n'`, where W is the optical path of a diffractive structure,
//! `d' = v + b N`, `b = (R - g) / q`, `g = N.v`, `q = N.N`, `R = sqrt(q (1 - v.v) + g^2)`.
//!
//! These formulas are long, and many shapes share them. So they are compiled once per instruction set, as operations on
//! numbers in memory ([`Rows`]), and not into every kernel.

use pulp::{Simd, WithSimd};

use super::rays::{Meeting, Rays, Tangent};
use crate::jet::{Dual, Jet};
use crate::lanes::{Lanes, MAX_LANES, Mask, V3, along, dot, scaled};
use crate::number::Number;
use crate::number::PHASE_TERMS;
use crate::trace::sequence::{Bending, SurfaceAtWavelength, structure_path};

/// Largest number of Newton steps.
const MAX_NEWTON: usize = 40;

/// A Newton step below this length, mm, is the last.
const LAST_STEP_MM: f64 = 1e-8;

/// Intersects rays with a surface with a departure: Newton's method on `F(t) = z(t) - sag(x(t), y(t))`.
#[inline(always)]
fn newton<S: Simd>(s: &SurfaceAtWavelength, ray: &Rays<S>, mut path: Lanes<S>) -> Meeting<S> {
    let (p, d) = (ray.position, ray.direction);
    let zero = p[0].constant(0.0);
    let mut ok = path.lt(path);
    for _ in 0..MAX_NEWTON {
        // The sag and its derivative along the ray, at the present path.
        let q = along(p, path, d);
        let x = Dual { value: q[0], by: d[0] };
        let y = Dual { value: q[1], by: d[1] };
        let sag = s.shape.sag_of(x, y);
        let rate = d[2] - sag.by;
        let step = (q[2] - sag.value) / rate;
        path -= step;
        ok = step.abs().lt(zero.constant(LAST_STEP_MM)).and(zero.lt(rate));
        if ok.all() {
            break;
        }
    }
    Meeting { point: along(p, path, d), path, ok }
}

/// Rays at a surface: its shape around their points, and the intermediate results of the bending.
struct Step<S: Simd> {
    point: V3<S>,
    before: V3<S>,
    /// Sag.
    sag: Jet<Lanes<S>>,
    /// `(-z_x, -z_y, 1)`.
    pub normal: V3<S>,
    mu: f64,
    /// The sum of `mu d` and the structure's share.
    v: V3<S>,
    /// Optical path of a diffractive structure.
    path: Option<Jet<Lanes<S>>>,
    b: Lanes<S>,
    g: Lanes<S>,
    q: Lanes<S>,
    /// `1 - v.v`.
    under: Lanes<S>,
    root: Lanes<S>,
    /// Direction behind.
    pub after: V3<S>,
    /// Whether light passes.
    pub ok: Mask<S>,
}

/// Changes of a surface's own numbers, as they enter tangents. They are changes of the sag and its slopes, of `mu` and the index behind, of
/// the slopes of the structure's optical path at the point, and of the power of a thin lens.
#[derive(Clone, Copy)]
struct Own<S: Simd> {
    pub sag: Lanes<S>,
    pub slope: [Lanes<S>; 2],
    pub mu: f64,
    pub n_after: f64,
    pub path_slope: [Lanes<S>; 2],
    pub power: f64,
}

/// Cotangents of the inputs of a step.
struct StepCotangent<S: Simd> {
    /// Of the direction in front, at a fixed point.
    pub before: V3<S>,
    /// Of the point, at a fixed direction in front.
    pub point: V3<S>,
    /// Of the slopes of the sag.
    pub slope: [Lanes<S>; 2],
    /// Of `mu`.
    pub mu: Lanes<S>,
    /// Of the index behind, apart from mu.
    pub n_after: Lanes<S>,
    /// Of the slopes of the structure's optical path.
    path_slope: [Lanes<S>; 2],
    /// Of the power of a thin lens.
    pub power: Lanes<S>,
}

impl<S: Simd> Step<S> {
    /// The step of rays at points of a surface.
    #[inline(always)]
    pub fn new(s: &SurfaceAtWavelength, point: V3<S>, before: V3<S>) -> Self {
        // The normal, from the slopes of the sag.
        let one = point[0].constant(1.0);
        let zero = point[0].constant(0.0);
        let sag = s.shape.sag_jet([point[0], point[1]]);
        let normal = [-sag.slope[0], -sag.slope[1], one];
        // v = mu d + grad W / n', and 1 - v.v.
        let mu = s.n_before / s.n_after;
        let mut v = scaled(one * mu, before);
        let mut under = one * (1.0 - mu * mu);
        let mut path = None;
        if let Bending::Path { along_y, radial, .. } = &s.bending {
            let [x, y] = Jet::axes([point[0], point[1]]);
            let jet = structure_path(*along_y, radial, x, y);
            v[0] += jet.slope[0] * (1.0 / s.n_after);
            v[1] += jet.slope[1] * (1.0 / s.n_after);
            under = one - dot(v, v);
            path = Some(jet);
        }
        let (g, q) = (dot(normal, v), dot(normal, normal));
        let root2 = q * under + g * g;
        // Snell's law. Rays that do not pass get a dummy root, so that their numbers stay finite.
        let passes = zero.constant(-f64::MIN_POSITIVE).lt(root2);
        let root = passes.select(root2.max(zero.constant(1e-300)).sqrt(), one);
        let b = (root - g) / q;
        let (after, ok) = (v, zero.lt(one));
        let mut step = Self { point, before, sag, normal, mu, v, path, b, g, q, under, root, after, ok };
        // The direction behind: by the slopes of a thin lens, or d' = v + b N.
        if let Bending::ThinLens { power_per_mm } = s.bending {
            let [x, y] = step.slopes_behind_thin_lens(s, power_per_mm);
            let per_length = one / (x * x + y * y + 1.0).sqrt();
            step.after = [x * per_length, y * per_length, per_length];
        } else {
            step.after = along(v, b, normal);
            step.ok = passes;
        }
        step
    }

    /// `tan' = mu tan - power (x, y) / n'`.
    #[inline(always)]
    fn slopes_behind_thin_lens(&self, s: &SurfaceAtWavelength, power_per_mm: f64) -> [Lanes<S>; 2] {
        let [l, m, n] = self.before;
        let weak = power_per_mm / s.n_after;
        [l / n * self.mu - self.point[0] * weak, m / n * self.mu - self.point[1] * weak]
    }

    /// `N.d` in front.
    #[inline(always)]
    pub fn approach(&self) -> Lanes<S> {
        dot(self.normal, self.before)
    }

    /// Carries the tangent of entering rays to their points on the surface and to their directions behind it.
    #[inline(always)]
    pub fn push_forward(
        &self,
        s: &SurfaceAtWavelength,
        path: Lanes<S>,
        tangent: &Tangent<S>,
        own: Option<&Own<S>>,
    ) -> Tangent<S> {
        let zero = path.constant(0.0);
        // Move the point: shift the ray at a fixed path, then follow it back to the surface along its direction.
        let (d, n) = (self.before, self.normal);
        let moved = along(tangent.position, path, tangent.direction);
        let mut rise = -dot(n, moved);
        if let Some(own) = own {
            rise += own.sag;
        }
        let point = along(moved, rise / self.approach(), d);
        // Change the slopes of the sag and of the structure's path: by the move of the point and by the surface's own
        // numbers.
        let (mut slope, mut path_slope) = (turn(&self.sag, point), [zero; 2]);
        if let Some(jet) = &self.path {
            path_slope = turn(jet, point);
        }
        let (mut mu_dot, mut n_dot, mut power_dot) = (0.0, 0.0, 0.0);
        if let Some(own) = own {
            for axis in 0..2 {
                slope[axis] += own.slope[axis];
                path_slope[axis] += own.path_slope[axis];
            }
            (mu_dot, n_dot, power_dot) = (own.mu, own.n_after, own.power);
        }
        let per_n = 1.0 / s.n_after;
        // A thin lens: differentiate tan' = mu tan - power (x, y) / n', then normalise to a unit direction.
        if let Bending::ThinLens { power_per_mm } = s.bending {
            let e = tangent.direction;
            let mut tan = [zero; 3];
            for axis in 0..2 {
                let before = d[axis] / d[2];
                let before_dot = (e[axis] - before * e[2]) / d[2];
                let bent = point[axis] * power_per_mm + self.point[axis] * power_dot;
                tan[axis] = before_dot * self.mu + before * mu_dot - bent * per_n
                    + self.point[axis] * (power_per_mm * n_dot * per_n * per_n);
            }
            let turned = along(tan, -dot(self.after, tan), self.after);
            return Tangent { position: point, direction: scaled(self.after[2], turned) };
        }
        // Differentiate v = mu d + grad W / n', and 1 - v.v.
        let mut v_dot = along(scaled(zero.constant(self.mu), tangent.direction), zero.constant(mu_dot), d);
        if let Some(jet) = &self.path {
            for axis in 0..2 {
                v_dot[axis] += (path_slope[axis] - jet.slope[axis] * (n_dot * per_n)) * per_n;
            }
        }
        let under_dot = match &self.path {
            Some(_) => -(dot(self.v, v_dot) * 2.0),
            None => zero.constant(-2.0 * self.mu * mu_dot),
        };
        // Differentiate b = (R - g) / q with g = N.v, q = N.N and R = sqrt(q (1 - v.v) + g^2), then d' = v + b N.
        let normal_dot = [-slope[0], -slope[1], zero];
        let g_dot = dot(normal_dot, self.v) + dot(n, v_dot);
        let q_dot = dot(n, normal_dot) * 2.0;
        let root_dot = (q_dot * self.under + self.q * under_dot + self.g * g_dot * 2.0) / (self.root * 2.0);
        let b_dot = (root_dot - g_dot - self.b * q_dot) / self.q;
        Tangent { position: point, direction: along(along(v_dot, b_dot, n), self.b, normal_dot) }
    }

    /// Pulls cotangents of the direction behind back to the inputs of the step.
    #[inline(always)]
    pub fn pull_back(&self, s: &SurfaceAtWavelength, after_bar: V3<S>) -> StepCotangent<S> {
        let zero = self.b.constant(0.0);
        let (d, n) = (self.before, self.normal);
        let per_n = 1.0 / s.n_after;
        let mut inputs_bar = StepCotangent {
            before: [zero; 3],
            point: [zero; 3],
            slope: [zero; 2],
            mu: zero,
            n_after: zero,
            path_slope: [zero; 2],
            power: zero,
        };
        // A thin lens: through the normalisation to the slopes, then through tan' = mu tan - power (x, y) / n'.
        if let Bending::ThinLens { power_per_mm } = s.bending {
            let tan_bar = scaled(self.after[2], along(after_bar, -dot(self.after, after_bar), self.after));
            for axis in 0..2 {
                let bar = tan_bar[axis];
                let before = d[axis] / d[2];
                inputs_bar.mu += bar * before;
                inputs_bar.power -= bar * self.point[axis] * per_n;
                inputs_bar.n_after += bar * self.point[axis] * (power_per_mm * per_n * per_n);
                inputs_bar.point[axis] = bar * (-power_per_mm * per_n);
                let before_bar = bar * self.mu / d[2];
                inputs_bar.before[axis] = before_bar;
                inputs_bar.before[2] -= before_bar * before;
            }
            return inputs_bar;
        }
        // Through d' = v + b N and b = (R - g) / q to g, q, 1 - v.v, the normal and v.
        let root_bar = dot(after_bar, n) / self.q;
        let half = root_bar / (self.root * 2.0);
        let g_bar = half * self.g * 2.0 - root_bar;
        let q_bar = half * self.under - root_bar * self.b;
        let under_bar = half * self.q;
        let normal_bar = along(along(scaled(self.b, after_bar), g_bar, self.v), q_bar + q_bar, n);
        let mut v_bar = along(after_bar, g_bar, n);
        // Through v = mu d + grad W / n' to the structure's slopes, the index behind, mu and the direction in front.
        match &self.path {
            Some(jet) => {
                v_bar = along(v_bar, -(under_bar + under_bar), self.v);
                for axis in 0..2 {
                    inputs_bar.path_slope[axis] = v_bar[axis] * per_n;
                    inputs_bar.n_after -= inputs_bar.path_slope[axis] * jet.slope[axis] * per_n;
                }
                let by_point = turn_transposed(jet, inputs_bar.path_slope);
                inputs_bar.point[0] += by_point[0];
                inputs_bar.point[1] += by_point[1];
            }
            None => inputs_bar.mu -= under_bar * (2.0 * self.mu),
        }
        inputs_bar.mu += dot(v_bar, d);
        inputs_bar.before = scaled(zero.constant(self.mu), v_bar);
        // The normal to the slopes of the sag, and these to the point.
        inputs_bar.slope = [-normal_bar[0], -normal_bar[1]];
        let by_point = turn_transposed(&self.sag, inputs_bar.slope);
        inputs_bar.point[0] += by_point[0];
        inputs_bar.point[1] += by_point[1];
        inputs_bar
    }

    /// Changes of the sag and its slopes when the numbers of the shape change by `change`, given by slot.
    #[inline(always)]
    pub fn shape_change(&self, s: &SurfaceAtWavelength, change: &[f64]) -> (Lanes<S>, [Lanes<S>; 2]) {
        let zero = self.b.constant(0.0);
        let (mut sag, mut slope) = (zero, [zero; 2]);
        for (number, jet) in s.shape.sensitivities([self.point[0], self.point[1]]) {
            let amount = change[number.slot()];
            sag += jet.value * amount;
            slope[0] += jet.slope[0] * amount;
            slope[1] += jet.slope[1] * amount;
        }
        (sag, slope)
    }

    /// Change of the slopes of a structure's optical path when its coefficients change by `change`, given by slot.
    #[inline(always)]
    pub fn path_change(&self, s: &SurfaceAtWavelength, change: &[f64]) -> [Lanes<S>; 2] {
        let zero = self.b.constant(0.0);
        let mut slope = [zero; 2];
        for (term, amount) in self.path_terms(s).iter().zip(&change[Number::Phase(0).slot()..]) {
            slope[0] += term[1] * *amount;
            slope[1] += term[2] * *amount;
        }
        slope
    }

    /// Cotangents of the numbers of a structure, from those of the slopes of its optical path and of the path itself.
    #[inline(always)]
    pub fn path_sums(
        &self,
        s: &SurfaceAtWavelength,
        bar: [Lanes<S>; 2],
        path: Lanes<S>,
    ) -> [Lanes<S>; PHASE_TERMS] {
        let mut sums = [self.b.constant(0.0); PHASE_TERMS];
        for (sum, term) in sums.iter_mut().zip(self.path_terms(s)) {
            *sum = term[0] * path + term[1] * bar[0] + term[2] * bar[1];
        }
        sums
    }

    /// Derivatives of the optical path and of its slopes by the numbers of a structure.
    #[inline(always)]
    fn path_terms(&self, s: &SurfaceAtWavelength) -> [[Lanes<S>; 3]; PHASE_TERMS] {
        let zero = self.b.constant(0.0);
        let mut all = [[zero; 3]; PHASE_TERMS];
        let Bending::Path { is_grating, per_number, .. } = &s.bending else { return all };
        let [x, y] = Jet::axes([self.point[0], self.point[1]]);
        if *is_grating {
            all[0] = [self.point[1] * per_number[0], zero, zero.constant(per_number[0])];
            return all;
        }
        let u = x * x + y * y;
        let mut power = u;
        for (to, by) in all.iter_mut().zip(per_number) {
            *to = [power.value * *by, power.slope[0] * *by, power.slope[1] * *by];
            power = power * u;
        }
        all
    }
}

/// Numbers of several rays in memory, one row per number.
type Rows<const N: usize> = [[f64; MAX_LANES]; N];

#[inline(always)]
fn store<S: Simd, const N: usize>(values: [Lanes<S>; N]) -> Rows<N> {
    let mut rows = [[0.0; MAX_LANES]; N];
    for (row, value) in rows.iter_mut().zip(values) {
        value.store(row);
    }
    rows
}

#[inline(always)]
fn load<S: Simd, const N: usize>(simd: S, rows: &Rows<N>) -> [Lanes<S>; N] {
    let mut values = [Lanes::splat(simd, 0.0); N];
    for (value, row) in values.iter_mut().zip(rows) {
        *value = Lanes::load(simd, row);
    }
    values
}

/// One where the mask holds, zero elsewhere.
#[inline(always)]
fn as_number<S: Simd>(ok: Mask<S>, like: Lanes<S>) -> Lanes<S> {
    ok.select(like.constant(1.0), like.constant(0.0))
}

#[inline(always)]
fn is_one<S: Simd>(ok: Lanes<S>) -> Mask<S> {
    ok.constant(0.5).lt(ok)
}

struct Follow<'a> {
    s: &'a SurfaceAtWavelength,
    position: Rows<3>,
    direction: Rows<3>,
    start: Rows<1>,
}

impl WithSimd for Follow<'_> {
    /// Path, and whether there is one.
    type Output = Rows<2>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Rows<2> {
        let ray = Rays { position: load(simd, &self.position), direction: load(simd, &self.direction) };
        let [start] = load(simd, &self.start);
        let meeting = newton(self.s, &ray, start);
        store([meeting.path, as_number(meeting.ok, meeting.path)])
    }
}

/// Intersects rays with a surface with a departure, from a first guess of the path.
#[inline(always)]
pub(super) fn follow<S: Simd>(s: &SurfaceAtWavelength, ray: &Rays<S>, start: Lanes<S>) -> Meeting<S> {
    let simd = ray.position[0].simd();
    let (position, direction) = (store(ray.position), store(ray.direction));
    let found = simd.vectorize(Follow { s, position, direction, start: store([start]) });
    let [path, ok] = load(simd, &found);
    Meeting { point: along(ray.position, path, ray.direction), path, ok: is_one(ok) }
}

struct Redirect<'a> {
    s: &'a SurfaceAtWavelength,
    point: Rows<3>,
    before: Rows<3>,
}

impl WithSimd for Redirect<'_> {
    /// Direction behind, and whether light passes.
    type Output = Rows<4>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Rows<4> {
        let step = Step::new(self.s, load(simd, &self.point), load(simd, &self.before));
        let [x, y, z] = step.after;
        store([x, y, z, as_number(step.ok, x)])
    }
}

/// Direction behind a surface, and whether light passes.
#[inline(always)]
pub(super) fn redirect<S: Simd>(s: &SurfaceAtWavelength, point: V3<S>, before: V3<S>) -> (V3<S>, Mask<S>) {
    let simd = point[0].simd();
    let found = simd.vectorize(Redirect { s, point: store(point), before: store(before) });
    let [x, y, z, ok] = load(simd, &found);
    ([x, y, z], is_one(ok))
}

/// Changes of the numbers of a surface: its own, by slot, `mu`, and the signed index behind.
#[derive(Clone, Copy)]
pub(super) struct Change<'a> {
    pub numbers: &'a [f64],
    pub mu: f64,
    pub n_after: f64,
}

struct PathChange<'a> {
    s: &'a SurfaceAtWavelength,
    point: Rows<3>,
    before: Rows<3>,
    change: &'a [f64],
}

impl WithSimd for PathChange<'_> {
    type Output = Rows<1>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Rows<1> {
        let point: V3<S> = load(simd, &self.point);
        let step = Step::new(self.s, point, load(simd, &self.before));
        let mut sum = Lanes::splat(simd, 0.0);
        for (term, amount) in step.path_terms(self.s).iter().zip(&self.change[Number::Phase(0).slot()..]) {
            sum += term[0] * *amount;
        }
        if let Bending::ThinLens { .. } = self.s.bending {
            sum = (point[0] * point[0] + point[1] * point[1]) * (-0.5 * self.change[Number::Power.slot()]);
        }
        store([sum])
    }
}

/// Change of the optical path of a thin lens or a structure at fixed points, when its own numbers change by `change`, given by
/// slot.
#[inline(always)]
pub(super) fn added_path_change<S: Simd>(
    s: &SurfaceAtWavelength,
    point: V3<S>,
    before: V3<S>,
    change: &[f64],
) -> Lanes<S> {
    let simd = point[0].simd();
    let [sum] =
        load(simd, &simd.vectorize(PathChange { s, point: store(point), before: store(before), change }));
    sum
}

struct PushForward<'a> {
    s: &'a SurfaceAtWavelength,
    point: Rows<3>,
    before: Rows<3>,
    path: Rows<1>,
    position: Rows<3>,
    direction: Rows<3>,
    change: Option<Change<'a>>,
}

impl WithSimd for PushForward<'_> {
    /// Position and direction.
    type Output = (Rows<3>, Rows<3>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (Rows<3>, Rows<3>) {
        let step = Step::new(self.s, load(simd, &self.point), load(simd, &self.before));
        let [path] = load(simd, &self.path);
        let tangent =
            Tangent { position: load(simd, &self.position), direction: load(simd, &self.direction) };
        let mut own = None;
        if let Some(change) = &self.change {
            let (sag, slope) = step.shape_change(self.s, change.numbers);
            own = Some(Own {
                sag,
                slope,
                mu: change.mu,
                n_after: change.n_after,
                path_slope: step.path_change(self.s, change.numbers),
                power: change.numbers[Number::Power.slot()],
            });
        }
        let pushed = step.push_forward(self.s, path, &tangent, own.as_ref());
        (store(pushed.position), store(pushed.direction))
    }
}

/// Carries the tangent of entering rays of direction `before` to their points on the surface and to their directions
/// behind it.
#[inline(always)]
pub(super) fn push_forward<S: Simd>(
    s: &SurfaceAtWavelength,
    point: V3<S>,
    before: V3<S>,
    path: Lanes<S>,
    tangent: &Tangent<S>,
    change: Option<Change>,
) -> Tangent<S> {
    let simd = path.simd();
    let (position, direction) = simd.vectorize(PushForward {
        s,
        point: store(point),
        before: store(before),
        path: store([path]),
        position: store(tangent.position),
        direction: store(tangent.direction),
        change,
    });
    Tangent { position: load(simd, &position), direction: load(simd, &direction) }
}

/// Cotangents of the direction behind a surface, pulled back to the inputs of the bending.
pub(super) struct Pulled<S: Simd> {
    /// Of the direction in front, at a fixed point.
    pub before: V3<S>,
    /// Of the point, at a fixed direction in front.
    pub point: V3<S>,
    /// Of `mu`.
    pub mu: Lanes<S>,
    /// Of the index behind, apart from mu.
    pub n_after: Lanes<S>,
    /// `(-z_x, -z_y, 1)`.
    pub normal: V3<S>,
    /// The normal times the direction in front.
    pub approach: Lanes<S>,
    slopes_and_power: Rows<5>,
}

struct PullBack<'a> {
    s: &'a SurfaceAtWavelength,
    point: Rows<3>,
    before: Rows<3>,
    after_bar: Rows<3>,
}

impl WithSimd for PullBack<'_> {
    /// The fields of [`Pulled`] in their order, but for the last; and the last.
    type Output = (Rows<12>, Rows<5>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (Rows<12>, Rows<5>) {
        let step = Step::new(self.s, load(simd, &self.point), load(simd, &self.before));
        let inputs_bar = step.pull_back(self.s, load(simd, &self.after_bar));
        let ([a, b, c], [d, e, f], [g, h, i]) = (inputs_bar.before, inputs_bar.point, step.normal);
        let first = store([a, b, c, d, e, f, inputs_bar.mu, inputs_bar.n_after, g, h, i, step.approach()]);
        let ([sx, sy], [px, py]) = (inputs_bar.slope, inputs_bar.path_slope);
        (first, store([sx, sy, px, py, inputs_bar.power]))
    }
}

/// Pulls cotangents of the direction behind back to the direction in front and to the point.
#[inline(always)]
pub(super) fn pull_back<S: Simd>(
    s: &SurfaceAtWavelength,
    point: V3<S>,
    before: V3<S>,
    after_bar: V3<S>,
) -> Pulled<S> {
    let simd = point[0].simd();
    let (first, slopes_and_power) = simd.vectorize(PullBack {
        s,
        point: store(point),
        before: store(before),
        after_bar: store(after_bar),
    });
    let [a, b, c, d, e, f, mu, n_after, g, h, i, approach] = load(simd, &first);
    Pulled { before: [a, b, c], point: [d, e, f], mu, n_after, normal: [g, h, i], approach, slopes_and_power }
}

struct AddedPath<'a> {
    s: &'a SurfaceAtWavelength,
    at: Rows<2>,
}

impl WithSimd for AddedPath<'_> {
    type Output = Rows<2>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Rows<2> {
        store(self.s.added_path_mm(Jet::axes(load(simd, &self.at))).slope)
    }
}

/// Gradient by x and y of the optical path of a thin lens or a structure.
#[inline(always)]
pub(super) fn added_path_slope<S: Simd>(s: &SurfaceAtWavelength, point: V3<S>) -> [Lanes<S>; 2] {
    let simd = point[0].simd();
    load(simd, &simd.vectorize(AddedPath { s, at: store([point[0], point[1]]) }))
}

struct OwnSums<'a> {
    s: &'a SurfaceAtWavelength,
    point: Rows<3>,
    before: Rows<3>,
    slopes_and_power: &'a Rows<5>,
    /// Cotangents of the sag, and of the optical path.
    alpha: Rows<2>,
}

/// Sums of a surface's own numbers: of its shape, of a diffractive structure and of the power of a thin lens.
pub(super) struct OwnBars {
    pub shape: Vec<(Number, [f64; MAX_LANES])>,
    pub phase: Rows<PHASE_TERMS>,
    pub power: [f64; MAX_LANES],
}

impl WithSimd for OwnSums<'_> {
    type Output = OwnBars;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> OwnBars {
        let point = load(simd, &self.point);
        let step = Step::new(self.s, point, load(simd, &self.before));
        let [sx, sy, px, py, power] = load(simd, self.slopes_and_power);
        let [alpha, path] = load(simd, &self.alpha);
        let sensitivities = self.s.shape.sensitivities([point[0], point[1]]);
        let mut shape = Vec::with_capacity(sensitivities.len());
        for (number, jet) in &sensitivities {
            let bar = alpha * jet.value + sx * jet.slope[0] + sy * jet.slope[1];
            let [row] = store([bar]);
            shape.push((*number, row));
        }
        // A thin lens adds -power r^2 / 2 to the optical path.
        let square = point[0] * point[0] + point[1] * point[1];
        let [power] = match self.s.bending {
            Bending::ThinLens { .. } => store([power - path * square * 0.5]),
            _ => store([power]),
        };
        OwnBars { shape, phase: store(step.path_sums(self.s, [px, py], path)), power }
    }
}

/// Cotangents of a surface's own numbers, from `alpha`, the cotangent of its sag, and that of the optical path.
#[inline(always)]
pub(super) fn own_bars<S: Simd>(
    s: &SurfaceAtWavelength,
    point: V3<S>,
    before: V3<S>,
    pulled: &Pulled<S>,
    alpha: Lanes<S>,
    optical_path_bar: Option<Lanes<S>>,
) -> OwnBars {
    let (point, before) = (store(point), store(before));
    let path = match optical_path_bar {
        Some(bar) => bar,
        None => alpha.constant(0.0),
    };
    alpha.simd().vectorize(OwnSums {
        s,
        point,
        before,
        slopes_and_power: &pulled.slopes_and_power,
        alpha: store([alpha, path]),
    })
}

/// Change of the slopes of a function when the point moves.
#[inline(always)]
fn turn<S: Simd>(jet: &Jet<Lanes<S>>, point: V3<S>) -> [Lanes<S>; 2] {
    let [xx, xy, yy] = jet.second;
    [xx * point[0] + xy * point[1], xy * point[0] + yy * point[1]]
}

/// The transpose of [`turn`].
#[inline(always)]
fn turn_transposed<S: Simd>(jet: &Jet<Lanes<S>>, bar: [Lanes<S>; 2]) -> [Lanes<S>; 2] {
    let [xx, xy, yy] = jet.second;
    [xx * bar[0] + xy * bar[1], xy * bar[0] + yy * bar[1]]
}
