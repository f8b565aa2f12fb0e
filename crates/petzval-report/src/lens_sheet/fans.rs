//! Fans: ray aberrations and optical path differences over two diameters of the pupil, one row a field.

use maud::html;
use petzval_optics::analysis::{Analysis, Fan};

use super::style::{are_own, blank, field_name, scales, wavelength_keys, wavelength_name, wavelength_pen};
use crate::palette::INK;
use crate::plot::{Axis, Curve, Frame, Names, Sheet, px, span};

/// Size of a panel, distance of rows, px.
const PANEL_PX: [f64; 2] = [352.0, 118.0];
const ROW_PX: f64 = 150.0;
const TOP_PX: f64 = 28.0;

/// Left edges of the tangential and of the sagittal panels, px.
const LEFT_PX: [f64; 2] = [112.0, 536.0];

/// `[wavelength][point]`, `None` where the ray is lost.
type Curves = Vec<Vec<Option<f64>>>;

/// The quantity of a fan.
struct Kind {
    class: &'static str,
    title: &'static str,
    remark: String,
    /// Names of the vertical axes of both panels.
    values: [&'static str; 2],
    /// Tangential and sagittal curves.
    of: fn(&Fan) -> [&Curves; 2],
}

/// Ray aberrations.
pub(super) fn ray_fans(analysis: &Analysis) -> Sheet {
    let kind = Kind {
        class: "ray-fans",
        title: "Ray fans",
        remark: format!(
            "Transverse aberration from the chief ray at {}, over the height of the ray in the stop.",
            wavelength_name(analysis.reference_um)
        ),
        values: ["εy, µm", "εx, µm"],
        of: |fan| [&fan.tangential_um, &fan.sagittal_um],
    };
    fans(analysis, &kind)
}

/// Optical path differences.
pub(super) fn opd_fans(analysis: &Analysis) -> Sheet {
    let kind = Kind {
        class: "opd-fans",
        title: "Optical path difference",
        remark: format!(
            "In waves, from the sphere about the chief ray at {}, over the height of the ray in the stop.",
            wavelength_name(analysis.reference_um)
        ),
        values: ["W, waves", "W, waves"],
        of: |fan| [&fan.tangential_waves, &fan.sagittal_waves],
    };
    fans(analysis, &kind)
}

fn fans(analysis: &Analysis, kind: &Kind) -> Sheet {
    let reach = |fan: &Fan| {
        let all = (kind.of)(fan).into_iter().flatten().flatten().flatten().copied();
        span(all).map_or(0.0, |(low, high)| low.abs().max(high.abs()))
    };
    let scales = scales(&analysis.fans.iter().map(reach).collect::<Vec<f64>>());
    let x = pupil_axis();
    let last = analysis.fans.len().saturating_sub(1);
    let body = html! {
        @for (row, fan) in analysis.fans.iter().enumerate() {
            @let top = TOP_PX + row as f64 * ROW_PX;
            text x="4" y=(px(top + 0.5 * PANEL_PX[1] + 5.0)) fill=(INK) font-size="13.5" font-weight="600" {
                (field_name(fan.field_deg))
            }
            @for (side, curves) in (kind.of)(fan).into_iter().enumerate() {
                @let frame = Frame {
                    left: LEFT_PX[side], top, width: PANEL_PX[0], height: PANEL_PX[1], x: x.clone(), y: Axis::about_zero(scales[row]),
                };
                @let names = Names {
                    head: if row == 0 { ["tangential", "sagittal"][side] } else { "" },
                    x: if row == last { ["Py", "Px"][side] } else { "" },
                    y: kind.values[side],
                };
                @let lines: Vec<Curve> = curves.iter().enumerate()
                    .map(|(i, c)| Curve::over(wavelength_pen(analysis, i), i, &fan.pupil, c.iter().copied()))
                    .collect();
                (frame.draw(names, &lines))
            }
        }
    };
    Sheet {
        remark: format!(
            "{}{}",
            kind.remark,
            if are_own(&scales) { " Each field has its own scale." } else { "" }
        ),
        keys: wavelength_keys(analysis),
        alt: format!(
            "{} of {}, one row for each of {} fields",
            kind.title,
            analysis.name,
            analysis.fans.len()
        ),
        height: TOP_PX + analysis.fans.len() as f64 * ROW_PX + 20.0,
        body,
        ..blank(analysis, kind.class, kind.title)
    }
}

/// From edge to edge of the pupil.
fn pupil_axis() -> Axis {
    let mut axis = Axis::between(-1.0, 1.0, 4);
    axis.ticks = vec![-1.0, -0.5, 0.0, 0.5, 1.0];
    axis
}
