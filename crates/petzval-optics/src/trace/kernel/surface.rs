//! Several rays at one surface: intersection, refraction, and the tangents of both.
//!
//! A surface is the level set `G = 0` of `G(x, y, z) = h - c/2 (u + (1+k) h^2)`, with `u = x^2 + y^2` and
//! `h = z - P(u)` the height above the polynomial part: for `P = 0` the quadric of a conic, without root or
//! quotient. On the surface `dG/dz = w = sqrt(1 - (1+k) c^2 u)`, the root of the explicit formula.

use pulp::Simd;

use super::general;
use super::rays::{Meeting, Rays, Tangent};
use crate::lanes::{Lanes, Mask, V3, along, dot, scaled};
use crate::lens::Departure;
use crate::trace::sequence::SurfaceAtWavelength;

/// Newton steps allowed for an asphere; a well-posed ray needs two or three.
const MAX_NEWTON: usize = 30;

/// A Newton step below this length, mm, is the last: the error left is about its square times the curvature.
const LAST_STEP_MM: f64 = 1e-8;

/// `P(u)` and `P'(u)` of the polynomial part.
#[inline(always)]
fn polynomial<S: Simd>(s: &SurfaceAtWavelength, u: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let (mut p, mut d) = (u.constant(0.0), u.constant(0.0));
    for a in s.polynomial().iter().rev() {
        d = d.mul_add(u, p);
        p = p.mul_add(u, u.constant(*a));
    }
    // p is P / u: P = u p, P' = p + u p'.
    (u * p, u.mul_add(d, p))
}

/// `P'(u)` and `P''(u)`.
#[inline(always)]
fn polynomial_slopes<S: Simd>(s: &SurfaceAtWavelength, u: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let zero = u.constant(0.0);
    let (mut p, mut d, mut dd) = (zero, zero, zero);
    for a in s.polynomial().iter().rev() {
        dd = dd.mul_add(u, d + d);
        d = d.mul_add(u, p);
        p = p.mul_add(u, u.constant(*a));
    }
    (u.mul_add(d, p), u.mul_add(dd, d + d))
}

/// Intersects rays with the surface.
#[inline(always)]
pub(super) fn meet<S: Simd>(s: &SurfaceAtWavelength, ray: &Rays<S>) -> Meeting<S> {
    let (c, k) = (s.shape.curvature, s.shape.conic);
    let (p, d) = (ray.position, ray.direction);
    let zero = p[0].constant(0.0);
    // A plane.
    if c == 0.0 && s.is_conic {
        let path = -p[2] / d[2];
        let point = [path.mul_add(d[0], p[0]), path.mul_add(d[1], p[1]), zero];
        return Meeting { point, path, ok: zero.lt(d[2]) };
    }
    // Solve the quadratic equation of the conic: A t^2 - 2 B t + C = 0, t = C / (B + sqrt(B^2 - A C)), and (B -
    // sqrt(B^2 - A C)) / A where B < 0.
    let (kn, kz) = (d[2] * k, p[2] * k);
    let a = d[2].mul_add(kn, d[2].constant(1.0)) * c;
    let b = d[2] - (dot(p, d) + kz * d[2]) * c;
    let q = (dot(p, p) + kz * p[2]) * c - (p[2] + p[2]);
    let discriminant = b * b - a * q;
    let root = discriminant.max(zero).sqrt();
    let mut path = q / (b + root);
    let from_beyond = b.lt(zero);
    if from_beyond.any() {
        path = from_beyond.select((b - root) / a, path);
    }
    let point = along(p, path, d);
    // Accept only the half of the conic that contains the vertex. A path that is not a number fails the comparison.
    let front = (point[2] * (c * (1.0 + k))).lt(zero.constant(1.0));
    let meets = zero.constant(-f64::MIN_POSITIVE).lt(discriminant).and(front);
    if s.is_conic {
        return Meeting { point, path, ok: meets };
    }
    // Start the iteration for other shapes at the conic, or at the vertex plane if the conic is missed.
    let from_vertex_plane = -p[2] / d[2];
    if s.is_general && s.shape.departure != Departure::None {
        return general::follow(s, ray, meets.select(path, from_vertex_plane));
    }
    follow_to_asphere(s, ray, meets.select(path, from_vertex_plane))
}

