//! Field curves: spot radius and illumination from the axis to the full field.

use petzval_optics::lens::Lens;
use petzval_optics::pupil::Quadrature;
use petzval_optics::spot::spot;

/// Pupil cells a side; spot radii are then right to a few parts in a thousand.
const PUPIL_CELLS: usize = 32;

/// Fields from the axis to the edge.
const FIELDS: usize = 25;

/// A lens at one field, over all colour channels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FieldPoint {
    /// Field angle, degrees.
    pub field_deg: f64,
    /// RMS spot radius about the common centroid of the channels, um.
    pub rms_um: f64,
    /// Relative illumination, mean of the channels.
    pub illumination: f64,
}

/// Traces a lens at given fields; a field without light is left out.
pub(crate) fn at_fields(lens: &Lens, fields_rad: &[f64], wavelengths_um: &[f64]) -> Vec<FieldPoint> {
    let lens = Lens { wavelengths_um: wavelengths_um.to_vec(), ..lens.clone() };
    let Ok(quadrature) = Quadrature::grid(PUPIL_CELLS) else { return Vec::new() };
    fields_rad
        .iter()
        .filter_map(|field| spot(&lens, *field, &quadrature))
        .map(|s| FieldPoint {
            field_deg: s.field_rad.to_degrees(),
            rms_um: s.rms_poly_um,
            illumination: s.illumination.iter().sum::<f64>() / s.illumination.len() as f64,
        })
        .collect()
}

/// Traces a lens at evenly spaced fields up to the full field, rad.
pub(crate) fn to_full_field(lens: &Lens, full_rad: f64, wavelengths_um: &[f64]) -> Vec<FieldPoint> {
    let fields: Vec<f64> = (0..FIELDS).map(|i| full_rad * i as f64 / (FIELDS - 1) as f64).collect();
    at_fields(lens, &fields, wavelengths_um)
}
