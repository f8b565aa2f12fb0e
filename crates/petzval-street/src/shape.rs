//! Convex shapes in coordinates of their own, and where a ray enters them.

use crate::vector::{Vec3, vec3};

/// Least distance at which a ray can hit anything, in units of its direction.
const NEAREST: f64 = 1e-6;

/// A convex solid. A frame places and stretches it in the world.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    /// All points with `|q| <= 1`.
    Sphere,
    /// All points whose coordinates lie in -1..1.
    Cube,
    /// A capped cone about y, from -1 (radius 1) to 1 (radius `top`); a cylinder where `top` is 1.
    Cone { top: f64 },
    /// The hull of a sphere of radius `low` at the origin and one of radius `high` at `(0, height, 0)`.
    RoundCone { low: f64, high: f64, height: f64 },
    /// All points below all planes.
    Convex(Convex),
}

/// A convex polyhedron.
#[derive(Clone, Debug)]
pub(crate) struct Convex {
    /// Outward unit normals and distances from the origin.
    pub planes: Vec<(Vec3, f64)>,
    /// Its corners.
    pub corners: Vec<Vec3>,
}

impl Convex {
    /// The solid below planes given by outward normals (of any length) and points on them. It must be bounded.
    pub fn new(planes: &[(Vec3, Vec3)]) -> Self {
        let planes: Vec<(Vec3, f64)> = planes.iter().map(|(n, p)| (n.unit(), n.unit().dot(*p))).collect();
        let mut corners = Vec::new();
        // A corner is a point of three planes that is not above any other.
        for (i, &(a, da)) in planes.iter().enumerate() {
            for (j, &(b, db)) in planes.iter().enumerate().skip(i + 1) {
                for &(c, dc) in &planes[j + 1..] {
                    let volume = a.dot(b.cross(c));
                    if volume.abs() < 1e-6 {
                        continue;
                    }
                    let corner = (b.cross(c) * da + c.cross(a) * db + a.cross(b) * dc) * (1.0 / volume);
                    if planes.iter().all(|(n, d)| n.dot(corner) <= d + 1e-7) {
                        corners.push(corner);
                    }
                }
            }
        }
        assert!(corners.len() >= 4, "the planes bound no solid");
        Self { planes, corners }
    }
}

impl Shape {
    /// Where the ray `o + t d` enters: the least positive `t`, and the face. The direction may have any length. A ray that starts
    /// inside has no entry.
    #[inline]
    pub fn enter(&self, o: Vec3, d: Vec3) -> Option<(f64, u32)> {
        match self {
            Self::Sphere => sphere(o, d, 1.0).map(|[near, _]| (near, 0)),
            Self::Cube => cube(o, d),
            Self::Cone { top } => cone(o, d, *top),
            Self::RoundCone { low, high, height } => round_cone(o, d, *low, *high, *height),
            Self::Convex(convex) => polyhedron(o, d, &convex.planes),
        }
        .filter(|(t, _)| *t > NEAREST)
    }

    /// Both places where a ray crosses a sphere; other shapes have only their entry.
    pub fn crossings(&self, o: Vec3, d: Vec3) -> [Option<f64>; 2] {
        match self {
            Self::Sphere => match sphere(o, d, 1.0) {
                Some(both) => both.map(|t| (t > NEAREST).then_some(t)),
                None => [None; 2],
            },
            _ => [self.enter(o, d).map(|(t, _)| t), None],
        }
    }

    /// The outward normal, of any length, at a point of a face.
    pub fn normal(&self, q: Vec3, face: u32) -> Vec3 {
        match self {
            Self::Sphere => q,
            Self::Cube => match face {
                0 => vec3(q.x, 0.0, 0.0),
                1 => vec3(0.0, q.y, 0.0),
                _ => vec3(0.0, 0.0, q.z),
            },
            Self::Cone { top } => match face {
                0 => vec3(q.x, 0.25 * (1.0 - top) * ((1.0 + top) + (top - 1.0) * q.y), q.z),
                1 => vec3(0.0, -1.0, 0.0),
                _ => vec3(0.0, 1.0, 0.0),
            },
            Self::RoundCone { low, high, height } => match face {
                1 => q,
                2 => q - vec3(0.0, *height, 0.0),
                _ => {
                    let across = q.x.hypot(q.z);
                    vec3(q.x, across * slope(*low, *high, *height).1, q.z)
                }
            },
            Self::Convex(convex) => convex.planes[face as usize].0,
        }
    }

