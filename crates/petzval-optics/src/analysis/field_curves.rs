//! Curves over the field: focus of lines, distortion, lateral colour and illumination.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::lens_at_field::{LensAtField, pupil};
use super::{AnalysisError, AnalysisOptions};
use crate::lens::Lens;
use crate::paraxial::rectilinear_tangent;
use crate::pupil::{aim_one, chief_ray, launch_radius_mm};
use crate::trace::{Ray, Sequence, launch, trace_ray};

/// Distance on the launch plane of the two rays whose crossing is a focus, as a share of the width of the beam there. It is so small that
/// aberrations, which grow with its square, do not count, and so large that eight digits are kept.
const CLOSE: f64 = 1e-4;

/// Field, as a share of the full one, whose chief rays are the reference of distortion.
const NEAR: f64 = 1e-3;

/// Difference of two fields that are the same but for rounding, rad or the tangent.
const SAME_FIELD: f64 = 1e-9;

/// Curves over the field; lists by wavelength hold one value per field. "The axis" is [`Lens::reference_field_deg`] where no field is near it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FieldCurves {
    /// Fields from the axis outwards, or from one side to the other, degrees.
    pub field_deg: Vec<f64>,
    /// `[wavelength]`: crossing of the chief ray with nearby rays in the plane of the fields, z from the image plane, mm.
    pub tangential_focus_mm: Vec<Vec<f64>>,
    /// `[wavelength]`: crossing of the chief ray with nearby rays across that plane, z from the image plane, mm.
    pub sagittal_focus_mm: Vec<Vec<f64>>,
    /// `[wavelength]`: height of the chief ray divided by the tangent of the field, relative to the same for chief rays
    /// of the reference wavelength near the axis, minus one, %. All heights are on the image plane, so defocus alone is
    /// no distortion. -100 % for fields of 90 degrees and more, which a rectilinear image never reaches.
    pub distortion_percent: Vec<Vec<f64>>,
    /// `[wavelength]`: the same with the field itself in place of its tangent.
    pub f_theta_distortion_percent: Vec<Vec<f64>>,
    /// `[wavelength]`: chief-ray height minus that of the reference wavelength, um.
    pub lateral_colour_um: Vec<Vec<f64>>,
    /// `[wavelength]`: irradiance of the image of a uniform scene divided by that on the axis at the same wavelength; light
    /// is counted per image area as the lens forms it, distortion included.
    pub relative_illumination: Vec<Vec<f64>>,
}

/// One field at every wavelength.
struct AtField {
    foci_mm: Vec<[f64; 2]>,
    height_mm: Vec<f64>,
    reference_height_mm: f64,
    illumination: Vec<f64>,
}

impl FieldCurves {
    /// No curves, for a number of wavelengths.
    pub(super) fn none(colours: usize) -> Self {
        let empty = || vec![Vec::new(); colours];
        Self {
            field_deg: Vec::new(),
            tangential_focus_mm: empty(),
            sagittal_focus_mm: empty(),
            distortion_percent: empty(),
            f_theta_distortion_percent: empty(),
            lateral_colour_um: empty(),
            relative_illumination: empty(),
        }
    }
}

