//! One ray at one surface: intersection, transmission of the edge, refraction.

use super::fate::Fate;
use super::ray::Ray;
use super::sequence::{Bending, SurfaceAtWavelength, structure_path};
use crate::jet::{Dual, Jet};
use crate::lens::Departure;
use crate::vector::{Vec3, along, dot};

/// Newton steps allowed for an asphere; a well-posed ray needs three or four.
const MAX_NEWTON: usize = 30;

/// A step below this length, plus this share of the path, ends Newton's iteration, mm.
const NEWTON_TOLERANCE: f64 = 1e-13;

/// The crossing of one surface by a ray.
#[derive(Clone, Copy, Debug)]
pub struct Passage {
    /// Direction in front of the surface.
    pub direction_before: Vec3,
    /// Direction behind it.
    pub direction_after: Vec3,
    /// Point on the surface, in its own vertex coordinates, mm.
    pub point: Vec3,
    /// Path travelled from the entry point to `point`, mm.
    pub path_mm: f64,
    /// Slopes of the sag: dz/dx, dz/dy.
    pub slope: [f64; 2],
}

/// Path along `ray` to the conic part of the surface, starting from any point of the ray.
///
/// The quadratic `A t^2 - 2 B t + C = 0` with `A = c (1 + k n^2)`, `B = n - c (p.d + k z n)`,
/// `C = c (p.p + k z^2) - 2 z` is solved in the form `t = C / (B + sqrt(B^2 - A C))`, which stays
/// exact as the curvature goes to zero; where B is negative, as for a ray that comes from beyond the centre of curvature,
/// in the form `(B - sqrt(B^2 - A C)) / A`, the same root. There the ray crosses from in front of the quadric to behind it.
/// Source: Welford, Aberrations of Optical Systems, ch. 4.
#[inline]
fn conic_path(s: &SurfaceAtWavelength, ray: &Ray) -> Option<f64> {
    let (c, k) = (s.shape.curvature, s.shape.conic);
    let (p, d) = (ray.position, ray.direction);
    let a = c * (1.0 + k * d[2] * d[2]);
    let b = d[2] - c * (dot(p, d) + k * p[2] * d[2]);
    let q = c * (dot(p, p) + k * p[2] * p[2]) - 2.0 * p[2];
    let discriminant = b * b - a * q;
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    let path = if b < 0.0 { (b - root) / a } else { q / (b + root) };
    path.is_finite().then_some(path)
}

/// Intersects a ray with the surface: path from the ray's point, the point, and the slopes of the sag.
#[inline]
fn intersect(s: &SurfaceAtWavelength, ray: &Ray) -> Option<(f64, Vec3, [f64; 2])> {
    // Intersect the conic. An asphere may extend beyond the end of its conic: Newton's method starts from the vertex plane
    // there.
    let start = conic_path(s, ray);
    if s.shape.departure != Departure::None {
        return intersect_general(s, ray, start.unwrap_or(-ray.position[2] / ray.direction[2]));
    }
    let slope_at = |q: Vec3| s.shape.jet(q[0] * q[0] + q[1] * q[1]);
    if s.is_conic {
        let path = start?;
        let point = along(ray.position, path, ray.direction);
        // Accept only the half of the conic that contains the vertex.
        if s.shape.curvature * (1.0 + s.shape.conic) * point[2] >= 1.0 {
            return None;
        }
        let first = slope_at(point)?.first;
        return Some((path, point, [2.0 * point[0] * first, 2.0 * point[1] * first]));
    }
    // Newton's method along the ray for the asphere: F(t) = z(t) - sag(r(t)^2), F' = N . d.
    let mut path = start.unwrap_or(-ray.position[2] / ray.direction[2]);
    for _ in 0..MAX_NEWTON {
        let point = along(ray.position, path, ray.direction);
        let jet = slope_at(point)?;
        let slope = [2.0 * point[0] * jet.first, 2.0 * point[1] * jet.first];
        let rate = ray.direction[2] - slope[0] * ray.direction[0] - slope[1] * ray.direction[1];
        let step = (point[2] - jet.sag) / rate;
        if !step.is_finite() {
            return None;
        }
        path -= step;
        if step.abs() < NEWTON_TOLERANCE * (1.0 + path.abs()) {
            let point = along(ray.position, path, ray.direction);
            let first = slope_at(point)?.first;
            return (rate > 0.0).then_some((path, point, [2.0 * point[0] * first, 2.0 * point[1] * first]));
        }
    }
    None
}

