//! Where a beam starts: launch points by first-order optics, and the light that a launch area gathers.

use crate::lens::ObjectDistance;
use crate::paraxial::FirstOrder;
use crate::trace::{AimedRays, Launch, Sequence, launch};

/// The launch point of first-order optics: the ray goes through the paraxial entrance pupil.
pub fn paraxial_launch(order: &FirstOrder, sequence: &Sequence, field_rad: f64, p: [f64; 2]) -> [f64; 2] {
    let radius = 0.5 * sequence.entrance_pupil_mm;
    let [x, y] = [radius * p[0], radius * p[1]];
    let at = order.entrance_pupil_at_mm;
    let Launch { ray, .. } = launch(sequence, field_rad, [0.0, 0.0]);
    let slope = ray.direction[1] / ray.direction[2];
    match sequence.object {
        ObjectDistance::Infinity => [x, y - at * slope],
        ObjectDistance::Finite(distance) => {
            // Intersect the line from the object point to the pupil point with the launch plane.
            let share = distance / (distance + at);
            let object_y = -distance * field_rad.tan();
            [share * x, object_y + share * (y - object_y)]
        }
    }
}

/// Irradiance of a ray relative to one along the axis, `n_z^4` with n_z the direction cosine of its
/// launch (from infinity this is the cosine-fourth law), and its derivative by the launch point.
fn projection(start: &Launch) -> (f64, [f64; 2]) {
    let nz = start.ray.direction[2];
    let slope = 4.0 * nz.powi(3);
    (nz.powi(4), start.direction_by.map(|by| slope * by[2]))
}

/// [`projection`] of the first `count` aimed rays.
pub(super) fn projections<'a>(
    sequence: &'a Sequence,
    field_rad: f64,
    aimed: &'a AimedRays,
    count: usize,
) -> impl Iterator<Item = (f64, [f64; 2])> + 'a {
    // From infinity all rays are parallel.
    let parallel = (sequence.object == ObjectDistance::Infinity)
        .then(|| projection(&launch(sequence, field_rad, [0.0; 2])));
    (0..count).map(move |i| {
        parallel.unwrap_or_else(|| projection(&launch(sequence, field_rad, aimed.launch_of(i))))
    })
}

/// Area, over pi, in which the paraxial beam of the axis crosses the plane of the first vertex, mm^2: that of the
/// entrance pupil or, from a near object, its shadow on that plane.
pub(super) fn launch_area(sequence: &Sequence, order: &FirstOrder) -> f64 {
    let radius = 0.5 * sequence.entrance_pupil_mm;
    match sequence.object {
        ObjectDistance::Infinity => radius * radius,
        ObjectDistance::Finite(distance) => {
            let shadow = radius * distance / (distance + order.entrance_pupil_at_mm);
            shadow * shadow
        }
    }
}
