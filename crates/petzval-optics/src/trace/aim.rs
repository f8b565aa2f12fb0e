//! Real ray aiming: finds the launch point of the ray through a given point of the stop.

use super::launch::launch;
use super::ray::Ray;
use super::sequence::{Bending, Sequence, SurfaceAtWavelength, structure_path};
use super::surface_step::{Passage, pass, unit_normal};
use crate::jet::Jet;
use crate::vector::{Vec3, along, apply, dot, transposed};

/// Newton steps allowed; a well-posed ray needs three to five.
const MAX_STEPS: usize = 30;

/// Largest distance of an aimed ray from its point of the stop, mm.
const TOLERANCE_MM: f64 = 1e-12;

/// A launch point whose ray passes the given point of the stop.
#[derive(Clone, Copy, Debug)]
pub struct AimedRay {
    /// Launch coordinates on the launch plane of the field, see [`launch`], mm.
    pub launch_mm: [f64; 2],
    /// d(stop x, stop y) / d(launch x, launch y), row by row.
    pub stop_by_launch: [[f64; 2]; 2],
}

/// Derivatives of the position and the direction of a ray by one launch coordinate.
#[derive(Clone, Copy)]
struct Tangent {
    position: Vec3,
    direction: Vec3,
}

impl Tangent {
    /// The tangent in the coordinates of a surface.
    fn enter(self, s: &SurfaceAtWavelength) -> Self {
        let Some(frame) = &s.frame else { return self };
        let to_surface = transposed(&frame.rotation);
        Self { position: apply(&to_surface, self.position), direction: apply(&to_surface, self.direction) }
    }

    /// The tangent in the coordinates of the axis behind a surface.
    fn leave(self, s: &SurfaceAtWavelength) -> Self {
        let Some(frame) = &s.frame else { return self };
        Self { position: frame.turn_back(self.position), direction: frame.turn_back(self.direction) }
    }
}

/// Carries the tangent of an entering ray to its point on the surface and to its direction behind it.
///
/// With N the surface gradient and t the path, `dt = -N.(dp + t dd) / (N.d)`. The normal turns with the second derivatives
/// of the sag, and Snell's law is differentiated directly.
fn push_forward(s: &SurfaceAtWavelength, p: &Passage, tangent: Tangent) -> Tangent {
    // Move the point: shift the ray at a fixed path, then follow it back to the surface along its direction.
    let d = p.direction_before;
    let gradient = [-p.slope[0], -p.slope[1], 1.0];
    let moved = along(tangent.position, p.path_mm, tangent.direction);
    let path = -dot(gradient, moved) / dot(gradient, d);
    let point = along(moved, path, d);

    // Turn the normal (-z_x, -z_y, 1) with the second derivatives of the sag.
    let [x, y, _] = p.point;
    let [xx, xy, yy] = s.shape.sag_jet([x, y]).second;
    let turn = [-(xx * point[0] + xy * point[1]), -(xy * point[0] + yy * point[1]), 0.0];
    let (normal, length) = unit_normal(p.slope);
    let normal_turn = along(turn, -dot(normal, turn), normal).map(|v| v / length);

    // Differentiate v = mu d + grad W / n', where W is the path of a structure.
    let mu = s.n_before / s.n_after;
    let (mut v, mut v_turn) = (d.map(|c| mu * c), tangent.direction.map(|c| mu * c));
    match &s.bending {
        Bending::Snell => {}
        Bending::ThinLens { power_per_mm } => {
            return Tangent {
                position: point,
                direction: thin_lens_turn(s, *power_per_mm, p, tangent, point),
            };
        }
        Bending::Path { along_y, radial, .. } => {
            let [x, y] = Jet::axes([x, y]);
            let path = structure_path(*along_y, radial, x, y);
            let [xx, xy, yy] = path.second;
            let turn = [xx * point[0] + xy * point[1], xy * point[0] + yy * point[1]];
            for axis in 0..2 {
                v[axis] += path.slope[axis] / s.n_after;
                v_turn[axis] += turn[axis] / s.n_after;
            }
        }
    }
    // Differentiate d' = v + (sqrt(1 - v.v + (n.v)^2) - n.v) n.
    let cos = dot(normal, v);
    let root = (1.0 - dot(v, v) + cos * cos).sqrt();
    let cos_turn = dot(normal_turn, v) + dot(normal, v_turn);
    let bend_turn = (cos * cos_turn - dot(v, v_turn)) / root - cos_turn;
    let direction = along(along(v_turn, bend_turn, normal), root - cos, normal_turn);
    Tangent { position: point, direction }
}

