//! First-order optics: the properties of a lens near its axis, and their gradient.
//!
//! A paraxial ray is a height y and an optical slope `w = n u`. Refraction `w' = w - y phi`, with
//! `phi = (n' - n) (c + 2 a_2)`; transfer `y_next = y + t w' / n'`.
//!
//! Behind an odd number of mirrors indices and distances are negative, and the formulas stay the same. A thin lens has
//! its own power, and a diffractive structure with the optical path `a r^2` the power `-2 a`. Shifts and turns of
//! surfaces and straight gratings are ignored: the properties are those of the lens with every surface on its axis.

use std::ops::Range;

use std::f64::consts::FRAC_PI_2;

use crate::gradient::LensGradient;
use crate::lens::ObjectDistance;
use crate::number::Number;
use crate::trace::{Bending, Sequence, SurfaceAtWavelength};

/// A paraxial ray at every surface.
#[derive(Clone, Debug)]
pub struct ParaxialRay {
    /// Height on each surface, mm.
    pub y: Vec<f64>,
    /// Optical slope n u in front of each surface, and behind the last.
    pub w: Vec<f64>,
}

/// First-order properties, for an image in the medium behind the last surface. A quantity at infinity is not finite. Examples are the focal
/// length of an afocal lens, the image of an object at the front focus, and the exit pupil of a lens that is telecentric towards its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrder {
    /// Effective focal length, the reciprocal of the power, mm.
    pub efl_mm: f64,
    /// From the last vertex to the rear focal point, mm.
    pub bfl_mm: f64,
    /// From the last vertex to the paraxial image of the object, mm.
    pub image_distance_mm: f64,
    /// EFL divided by the entrance pupil diameter, without its sign.
    pub f_number: f64,
    /// Entrance pupil, from the first vertex, mm.
    pub entrance_pupil_at_mm: f64,
    /// Exit pupil, from the last vertex, mm.
    pub exit_pupil_at_mm: f64,
    /// Exit pupil diameter, mm.
    pub exit_pupil_mm: f64,
    /// Radius of the stop that gives the specified entrance pupil, mm.
    pub stop_radius_mm: f64,
}

/// Cotangents of first-order properties.
#[derive(Clone, Copy, Debug, Default)]
pub struct FirstOrderCotangent {
    /// By the effective focal length, 1/mm.
    pub efl: f64,
    /// By the back focal length, 1/mm.
    pub bfl: f64,
    /// By the stop radius, 1/mm.
    pub stop_radius: f64,
}

fn power(sequence: &Sequence, i: usize) -> f64 {
    let s = &sequence.surfaces[i];
    let by_shape = (s.n_after - s.n_before) * s.shape.paraxial_curvature();
    match &s.bending {
        Bending::Snell => by_shape,
        Bending::ThinLens { power_per_mm } => by_shape + power_per_mm,
        Bending::Path { radial, .. } => by_shape - 2.0 * radial[0],
    }
}

/// Adds the cotangent of the power of a surface to its numbers, except the indices.
fn pull_back_power(s: &SurfaceAtWavelength, power_bar: f64, i: usize, gradient: &mut LensGradient) {
    let by_curvature = power_bar * (s.n_after - s.n_before);
    gradient[(i, Number::Curvature)] += by_curvature;
    gradient[(i, Number::Asphere(0))] += 2.0 * by_curvature;
    for (k, by) in s.shape.paraxial_sensitivity() {
        gradient[(i, Number::Departure(k))] += by_curvature * by;
    }
    match &s.bending {
        Bending::Snell => {}
        Bending::ThinLens { .. } => gradient[(i, Number::Power)] += power_bar,
        Bending::Path { is_grating, per_number, .. } => {
            if !is_grating {
                gradient[(i, Number::Phase(0))] -= 2.0 * per_number[0] * power_bar;
            }
        }
    }
}

/// Traces a paraxial ray through some of the surfaces from its height on the first of them.
fn through(sequence: &Sequence, range: Range<usize>, mut y: f64, mut w: f64) -> ParaxialRay {
    let mut ray = ParaxialRay { y: Vec::with_capacity(range.len()), w: vec![w] };
    for i in range.clone() {
        ray.y.push(y);
        w -= y * power(sequence, i);
        ray.w.push(w);
        y += sequence.surfaces[i].thickness_mm * w / sequence.surfaces[i].n_after;
    }
    ray
}