/// [`intersect`] for a shape with a departure: Newton's method on `F(t) = z(t) - sag(x(t), y(t))`.
fn intersect_general(s: &SurfaceAtWavelength, ray: &Ray, mut path: f64) -> Option<(f64, Vec3, [f64; 2])> {
    let (p, d) = (ray.position, ray.direction);
    for _ in 0..MAX_NEWTON {
        let [x, y, z] = [0, 1, 2].map(|i| Dual { value: p[i] + path * d[i], by: d[i] });
        let height = z - s.shape.sag_of(x, y);
        let step = height.value / height.by;
        if !step.is_finite() {
            return None;
        }
        path -= step;
        if step.abs() < NEWTON_TOLERANCE * (1.0 + path.abs()) {
            let point = along(p, path, d);
            let slope = s.shape.sag_jet([point[0], point[1]]).slope;
            return (height.by > 0.0).then_some((path, point, slope));
        }
    }
    None
}

/// Direction behind a thin lens without aberrations: `n' tan' = n tan - power (x, y)`.
fn through_thin_lens(s: &SurfaceAtWavelength, power_per_mm: f64, point: Vec3, d: Vec3) -> Vec3 {
    let slope = |i: usize| (s.n_before * d[i] / d[2] - power_per_mm * point[i]) / s.n_after;
    let [x, y] = [slope(0), slope(1)];
    let length = (1.0 + x * x + y * y).sqrt();
    [x / length, y / length, 1.0 / length]
}

/// Carries a ray, given in the surface's vertex coordinates, through the surface.
///
/// Snell's law in vector form, `d' = mu d + (sqrt(1 - mu^2 (1 - cos^2)) - mu cos) n`, with
/// `mu = n_before / n_after`, `n` the unit normal along +z and `cos = n . d`. A structure with the optical path
/// `W(x, y)` adds `grad W / n_after` to `mu d` first: with `v` that sum, `d' = v + (sqrt(1 - v.v + (n.v)^2) - n.v) n`.
#[inline]
pub(crate) fn pass(s: &SurfaceAtWavelength, index: usize, ray: &Ray) -> Result<Passage, Fate> {
    let (path_mm, point, slope) = intersect(s, ray).ok_or(Fate::Missed(index))?;
    let mut passage =
        Passage { direction_before: ray.direction, direction_after: ray.direction, point, path_mm, slope };
    let normal = unit_normal(slope).0;
    let mu = s.n_before / s.n_after;
    match &s.bending {
        Bending::Snell => {}
        Bending::ThinLens { power_per_mm } => {
            passage.direction_after = through_thin_lens(s, *power_per_mm, point, ray.direction);
            return Ok(passage);
        }
        Bending::Path { along_y, radial, .. } => {
            let [x, y] = Jet::axes([point[0], point[1]]);
            let by = structure_path(*along_y, radial, x, y).slope;
            let d = ray.direction;
            let v = [mu * d[0] + by[0] / s.n_after, mu * d[1] + by[1] / s.n_after, mu * d[2]];
            let cos = dot(normal, v);
            let under = 1.0 - dot(v, v) + cos * cos;
            if under < 0.0 {
                return Err(Fate::TotalReflection(index));
            }
            passage.direction_after = along(v, under.sqrt() - cos, normal);
            return Ok(passage);
        }
    }
    let cos = dot(normal, ray.direction);
    let under = 1.0 - mu * mu * (1.0 - cos * cos);
    if under < 0.0 {
        return Err(Fate::TotalReflection(index));
    }
    let bend = under.sqrt() - mu * cos;
    let d = ray.direction;
    passage.direction_after = along([mu * d[0], mu * d[1], mu * d[2]], bend, normal);
    Ok(passage)
}

/// Unit normal along +z of a surface with these sag slopes, and the length of `(-z_x, -z_y, 1)`.
#[inline]
pub(crate) fn unit_normal(slope: [f64; 2]) -> (Vec3, f64) {
    let length = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
    ([-slope[0] / length, -slope[1] / length, 1.0 / length], length)
}