    /// The corners of a box around the shape, or its own corners.
    pub fn hull(&self) -> Vec<Vec3> {
        let corners = |low: Vec3, high: Vec3| {
            let pick = |bit: usize, a: f64, b: f64| if bit == 0 { a } else { b };
            (0..8)
                .map(|i| {
                    vec3(pick(i & 1, low.x, high.x), pick(i & 2, low.y, high.y), pick(i & 4, low.z, high.z))
                })
                .collect()
        };
        match self {
            Self::Sphere | Self::Cube => corners(vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, 1.0)),
            Self::Cone { top } => {
                let r = top.max(1.0);
                corners(vec3(-r, -1.0, -r), vec3(r, 1.0, r))
            }
            Self::RoundCone { low, high, height } => {
                let r = low.max(*high);
                corners(vec3(-r, (-low).min(height - high), -r), vec3(r, low.max(height + high), r))
            }
            Self::Convex(convex) => convex.corners.clone(),
        }
    }
}

/// Both roots of `a t^2 + 2 b t + c`.
#[inline(always)]
fn roots(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let square = b * b - a * c;
    if square < 0.0 || a == 0.0 {
        return None;
    }
    let root = square.sqrt();
    let (first, second) = ((-b - root) / a, (-b + root) / a);
    Some([first.min(second), first.max(second)])
}

#[inline(always)]
fn sphere(o: Vec3, d: Vec3, radius: f64) -> Option<[f64; 2]> {
    roots(d.dot(d), o.dot(d), o.dot(o) - radius * radius)
}

#[inline(always)]
fn cube(o: Vec3, d: Vec3) -> Option<(f64, u32)> {
    let (mut near, mut far, mut face) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for (axis, (o, d)) in [(o.x, d.x), (o.y, d.y), (o.z, d.z)].into_iter().enumerate() {
        if d == 0.0 {
            if o.abs() > 1.0 {
                return None;
            }
            continue;
        }
        let inverse = 1.0 / d;
        let (a, b) = ((-1.0 - o) * inverse, (1.0 - o) * inverse);
        let (enter, leave) = (a.min(b), a.max(b));
        if enter > near {
            (near, face) = (enter, axis as u32);
        }
        far = far.min(leave);
    }
    (near <= far).then_some((near, face))
}

#[inline]
fn cone(o: Vec3, d: Vec3, top: f64) -> Option<(f64, u32)> {
    let (middle, slope) = (0.5 * (1.0 + top), 0.5 * (top - 1.0));
    let (ro, rd) = (middle + slope * o.y, slope * d.y);
    let mut best: Option<(f64, u32)> = None;
    let mut offer = |t: f64, face: u32| {
        if t > NEAREST && best.is_none_or(|(b, _)| t < b) {
            best = Some((t, face));
        }
    };
    let lateral = roots(
        d.x * d.x + d.z * d.z - rd * rd,
        o.x * d.x + o.z * d.z - ro * rd,
        o.x * o.x + o.z * o.z - ro * ro,
    );
    for t in lateral.into_iter().flatten() {
        if (o.y + t * d.y).abs() <= 1.0 {
            offer(t, 0);
        }
    }
    if d.y != 0.0 {
        for (y, radius, face) in [(-1.0, 1.0, 1), (1.0, top, 2)] {
            let t = (y - o.y) / d.y;
            let (x, z) = (o.x + t * d.x, o.z + t * d.z);
            if x * x + z * z <= radius * radius {
                offer(t, face);
            }
        }
    }
    best
}

/// Sine of the half angle of the cone between two spheres, and its tangent.
#[inline(always)]
fn slope(low: f64, high: f64, height: f64) -> (f64, f64) {
    let sin = ((low - high) / height).clamp(-0.999, 0.999);
    (sin, sin / (1.0 - sin * sin).sqrt())
}

#[inline]
fn round_cone(o: Vec3, d: Vec3, low: f64, high: f64, height: f64) -> Option<(f64, u32)> {
    let mut best: Option<(f64, u32)> = None;
    let mut offer = |t: f64, face: u32| {
        if t > NEAREST && best.is_none_or(|(b, _)| t < b) {
            best = Some((t, face));
        }
    };
    let top = o - vec3(0.0, height, 0.0);
    for (origin, radius, face) in [(o, low, 1), (top, high, 2)] {
        if let Some([near, _]) = sphere(origin, d, radius) {
            offer(near, face);
        }
    }
    // The cone touches the spheres on two circles.
    let (sin, tan) = slope(low, high, height);
    let cos = (1.0 - sin * sin).sqrt();
    let (y0, y1) = (low * sin, height + high * sin);
    let r0 = low * cos;
    let (ro, rd) = (r0 - tan * (o.y - y0), -tan * d.y);
    let lateral = roots(
        d.x * d.x + d.z * d.z - rd * rd,
        o.x * d.x + o.z * d.z - ro * rd,
        o.x * o.x + o.z * o.z - ro * ro,
    );
    for t in lateral.into_iter().flatten() {
        let y = o.y + t * d.y;
        if y >= y0 && y <= y1 {
            offer(t, 0);
        }
    }
    best
}

