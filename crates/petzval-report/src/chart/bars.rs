//! Bars from a common zero: what each of many things does, the greatest at the top.

use plotters::prelude::*;

use super::{DrawResult, FINENESS, GRID, INK, MUTED, WIDTH_PX, stand_alone, text};
use crate::number;

/// Height of a row, of what is above the first and of what is below the last, px.
const ROW_PX: i32 = 19;
const HEAD_PX: i32 = 34;
const FOOT_PX: i32 = 44;

/// Width of a character of a name, px.
const CHARACTER_PX: f64 = 5.9;

/// One row with a pair of bars.
#[derive(Clone, Debug)]
pub struct Bar {
    /// What it is about.
    pub name: String,
    /// Lengths of the bars, in the unit of the axis; negative ones go to the left, and what is not finite fills the row.
    pub values: [f64; 2],
}

/// Rows of bars over one axis.
#[derive(Clone, Debug)]
pub struct BarChart {
    /// What the picture shows, for those who cannot see it.
    pub alt: String,
    /// Name of the axis, with its unit.
    pub axis: String,
    /// What the two bars of a row are.
    pub names: [String; 2],
    /// Rows from top to bottom.
    pub bars: Vec<Bar>,
}

/// Colours of the two bars of a row.
const COLOURS: [RGBColor; 2] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0)];

/// The chart as a stand-alone SVG picture; a chart without rows says so.
pub fn bars_svg(chart: &BarChart) -> String {
    let height_px = (HEAD_PX + FOOT_PX + ROW_PX * chart.bars.len().max(1) as i32) as u32;
    let mut svg = String::new();
    {
        let size = (WIDTH_PX * FINENESS, height_px * FINENESS);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        // Drawing into a string cannot fail, and a chart that could not be drawn stays empty.
        let _ = draw(&root, chart, height_px as i32);
        let _ = root.present();
    }
    stand_alone(&svg, &chart.alt, height_px)
}

fn draw(root: &super::Area, chart: &BarChart, height_px: i32) -> DrawResult {
    let f = FINENESS as i32;
    root.fill(&WHITE)?;
    if chart.bars.is_empty() {
        root.draw(&Text::new("no data", (20 * f, 20 * f), text(13, MUTED)))?;
        return Ok(());
    }
    let longest = chart.bars.iter().map(|b| b.name.chars().count()).max().unwrap_or(0);
    let left = (14.0 + CHARACTER_PX * longest as f64).min(0.55 * f64::from(WIDTH_PX));
    let right = f64::from(WIDTH_PX) - 16.0;
    let finite = || chart.bars.iter().flat_map(|b| b.values).filter(|v| v.is_finite());
    let (low, high) = (finite().fold(0.0, f64::min), finite().fold(0.0, f64::max));
    let high = if high > low { high } else { low + 1.0 };
    let air = 0.04 * (high - low);
    let (low, high) = (if low < 0.0 { low - air } else { 0.0 }, high + air);
    let place = |value: f64| ((left + (right - left) * (value - low) / (high - low)) * f64::from(f)) as i32;
    let (top, bottom) = (HEAD_PX * f, (height_px - FOOT_PX) * f);

    // Name the two bars above, and lay the grid below them.
    let mut x = (left as i32) * f;
    for (name, colour) in chart.names.iter().zip(COLOURS) {
        root.draw(&Rectangle::new([(x, 13 * f), (x + 14 * f, 23 * f)], colour.filled()))?;
        root.draw(&Text::new(name.clone(), (x + 20 * f, 12 * f), text(12, INK)))?;
        x += (44 + (6.6 * name.chars().count() as f64) as i32) * f;
    }
    let ticks = number::ticks(low, high, 5);
    let step = ticks.get(1).zip(ticks.first()).map_or(1.0, |(b, a)| b - a);
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    for tick in ticks {
        let at = place(tick);
        let colour = if tick.abs() < 1e-9 * step { MUTED } else { GRID };
        root.draw(&PathElement::new([(at, top), (at, bottom)], colour.stroke_width(FINENESS)))?;
        let label = number::fixed(tick, decimals);
        let half = (3.2 * label.chars().count() as f64) as i32 * f;
        root.draw(&Text::new(label, (at - half, bottom + 4 * f), text(11, MUTED)))?;
    }
    let middle = (0.5 * (left + right) - 3.1 * chart.axis.chars().count() as f64) as i32;
    root.draw(&Text::new(chart.axis.clone(), (middle * f, bottom + 22 * f), text(12, INK)))?;

    for (row, bar) in chart.bars.iter().enumerate() {
        let y = top + row as i32 * ROW_PX * f;
        root.draw(&Text::new(bar.name.clone(), (8 * f, y + 3 * f), text(11, INK)))?;
        for (k, (value, colour)) in bar.values.into_iter().zip(COLOURS).enumerate() {
            let end = if value.is_finite() { value } else { high };
            let (from, to) = (place(end.min(0.0)), place(end.max(0.0)));
            let upper = y + (3 + 7 * k as i32) * f;
            root.draw(&Rectangle::new([(from, upper), (to, upper + 6 * f)], colour.filled()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_names_and_bars() {
        let bar = |name: &str, values| Bar { name: name.into(), values };
        let chart = BarChart {
            alt: "a <test>".into(),
            axis: "change, um".into(),
            names: ["at minus".into(), "at plus".into()],
            bars: vec![bar("tilt & shift", [1.0, -0.5]), bar("lost", [f64::INFINITY, 0.0])],
        };
        let svg = bars_svg(&chart);
        assert!(svg.contains("aria-label=\"a &lt;test&gt;\"") && svg.contains("tilt &amp; shift"));
        assert!(svg.contains("change, um") && svg.contains("at minus"));
        assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("NaN") && !svg.contains("inf"));
        // Two bars a row and two in the key.
        assert_eq!(svg.matches("#0072B2").count() + svg.matches("#D55E00").count(), 6);
        assert!(bars_svg(&BarChart { bars: Vec::new(), ..chart }).contains("no data"));
    }
}
