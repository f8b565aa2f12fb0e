//! Focus along the axis: by colour, and by zone of the pupil.

use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisOptions;
use super::options::evenly;
use crate::lens::Lens;
use crate::paraxial::first_order;
use crate::pupil::aim_one;
use crate::trace::{launch, trace_ray};

/// Number of wavelengths of the curve.
const POINTS: usize = 41;

/// Paraxial focus over the wavelength.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct AxialColour {
    /// From the shortest to the longest wavelength of the lens, um.
    pub wavelength_um: Vec<f64>,
    /// Shift of the paraxial focus along z from the one of the reference wavelength, mm. `None` if there is no focus, or a glass has no
    /// index.
    pub shift_mm: Vec<Option<f64>>,
}

/// Crossings of axial rays with the axis, over their height in the pupil; of rays of [`Lens::reference_field_deg`] with its chief ray.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LongitudinalAberration {
    /// Height on the stop in units of its radius, 0..1.
    pub pupil: Vec<f64>,
    /// `[wavelength]`: crossing, z from the image plane, mm; `None` where the ray is lost.
    pub crossing_mm: Vec<Vec<Option<f64>>>,
}

/// Paraxial focus over the wavelength; for a lens with one wavelength, a tenth of it to both sides.
pub fn axial_colour(lens: &Lens) -> AxialColour {
    let (low, high) =
        lens.wavelengths_um.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), w| (a.min(*w), b.max(*w)));
    let (low, high) = if high > low { (low, high) } else { (0.9 * low, 1.1 * high) };
    let focus = |w: f64| first_order(&lens.at_wavelength(w)).image_distance_mm;
    let reference = focus(lens.reference_um);
    let wavelength_um = evenly(low, high, POINTS);
    let shift_mm =
        wavelength_um.iter().map(|w| Some(focus(*w) - reference).filter(|v| v.is_finite())).collect();
    AxialColour { wavelength_um, shift_mm }
}

/// Crossings of rays of the axis, or of [`Lens::reference_field_deg`], in the plane of the fields.
pub fn longitudinal_aberration(lens: &Lens, options: &AnalysisOptions) -> LongitudinalAberration {
    let pupil = evenly(0.0, 1.0, options.fan_points.max(3));
    let stop = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
    let field_rad = lens.reference_field_deg().to_radians();
    let crossing_mm = lens.wavelengths_um.iter().map(|w| {
        let sequence = lens.at_wavelength(*w);
        let image = |p: f64| {
            let at = aim_one(&sequence, field_rad, stop, [0.0, p])?;
            trace_ray(&sequence, launch(&sequence, field_rad, at).ray).image
        };
        let chief = image(0.0);
        let crossing = |p: f64| {
            // The ray at zero height lies on the axis: use a neighbouring ray for its crossing.
            let (ray, chief) = (image(p.max(1e-4))?, chief?);
            let slope = |r: crate::trace::Ray| r.direction[1] / r.direction[2];
            let apart = ray.position[1] - chief.position[1];
            Some(-apart / (slope(ray) - slope(chief))).filter(|z| z.is_finite())
        };
        pupil.iter().map(|p| crossing(*p)).collect()
    });
    let crossing_mm = crossing_mm.collect();
    LongitudinalAberration { pupil, crossing_mm }
}
