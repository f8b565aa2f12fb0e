//! The Seidel diagram: third-order sums as bars by surface, and of the whole lens.

use maud::{Markup, html};
use petzval_optics::analysis::{Analysis, ThirdOrder, ThirdOrderSurface};

use super::style::{blank, field_name, wavelength_name};
use crate::palette;
use crate::palette::{GRID, INK, MUTED};
use crate::plot::{Axis, Frame, Key, KeyLine, Names, Sheet, WIDTH_PX, px, span};

/// Height of the frame, least width of a group of bars, px.
const HEIGHT_PX: f64 = 380.0;
const GROUP_PX: f64 = 56.0;
const LEFT_PX: f64 = 86.0;

/// The sums in the order of their bars.
pub(super) const SUMS: [(&str, &str); 7] = [
    ("S I", "spherical aberration"),
    ("S II", "coma"),
    ("S III", "astigmatism"),
    ("S IV", "Petzval curvature"),
    ("S V", "distortion"),
    ("C I", "axial colour"),
    ("C II", "lateral colour"),
];

/// The sums of a surface in that order, mm.
pub(super) fn sums(of: &ThirdOrderSurface) -> [f64; 7] {
    let ([a, b, c, d, e], [f, g]) = (of.seidel_mm, of.chromatic_mm);
    [a, b, c, d, e, f, g]
}

/// The diagram, or a remark if third-order theory does not cover the lens.
pub(super) fn seidel(analysis: &Analysis) -> Sheet {
    let blank = Sheet {
        remark: "Third-order theory does not cover thin lenses and diffractive power.".into(),
        alt: format!("Seidel sums of {} by surface", analysis.name),
        height: 20.0,
        ..blank(analysis, "seidel", "Seidel sums")
    };
    let Some(order) = &analysis.third_order else { return blank };
    let groups = order.surfaces.len() + 1;
    let width = (GROUP_PX * groups as f64).max(WIDTH_PX - LEFT_PX - 22.0);
    let keys = SUMS.iter().enumerate().map(|(i, (sum, name))| Key {
        line: KeyLine::Fill(palette::camera(i).into()),
        name: format!("{sum} {name}"),
    });
    Sheet {
        remark: format!(
            "Sums at {} for the field of {}, from left to right in the order of the key; last the whole lens.",
            wavelength_name(analysis.reference_um),
            field_name(order.field_deg)
        ),
        keys: keys.collect(),
        width: LEFT_PX + width + 22.0,
        height: HEIGHT_PX + 66.0,
        body: diagram(order, width),
        ..blank
    }
}

fn diagram(order: &ThirdOrder, width: f64) -> Markup {
    let groups: Vec<[f64; 7]> = order.surfaces.iter().chain([&order.total]).map(sums).collect();
    let (low, high) = span(groups.iter().flatten().copied().chain([0.0])).unwrap_or((0.0, 0.0));
    let y = if high > low { Axis::around(low, high, 6) } else { Axis::about_zero(1.0) };
    let mut x = Axis::between(0.0, groups.len() as f64, 1);
    x.ticks.clear();
    let frame = Frame { left: LEFT_PX, top: 14.0, width, height: HEIGHT_PX, x, y };
    let group_px = width / groups.len() as f64;
    let bar_px = 0.8 * group_px / SUMS.len() as f64;
    let bars = html! {
        @for (g, values) in groups.iter().enumerate() {
            @let left = g as f64 * group_px;
            @if g > 0 { path d=(format!("M{} 0V{HEIGHT_PX}", px(left))) stroke=(GRID) {} }
            @for (i, value) in values.iter().enumerate() {
                @let bar_left = left + 0.1 * group_px + i as f64 * bar_px;
                (frame.column(bar_left, 0.9 * bar_px, *value, palette::camera(i)))
            }
        }
    };
    html! {
        (frame.draw_around(Names { head: "", x: "surface", y: "sum, mm" }, bars))
        g font-size="12" text-anchor="middle" {
            @for g in 0..groups.len() {
                @let x = px(LEFT_PX + (g as f64 + 0.5) * group_px);
                @if g + 1 < groups.len() {
                    text x=(x) y=(px(HEIGHT_PX + 30.0)) fill=(MUTED) { (g + 1) }
                } @else {
                    text x=(x) y=(px(HEIGHT_PX + 30.0)) fill=(INK) font-weight="600" { "sum" }
                }
            }
        }
    }
}
