//! Charts: curves over steps or fields as SVG on a white card.

mod axis;
mod bars;
mod curve;

pub use bars::{Bar, BarChart, bars_svg};

use axis::{Axis, Scale};
use curve::{smoothed, thinned};
use plotters::prelude::*;

use super::palette;

/// Size of a chart, px, and how much finer than that the grid of its coordinates is.
const WIDTH_PX: u32 = 520;
const HEIGHT_PX: u32 = 300;
const FINENESS: u32 = 4;

/// A curve with fewer points than this is shown as it is, without smoothing.
const FEWEST_TO_SMOOTH: usize = 24;

/// A named curve.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the key.
    pub name: String,
    /// Colour, `#rrggbb`.
    pub colour: String,
    /// Points in ascending x.
    pub points: Vec<(f64, f64)>,
}

/// Curves over one pair of axes.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What the picture shows, for those who cannot see it.
    pub alt: String,
    /// Name of the horizontal axis, with its unit.
    pub x_axis: String,
    /// Name of the vertical axis, with its unit.
    pub y_axis: String,
    /// The curves.
    pub series: Vec<Series>,
    /// Noisy data: a thick smoothed line over the faint data.
    pub smooth: bool,
    /// Whether the vertical axis begins at zero. Otherwise it spans the data, and is logarithmic where
    /// they span more than a decade.
    pub from_zero: bool,
}

/// The chart as a stand-alone SVG picture; a chart without finite data says so.
pub fn chart_svg(chart: &Chart) -> String {
    let mut svg = String::new();
    {
        let size = (WIDTH_PX * FINENESS, HEIGHT_PX * FINENESS);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        // Drawing into a string cannot fail, and a chart that could not be drawn stays empty.
        let _ = draw(&root, chart);
        let _ = root.present();
    }
    stand_alone(&svg, &chart.alt, HEIGHT_PX)
}

/// A drawn picture with a description, and sharp text in the page's own font.
fn stand_alone(svg: &str, alt: &str, height_px: u32) -> String {
    let body = svg.split_once('>').map_or("", |(_, body)| body);
    let alt = maud::html! { (alt) }.into_string();
    let (w, h) = (WIDTH_PX * FINENESS, height_px * FINENESS);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" role=\"img\" aria-label=\"{alt}\" \
         viewBox=\"0 0 {w} {h}\" width=\"{WIDTH_PX}\" stroke-linejoin=\"round\" \
         stroke-linecap=\"round\">{body}"
    )
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// Text of so many px in a colour.
fn text(px: u32, colour: RGBColor) -> TextStyle<'static> {
    // The drawing library counts the height of a line, 1.24 times the size of its characters.
    let line = 1.24 * f64::from(px * FINENESS);
    ("system-ui, sans-serif", line).into_font().color(&colour)
}

const INK: RGBColor = RGBColor(34, 39, 46);
const MUTED: RGBColor = RGBColor(95, 102, 112);
const GRID: RGBColor = RGBColor(228, 231, 235);

fn draw(root: &Area, chart: &Chart) -> DrawResult {
    root.fill(&WHITE)?;
    let f = FINENESS as i32;
    let series: Vec<Series> = chart.series.iter().map(finite).collect();
    let all = || series.iter().flat_map(|s| s.points.iter().copied());
    let Some(((x_low, x_high), values)) = span(all().map(|p| p.0)).zip(span(all().map(|p| p.1))) else {
        root.draw(&Text::new("no data", (20 * f, 20 * f), text(13, MUTED)))?;
        return Ok(());
    };
    // Place the key in a row of its own above the curves.
    key(root, &series)?;
    let scale = scale_for(chart, values);
    let x_axis = Axis::new(Scale::Linear, (x_low, if x_high > x_low { x_high } else { x_low + 1.0 }), 6);
    let y_axis = Axis::new(scale, y_range(chart, scale, values), 5);
    let y_labels = (34 + 7 * y_axis.widest_label() as u32) * FINENESS;
    let mut canvas = ChartBuilder::on(root)
        .margin_top(36 * FINENESS)
        .margin_right(16 * FINENESS)
        .margin_bottom(6 * FINENESS)
        .margin_left(6 * FINENESS)
        .x_label_area_size(42 * FINENESS)
        .y_label_area_size(y_labels)
        .build_cartesian_2d(x_axis, y_axis)?;
    canvas
        .configure_mesh()
        .x_desc(chart.x_axis.as_str())
        .y_desc(chart.y_axis.as_str())
        .axis_desc_style(text(12, INK))
        .label_style(text(11, MUTED))
        .bold_line_style(GRID.stroke_width(FINENESS))
        .light_line_style(TRANSPARENT)
        .axis_style(RGBColor(150, 157, 166).stroke_width(FINENESS))
        .set_all_tick_mark_size(3 * FINENESS)
        .draw()?;

    // Draw the data, faint where a smoothed line lies over them.
    for s in &series {
        let [r, g, b] = palette::rgb(&s.colour);
        let colour = RGBColor(r, g, b);
        let on_axis: Vec<(f64, f64)> = s.points.iter().map(|(x, y)| (*x, scale.to_axis(*y))).collect();
        let smooths = chart.smooth && on_axis.len() >= FEWEST_TO_SMOOTH;
        if smooths {
            let faint = colour.mix(0.28).stroke_width(FINENESS);
            canvas.draw_series(LineSeries::new(thinned(&on_axis), faint))?;
        }
        let line = if smooths { smoothed(&on_axis) } else { on_axis };
        canvas.draw_series(LineSeries::new(thinned(&line), colour.stroke_width(9 * FINENESS / 4)))?;
    }
    Ok(())
}

