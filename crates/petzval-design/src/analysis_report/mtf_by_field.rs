//! Modulation over the field.

use petzval_optics::analysis::Analysis;

use super::mtf::{modulation_frame, sheet};
use super::style::{ONE_FIELD, field_pen, has_one_field, section_curves, section_keys, short};
use crate::plot::{Axis, Curve, Key, Names, Sheet, span};

/// One pair of curves for each frequency.
pub(super) fn mtf_by_field(analysis: &Analysis) -> Sheet {
    let data = &analysis.mtf_by_field;
    let (curves, method) = match &data.diffraction {
        Some(curves) => (curves, "By waves"),
        None => (&data.geometric, "By rays"),
    };
    let mut keys: Vec<Key> = data
        .frequency_per_mm
        .iter()
        .enumerate()
        .map(|(i, f)| Key::pen(field_pen(i), format!("{} cycles/mm", short(*f, 2))))
        .collect();
    keys.extend(section_keys());
    let lines: Vec<Curve> = curves
        .iter()
        .enumerate()
        .flat_map(|(i, curve)| section_curves(&field_pen(i), i, &data.field_deg, curve))
        .collect();
    let (low, high) = span(data.field_deg.iter().copied()).unwrap_or((0.0, 1.0));
    let frame = modulation_frame(Axis::between(low, high, 4));
    let names = Names { head: "", x: "field, degrees", y: "modulation" };
    let remark = match has_one_field(&data.field_deg) {
        true => ONE_FIELD.into(),
        false => format!("{method}, mean of the wavelengths."),
    };
    sheet(analysis, "mtf-by-field", "MTF over the field", &remark, keys, frame.draw(names, &lines))
}
