//! The start of rays: on the plane of the first vertex, towards the lens.

use super::ray::Ray;
use super::sequence::Sequence;
use crate::lens::ObjectDistance;
use crate::vector::Vec3;

/// A ray on the plane of the first vertex, and the derivatives of its direction by its position there.
#[derive(Clone, Copy, Debug)]
pub struct Launch {
    /// The ray, at z = 0 of the first surface.
    pub ray: Ray,
    /// Derivatives of the direction with respect to the launch coordinates x and y, 1/mm.
    pub direction_by: [Vec3; 2],
}

/// The ray of a field that crosses the plane of the first vertex at `at_mm` = (x, y).
///
/// From infinity all rays of a field are parallel; from a near object they come from the point
/// `(0, -D tan(field), -D)`. In both a positive field sends light upwards.
pub fn launch(sequence: &Sequence, field_rad: f64, at_mm: [f64; 2]) -> Launch {
    let position = [at_mm[0], at_mm[1], 0.0];
    match sequence.object {
        ObjectDistance::Infinity => Launch {
            ray: Ray { position, direction: [0.0, field_rad.sin(), field_rad.cos()] },
            direction_by: [[0.0; 3]; 2],
        },
        ObjectDistance::Finite(distance) => {
            let v = [at_mm[0], at_mm[1] + distance * field_rad.tan(), distance];
            let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            let direction = [v[0] / length, v[1] / length, v[2] / length];
            // d(v/|v|) = (e - d (d.e)) / |v|
            let by = |axis: usize| {
                let mut g = [0.0; 3];
                for i in 0..3 {
                    let e = if i == axis { 1.0 } else { 0.0 };
                    g[i] = (e - direction[i] * direction[axis]) / length;
                }
                g
            };
            Launch { ray: Ray { position, direction }, direction_by: [by(0), by(1)] }
        }
    }
}