#[inline]
fn polyhedron(o: Vec3, d: Vec3, planes: &[(Vec3, f64)]) -> Option<(f64, u32)> {
    let (mut near, mut far, mut face) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for (i, (n, distance)) in planes.iter().enumerate() {
        let (speed, gap) = (n.dot(d), distance - n.dot(o));
        if speed < 0.0 {
            let t = gap / speed;
            if t > near {
                (near, face) = (t, i as u32);
            }
        } else if speed > 0.0 {
            far = far.min(gap / speed);
        } else if gap < 0.0 {
            return None;
        }
        if near > far {
            return None;
        }
    }
    Some((near, face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{cell, hash};

    /// Whether a point lies inside, by the definition of each shape.
    fn inside(shape: &Shape, q: Vec3) -> bool {
        match shape {
            Shape::Sphere => q.length() <= 1.0,
            Shape::Cube => q.x.abs().max(q.y.abs()).max(q.z.abs()) <= 1.0,
            Shape::Cone { top } => {
                q.y.abs() <= 1.0 && q.x.hypot(q.z) <= 0.5 * ((1.0 + top) + (top - 1.0) * q.y)
            }
            // A point is inside if it is inside a sphere anywhere between the two.
            Shape::RoundCone { low, high, height } => (0..=200).any(|i| {
                let s = f64::from(i) / 200.0;
                (q - vec3(0.0, s * height, 0.0)).length() <= low + s * (high - low)
            }),
            Shape::Convex(convex) => convex.planes.iter().all(|(n, d)| n.dot(q) <= *d),
        }
    }

    #[test]
    fn the_entry_of_a_ray_is_the_first_point_inside() {
        let up = vec3(0.0, 1.0, 0.0);
        let convex = Convex::new(&[
            (vec3(1.0, 0.2, 0.0), vec3(0.8, 0.0, 0.0)),
            (vec3(-1.0, 0.1, 0.0), vec3(-0.7, 0.0, 0.0)),
            (up, up * 0.6),
            (-up, up * -0.5),
            (vec3(0.0, 0.5, 1.0), vec3(0.0, 0.0, 0.9)),
            (vec3(0.1, 0.0, -1.0), vec3(0.0, 0.0, -0.9)),
        ]);
        let shapes = [
            Shape::Sphere,
            Shape::Cube,
            Shape::Cone { top: 0.4 },
            Shape::Cone { top: 1.0 },
            Shape::RoundCone { low: 0.5, high: 0.25, height: 0.9 },
            Shape::Convex(convex),
        ];
        for (s, shape) in shapes.iter().enumerate() {
            let mut hits = 0;
            for i in 0..250 {
                let number = |k: i32| 2.0 * f64::from(cell(i, k, hash(s as i32, 1, 2, 3))) - 1.0;
                let o = vec3(number(0), number(1), number(2)).unit() * 3.0;
                let d = vec3(number(3), number(4), number(5)) * 0.8 - o;
                // March along the ray in small steps.
                let first = (1..4000).map(|k| f64::from(k) * 5e-4).find(|t| inside(shape, o + d * *t));
                match (shape.enter(o, d), first) {
                    (Some((t, face)), Some(first)) => {
                        assert!((t - first).abs() < 2e-2 && t <= first + 2e-3, "{s} {i}: {t} {first}");
                        assert!(
                            shape.normal(o + d * t, face).dot(d) <= 1e-9,
                            "{s} {i}: the normal looks away"
                        );
                        hits += 1;
                    }
                    (None, None) => {}
                    // A grazing ray may pass between two steps.
                    (Some((t, _)), None) => assert!(!inside(shape, o + d * (t + 0.02)), "{s} {i}"),
                    (None, Some(_)) => panic!("shape {s}, ray {i}: no entry"),
                }
            }
            assert!(hits > 60, "{s}: {hits}");
            for corner in shape.hull() {
                assert!(!inside(shape, corner * 1.001), "{s}");
            }
        }
    }
}