/// Traces a paraxial ray from height `y_mm` and slope `u` at the first surface.
pub fn paraxial_ray(sequence: &Sequence, y_mm: f64, u: f64) -> ParaxialRay {
    let n = sequence.surfaces.first().map_or(1.0, |s| s.n_before);
    through(sequence, 0..sequence.surfaces.len(), y_mm, n * u)
}

/// Share of the largest part of a sum below which the sum is rounding: of a power, a height or a slope that would be zero with exact numbers.
const ROUNDING: f64 = 1e-9;

/// A height or slope behind the last of some surfaces, or zero where it is nothing but rounding: `parts` are what it is the sum of.
fn without_rounding(sum: f64, parts: impl Iterator<Item = f64>) -> f64 {
    let largest = parts.fold(0.0_f64, |most, part| most.max(part.abs()));
    if sum.abs() <= ROUNDING * largest { 0.0 } else { sum }
}

impl ParaxialRay {
    /// Its slope behind the last surface of `range`, at whose beginning it starts, or zero where that is rounding.
    fn slope_behind(&self, sequence: &Sequence, range: Range<usize>) -> f64 {
        let end = self.w[range.len()];
        let bends = range.zip(&self.y).map(|(i, y)| y * power(sequence, i));
        without_rounding(end, bends.chain([self.w[0]]))
    }

    /// Its height on the last surface of `range`, at whose beginning it starts, or zero where that is rounding.
    fn height_at_end(&self, sequence: &Sequence, range: Range<usize>) -> f64 {
        let end = self.y[range.len() - 1];
        let rise = |(s, w): (&SurfaceAtWavelength, &f64)| s.thickness_mm * w / s.n_after;
        let gaps = &sequence.surfaces[range.start..range.end - 1];
        let rises = gaps.iter().zip(&self.w[1..]).map(rise);
        without_rounding(end, rises.chain([self.y[0]]))
    }
}

/// First-order properties at the sequence's wavelength.
pub fn first_order(sequence: &Sequence) -> FirstOrder {
    let last = sequence.surfaces.len() - 1;
    let n_image = sequence.surfaces[last].n_after;

    let (all, to_stop) = (0..last + 1, 0..sequence.stop + 1);

    // Trace a ray parallel to the axis: it gives the focal lengths and the ratio of stop to pupil.
    let parallel = paraxial_ray(sequence, 1.0, 0.0);
    let w_end = parallel.slope_behind(sequence, all.clone());
    let efl_mm = -1.0 / w_end;
    let bfl_mm = -parallel.height_at_end(sequence, all) * n_image / w_end + 0.0;
    let stop_per_pupil = parallel.height_at_end(sequence, to_stop.clone());

    // Trace a ray through the first vertex: every other ray is a combination of the two. The entrance pupil is the apparent
    // position of the stop's centre.
    let oblique = paraxial_ray(sequence, 0.0, 1.0);
    let entrance_pupil_at_mm = oblique.height_at_end(sequence, to_stop) / stop_per_pupil;

    // Trace rays from the centre and from the rim of the stop to the exit pupil.
    let s = &sequence.surfaces[sequence.stop];
    let first = sequence.stop + 1;
    let (exit_pupil_at_mm, exit_magnification) = if first > last {
        (0.0, 1.0)
    } else {
        let centre = through(sequence, first..last + 1, s.thickness_mm, s.n_after);
        let w_centre = centre.slope_behind(sequence, first..last + 1);
        let at = -centre.height_at_end(sequence, first..last + 1) * n_image / w_centre + 0.0;
        let rim = through(sequence, first..last + 1, 1.0, 0.0);
        (at, rim.y[last - first] + at * rim.w[last + 1 - first] / n_image)
    };
    let stop_radius_mm = 0.5 * sequence.entrance_pupil_mm * stop_per_pupil;

    let image_distance_mm = match sequence.object {
        ObjectDistance::Infinity => bfl_mm,
        ObjectDistance::Finite(distance) => {
            let y_parts = [parallel.y[last] * distance, oblique.y[last]];
            let w_parts = [w_end * distance, oblique.w[last + 1]];
            let y = without_rounding(y_parts[0] + y_parts[1], y_parts.into_iter());
            let w = without_rounding(w_parts[0] + w_parts[1], w_parts.into_iter());
            -y * n_image / w + 0.0
        }
    };
    FirstOrder {
        efl_mm,
        bfl_mm,
        image_distance_mm,
        f_number: (efl_mm / sequence.entrance_pupil_mm).abs(),
        entrance_pupil_at_mm,
        exit_pupil_at_mm,
        exit_pupil_mm: 2.0 * (stop_radius_mm * exit_magnification).abs(),
        stop_radius_mm,
    }
}

