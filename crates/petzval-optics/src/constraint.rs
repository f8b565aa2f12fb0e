//! What a manufacturer needs of a lens, as a penalty with a gradient.

use crate::gradient::LensGradient;
use crate::lens::{Lens, azimuths};
use crate::number::Number;
use crate::pupil::{chief_ray, pull_back_chief};

/// Least distances that a lens must keep, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearances {
    /// Edge thickness of an element, at the larger of its two clear semi-diameters.
    pub element_edge_mm: f64,
    /// Air between two surfaces, at their vertices and at the smaller of their semi-diameters.
    pub air_gap_mm: f64,
    /// From the last vertex to the image plane.
    pub back_focal_mm: f64,
}

impl Default for Clearances {
    fn default() -> Self {
        Self { element_edge_mm: 0.8, air_gap_mm: 0.05, back_focal_mm: 10.0 }
    }
}

/// `sum max(0, wanted - found)^2` over all clearances, mm^2, and its gradient.
pub fn clearance_penalty(lens: &Lens, wanted: &Clearances) -> (f64, LensGradient) {
    let mut value = 0.0;
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let mut hinge = |short: f64, spread: &mut dyn FnMut(f64, &mut LensGradient)| {
        if short > 0.0 {
            value += short * short;
            spread(-2.0 * short, &mut gradient);
        }
    };
    for i in 0..lens.surfaces.len() - 1 {
        let (a, b) = (&lens.surfaces[i], &lens.surfaces[i + 1]);
        let (least, height) = if a.glass.is_air() {
            (wanted.air_gap_mm, a.semi_diameter_mm.min(b.semi_diameter_mm))
        } else {
            (wanted.element_edge_mm, a.semi_diameter_mm.max(b.semi_diameter_mm))
        };
        let sign = direction_of_light(lens, i);
        if let Some((edge, towards)) = thinnest_edge(lens, i, height) {
            let at = towards.map(|v| v * height);
            hinge(least - edge, &mut |bar, g| {
                g[(i, Number::Thickness)] += sign * bar;
                sag_gradient(lens, i, at, -sign * bar, g);
                sag_gradient(lens, i + 1, at, sign * bar, g);
            });
        }
        hinge(least - sign * a.thickness_mm, &mut |bar, g| g[(i, Number::Thickness)] += sign * bar);
    }
    let last = lens.surfaces.len() - 1;
    let sign = direction_of_light(lens, last);
    hinge(wanted.back_focal_mm - sign * lens.image_distance_mm(), &mut |bar, g| {
        g[(last, Number::Thickness)] += sign * bar;
    });
    (value, gradient)
}

/// Distance from a surface to the next at a height, mm: the edge thickness of an element, or the air there, positive in the
/// direction of light; the least all round. `None` where one of them does not reach that far.
pub(crate) fn edge_clearance(lens: &Lens, surface: usize, height_mm: f64) -> Option<f64> {
    thinnest_edge(lens, surface, height_mm).map(|(clearance_mm, _)| clearance_mm)
}

/// That distance, and the direction across the axis in which it is.
pub(crate) fn thinnest_edge(lens: &Lens, surface: usize, height_mm: f64) -> Option<(f64, [f64; 2])> {
    let directions = azimuths(&[&lens.surfaces[surface], &lens.surfaces[surface + 1]]);
    let clearances =
        directions.into_iter().map(|d| Some((clearance_towards(lens, surface, d, height_mm)?, d)));
    let all: Vec<(f64, [f64; 2])> = clearances.collect::<Option<_>>()?;
    all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
}

fn clearance_towards(lens: &Lens, surface: usize, direction: [f64; 2], height_mm: f64) -> Option<f64> {
    let at = direction.map(|v| v * height_mm);
    let (a, b) = (&lens.surfaces[surface], &lens.surfaces[surface + 1]);
    let along_z = a.thickness_mm + b.shape.sag_at_mm(at)? - a.shape.sag_at_mm(at)?;
    Some(along_z * direction_of_light(lens, surface))
}

/// 1 where light goes along +z behind a surface, -1 behind an odd number of mirrors.
pub(crate) fn direction_of_light(lens: &Lens, surface: usize) -> f64 {
    if lens.light_goes_forwards(surface) { 1.0 } else { -1.0 }
}

/// Adds the gradient of a loss that depends on the sag of a surface at a point, `bar` per mm.
pub(crate) fn sag_gradient(lens: &Lens, surface: usize, at: [f64; 2], bar: f64, gradient: &mut LensGradient) {
    for (number, by) in lens.surfaces[surface].shape.sensitivities(at) {
        gradient[(surface, number)] += bar * by.value;
    }
}

/// `max(0, min - R)^2 + max(0, R - max)^2` of a surface's radius, mm^2, and its gradient: for a radius that is
/// solved for and so has no bounds of its own.
pub fn radius_penalty(lens: &Lens, surface: usize, [min, max]: [f64; 2]) -> (f64, LensGradient) {
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let curvature = lens.surfaces[surface].shape.curvature;
    let radius = 1.0 / curvature;
    let beyond = (radius - max).max(0.0) - (min - radius).max(0.0);
    // dR/dc = -R^2
    gradient[(surface, Number::Curvature)] = -2.0 * beyond * radius * radius;
    (beyond * beyond, gradient)
}

/// Square of what the chief ray of a field misses its wanted height on the image by, beyond a tolerance, mm^2,
/// and its gradient: it holds the field of view. `None` if the chief ray does not arrive.
pub fn chief_height_penalty(
    lens: &Lens,
    field_rad: f64,
    wanted_mm: f64,
    tolerance_mm: f64,
) -> Option<(f64, LensGradient)> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let chief = chief_ray(&sequence, field_rad)?;
    let miss = chief.y_mm - wanted_mm;
    let beyond = miss.signum() * (miss.abs() - tolerance_mm).max(0.0);
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    pull_back_chief(&sequence, &chief, [0.0, 2.0 * beyond], &mut gradient);
    Some((beyond * beyond, gradient))
}
