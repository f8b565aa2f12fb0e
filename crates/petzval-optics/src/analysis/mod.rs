//! The analyses of lens design, each as plain data in the units of its axes.
//!
//! Every analysis is a function of a lens and of options for its resolution, and uses exact tracing; nothing here
//! draws. [`analyze`] computes them all. Fields are those of the lens file, in its order. Rays are aimed at the real
//! stop. All colours have equal weight.

mod axial_colour;
mod cone;
mod encircled_energy;
mod error;
mod fan;
mod field_curves;
mod first_order_table;
mod layout;
mod lens_at_field;
mod mtf;
mod options;
mod spot_diagram;
mod third_order;
mod wavefront;

pub use axial_colour::{AxialColour, LongitudinalAberration, axial_colour, longitudinal_aberration};
pub use cone::{Cone, leaves_parallel, paraxial_image_mm};
pub use encircled_energy::{EncircledEnergy, encircled_energy};
pub use error::AnalysisError;
pub use fan::{Fan, fan};
pub use field_curves::{FieldCurves, field_curves};
pub use first_order_table::{FirstOrderTable, first_order_table};
pub use layout::{Layout, LayoutElement, LayoutLine, LayoutRay, LineKind, layout};
pub use mtf::{
    FieldMtf, MtfByField, MtfCurve, ThroughFocusMtf, field_mtf, mtf_at, mtf_by_field, through_focus_mtf,
};
pub use options::{AnalysisOptions, image_f_number};
pub use spot_diagram::{SpotDiagram, spot_diagram};
pub use third_order::{ThirdOrder, ThirdOrderSurface, third_order};
pub use wavefront::{Wavefront, ZERNIKE_TERMS, fringe_zernike, wavefront};

use petzval_base::Cancelled;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::lens::Lens;

/// All analyses of a lens.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Analysis {
    /// Name of the lens.
    pub name: String,
    /// Wavelengths, um, in the order of every list by wavelength.
    pub wavelengths_um: Vec<f64>,
    /// Wavelength of the reference chief rays, um.
    pub reference_um: f64,
    /// Fields, degrees, in the order of every list by field.
    pub fields_deg: Vec<f64>,
    /// The Nyquist frequency of the sensor, cycles/mm, if its pixel pitch is known.
    pub nyquist_per_mm: Option<f64>,
    /// First-order properties.
    pub first_order: FirstOrderTable,
    /// Seidel sums, by surface.
    pub third_order: Option<ThirdOrder>,
    /// The cross-section with rays.
    pub layout: Layout,
    /// Positions of rays on the image plane, by field.
    pub spots: Vec<SpotDiagram>,
    /// Ray and wavefront aberrations along two diameters of the stop, by field.
    pub fans: Vec<Fan>,
    /// Wavefronts, by field.
    pub wavefronts: Vec<Wavefront>,
    /// Modulation over frequency, by field.
    pub mtf: Vec<FieldMtf>,
    /// Modulation over the field.
    pub mtf_by_field: MtfByField,
    /// Modulation over focus, by field.
    pub mtf_through_focus: Vec<ThroughFocusMtf>,
    /// Field curvature, distortion, lateral colour and illumination over the field.
    pub field_curves: FieldCurves,
    /// Focus over wavelength.
    pub axial_colour: AxialColour,
    /// Focus over the height in the pupil.
    pub longitudinal_aberration: LongitudinalAberration,
    /// Energy within circles, by field.
    pub encircled_energy: Vec<EncircledEnergy>,
    /// Why there are no curves over the field: a field between those of the lens has no light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_curves: Option<String>,
}

/// Curves over the field. Where a field that the lens does not name has no light, there are none, and `no_curves` says why.
fn over_the_field<T>(
    curves: Result<T, AnalysisError>,
    none: impl FnOnce() -> T,
    no_curves: &mut Option<String>,
) -> T {
    curves.unwrap_or_else(|error| {
        *no_curves = Some(error.to_string());
        none()
    })
}

/// All analyses of a lens. Calls `tick` after each field of the lens; its error ends the analysis.
pub fn analyze(
    lens: &Lens,
    options: &AnalysisOptions,
    tick: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<Analysis, AnalysisError> {
    let by_field = |i: usize| -> Result<_, AnalysisError> {
        let field = lens.fields_deg[i];
        let of_field = (
            spot_diagram(lens, field, options)?,
            fan(lens, field, options)?,
            wavefront(lens, field)?,
            field_mtf(lens, field, options)?,
            through_focus_mtf(lens, field, options)?,
            encircled_energy(lens, field, options)?,
        );
        tick()?;
        Ok(of_field)
    };
    let (per_field, (mtf_by_field, field_curves)) = rayon::join(
        || (0..lens.fields_deg.len()).into_par_iter().map(by_field).collect::<Result<Vec<_>, _>>(),
        || (mtf_by_field(lens, options), field_curves(lens, options)),
    );
    // Fields of the lens without light are errors; the curves take fields between them.
    let per_field = per_field?;
    let mut no_curves = None;
    let mtf_by_field = over_the_field(mtf_by_field, MtfByField::none, &mut no_curves);
    let none = || FieldCurves::none(lens.wavelengths_um.len());
    let field_curves = over_the_field(field_curves, none, &mut no_curves);
    Ok(Analysis {
        name: lens.name.clone(),
        wavelengths_um: lens.wavelengths_um.clone(),
        reference_um: lens.reference_um,
        fields_deg: lens.fields_deg.clone(),
        nyquist_per_mm: options.nyquist_per_mm(),
        first_order: first_order_table(lens),
        third_order: third_order(lens),
        layout: layout(lens, options),
        spots: per_field.iter().map(|f| f.0.clone()).collect(),
        fans: per_field.iter().map(|f| f.1.clone()).collect(),
        wavefronts: per_field.iter().map(|f| f.2.clone()).collect(),
        mtf: per_field.iter().map(|f| f.3.clone()).collect(),
        mtf_through_focus: per_field.iter().map(|f| f.4.clone()).collect(),
        encircled_energy: per_field.into_iter().map(|f| f.5).collect(),
        mtf_by_field,
        field_curves,
        axial_colour: axial_colour(lens),
        longitudinal_aberration: longitudinal_aberration(lens, options),
        no_curves,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dark_field_that_the_lens_does_not_name_leaves_the_curves_out_and_says_why() {
        let mut reason = None;
        let dark = Err(AnalysisError::NoLight { field_deg: 3.0 });
        let curves = over_the_field(dark, || FieldCurves::none(2), &mut reason);
        assert!(curves.field_deg.is_empty() && curves.relative_illumination.iter().all(Vec::is_empty));
        assert_eq!(reason.as_deref(), Some("at 3 degrees no light reaches the image"));
        let mut reason = None;
        assert_eq!(over_the_field(Ok(7), || 0, &mut reason), 7);
        assert_eq!(reason, None);
    }
}
