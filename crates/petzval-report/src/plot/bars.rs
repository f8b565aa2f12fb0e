//! Bar charts: rows of bars from a common zero.

use maud::html;

use super::chart::{BELOW_PX, RIGHT_PX, WIDTH_PX};
use super::sheet::without_data;
use super::{Axis, Frame, Key, KeyLine, Names, Sheet, plain, px, span, width_of};
use crate::palette;
use crate::palette::INK;

/// Height of a bar, of the space between rows, and of that above the first row, px.
const BAR_PX: f64 = 6.5;
const BETWEEN_PX: f64 = 7.0;
const ABOVE_PX: f64 = 10.0;

/// Size of the names of the rows, px, and the largest share of the width that they take.
const NAME_PX: f64 = 11.5;
const WIDEST_NAMES: f64 = 0.55;

/// One row of bars.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Name.
    pub name: String,
    /// Lengths of the bars, in the unit of the axis. Negative ones extend to the left; infinite ones extend to the edge.
    pub values: Vec<f64>,
}

/// What one bar of every row stands for.
#[derive(Clone, Debug)]
pub struct BarKey {
    /// Name.
    pub name: String,
    /// Colour.
    pub colour: String,
}

impl BarKey {
    /// The bar at place `k` of every row, in one of the colours of the palette.
    pub fn nth(k: usize, name: &str) -> Self {
        Self { name: name.to_owned(), colour: palette::camera(k + 1).to_owned() }
    }
}

/// Rows of bars over one axis.
#[derive(Clone, Debug)]
pub struct BarChart {
    /// Description of the picture for readers who cannot see it.
    pub alt: String,
    /// Name of the axis, with its unit.
    pub axis: String,
    /// The bars of a row.
    pub keys: Vec<BarKey>,
    /// Rows from top to bottom.
    pub bars: Vec<Bar>,
}

/// The chart as a stand-alone SVG picture; a chart without rows says so.
pub fn bars_svg(chart: &BarChart) -> String {
    if chart.bars.is_empty() {
        return without_data(&chart.alt, WIDTH_PX).svg();
    }
    let x = axis(&chart.bars);
    let longest = chart.bars.iter().map(|b| width_of(&b.name, NAME_PX)).fold(0.0, f64::max);
    let left = (longest + 18.0).min(WIDEST_NAMES * WIDTH_PX);
    let of_row = BAR_PX * chart.keys.len() as f64;
    let row_px = of_row + BETWEEN_PX;
    let height = row_px * chart.bars.len() as f64;
    let mut y = Axis::between(0.0, 1.0, 1);
    y.ticks.clear();
    let frame = Frame { left, top: ABOVE_PX, width: WIDTH_PX - left - RIGHT_PX, height, x, y };
    let zero = frame.at([0.0, 0.0])[0];
    let bars = html! {
        @for (row, bar) in chart.bars.iter().enumerate() {
            @for (k, (value, key)) in bar.values.iter().copied().zip(&chart.keys).enumerate() {
                // A bar that is not finite ends at the edge of the frame.
                @let end = frame.at([if value.is_finite() { value } else { frame.x.high }, 0.0])[0];
                @let top = row_px * (row as f64 + 0.5) - 0.5 * of_row + BAR_PX * k as f64;
                rect class="bar" x=(px(end.min(zero))) width=(px((end - zero).abs())) y=(px(top)) height=(px(BAR_PX))
                    fill=(key.colour) {}
            }
        }
    };
    let names = html! {
        g font-size=(NAME_PX) fill=(INK) {
            @for (row, bar) in chart.bars.iter().enumerate() {
                text x="8" y=(px(ABOVE_PX + row_px * (row as f64 + 0.5) + 0.35 * NAME_PX)) { (plain(&bar.name)) }
            }
        }
    };
    let key = |key: &BarKey| Key { line: KeyLine::Fill(key.colour.clone()), name: key.name.clone() };
    Sheet {
        class: "chart",
        keys: chart.keys.iter().map(key).collect(),
        alt: chart.alt.clone(),
        width: WIDTH_PX,
        height: ABOVE_PX + height + BELOW_PX,
        body: html! { (frame.draw_around(Names { head: "", x: &chart.axis, y: "" }, bars)) (names) },
        ..Sheet::default()
    }
    .svg()
}

/// An axis that includes zero and every finite bar, with a margin at their ends.
fn axis(bars: &[Bar]) -> Axis {
    let (low, high) =
        span(bars.iter().flat_map(|b| b.values.iter().copied()).chain([0.0])).unwrap_or((0.0, 1.0));
    let high = if high > low { high } else { low + 1.0 };
    let air = 0.04 * (high - low);
    Axis::between(if low < 0.0 { low - air } else { 0.0 }, high + air, 5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_names_and_bars() {
        let bar = |name: &str, values: [f64; 2]| Bar { name: name.into(), values: values.to_vec() };
        let keys = vec![BarKey::nth(0, "at minus"), BarKey::nth(1, "at plus")];
        let colours: Vec<String> = keys.iter().map(|key| key.colour.clone()).collect();
        let chart = BarChart {
            alt: "a <test>".into(),
            axis: "change, um".into(),
            keys,
            bars: vec![bar("tilt & shift", [1.0, -0.5]), bar("lost", [f64::INFINITY, 0.0])],
        };
        let svg = bars_svg(&chart);
        assert!(svg.contains("aria-label=\"a &lt;test&gt;\"") && svg.contains("tilt &amp; shift"));
        assert!(svg.contains("change, um") && svg.contains("at minus"));
        assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("NaN") && !svg.contains("inf"));
        // Two bars a row and two in the key.
        assert_eq!(svg.matches(&colours[0]).count() + svg.matches(&colours[1]).count(), 6);
        assert_eq!(svg.matches("class=\"bar\"").count(), 4);
        assert!(bars_svg(&BarChart { bars: Vec::new(), ..chart }).contains("no data"));
    }
}
