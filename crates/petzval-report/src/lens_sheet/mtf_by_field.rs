//! Modulation over the field.

use petzval_optics::analysis::Analysis;

use super::mtf::{modulation_frame, sheet};
use super::style::{field_pen, has_one_field, method, section_curves, section_keys, short, without_curves};
use crate::plot::{Axis, Curve, Key, Names, Sheet, span};

/// One pair of curves for each frequency.
pub(super) fn mtf_by_field(analysis: &Analysis) -> Sheet {
    let data = &analysis.mtf_by_field;
    let (class, title) = ("mtf-by-field", "MTF over the field");
    if has_one_field(&data.field_deg) {
        return without_curves(analysis, class, title);
    }
    let curves = data.diffraction.as_ref().unwrap_or(&data.geometric);
    let mut keys: Vec<Key> = data
        .frequency_per_mm
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let is_nyquist = analysis.nyquist_per_mm == Some(*f);
            let name = if is_nyquist { ", Nyquist" } else { "" };
            Key::pen(field_pen(i), format!("{} cycles/mm{name}", short(*f, 2)))
        })
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
    let remark = format!("{}; mean of the wavelengths.", method(&[data.diffraction.is_some()]));
    sheet(analysis, class, title, &remark, keys, frame.draw(names, &lines))
}
