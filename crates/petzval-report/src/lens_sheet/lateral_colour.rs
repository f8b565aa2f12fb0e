//! Lateral colour over the field.

use petzval_optics::analysis::Analysis;

use super::field_curvature::{over_field, panel};
use super::style::{blank, has_one_field, wavelength_keys, wavelength_name, wavelength_pen, without_curves};
use crate::number;
use crate::palette::MUTED;
use crate::plot::{Curve, Key, Pen, Sheet};

/// Heights of the chief rays of all wavelengths relative to that of the reference, with the edges of the Airy disk.
pub(super) fn lateral_colour(analysis: &Analysis) -> Sheet {
    let data = &analysis.field_curves;
    let (class, title) = ("lateral-colour", "Lateral colour");
    if has_one_field(&data.field_deg) {
        return without_curves(analysis, class, title);
    }
    let airy = analysis.first_order.airy_radius_um.unwrap_or(f64::NAN);
    let edge = Pen::thin(MUTED).dashed();
    let mut curves: Vec<Curve> =
        [-airy, airy].map(|x| over_field(data, edge.clone(), 0, &vec![x; data.field_deg.len()])).into();
    for i in 0..analysis.wavelengths_um.len() {
        curves.push(over_field(data, wavelength_pen(analysis, i), i, &data.lateral_colour_um[i]));
    }
    let mut keys = wavelength_keys(analysis);
    keys.push(Key::pen(edge, format!("Airy disk, ±{} µm", number::fixed(airy, 2))));
    let remark = format!(
        "Height of the chief ray in the image minus that at {}.",
        wavelength_name(analysis.reference_um)
    );
    Sheet {
        remark,
        keys,
        alt: format!("Lateral colour of {} over the field", analysis.name),
        height: 500.0,
        body: panel(data, 70.0, 816.0, "", "lateral colour, µm", &curves),
        ..blank(analysis, class, title)
    }
}
