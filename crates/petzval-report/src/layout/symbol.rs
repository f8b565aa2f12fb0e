//! Symbols: mirrors with a hatched back, thin lenses as double arrows, structures as toothed lines, the stop.

use maud::{Markup, html};
use petzval_optics::analysis::{LayoutLine, LineKind};

use super::View;
use crate::palette::INK;
use crate::plot::px;

/// Length and distance of the strokes behind a mirror, px.
const HATCH_PX: f64 = 7.0;
const HATCH_STEP_PX: f64 = 7.0;

/// Length and half width of the head of an arrow, px.
const HEAD_PX: [f64; 2] = [9.0, 5.0];

/// A surface that belongs to no glass.
pub(super) fn line(view: &View, line: &LayoutLine) -> Markup {
    let points: Vec<[f64; 2]> = line.points.iter().map(|p| view.at(*p)).collect();
    let profile = view.path(&line.points, false);
    match line.kind {
        LineKind::Mirror => html! {
            path class="mirror" d=(profile) stroke=(INK) stroke-width="2.2" {}
            path class="mirror-back" d=(hatch(&points, [line.back[0], -line.back[1]])) stroke=(INK) stroke-width="0.8" {}
        },
        LineKind::ConvergingLens => thin_lens(&profile, &points, 1.0),
        LineKind::DivergingLens => thin_lens(&profile, &points, -1.0),
        LineKind::Structure => html! {
            path class="structure" d=(profile) stroke=(INK) stroke-width="2.4" stroke-dasharray="2 1.6" {}
        },
    }
}

/// Slanted strokes behind a profile, evenly spaced along it.
fn hatch(points: &[[f64; 2]], back: [f64; 2]) -> String {
    let mut strokes = String::new();
    let mut left = 0.5 * HATCH_STEP_PX;
    for pair in points.windows(2) {
        let step = [0, 1].map(|k| pair[1][k] - pair[0][k]);
        let length = step[0].hypot(step[1]);
        if !(length > 0.0 && length.is_finite()) {
            continue;
        }
        // Draw strokes at 45 degrees to the profile.
        let lean = [0, 1].map(|k| 0.7 * HATCH_PX * (back[k] - step[k] / length));
        while left <= length {
            let [x, y] = [0, 1].map(|k| pair[0][k] + step[k] * left / length);
            strokes += &format!("M{} {}l{} {}", px(x), px(y), px(lean[0]), px(lean[1]));
            left += HATCH_STEP_PX;
        }
        left -= length;
    }
    strokes
}

/// A line with heads that point outwards (a positive lens) or inwards.
fn thin_lens(profile: &str, points: &[[f64; 2]], outwards: f64) -> Markup {
    let heads = match (points.first(), points.last()) {
        (Some(low), Some(high)) => {
            let along = [0, 1].map(|k| high[k] - low[k]);
            let length = along[0].hypot(along[1]).max(1e-9);
            let unit = along.map(|v| v / length);
            head(*high, unit.map(|v| outwards * v)) + &head(*low, unit.map(|v| -outwards * v))
        }
        _ => String::new(),
    };
    html! {
        path class="thin-lens" d=(profile) stroke=(INK) stroke-width="1.6" {}
        path class="thin-lens-head" d=(heads) stroke=(INK) stroke-width="1.6" {}
    }
}

/// An open head at a point, towards a direction of unit length.
fn head([x, y]: [f64; 2], [u, v]: [f64; 2]) -> String {
    let [length, half] = HEAD_PX;
    let barb = |side: f64| [x - length * u - side * half * v, y - length * v + side * half * u];
    let ([ax, ay], [bx, by]) = (barb(1.0), barb(-1.0));
    format!("M{} {}L{} {}L{} {}", px(ax), px(ay), px(x), px(y), px(bx), px(by))
}

/// Two bars on either side of the stop's opening.
pub(super) fn stop(view: &View, bars: &[[[f64; 2]; 2]; 2]) -> Markup {
    let bar = |[edge, rim]: &[[f64; 2]; 2]| {
        let ([x, y], [rx, ry]) = (view.at(*edge), view.at(*rim));
        let length = (rx - x).hypot(ry - y).max(1e-9);
        let [u, v] = [(rx - x) / length, (ry - y) / length];
        html! {
            path d=(format!("M{} {}L{} {}", px(x), px(y), px(rx), px(ry))) {}
            path stroke-width="1.6"
                d=(format!("M{} {}L{} {}", px(x - 4.0 * v), px(y + 4.0 * u), px(x + 4.0 * v), px(y - 4.0 * u))) {}
        }
    };
    html! {
        g class="stop" stroke=(INK) stroke-width="2.6" { @for side in bars { (bar(side)) } }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Extent;
    use super::*;

    fn view() -> View {
        View {
            extent: Extent { z_min_mm: -10.0, z_max_mm: 10.0, y_min_mm: -10.0, y_max_mm: 10.0 },
            px_per_mm: 10.0,
        }
    }

    fn numbers(d: &str) -> Vec<f64> {
        d.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
            .filter_map(|n| n.parse().ok())
            .collect()
    }

    fn d_of(svg: &str, class: &str) -> String {
        let tail = svg.split(&format!("class=\"{class}\" d=\"")).nth(1).unwrap();
        tail.split('"').next().unwrap().into()
    }

    #[test]
    fn a_mirror_is_hatched_where_no_light_comes_from() {
        let mirror = |back: f64| LayoutLine {
            kind: LineKind::Mirror,
            points: vec![[0.0, -5.0], [0.0, 5.0]],
            back: [back, 0.0],
        };
        for back in [1.0, -1.0] {
            let strokes = d_of(&line(&view(), &mirror(back)).into_string(), "mirror-back");
            assert_eq!(strokes.matches('M').count(), 14);
            // x, y, dx, dy of every stroke.
            assert!(numbers(&strokes).chunks(4).all(|n| n[2] * back > 3.0), "{strokes}");
        }
    }

    #[test]
    fn arrows_of_thin_lenses_point_outwards_if_they_collect() {
        let lens = |kind| LayoutLine { kind, points: vec![[0.0, -5.0], [0.0, 5.0]], back: [1.0, 0.0] };
        let barb_below_tip = |kind| {
            let n = numbers(&d_of(&line(&view(), &lens(kind)).into_string(), "thin-lens-head"));
            n[1] - n[3]
        };
        // y grows downwards on the page.
        assert!(barb_below_tip(LineKind::ConvergingLens) > 5.0);
        assert!(barb_below_tip(LineKind::DivergingLens) < -5.0);
    }
}