/// Newton's method along the ray on `G`, from a first guess of the path.
#[inline(always)]
fn follow_to_asphere<S: Simd>(s: &SurfaceAtWavelength, ray: &Rays<S>, mut path: Lanes<S>) -> Meeting<S> {
    let (c, k1) = (s.shape.curvature, 1.0 + s.shape.conic);
    let (p, d) = (ray.position, ray.direction);
    let zero = path.constant(0.0);
    let mut ok = path.lt(path).or(zero.lt(zero));
    for _ in 0..MAX_NEWTON {
        // G and its derivative along the ray, at the present path.
        let q = along(p, path, d);
        let u = q[0].mul_add(q[0], q[1] * q[1]);
        let outward = q[0].mul_add(d[0], q[1] * d[1]);
        let (sag, slope) = polynomial(s, u);
        let h = q[2] - sag;
        let w = (h * (-c * k1)) + 1.0;
        let g = h - (h * k1).mul_add(h, u) * (0.5 * c);
        let rate = w * (d[2] - (slope + slope) * outward) - outward * c;
        let step = g / rate;
        path -= step;
        // The ray must cross the surface from the front (rate > 0), on the half that contains the vertex (w > 0).
        ok = step.abs().lt(zero.constant(LAST_STEP_MM)).and(zero.lt(rate)).and(zero.lt(w));
        if ok.all() {
            break;
        }
    }
    Meeting { point: along(p, path, d), path, ok }
}

/// The gradient of `G` at a point of the surface, `w (-z_x, -z_y, 1)`, and its squared length.
#[inline(always)]
fn normal<S: Simd>(s: &SurfaceAtWavelength, q: V3<S>) -> (V3<S>, Option<Lanes<S>>) {
    let (c, k1) = (s.shape.curvature, 1.0 + s.shape.conic);
    let one = q[0].constant(1.0);
    if s.is_conic {
        let n = [q[0] * -c, q[1] * -c, one - q[2] * (c * k1)];
        // On a sphere (and a plane) this is a unit vector.
        return (n, (s.shape.conic != 0.0 && c != 0.0).then(|| dot(n, n)));
    }
    let u = q[0].mul_add(q[0], q[1] * q[1]);
    let (sag, slope) = polynomial(s, u);
    let w = one - (q[2] - sag) * (c * k1);
    let across = -(w * (slope + slope)) - one * c;
    let n = [across * q[0], across * q[1], w];
    (n, Some(dot(n, n)))
}

/// Direction behind a surface, and whether light passes; otherwise it is totally reflected.
#[inline(always)]
pub(super) fn redirect<S: Simd>(s: &SurfaceAtWavelength, point: V3<S>, d: V3<S>) -> (V3<S>, Mask<S>) {
    if s.is_general {
        return general::redirect(s, point, d);
    }
    refract(s, point, d)
}

/// [`redirect`] by Snell's law, for shapes without a departure.
///
/// Snell's law `d' = mu d + b N` with a normal N of any length: `b = (sqrt(N.N (1 - mu^2) + mu^2 (N.d)^2) - mu N.d) / N.N`.
#[inline(always)]
fn refract<S: Simd>(s: &SurfaceAtWavelength, point: V3<S>, d: V3<S>) -> (V3<S>, Mask<S>) {
    let mu = s.n_before / s.n_after;
    let zero = d[0].constant(0.0);
    if mu == 1.0 {
        return (d, d[2].lt(d[2]).not());
    }
    let (n, length2) = normal(s, point);
    let g = dot(n, d);
    let root2 = match length2 {
        Some(q) => q.mul_add(q.constant(1.0 - mu * mu), g * g * (mu * mu)),
        None => (g * g) * (mu * mu) + (1.0 - mu * mu),
    };
    let mut bend = root2.max(zero).sqrt() - g * mu;
    if let Some(q) = length2 {
        bend = bend / q;
    }
    (along(scaled(zero.constant(mu), d), bend, n), zero.constant(-f64::MIN_POSITIVE).lt(root2))
}

/// Slopes of the sag at points of a surface, for the derivatives of intersection and refraction.
pub(super) struct Slopes<S: Simd> {
    /// `w`, and its reciprocal.
    pub w: Lanes<S>,
    pub per_w: Lanes<S>,
    /// `x^2 + y^2`.
    pub u: Lanes<S>,
    /// dz/du.
    pub first: Lanes<S>,
    /// d^2z/du^2.
    pub second: Lanes<S>,
    /// `(-z_x, -z_y, 1)`.
    pub normal: V3<S>,
}

/// Slopes of the sag at points of a surface.
#[inline(always)]
pub(super) fn slopes<S: Simd>(s: &SurfaceAtWavelength, q: V3<S>) -> Slopes<S> {
    let (c, k1) = (s.shape.curvature, 1.0 + s.shape.conic);
    let one = q[0].constant(1.0);
    let u = q[0].mul_add(q[0], q[1] * q[1]);
    let (w, by_polynomial) = if s.is_conic {
        (one - q[2] * (c * k1), None)
    } else {
        let (sag, _) = polynomial(s, u);
        (one - (q[2] - sag) * (c * k1), Some(polynomial_slopes(s, u)))
    };
    // The conic: z' = c / (2 w), z'' = (1+k) c^3 / (4 w^3).
    let per_w = one / w;
    let mut first = per_w * (0.5 * c);
    let mut second = per_w * per_w * per_w * (0.25 * k1 * c * c * c);
    if let Some((d, dd)) = by_polynomial {
        first += d;
        second += dd;
    }
    let twice = first + first;
    Slopes { w, per_w, u, first, second, normal: [-(twice * q[0]), -(twice * q[1]), one] }
}

