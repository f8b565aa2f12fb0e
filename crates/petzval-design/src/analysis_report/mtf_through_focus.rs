//! Modulation over focus.

use petzval_optics::analysis::{Analysis, MtfCurve};

use super::mtf::{modulation_frame, sheet};
use super::style::{field_keys, field_pen, section_curves, section_keys, short};
use crate::plot::{Axis, Curve, Names, Sheet, span};

/// One pair of curves for each field.
pub(super) fn mtf_through_focus(analysis: &Analysis) -> Sheet {
    let data = &analysis.mtf_through_focus;
    let diffraction: Option<Vec<&MtfCurve>> = data.iter().map(|m| m.diffraction.as_ref()).collect();
    let method = if diffraction.is_some() { "By waves" } else { "By rays" };
    let curves = diffraction.unwrap_or_else(|| data.iter().map(|m| &m.geometric).collect());
    let mut keys = field_keys(analysis);
    keys.extend(section_keys());
    let lines: Vec<Curve> = curves
        .iter()
        .zip(data)
        .enumerate()
        .flat_map(|(i, (curve, at))| section_curves(&field_pen(i), i, &at.defocus_mm, curve))
        .collect();
    let (low, high) = span(data.iter().flat_map(|m| m.defocus_mm.iter().copied())).unwrap_or((-1.0, 1.0));
    let frame = modulation_frame(Axis::between(low, high, 8));
    let names = Names { head: "", x: "shift of the image plane, mm", y: "modulation" };
    let frequency = data.first().map_or(f64::NAN, |m| m.frequency_per_mm);
    let remark = format!("{method}, at {} cycles/mm, mean of the wavelengths.", short(frequency, 2));
    sheet(analysis, "mtf-through-focus", "MTF through focus", &remark, keys, frame.draw(names, &lines))
}
