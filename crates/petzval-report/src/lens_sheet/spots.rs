//! Spot diagrams: one box a field on a common scale, with a colour and a marker for each wavelength.

use maud::{Markup, html};
use petzval_optics::analysis::{Analysis, SpotDiagram};

use super::style::{are_own, blank, field_name, scales, short, wavelength_keys, wavelength_pen};
use crate::number;
use crate::palette::{AXIS, INK, MUTED, PAPER};
use crate::plot::{Key, KeyLine, Sheet, WIDTH_PX, px, round_up};

/// Side of a box, space between boxes, height of the text below, px.
const BOX_PX: f64 = 200.0;
const GAP_PX: f64 = 24.0;
const TEXT_PX: f64 = 66.0;

/// Boxes in a row.
const COLUMNS: usize = 4;

/// Radius of a marker, px.
const MARKER_PX: f64 = 1.5;

/// The matrix of spots, in boxes of a given side or of one that fits them all.
pub(super) fn spots(analysis: &Analysis, side_um: Option<f64>) -> Sheet {
    let reach = |s: &SpotDiagram| match s.airy_radius_um {
        airy_um if airy_um.is_finite() => s.geometric_radius_um.max(1.2 * airy_um),
        _ => s.geometric_radius_um,
    };
    let sides_um: Vec<f64> = match side_um {
        Some(side_um) => vec![side_um; analysis.spots.len()],
        None => scales(&analysis.spots.iter().map(reach).collect::<Vec<f64>>())
            .into_iter()
            .map(|reach| round_up(2.06 * reach))
            .collect(),
    };
    let boxes = if are_own(&sides_um) {
        "Boxes, each on its own scale,".into()
    } else {
        format!("Boxes {} µm wide", short(sides_um.first().copied().unwrap_or(f64::NAN), 3))
    };
    let columns = analysis.spots.len().clamp(1, COLUMNS);
    let left = 0.5 * (WIDTH_PX - columns as f64 * (BOX_PX + GAP_PX) + GAP_PX);
    let step = BOX_PX + TEXT_PX;
    let body = html! {
        @for (i, spot) in analysis.spots.iter().enumerate() {
            @let (x, y) = (left + (i % columns) as f64 * (BOX_PX + GAP_PX), 6.0 + (i / columns) as f64 * step);
            g class="spot" transform=(format!("translate({} {})", px(x), px(y))) { (one(analysis, spot, sides_um[i])) }
        }
    };
    let mut keys: Vec<Key> = wavelength_keys(analysis)
        .into_iter()
        .map(|key| match key.line {
            KeyLine::Pen(pen) => {
                Key { line: pen.marker.map_or(KeyLine::None, |m| KeyLine::Marker(pen.colour, m)), ..key }
            }
            line => Key { line, ..key },
        })
        .collect();
    let airy = analysis.spots.first().map_or(f64::NAN, |s| s.airy_radius_um);
    if airy.is_finite() {
        keys.push(Key::remark(format!("circle: Airy disk, radius {} µm", number::fixed(airy, 2))));
    }
    Sheet {
        remark: format!(
            "{boxes} about the centroid of all light, y upwards; RMS and largest distance from there."
        ),
        keys,
        alt: format!("Spot diagrams of {} at {} fields", analysis.name, analysis.spots.len()),
        height: analysis.spots.len().div_ceil(columns) as f64 * step + 8.0,
        body,
        ..blank(analysis, "spots", "Spot diagrams")
    }
}

/// One box with the text below it.
fn one(analysis: &Analysis, spot: &SpotDiagram, side_um: f64) -> Markup {
    let scale = BOX_PX / side_um;
    let half = 0.5 * BOX_PX;
    let place = |p: &[f64; 2]| {
        [half + scale * (p[0] - spot.centroid_um[0]), half - scale * (p[1] - spot.centroid_um[1])]
    };
    let bar_um = number::round_length(0.2 * side_um);
    let (bar_px, bar_y) = (bar_um * scale, BOX_PX - 9.0);
    html! {
        path d=(format!("M0 {h}H{s}M{h} 0V{s}", h = px(half), s = px(BOX_PX))) stroke=(AXIS) stroke-width="0.6" {}
        svg class="field" width=(px(BOX_PX)) height=(px(BOX_PX)) {
            @for (i, points) in spot.points_um.iter().enumerate() {
                @let pen = wavelength_pen(analysis, i);
                @if let Some(marker) = pen.marker {
                    @let path = marker.path(points.iter().map(place), MARKER_PX);
                    @if marker.is_open() {
                        path class="rays" d=(path) stroke=(pen.colour) stroke-width="0.9" {}
                    } @else {
                        path class="rays" d=(path) fill=(pen.colour) fill-opacity="0.75" {}
                    }
                }
            }
            @if spot.airy_radius_um.is_finite() {
                circle class="airy" cx=(px(half)) cy=(px(half)) r=(px(scale * spot.airy_radius_um)) stroke=(INK)
                    stroke-width="1.1" {}
            }
        }
        rect width=(px(BOX_PX)) height=(px(BOX_PX)) stroke=(AXIS) {}
        path class="scale-bar" stroke=(INK) stroke-width="1.4"
            d=(format!("M8 {y}h{w}M8 {t}v6m{w} -6v6", y = px(bar_y), t = px(bar_y - 3.0), w = px(bar_px))) {}
        text x=(px(bar_px + 13.0)) y=(px(bar_y + 4.0)) fill=(INK) font-size="11.5" stroke=(PAPER) stroke-width="3"
            paint-order="stroke" { (short(bar_um, 3)) " µm" }
        g text-anchor="middle" font-size="12.5" {
            text x=(px(half)) y=(px(BOX_PX + 18.0)) fill=(INK) font-size="13.5" font-weight="600" {
                (field_name(spot.field_deg))
            }
            text x=(px(half)) y=(px(BOX_PX + 35.0)) fill=(INK) {
                "RMS " (number::fixed(spot.rms_um, 2)) " µm, max " (number::fixed(spot.geometric_radius_um, 1)) " µm"
            }
            text x=(px(half)) y=(px(BOX_PX + 51.0)) fill=(MUTED) {
                "chief ray at " (chief(spot.chief_mm)) " mm"
            }
        }
    }
}

/// Position of the chief ray; x is left out if it is zero.
fn chief([x, y]: [f64; 2]) -> String {
    let y = number::fixed(y, 3);
    if x.abs() < 5e-4 { format!("y {y}") } else { format!("x {}, y {y}", number::fixed(x, 3)) }
}
