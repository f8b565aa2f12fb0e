//! The start of rays: on a plane through the first vertex, towards the lens.

use super::ray::Ray;
use super::sequence::Sequence;
use crate::lens::ObjectDistance;
use crate::vector::Vec3;

/// Field of a far object from which rays start on the plane across their direction, rad: 60 degrees.
///
/// Up to it they start on the plane z = 0, which a ray at 90 degrees never crosses. Both planes give the same rays.
pub const ACROSS_FROM_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// A ray on its launch plane, and the derivatives of its start by its launch coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Launch {
    /// The ray, in the coordinates of the first surface.
    pub ray: Ray,
    /// Derivatives of the position with respect to the launch coordinates x and y: the axes of the launch plane.
    pub position_by: [Vec3; 2],
    /// Derivatives of the direction with respect to the launch coordinates x and y, 1/mm.
    pub direction_by: [Vec3; 2],
}

/// Whether the rays of a field start on the plane across their direction.
pub fn starts_across(sequence: &Sequence, field_rad: f64) -> bool {
    sequence.object == ObjectDistance::Infinity && field_rad.abs() > ACROSS_FROM_RAD
}

/// The axes of the launch plane of a field: unit vectors along the launch coordinates x and y.
///
/// The plane goes through the first vertex. It is z = 0 or, in a far field beyond [`ACROSS_FROM_RAD`], the plane across
/// the direction `(0, sin(field), cos(field))`, with `(0, cos(field), -sin(field))` as its second axis.
pub fn launch_axes(sequence: &Sequence, field_rad: f64) -> [Vec3; 2] {
    let along_y = if starts_across(sequence, field_rad) {
        [0.0, field_rad.cos(), -field_rad.sin()]
    } else {
        [0.0, 1.0, 0.0]
    };
    [[1.0, 0.0, 0.0], along_y]
}

/// The ray of a field that crosses its launch plane at `at_mm` = (x, y), see [`launch_axes`].
///
/// From infinity all rays of a field are parallel; from a near object they come from the point
/// `(0, -D tan(field), -D)`. In both a positive field sends light upwards. A start behind the first surface is
/// allowed: the path to the surface is then negative.
pub fn launch(sequence: &Sequence, field_rad: f64, at_mm: [f64; 2]) -> Launch {
    let position_by = launch_axes(sequence, field_rad);
    let position = if starts_across(sequence, field_rad) {
        [at_mm[0], at_mm[1] * position_by[1][1], at_mm[1] * position_by[1][2]]
    } else {
        [at_mm[0], at_mm[1], 0.0]
    };
    match sequence.object {
        ObjectDistance::Infinity => Launch {
            ray: Ray { position, direction: [0.0, field_rad.sin(), field_rad.cos()] },
            position_by,
            direction_by: [[0.0; 3]; 2],
        },
        ObjectDistance::Finite(distance) => {
            let v = [at_mm[0], at_mm[1] + distance * field_rad.tan(), distance];
            // Light goes from a real object, and to a virtual one.
            let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt().copysign(distance);
            let direction = [v[0] / length, v[1] / length, v[2] / length];
            // d(v/l) = (e - d (d.e)) / l with l = +-|v|
            let by = |axis: usize| {
                let mut g = [0.0; 3];
                for i in 0..3 {
                    let e = if i == axis { 1.0 } else { 0.0 };
                    g[i] = (e - direction[i] * direction[axis]) / length;
                }
                g
            };
            Launch { ray: Ray { position, direction }, position_by, direction_by: [by(0), by(1)] }
        }
    }
}