/// Adds the gradient of a loss that depends on first-order properties.
pub fn pull_back_first_order(
    sequence: &Sequence,
    cotangent: FirstOrderCotangent,
    gradient: &mut LensGradient,
) {
    let ray = paraxial_ray(sequence, 1.0, 0.0);
    let last = sequence.surfaces.len() - 1;
    let w_end = ray.w[last + 1];
    gradient.entrance_pupil += 0.5 * cotangent.stop_radius * ray.y[sequence.stop];
    let stop_bar = 0.5 * sequence.entrance_pupil_mm * cotangent.stop_radius;
    let w_bar = cotangent.efl / (w_end * w_end);
    let bars = RayCotangent { crossing: cotangent.bfl, end_slope: w_bar, stop: stop_bar };
    pull_back_ray(sequence, &ray, bars, gradient);
}

/// Adds the gradient of a loss that depends on the paraxial image distance, `bar` per mm.
pub fn pull_back_image_distance(sequence: &Sequence, bar: f64, gradient: &mut LensGradient) {
    let ray = match sequence.object {
        ObjectDistance::Infinity => paraxial_ray(sequence, 1.0, 0.0),
        ObjectDistance::Finite(distance) => paraxial_ray(sequence, distance, 1.0),
    };
    pull_back_ray(sequence, &ray, RayCotangent { crossing: bar, ..Default::default() }, gradient);
}

/// Tangent of a field from infinity, by which a rectilinear image grows: infinite from 90 degrees on, which such an image never
/// reaches.
pub fn rectilinear_tangent(field_rad: f64) -> f64 {
    if field_rad.abs() < FRAC_PI_2 { field_rad.tan() } else { f64::INFINITY.copysign(field_rad) }
}

/// Height of the paraxial image of a field divided by the tangent of its angle, mm: the focal length or, for a near
/// object at D, `-D / w'` with w' the final optical slope of its ray of slope 1 (Lagrange's invariant).
pub fn image_height_per_tangent(sequence: &Sequence) -> f64 {
    match sequence.object {
        ObjectDistance::Infinity => first_order(sequence).efl_mm,
        ObjectDistance::Finite(distance) => {
            -distance
                / paraxial_ray(sequence, distance, 1.0).slope_behind(sequence, 0..sequence.surfaces.len())
        }
    }
}

/// Adds the gradient of a loss that depends on [`image_height_per_tangent`], `bar` per mm.
pub fn pull_back_image_height(sequence: &Sequence, bar: f64, gradient: &mut LensGradient) {
    match sequence.object {
        ObjectDistance::Infinity => {
            let bars = FirstOrderCotangent { efl: bar, ..Default::default() };
            pull_back_first_order(sequence, bars, gradient);
        }
        ObjectDistance::Finite(distance) => {
            let ray = paraxial_ray(sequence, distance, 1.0);
            let w_end = ray.w[sequence.surfaces.len()];
            let end_slope = bar * distance / (w_end * w_end);
            pull_back_ray(sequence, &ray, RayCotangent { end_slope, ..Default::default() }, gradient);
        }
    }
}

/// Adds the gradient of a loss that depends on the position of the entrance pupil, `bar` per mm.
///
/// The pupil is at `b / a`, with a and b the heights at the stop of a ray parallel to the axis and of one through the
/// first vertex.
pub fn pull_back_entrance_pupil(sequence: &Sequence, bar: f64, gradient: &mut LensGradient) {
    let parallel = paraxial_ray(sequence, 1.0, 0.0);
    let oblique = paraxial_ray(sequence, 0.0, 1.0);
    let a = parallel.y[sequence.stop];
    let at = oblique.y[sequence.stop] / a;
    let at_stop = |stop: f64| RayCotangent { stop, ..Default::default() };
    pull_back_ray(sequence, &oblique, at_stop(bar / a), gradient);
    pull_back_ray(sequence, &parallel, at_stop(-bar * at / a), gradient);
}

/// Adds the gradient of a loss that depends on the height at the stop of the ray that leaves the foot of a near object with the slope 1, `bar` per mm.
pub(crate) fn pull_back_height_at_stop(
    sequence: &Sequence,
    distance_mm: f64,
    bar: f64,
    gradient: &mut LensGradient,
) {
    let ray = paraxial_ray(sequence, distance_mm, 1.0);
    pull_back_ray(sequence, &ray, RayCotangent { stop: bar, ..Default::default() }, gradient);
}