/// Intermediate results of Snell's law, for its derivatives: `d' = mu d + b N`, `b = (R - mu g) / q`, with `g = N.d`,
/// `q = N.N`, `R = sqrt(q (1 - mu^2) + mu^2 g^2)`.
pub(super) struct Bend<S: Simd> {
    pub mu: f64,
    pub b: Lanes<S>,
    pub g: Lanes<S>,
    pub q: Lanes<S>,
    pub per_q: Lanes<S>,
    pub per_root: Lanes<S>,
}

/// The bend at a surface with normal `n` for rays of direction `d`.
#[inline(always)]
pub(super) fn bend<S: Simd>(s: &SurfaceAtWavelength, n: V3<S>, d: V3<S>) -> Bend<S> {
    let mu = s.n_before / s.n_after;
    let (g, q) = (dot(n, d), dot(n, n));
    let root = q.mul_add(q.constant(1.0 - mu * mu), g * g * (mu * mu)).sqrt();
    let one = g.constant(1.0);
    let per_q = one / q;
    Bend { mu, b: (root - g * mu) * per_q, g, q, per_q, per_root: one / root }
}

/// Changes of a surface's own numbers, as they enter a tangent at its points.
#[derive(Clone, Copy)]
pub(super) struct OwnTangent<S: Simd> {
    /// Change of the sag at the point.
    pub sag: Lanes<S>,
    /// Change of dz/du at the point.
    pub first: Lanes<S>,
    /// Change of `mu = n_before / n_after`.
    pub mu: Lanes<S>,
}

/// Carries the tangent of entering rays to their points on the surface and to their directions behind it.
///
/// The path changes by `dt = (z_theta - N.(dp + t dd)) / N.d`. The normal turns with the second derivatives of the sag, and
/// Snell's law `d' = mu d + b N` is differentiated directly.
#[inline(always)]
pub(super) fn push_forward<S: Simd>(
    slopes: &Slopes<S>,
    bend: &Bend<S>,
    path: Lanes<S>,
    [x, y]: [Lanes<S>; 2],
    d: V3<S>,
    tangent: &Tangent<S>,
    own: Option<OwnTangent<S>>,
) -> Tangent<S> {
    // Move the point: shift the ray at a fixed path, then follow it back to the surface along its direction.
    let n = slopes.normal;
    let moved = along(tangent.position, path, tangent.direction);
    let mut rise = -dot(n, moved);
    if let Some(own) = &own {
        rise += own.sag;
    }
    let point = along(moved, rise / bend.g, d);

    // Turn the normal (-2 x z', -2 y z', 1): the point moves over the curved sag, and the sag itself changes.
    let mut first_dot = (x * point[0] + y * point[1]) * (slopes.second + slopes.second);
    if let Some(own) = &own {
        first_dot += own.first;
    }
    let zero = x.constant(0.0);
    let n_dot = [
        -(x * first_dot + slopes.first * point[0]) * 2.0,
        -(y * first_dot + slopes.first * point[1]) * 2.0,
        zero,
    ];

    // Differentiate b = (R - mu g) / q with g = N.d, q = N.N and R = sqrt(q (1 - mu^2) + mu^2 g^2).
    let mu = zero.constant(bend.mu);
    let g_dot = dot(n_dot, d) + dot(n, tangent.direction);
    let q_dot = dot(n, n_dot) * 2.0;
    let mut root_dot =
        (q_dot * (0.5 * (1.0 - bend.mu * bend.mu)) + bend.g * g_dot * (bend.mu * bend.mu)) * bend.per_root;
    let mut less = mu * g_dot;
    if let Some(own) = &own {
        root_dot += own.mu * mu * (bend.g * bend.g - bend.q) * bend.per_root;
        less += own.mu * bend.g;
    }
    let b_dot = (root_dot - less - bend.b * q_dot) * bend.per_q;

    // Bend the change of the direction: differentiate d' = mu d + b N.
    let mut direction = along(along(scaled(mu, tangent.direction), b_dot, n), bend.b, n_dot);
    if let Some(own) = &own {
        direction = along(direction, own.mu, d);
    }
    Tangent { position: point, direction }
}
