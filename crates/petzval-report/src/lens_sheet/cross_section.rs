//! The layout: the lens in cross-section, to scale, with rays of its fields.

use maud::html;
use petzval_optics::analysis::Analysis;

use super::style::{blank, field_name, wavelength_name};
use crate::layout::{Drawing, View, extent_of};
use crate::palette;
use crate::plot::{Key, Pen, Sheet, WIDTH_PX, px};

/// The largest height of the drawing, px.
const TALLEST_PX: f64 = 560.0;

/// The section with fans of rays.
pub(super) fn cross_section(analysis: &Analysis) -> Sheet {
    let drawing = Drawing { layout: &analysis.layout, ghost: None, key: &[] };
    let view = View::fitting(extent_of(&analysis.layout), [WIDTH_PX, TALLEST_PX]);
    let shift = 0.5 * (WIDTH_PX - view.width());
    let entry = |(i, field): (usize, &f64)| {
        Key::pen(Pen { width: 2.0, ..Pen::thin(palette::field(i)) }, field_name(*field))
    };
    Sheet {
        remark: format!(
            "To scale; rays of {} through the vertical diameter of the stop. Lost rays end in a dot.",
            wavelength_name(analysis.reference_um)
        ),
        keys: analysis.fields_deg.iter().enumerate().map(entry).collect(),
        alt: format!("Cross-section of {}: {} elements", analysis.name, analysis.layout.elements.len()),
        height: drawing.height(&view),
        body: html! { g transform=(format!("translate({} 0)", px(shift))) { (drawing.draw(&view)) } },
        ..blank(analysis, "layout", "Layout")
    }
}
