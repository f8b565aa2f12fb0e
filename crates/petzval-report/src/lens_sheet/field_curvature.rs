//! Field curvature and distortion side by side, with the field on the vertical axis.

use maud::html;
use petzval_optics::analysis::Analysis;

use super::style::{
    axis_with_zero, blank, field_name, has_one_field, section_keys, wavelength_keys, wavelength_name,
    wavelength_pen, without_curves,
};
use crate::plot::{Axis, Curve, Frame, Names, Pen, Sheet, span};

/// Height of both frames, px.
const HEIGHT_PX: f64 = 420.0;

/// Tangential and sagittal foci, and distortion.
pub(super) fn field_curvature(analysis: &Analysis) -> Sheet {
    let data = &analysis.field_curves;
    let (class, title) = ("field-curvature-distortion", "Field curvature and distortion");
    if has_one_field(&data.field_deg) {
        return without_curves(analysis, class, title);
    }
    let mut foci: Vec<Curve> = Vec::new();
    let mut distortion: Vec<Curve> = Vec::new();
    for i in 0..analysis.wavelengths_um.len() {
        let pen = wavelength_pen(analysis, i);
        foci.push(over_field(data, pen.clone(), i, &data.tangential_focus_mm[i]));
        foci.push(over_field(data, pen.clone().dashed(), i, &data.sagittal_focus_mm[i]));
        distortion.push(over_field(data, pen, i, &data.distortion_percent[i]));
    }
    let body = html! {
        (panel(data, 70.0, 400.0, "field curvature", "focus from the image plane, mm", &foci))
        (panel(data, 550.0, 336.0, "distortion", "distortion, %", &distortion))
    };
    let mut keys = wavelength_keys(analysis);
    keys.extend(section_keys());
    let remark = format!(
        "Foci of rays close to the chief ray; distortion of the chief ray from the tangent of the field; near {} {} has none.",
        analysis.first_order.image_na_field_deg.map_or_else(|| "the axis".to_owned(), field_name),
        wavelength_name(analysis.reference_um)
    );
    Sheet {
        remark,
        keys,
        alt: format!("Field curvature and distortion of {} over the field", analysis.name),
        height: HEIGHT_PX + 80.0,
        body,
        ..blank(analysis, class, title)
    }
}

/// A curve over the field, with the field on the vertical axis.
pub(super) fn over_field(
    data: &petzval_optics::analysis::FieldCurves,
    pen: Pen,
    index: usize,
    values: &[f64],
) -> Curve {
    Curve::beside(pen, index, &data.field_deg, values.iter().copied().map(Some))
}

/// A frame of curves over the field whose horizontal axis includes zero.
pub(super) fn panel(
    data: &petzval_optics::analysis::FieldCurves,
    left: f64,
    width: f64,
    head: &str,
    x_name: &str,
    curves: &[Curve],
) -> maud::Markup {
    let (bottom, top) = span(data.field_deg.iter().copied()).unwrap_or((0.0, 1.0));
    let y = Axis::between(bottom, top, 4);
    let frame = Frame { left, top: 30.0, width, height: HEIGHT_PX, x: axis_with_zero(curves), y };
    frame.draw(Names { head, x: x_name, y: "field, degrees" }, curves)
}
