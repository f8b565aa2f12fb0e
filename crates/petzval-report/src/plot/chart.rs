//! Charts: a few named curves over one pair of axes, with a key above them.

use super::sheet::without_data;
use super::smooth::{smoothed, thinned};
use super::{Axis, Curve, Frame, Key, Names, Pen, Sheet};

/// Width of a chart and height of the field between its axes, px.
pub(super) const WIDTH_PX: f64 = 520.0;
const FIELD_PX: f64 = 214.0;

/// Space above that field, below it (for the numbers and the name of the axis), and at its right, px.
const ABOVE_PX: f64 = 10.0;
pub(super) const BELOW_PX: f64 = 38.0;
pub(super) const RIGHT_PX: f64 = 18.0;

/// Width of a curve, and of the data behind a smoothed curve, px.
const LINE_PX: f64 = 2.2;
const DATA_PX: f64 = 1.0;

/// Opacity of the data behind a smoothed curve.
const FAINT: f64 = 0.28;

/// Least number of points of a smoothed curve.
const FEWEST_TO_SMOOTH: usize = 24;

/// A named curve.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the key; a curve without one has no entry.
    pub name: String,
    /// Colour, `#rrggbb`.
    pub colour: String,
    /// Whether the line is dashed.
    pub is_dashed: bool,
    /// Points in ascending x. A series without points is an entry of the key alone.
    pub points: Vec<(f64, f64)>,
}

/// A value of the horizontal axis that is marked by an upright line.
#[derive(Clone, Debug)]
pub struct Mark {
    /// Name in the key.
    pub name: String,
    /// Colour, `#rrggbb`.
    pub colour: String,
    /// The value.
    pub at: f64,
}

/// Curves over one pair of axes.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Description of the picture for readers who cannot see it.
    pub alt: String,
    /// Name of the horizontal axis, with its unit.
    pub x_axis: String,
    /// Name of the vertical axis, with its unit.
    pub y_axis: String,
    /// The curves.
    pub series: Vec<Series>,
    /// Marks on the horizontal axis, which extends to them.
    pub marks: Vec<Mark>,
    /// Noisy data: a thick smoothed line over the faint data.
    pub smooth: bool,
    /// What the axes span.
    pub axes: Axes,
}

/// What the axes of a chart span. The horizontal one spans the data and the marks, unless something else is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axes {
    /// The vertical one the data; it is logarithmic where they span more than a decade.
    OfData,
    /// The vertical one from zero to the data.
    #[default]
    FromZero,
    /// Both from 0 to 1, whatever the data span, so that charts can be compared by eye.
    Shares,
}

/// The chart as a stand-alone SVG picture; a chart without finite data says so.
pub fn chart_svg(chart: &Chart) -> String {
    let series: Vec<Series> = chart.series.iter().map(finite).collect();
    let points = || series.iter().flat_map(|s| s.points.iter());
    let marks: Vec<&Mark> = chart.marks.iter().filter(|mark| mark.at.is_finite()).collect();
    let across = points().map(|p| p.0).chain(marks.iter().map(|mark| mark.at));
    let Some((across, up)) = super::span(across).zip(super::span(points().map(|p| p.1))) else {
        return without_data(&chart.alt, WIDTH_PX).svg();
    };
    let (x, y) = chart.axes.over(across, up);
    let left = Frame::names_width(&y);
    let frame = Frame { left, top: ABOVE_PX, width: WIDTH_PX - left - RIGHT_PX, height: FIELD_PX, x, y };
    // On a logarithmic axis smooth the logarithms, so that the line runs through the middle of the visible points.
    let is_logarithmic = frame.y.is_logarithmic();
    let mut curves: Vec<Curve> =
        series.iter().flat_map(|s| curves(s, chart.smooth, is_logarithmic)).collect();
    curves.extend(marks.iter().map(|mark| Curve {
        pen: upright(mark),
        index: 0,
        points: [frame.y.low, frame.y.high].map(|y| Some([mark.at, y])).into(),
    }));
    // Faint data lie behind every line.
    curves.sort_by(|a, b| a.pen.opacity.total_cmp(&b.pen.opacity));
    let keys = series.iter().filter(|s| !s.name.is_empty()).map(|s| Key::pen(line(s), s.name.clone()));
    Sheet {
        class: "chart",
        keys: keys.chain(marks.iter().map(|mark| Key::pen(upright(mark), mark.name.clone()))).collect(),
        alt: chart.alt.clone(),
        width: WIDTH_PX,
        height: ABOVE_PX + FIELD_PX + BELOW_PX,
        body: frame.draw(Names { head: "", x: &chart.x_axis, y: &chart.y_axis }, &curves),
        ..Sheet::default()
    }
    .svg()
}

/// The pen of a series.
fn line(series: &Series) -> Pen {
    Pen { width: LINE_PX, is_dashed: series.is_dashed, ..Pen::thin(&series.colour) }
}

/// The pen of a mark.
fn upright(mark: &Mark) -> Pen {
    Pen::thin(&mark.colour).dashed()
}

