//! Modulation over focus.

use petzval_optics::analysis::Analysis;

use super::mtf::{modulation_frame, sheet};
use super::style::{field_keys_with_method, field_pen, method, section_curves, section_keys, short};
use crate::plot::{Axis, Curve, Names, Sheet, span};

/// One pair of curves for each field.
pub(super) fn mtf_through_focus(analysis: &Analysis) -> Sheet {
    let data = &analysis.mtf_through_focus;
    let has_waves: Vec<bool> = data.iter().map(|m| m.diffraction.is_some()).collect();
    let mut keys = field_keys_with_method(analysis, &has_waves);
    keys.extend(section_keys());
    let mut lines: Vec<Curve> = Vec::new();
    for (i, at) in data.iter().enumerate() {
        let curve = at.diffraction.as_ref().unwrap_or(&at.geometric);
        lines.extend(section_curves(&field_pen(i), i, &at.defocus_mm, curve));
    }
    let (low, high) = span(data.iter().flat_map(|m| m.defocus_mm.iter().copied())).unwrap_or((-1.0, 1.0));
    let frame = modulation_frame(Axis::between(low, high, 8));
    let names = Names { head: "", x: "shift of the image plane, mm", y: "modulation" };
    let frequency = data.first().map_or(f64::NAN, |m| m.frequency_per_mm);
    let remark =
        format!("At {} cycles/mm. {}; mean of the wavelengths.", short(frequency, 2), method(&has_waves));
    sheet(analysis, "mtf-through-focus", "MTF through focus", &remark, keys, frame.draw(names, &lines))
}