/// Change of the direction behind a thin lens.
fn thin_lens_turn(s: &SurfaceAtWavelength, power: f64, p: &Passage, tangent: Tangent, point: Vec3) -> Vec3 {
    let (d, after) = (p.direction_before, p.direction_after);
    let slope_turn = |i: usize| {
        let tan_turn = (tangent.direction[i] - d[i] / d[2] * tangent.direction[2]) / d[2];
        (s.n_before * tan_turn - power * point[i]) / s.n_after
    };
    // d' = t / |t| with t = (tan x, tan y, 1) = d' / d'_z.
    let turn = [slope_turn(0), slope_turn(1), 0.0].map(|v| v * after[2]);
    along(turn, -dot(after, turn), after)
}

/// Where the ray meets the stop, and the derivatives of that point by the launch coordinates.
fn to_stop(sequence: &Sequence, field_rad: f64, at: [f64; 2]) -> Option<([f64; 2], [[f64; 2]; 2])> {
    let start = launch(sequence, field_rad, at);
    let mut ray = start.ray;
    let mut tangents = [
        Tangent { position: start.position_by[0], direction: start.direction_by[0] },
        Tangent { position: start.position_by[1], direction: start.direction_by[1] },
    ];
    for (i, surface) in sequence.surfaces[..=sequence.stop].iter().enumerate() {
        let passage = pass(surface, i, &surface.enter(ray)).ok()?;
        tangents = tangents.map(|t| push_forward(surface, &passage, t.enter(surface)));
        if i == sequence.stop {
            let [a, b] = tangents.map(|t| t.position);
            return Some(([passage.point[0], passage.point[1]], [[a[0], b[0]], [a[1], b[1]]]));
        }
        tangents = tangents.map(|t| t.leave(surface));
        ray = surface.leave(Ray { position: passage.point, direction: passage.direction_after });
    }
    None
}

/// Finds the ray of a field through `target_mm` in the stop, by Newton's method from `guess_mm`. A step that loses the
/// ray or increases the miss is halved. `None` if no ray is found.
pub fn aim_at_stop(
    sequence: &Sequence,
    field_rad: f64,
    target_mm: [f64; 2],
    guess_mm: [f64; 2],
) -> Option<AimedRay> {
    let miss = |hit: [f64; 2]| [hit[0] - target_mm[0], hit[1] - target_mm[1]];
    let mut at = guess_mm;
    let (mut hit, mut jacobian) = to_stop(sequence, field_rad, at)?;
    for _ in 0..MAX_STEPS {
        let e = miss(hit);
        let distance = e[0].hypot(e[1]);
        if distance < TOLERANCE_MM {
            return Some(AimedRay { launch_mm: at, stop_by_launch: jacobian });
        }
        let [[a, b], [c, d]] = jacobian;
        let det = a * d - b * c;
        let step = [(d * e[0] - b * e[1]) / det, (a * e[1] - c * e[0]) / det];
        if !(step[0].is_finite() && step[1].is_finite()) {
            return None;
        }
        let mut share = 1.0;
        loop {
            let next = [at[0] - share * step[0], at[1] - share * step[1]];
            if let Some((next_hit, next_jacobian)) = to_stop(sequence, field_rad, next) {
                let f = miss(next_hit);
                // Accept the step if the miss decreases. Within a thousand tolerances rounding may increase it.
                if f[0].hypot(f[1]) < distance || distance < 1e3 * TOLERANCE_MM {
                    (at, hit, jacobian) = (next, next_hit, next_jacobian);
                    break;
                }
            }
            share *= 0.5;
            if share < 1e-6 {
                return None;
            }
        }
    }
    let e = miss(hit);
    (e[0].hypot(e[1]) < 1e3 * TOLERANCE_MM).then_some(AimedRay { launch_mm: at, stop_by_launch: jacobian })
}