/// The line of a series; noisy data lie faintly behind their smoothed line.
fn curves(series: &Series, smooth: bool, is_logarithmic: bool) -> Vec<Curve> {
    let curve = |pen: Pen, points: &[(f64, f64)]| Curve {
        pen,
        index: 0,
        points: thinned(points).into_iter().map(|(x, y)| Some([x, y])).collect(),
    };
    if !smooth || series.points.len() < FEWEST_TO_SMOOTH {
        return vec![curve(line(series), &series.points)];
    }
    let through = if is_logarithmic {
        let logarithms: Vec<_> = series.points.iter().map(|(x, y)| (*x, y.ln())).collect();
        smoothed(&logarithms).into_iter().map(|(x, y)| (x, y.exp())).collect()
    } else {
        smoothed(&series.points)
    };
    let faint = Pen { width: DATA_PX, opacity: FAINT, ..line(series) };
    vec![curve(faint, &series.points), curve(line(series), &through)]
}

/// A series without the points that are outside of an axis.
fn finite(series: &Series) -> Series {
    let is_finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    Series { points: series.points.iter().filter(is_finite).copied().collect(), ..series.clone() }
}

impl Axes {
    /// The horizontal and the vertical axis over data from the lowest to the highest.
    fn over(self, across: (f64, f64), (low, high): (f64, f64)) -> (Axis, Axis) {
        let x = Axis::between(across.0, if across.1 > across.0 { across.1 } else { across.0 + 1.0 }, 6);
        match self {
            Self::Shares => (Axis::between(0.0, 1.0, 6), Axis::between(0.0, 1.0, 5)),
            Self::FromZero => (x, Axis::between(low.min(0.0), if high > 0.0 { 1.08 * high } else { 1.0 }, 5)),
            Self::OfData if low > 0.0 && high > 10.0 * low => {
                let air = (high / low).powf(0.06);
                (x, Axis::ratios(low / air, high * air))
            }
            Self::OfData => {
                let air = if high > low { 0.06 * (high - low) } else { 0.5 * high.abs().max(1e-3) };
                (x, Axis::between(low - air, high + air, 5))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        Chart {
            alt: "a <test>".into(),
            x_axis: "step".into(),
            y_axis: "loss & co".into(),
            series: vec![Series {
                name: "nominal <b>".into(),
                colour: "#0072b2".into(),
                points,
                ..Series::default()
            }],
            marks: Vec::new(),
            smooth: true,
            axes: Axes::OfData,
        }
    }

    #[test]
    fn names_are_escaped_and_axes_named() {
        let svg = chart_svg(&chart((0..100).map(|i| (f64::from(i), 1.0 + f64::from(i))).collect()));
        assert!(svg.contains("aria-label=\"a &lt;test&gt;\""));
        assert!(svg.contains("nominal &lt;b&gt;") && svg.contains("loss &amp; co") && svg.contains("step"));
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        // The key, the data and the smoothed line.
        assert_eq!(svg.matches("#0072b2").count(), 3);
        assert_eq!(svg.matches("class=\"curve\"").count(), 2);
    }

    #[test]
    fn a_decade_makes_the_axis_logarithmic() {
        let is_logarithmic = |axes: Axes, values| axes.over((0.0, 1.0), values).1.is_logarithmic();
        assert!(!is_logarithmic(Axes::OfData, (1.0, 9.0)) && is_logarithmic(Axes::OfData, (1.0, 11.0)));
        assert!(!is_logarithmic(Axes::OfData, (0.0, 11.0)) && !is_logarithmic(Axes::FromZero, (1.0, 11.0)));
    }

    #[test]
    fn axes_of_shares_do_not_depend_on_the_data() {
        let ends = |axes: Axes| {
            let (x, y) = axes.over((0.3, 0.8), (0.4, 0.9));
            [x.low, x.high, y.low, y.high]
        };
        assert_eq!(ends(Axes::Shares), [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(ends(Axes::FromZero)[..2], [0.3, 0.8]);
        assert_eq!(ends(Axes::FromZero)[2], 0.0);
    }

    #[test]
    fn few_points_are_not_smoothed() {
        let svg = chart_svg(&chart(vec![(0.0, 1.0), (1.0, 2.0)]));
        assert_eq!(svg.matches("class=\"curve\"").count(), 1);
    }

    #[test]
    fn marks_widen_the_axis_and_a_curve_without_a_name_has_no_entry() {
        let mut chart = chart(vec![(0.0, 1.0), (10.0, 2.0)]);
        let entry = |name: &str| Series { name: name.into(), colour: "#22272e".into(), ..Series::default() };
        chart.series.extend([Series { name: String::new(), ..chart.series[0].clone() }, entry("sagittal")]);
        chart.marks.push(Mark { name: "limit".into(), colour: "#5f6670".into(), at: 20.0 });
        let svg = chart_svg(&chart);
        // Three curves, one of them empty, and the mark; names of two curves and of the mark.
        assert_eq!(svg.matches("class=\"curve\"").count(), 4);
        let key = svg.split("class=\"key\"").nth(1).unwrap().split("</g>").next().unwrap();
        assert_eq!(key.matches("<text").count(), 3, "{key}");
        // The mark stands at the right end of its axis.
        let curves = svg.split("class=\"curve\" d=\"").skip(1);
        let is_mark = |curve: &&str| curve.split('"').nth(2) == Some("#5f6670");
        let mark = curves.filter(is_mark).last().unwrap();
        let right = svg.split("class=\"field\" width=\"").nth(1).unwrap().split('"').next().unwrap();
        assert!(mark.starts_with(&format!("M{right} ")), "{mark}");
    }

    #[test]
    fn a_chart_without_data_says_so() {
        let svg = chart_svg(&chart(vec![(0.0, f64::NAN)]));
        assert!(svg.contains("no data") && svg.contains("a &lt;test&gt;"));
    }
}