/// Names of the curves from left to right, each with a piece of its line.
fn key(root: &Area, series: &[Series]) -> DrawResult {
    let f = FINENESS as i32;
    let mut x = 14 * f;
    for s in series {
        let [r, g, b] = palette::rgb(&s.colour);
        let line = RGBColor(r, g, b).stroke_width(3 * FINENESS);
        root.draw(&PathElement::new([(x, 18 * f), (x + 18 * f, 18 * f)], line))?;
        root.draw(&Text::new(s.name.clone(), (x + 24 * f, 12 * f), text(12, INK)))?;
        x += (24 + 24) * f + (6.6 * s.name.chars().count() as f64) as i32 * f;
    }
    Ok(())
}

/// A series without the points that have no place on an axis.
fn finite(series: &Series) -> Series {
    let is_finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    Series { points: series.points.iter().filter(is_finite).copied().collect(), ..series.clone() }
}

fn span(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
    })
}

fn scale_for(chart: &Chart, (low, high): (f64, f64)) -> Scale {
    if !chart.from_zero && low > 0.0 && high > 10.0 * low { Scale::Logarithmic } else { Scale::Linear }
}

/// The range of the vertical axis in its own scale, with a little air around the data.
fn y_range(chart: &Chart, scale: Scale, (low, high): (f64, f64)) -> (f64, f64) {
    let (low, high) = (scale.to_axis(low), scale.to_axis(high));
    if chart.from_zero {
        return (low.min(0.0), if high > 0.0 { 1.08 * high } else { 1.0 });
    }
    let air = if high > low { 0.06 * (high - low) } else { 0.5 * high.abs().max(1e-3) };
    (low - air, high + air)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        Chart {
            alt: "a <test>".into(),
            x_axis: "step".into(),
            y_axis: "loss & co".into(),
            series: vec![Series { name: "nominal <b>".into(), colour: "#0072b2".into(), points }],
            smooth: true,
            from_zero: false,
        }
    }

    #[test]
    fn names_are_escaped_and_axes_named() {
        let svg = chart_svg(&chart((0..100).map(|i| (f64::from(i), 1.0 + f64::from(i))).collect()));
        assert!(svg.contains("aria-label=\"a &lt;test&gt;\""));
        assert!(svg.contains("nominal &lt;b&gt;") && svg.contains("loss &amp; co") && svg.contains("step"));
        assert!(svg.trim_end().ends_with("</svg>"));
        // Raw and smoothed.
        assert_eq!(svg.matches("#0072B2").count(), 3);
    }

    #[test]
    fn a_decade_makes_the_axis_logarithmic() {
        let c = chart(Vec::new());
        assert_eq!(scale_for(&c, (1.0, 9.0)), Scale::Linear);
        assert_eq!(scale_for(&c, (1.0, 11.0)), Scale::Logarithmic);
        assert_eq!(scale_for(&c, (0.0, 11.0)), Scale::Linear);
    }

    #[test]
    fn a_chart_without_data_says_so() {
        assert!(chart_svg(&chart(vec![(0.0, f64::NAN)])).contains("no data"));
    }
}
