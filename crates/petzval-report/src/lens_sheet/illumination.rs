//! Relative illumination over the field.

use petzval_optics::analysis::Analysis;

use super::mtf::{modulation_frame, sheet};
use super::style::{axis_name, has_one_field, wavelength_keys, wavelength_pen, without_curves};
use crate::plot::{Axis, Curve, Names, Sheet, span};

/// Illumination of the image divided by that on the axis, by wavelength.
pub(super) fn relative_illumination(analysis: &Analysis) -> Sheet {
    let data = &analysis.field_curves;
    let (class, title) = ("relative-illumination", "Relative illumination");
    if has_one_field(&data.field_deg) {
        return without_curves(analysis, class, title);
    }
    let curves: Vec<Curve> = data
        .relative_illumination
        .iter()
        .enumerate()
        .map(|(i, y)| {
            Curve::over(wavelength_pen(analysis, i), i, &data.field_deg, y.iter().copied().map(Some))
        })
        .collect();
    let (low, high) = span(data.field_deg.iter().copied()).unwrap_or((0.0, 1.0));
    let mut frame = modulation_frame(Axis::between(low, high, 4));
    // In some lenses off-axis fields are brighter than the axis.
    let brightest = span(curves.iter().flat_map(|c| c.values(1))).map_or(1.0, |s| s.1);
    if brightest > 1.0 + 1e-6 {
        frame.y = Axis::around(0.0, brightest, 6);
    }
    let names = Names { head: "", x: "field, degrees", y: "relative illumination" };
    let axis = axis_name(analysis);
    let remark = format!("Light on the image plane divided by that {axis} at the same wavelength.");
    sheet(analysis, class, title, &remark, wavelength_keys(analysis), frame.draw(names, &curves))
}
