//! Frames: a pair of axes on a sheet, with its curves.

use maud::{Markup, html};

use super::{Axis, Curve, px};
use crate::palette::{AXIS, GRID, INK, MUTED, PAPER};

/// Size of the numbers at ticks and of the names of axes, px.
const NUMBER_PX: f64 = 12.0;
const NAME_PX: f64 = 12.5;

/// Radius of a marker on a curve, px.
const MARKER_PX: f64 = 3.1;

/// Markers on a curve.
const MARKERS: usize = 6;

/// A pair of axes.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// Left and upper edge on the sheet, px.
    pub left: f64,
    pub top: f64,
    /// Size of the field between the axes, px.
    pub width: f64,
    pub height: f64,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
}

/// Texts of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Names<'a> {
    /// Above the frame.
    pub head: &'a str,
    /// Below, with its unit.
    pub x: &'a str,
    /// To the left, with its unit.
    pub y: &'a str,
}

impl Frame {
    /// A point in px from the frame's own upper left corner.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.width * self.x.share(x), self.height * (1.0 - self.y.share(y))]
    }

    /// Space that the numbers of the vertical axis take to its left, px.
    pub fn number_width(axis: &Axis) -> f64 {
        super::width_of("0", NUMBER_PX) * axis.widest_label() as f64 + 10.0
    }

    /// Space that the numbers and the name of the vertical axis take to its left, px.
    pub fn names_width(axis: &Axis) -> f64 {
        Self::number_width(axis) + 30.0
    }

    /// The frame with a grid, numbers and names, and curves that end at its edges.
    pub fn draw(&self, names: Names, curves: &[Curve]) -> Markup {
        let lines = html! { @for curve in curves { (self.curve(curve)) } };
        self.draw_around(names, lines)
    }

    /// The frame around any content, which is cut at its edges.
    pub fn draw_around(&self, names: Names, content: Markup) -> Markup {
        html! {
            g transform=(format!("translate({} {})", px(self.left), px(self.top))) {
                (self.grid())
                // An inner svg element clips its content, without the ids that clip paths need.
                svg class="field" width=(px(self.width)) height=(px(self.height)) { (content) }
                (self.scale())
                (self.names(names))
            }
        }
    }

    fn grid(&self) -> Markup {
        let mut lines = String::new();
        let mut zeros = String::new();
        for x in &self.x.ticks {
            let line = format!("M{} 0V{}", px(self.at([*x, 0.0])[0]), px(self.height));
            if is_zero(*x, &self.x) { &mut zeros } else { &mut lines }.push_str(&line);
        }
        for y in &self.y.ticks {
            let line = format!("M0 {}H{}", px(self.at([0.0, *y])[1]), px(self.width));
            if is_zero(*y, &self.y) { &mut zeros } else { &mut lines }.push_str(&line);
        }
        html! {
            path d=(lines) stroke=(GRID) {}
            path d=(zeros) stroke=(AXIS) stroke-width="0.9" {}
        }
    }

    fn scale(&self) -> Markup {
        html! {
            rect width=(px(self.width)) height=(px(self.height)) stroke=(AXIS) {}
            g fill=(MUTED) font-size=(NUMBER_PX) {
                @for x in &self.x.ticks {
                    text x=(px(self.at([*x, 0.0])[0])) y=(px(self.height + 16.0)) text-anchor="middle" {
                        (self.x.label(*x))
                    }
                }
                @for y in &self.y.ticks {
                    text x="-6" y=(px(self.at([0.0, *y])[1] + 0.35 * NUMBER_PX)) text-anchor="end" {
                        (self.y.label(*y))
                    }
                }
            }
        }
    }

    fn names(&self, names: Names) -> Markup {
        let (middle, left) = (0.5 * self.height, -Self::number_width(&self.y) - 8.0);
        html! {
            g fill=(INK) font-size=(NAME_PX) text-anchor="middle" {
                @if !names.head.is_empty() {
                    text x=(px(0.5 * self.width)) y="-9" font-weight="600" { (names.head) }
                }
                @if !names.x.is_empty() { text x=(px(0.5 * self.width)) y=(px(self.height + 35.0)) { (names.x) } }
                @if !names.y.is_empty() {
                    text transform=(format!("translate({} {}) rotate(-90)", px(left), px(middle))) { (names.y) }
                }
            }
        }
    }

    /// A curve with its markers.
    pub fn curve(&self, curve: &Curve) -> Markup {
        let pen = &curve.pen;
        let mut path = String::new();
        let mut is_down = false;
        for point in &curve.points {
            if let Some(point) = point {
                let [x, y] = self.at(*point);
                path += &format!("{}{} {}", if is_down { 'L' } else { 'M' }, px(x), px(y));
            }
            is_down = point.is_some();
        }
        let markers = pen.marker.map(|m| (m, m.path(self.marked(curve), MARKER_PX)));
        html! {
            path class="curve" d=(path) stroke=(pen.colour) stroke-width=(px(pen.width))
                stroke-opacity=[(pen.opacity < 1.0).then_some(pen.opacity)] stroke-dasharray=[pen.dashes()] {}
            @if let Some((marker, path)) = markers {
                @if marker.is_open() {
                    path class="markers" d=(path) stroke=(pen.colour) stroke-width="1.7" {}
                } @else {
                    path class="markers" d=(path) fill=(pen.colour) stroke=(PAPER) stroke-width="0.7" {}
                }
            }
        }
    }

    /// A bar from zero to a value, px from the left edge of the frame.
    pub fn column(&self, left: f64, width: f64, value: f64, colour: &str) -> Markup {
        let [zero, end] = [0.0, value].map(|v| self.at([0.0, v])[1]);
        html! {
            rect class="bar" x=(px(left)) width=(px(width)) y=(px(end.min(zero))) height=(px((end - zero).abs()))
                fill=(colour) {}
        }
    }

    /// Indices of the points with markers: spread over the curve, and different for each curve.
    fn marked(&self, curve: &Curve) -> Vec<[f64; 2]> {
        let points: Vec<[f64; 2]> = curve.points.iter().flatten().map(|p| self.at(*p)).collect();
        let step = points.len().div_ceil(MARKERS).max(1);
        // Offsets by the golden ratio separate the markers of the first few curves for any step.
        let first = (0.618_034 * (curve.index as f64 + 0.4)).fract() * step as f64;
        points.into_iter().skip(first as usize).step_by(step).collect()
    }
}