/// Tangent of the angle between the axis and the paraxial marginal ray of a near object at D: half the entrance pupil over `D + z`, with the pupil
/// at z; `None` for an object at infinity.
pub fn marginal_tangent(sequence: &Sequence) -> Option<f64> {
    let ObjectDistance::Finite(distance) = sequence.object else { return None };
    Some(0.5 * sequence.entrance_pupil_mm / (distance + first_order(sequence).entrance_pupil_at_mm))
}

/// Brightness of the image on the axis, by which lenses in front of one scene are compared: the square of the entrance pupil's diameter over
/// the focal length, `1 / N^2`. For a near object at D, with the pupil at z: the diameter is multiplied by `D / (D + z)`, and
/// [`image_height_per_tangent`] takes the place of the focal length. Irradiance is `pi / 4` of the radiance times this. It is that
/// of a paraxial pupil, to which relative illuminations refer.
pub fn image_brightness(sequence: &Sequence) -> f64 {
    let nearness = match sequence.object {
        ObjectDistance::Infinity => 1.0,
        ObjectDistance::Finite(distance) => {
            distance / (distance + first_order(sequence).entrance_pupil_at_mm)
        }
    };
    (sequence.entrance_pupil_mm * nearness / image_height_per_tangent(sequence)).powi(2)
}

/// Adds the gradient of a loss that depends on the logarithm of [`image_brightness`], by which its derivative is `bar`.
pub fn pull_back_log_brightness(sequence: &Sequence, bar: f64, gradient: &mut LensGradient) {
    gradient.entrance_pupil += 2.0 * bar / sequence.entrance_pupil_mm;
    pull_back_image_height(sequence, -2.0 * bar / image_height_per_tangent(sequence), gradient);
    if let ObjectDistance::Finite(distance) = sequence.object {
        let at = first_order(sequence).entrance_pupil_at_mm;
        pull_back_entrance_pupil(sequence, -2.0 * bar / (distance + at), gradient);
    }
}

/// Cotangents of a paraxial ray.
#[derive(Clone, Copy, Default)]
struct RayCotangent {
    /// By its crossing of the axis behind the lens.
    crossing: f64,
    /// By its final optical slope.
    end_slope: f64,
    /// By its height at the stop.
    stop: f64,
}

/// The adjoint of a paraxial ray.
///
/// Backwards, `ybar -= phi wbar'`, `phibar = -y wbar'`, then `wbar += (t / n) ybar`.
fn pull_back_ray(sequence: &Sequence, ray: &ParaxialRay, bars: RayCotangent, gradient: &mut LensGradient) {
    let last = sequence.surfaces.len() - 1;
    let n_image = sequence.surfaces[last].n_after;
    let w_end = ray.w[last + 1];
    // Differentiate the crossing -y n' / w'; `index_bar` holds the cotangents of the signed index behind each surface.
    let mut index_bar = vec![0.0; last + 1];
    index_bar[last] -= bars.crossing * ray.y[last] / w_end;
    let mut y_bar = -bars.crossing * n_image / w_end;
    let mut w_bar = bars.end_slope + bars.crossing * ray.y[last] * n_image / (w_end * w_end);
    for i in (0..=last).rev() {
        if i == sequence.stop {
            y_bar += bars.stop;
        }
        // Refraction at surface i: w' = w - y phi.
        let s = &sequence.surfaces[i];
        let power_bar = -w_bar * ray.y[i];
        y_bar -= w_bar * power(sequence, i);
        pull_back_power(s, power_bar, i, gradient);
        let by_index = power_bar * s.shape.paraxial_curvature();
        index_bar[i] += by_index;
        if i == 0 {
            break;
        }
        index_bar[i - 1] -= by_index;
        // Transfer from surface i - 1: y_next = y + t w' / n'.
        let before = &sequence.surfaces[i - 1];
        let (t, n) = (before.thickness_mm, before.n_after);
        gradient[(i - 1, Number::Thickness)] += y_bar * ray.w[i] / n;
        index_bar[i - 1] -= y_bar * t * ray.w[i] / (n * n);
        w_bar += y_bar * t / n;
    }
    for i in 0..=last {
        gradient[(i, Number::Index)] += sequence.glass_index_bar(i, |j| index_bar[j]);
    }
}