/// The curves of a lens.
pub fn field_curves(lens: &Lens, options: &AnalysisOptions) -> Result<FieldCurves, AnalysisError> {
    let field_deg = options.fields_deg(lens);
    let quadrature = pupil(options.pupil_cells);
    let at = |deg: &f64| -> Result<AtField, AnalysisError> {
        let field = LensAtField::new(lens, *deg)?;
        let beams = field.beams(&quadrature)?;
        let mut result = AtField {
            foci_mm: Vec::new(),
            height_mm: Vec::new(),
            reference_height_mm: field.chief_mm[1],
            illumination: beams.iter().map(|beam| beam.light() * field.image_area).collect(),
        };
        for colour in &field.colours {
            let lost = || AnalysisError::NoChiefRay { field_deg: *deg, wavelength_um: colour.wavelength_um };
            result.height_mm.push(chief_ray(colour, field.field_rad).ok_or_else(lost)?.y_mm);
            result.foci_mm.push(foci(colour, field.field_rad, field.stop_radius_mm).ok_or_else(lost)?);
        }
        Ok(result)
    };
    let fields = field_deg.par_iter().map(at).collect::<Result<Vec<_>, _>>()?;
    let axis_deg = lens.reference_field_deg();
    let (axis, axis_rad) = (at(&axis_deg)?, axis_deg.to_radians());
    let furthest = field_deg.iter().fold(0.0_f64, |a, b| a.max((b - axis_deg).abs()));
    let scale = |w: f64| {
        let lost = AnalysisError::NoChiefRay { field_deg: axis_deg, wavelength_um: w };
        height_per_tangent(&lens.at_wavelength(w), axis_rad, furthest.to_radians()).ok_or(lost)
    };
    let reference_scale = scale(lens.reference_um)?;
    let scales = lens.wavelengths_um.iter().map(|w| scale(*w)).collect::<Result<Vec<_>, _>>()?;
    let by_colour = |value: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        (0..lens.wavelengths_um.len())
            .map(|colour| (0..fields.len()).map(|i| value(i, colour)).collect())
            .collect()
    };
    // Scales are per tangent; `tangent_slope` turns them into those per unit of the ideal, at the axis.
    let distortion = |ideal: &dyn Fn(f64) -> f64, tangent_slope: f64| {
        by_colour(&|i, colour| {
            let measure = ideal(field_deg[i].to_radians()) - ideal(axis_rad);
            let found = if measure.abs() < SAME_FIELD {
                scales[colour] * tangent_slope
            } else {
                (fields[i].height_mm[colour] - axis.height_mm[colour]) / measure
            };
            100.0 * (found / (reference_scale * tangent_slope) - 1.0)
        })
    };
    Ok(FieldCurves {
        tangential_focus_mm: by_colour(&|i, colour| fields[i].foci_mm[colour][1]),
        sagittal_focus_mm: by_colour(&|i, colour| fields[i].foci_mm[colour][0]),
        distortion_percent: distortion(&rectilinear_tangent, 1.0),
        f_theta_distortion_percent: distortion(&|field| field, axis_rad.cos().powi(-2)),
        lateral_colour_um: by_colour(&|i, colour| {
            1e3 * (fields[i].height_mm[colour] - fields[i].reference_height_mm)
        }),
        relative_illumination: by_colour(&|i, colour| {
            fields[i].illumination[colour] / axis.illumination[colour]
        }),
        field_deg,
    })
}

/// Height of chief rays near the field `axis_rad` divided by the tangent of their field, both from that field on, mm; `None` if they are lost.
fn height_per_tangent(sequence: &Sequence, axis_rad: f64, full_field_rad: f64) -> Option<f64> {
    // Take a field so small that distortion, which grows with the square, is below the printed digits.
    let near = if full_field_rad > 0.0 { NEAR * full_field_rad } else { NEAR };
    let height = |field: f64| Some(chief_ray(sequence, field)?.y_mm);
    let (below, above) = (axis_rad - near, axis_rad + near);
    Some((height(above)? - height(below)?) / (above.tan() - below.tan()))
}

/// Crossings of the chief ray with nearby rays, across the plane of the fields and in it: z from the image plane, mm.
fn foci(sequence: &Sequence, field_rad: f64, stop_radius_mm: f64) -> Option<[f64; 2]> {
    let chief = aim_one(sequence, field_rad, stop_radius_mm, [0.0; 2])?;
    let close = CLOSE * 2.0 * launch_radius_mm(sequence, stop_radius_mm);
    let image = |at: [f64; 2]| trace_ray(sequence, launch(sequence, field_rad, at).ray).image;
    let crossing = |axis: usize| -> Option<f64> {
        let mut ends = [chief; 2];
        ends[0][axis] -= close;
        ends[1][axis] += close;
        let [a, b]: [Ray; 2] = [image(ends[0])?, image(ends[1])?];
        let apart = b.position[axis] - a.position[axis];
        let slope = |ray: Ray| ray.direction[axis] / ray.direction[2];
        Some(-apart / (slope(b) - slope(a)))
    };
    Some([crossing(0)?, crossing(1)?])
}