fn is_zero(tick: f64, axis: &Axis) -> bool {
    tick.abs() < 1e-9 * (axis.high - axis.low)
}

#[cfg(test)]
mod tests {
    use super::super::{Marker, Pen};
    use super::*;

    fn frame() -> Frame {
        Frame {
            left: 50.0,
            top: 20.0,
            width: 200.0,
            height: 100.0,
            x: Axis::between(0.0, 10.0, 5),
            y: Axis::between(0.0, 1.0, 5),
        }
    }

    #[test]
    fn values_are_drawn_at_their_positions_on_the_axes() {
        assert_eq!(frame().at([0.0, 1.0]), [0.0, 0.0]);
        assert_eq!(frame().at([5.0, 0.25]), [100.0, 75.0]);
    }

    #[test]
    fn a_missing_point_breaks_the_line() {
        let x = [0.0, 1.0, 2.0, 3.0];
        let curve = Curve::over(Pen::thin("#000000"), 0, &x, [Some(0.0), None, Some(1.0), Some(f64::NAN)]);
        let svg = frame().curve(&curve).into_string();
        assert_eq!(svg.matches('M').count(), 2, "{svg}");
        assert!(!svg.contains('L'));
    }

    #[test]
    fn dashes_and_markers_show() {
        let x: Vec<f64> = (0..=50).map(|i| 0.2 * f64::from(i)).collect();
        let pen = Pen::marked("#0072b2", Marker::Square);
        let curve = Curve::over(pen.clone().dashed(), 1, &x, x.iter().map(|x| Some(0.1 * x)));
        let svg = frame().draw(Names { head: "a & b", x: "x, mm", y: "y, um" }, &[curve]).into_string();
        assert!(svg.contains("stroke-dasharray=\"6 4\"") && svg.contains("a &amp; b"));
        let markers = svg.split("class=\"markers\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        assert!((5..=6).contains(&markers.matches('z').count()));
        assert_eq!(pen.unmarked().marker, None);
    }
}
