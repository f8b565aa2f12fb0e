//! Where a beam starts: launch points by first-order optics, and the light that a launch area gathers.

use crate::gradient::LensGradient;
use crate::lens::ObjectDistance;
use crate::paraxial::{FirstOrder, paraxial_ray, pull_back_height_at_stop};
use crate::trace::{AimedRays, Launch, Sequence, launch, starts_across};

/// Least cosine of a field in the law of rectilinear images: that of 89 degrees.
pub(super) const LEAST_COSINE: f64 = 0.017_452_406_437_283_51;

/// The launch point of first-order optics: the ray goes through the paraxial entrance pupil at the point `p` (units of its
/// radius). Coordinates are those of the launch plane, mm, see [`launch`].
pub fn paraxial_launch(order: &FirstOrder, sequence: &Sequence, field_rad: f64, p: [f64; 2]) -> [f64; 2] {
    let radius = 0.5 * sequence.entrance_pupil_mm;
    let [x, y] = [radius * p[0], radius * p[1]];
    let at = order.entrance_pupil_at_mm;
    let Launch { ray, .. } = launch(sequence, field_rad, [0.0, 0.0]);
    let [_, sin, cos] = ray.direction;
    match sequence.object {
        // Across the direction, the point (x, y, at) is at y cos(field) - at sin(field).
        ObjectDistance::Infinity if starts_across(sequence, field_rad) => [x, y * cos - at * sin],
        ObjectDistance::Infinity => [x, y - at * (sin / cos)],
        ObjectDistance::Finite(distance) => {
            // Intersect the line from the object point to the pupil point with the launch plane.
            let share = distance / (distance + at);
            let object_y = -distance * field_rad.tan();
            [share * x, object_y + share * (y - object_y)]
        }
    }
}

/// Irradiance of a ray per area of its launch plane relative to one along the axis, and its derivative by the launch point.
///
/// It is `n_z^4` with n_z the direction cosine of the launch (from infinity this is the cosine-fourth law): n_z projects the
/// area of the plane z = 0, and `n_z^3` is the solid angle of the object per area of a rectilinear image. On a plane across
/// the direction the area needs no projection. A rectilinear image ends before 90 degrees: from 89 degrees on the solid
/// angle is that of 89 degrees, so that the rays of a beam keep their weights relative to each other.
fn projection(sequence: &Sequence, field_rad: f64, start: &Launch) -> (f64, [f64; 2]) {
    let nz = start.ray.direction[2];
    if starts_across(sequence, field_rad) {
        return (nz.max(LEAST_COSINE).powi(3), [0.0; 2]);
    }
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
        .then(|| projection(sequence, field_rad, &launch(sequence, field_rad, [0.0; 2])));
    (0..count).map(move |i| {
        parallel.unwrap_or_else(|| {
            projection(sequence, field_rad, &launch(sequence, field_rad, aimed.launch_of(i)))
        })
    })
}

/// Radius, mm, with which the paraxial beam of the axis crosses its launch plane: that of the entrance pupil or, from a near object, of the cone to
/// the rim of the stop. It is finite where the entrance pupil of a wavelength lies at infinity, and is as large as that.
pub(crate) fn launch_radius_mm(sequence: &Sequence, stop_radius_mm: f64) -> f64 {
    match sequence.object {
        ObjectDistance::Infinity => 0.5 * sequence.entrance_pupil_mm,
        ObjectDistance::Finite(distance) => {
            (stop_radius_mm * distance / height_at_stop_mm(sequence, distance)).abs()
        }
    }
}

/// Height at the stop of the paraxial ray that leaves the foot of a near object with the slope 1, mm.
fn height_at_stop_mm(sequence: &Sequence, distance_mm: f64) -> f64 {
    paraxial_ray(sequence, distance_mm, 1.0).y[sequence.stop]
}

/// Area, over pi, in which the paraxial beam of the axis crosses its launch plane, mm^2. The light of rays is relative to it.
pub(super) fn launch_area(sequence: &Sequence, stop_radius_mm: f64) -> f64 {
    let radius = launch_radius_mm(sequence, stop_radius_mm);
    radius * radius
}

/// Adds the gradient of a loss that depends on the logarithm of [`launch_area`], by which its derivative is `bar`. Returns its derivative by the
/// logarithm of the stop radius.
pub(super) fn pull_back_log_launch_area(sequence: &Sequence, bar: f64, gradient: &mut LensGradient) -> f64 {
    match sequence.object {
        ObjectDistance::Infinity => {
            gradient.entrance_pupil += 2.0 * bar / sequence.entrance_pupil_mm;
            0.0
        }
        ObjectDistance::Finite(distance) => {
            let by_height = -2.0 * bar / height_at_stop_mm(sequence, distance);
            pull_back_height_at_stop(sequence, distance, by_height, gradient);
            2.0 * bar
        }
    }
}

/// Change of the logarithm of [`launch_area`] along a change of the lens and of the logarithm of the stop radius.
pub(super) fn push_forward_log_launch_area(
    sequence: &Sequence,
    change: &LensGradient,
    stop_growth: f64,
) -> f64 {
    let mut gradient = LensGradient::zero(sequence.surfaces.len());
    let by_stop = pull_back_log_launch_area(sequence, 1.0, &mut gradient);
    gradient.along(change) + by_stop * stop_growth
}
