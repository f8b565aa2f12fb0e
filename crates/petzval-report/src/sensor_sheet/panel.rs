//! Panels: frames with measured points, models and step-shaped histograms, one or several on a sheet.

use maud::{Markup, html};

use crate::plot::{Axis, Curve, Frame, Marker, Names, px};

/// Space right of a frame, and between its lower edge and the next head, px.
const RIGHT_PX: f64 = 22.0;
const BELOW_PX: f64 = 76.0;
/// Space above a frame without and with a head, px.
const ABOVE_PX: [f64; 2] = [14.0, 30.0];
/// Radius of a measured point, px, and that of points so close that they would hide each other.
const POINT_PX: f64 = 3.4;
const CROWDED_PX: f64 = 2.6;

/// Measured points.
#[derive(Clone, Debug)]
pub(super) struct Points {
    pub colour: String,
    pub marker: Marker,
    /// Whether they are drawn hollow: measured, but not part of the fit.
    pub is_hollow: bool,
    /// (x, y, standard error of y); errors are drawn where they are larger than the marker.
    pub at: Vec<(f64, f64, f64)>,
}

/// Bars from the lower edge of the frame without lines between them, as a histogram.
#[derive(Clone, Debug)]
pub(super) struct Steps {
    pub colour: String,
    /// Left edge of each bar, and the right edge of the last.
    pub edges: Vec<f64>,
    pub heights: Vec<f64>,
}

/// A pair of axes with everything in it.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub head: String,
    pub x_name: String,
    pub y_name: String,
    pub x: Axis,
    pub y: Axis,
    pub steps: Vec<Steps>,
    pub curves: Vec<Curve>,
    pub points: Vec<Points>,
    /// Lines of text in an upper corner.
    pub notes: Vec<String>,
    /// Whether that is the left one.
    pub notes_left: bool,
}

impl Panel {
    /// An empty panel.
    pub fn new(head: impl Into<String>, [x_name, y_name]: [&str; 2], x: Axis, y: Axis) -> Self {
        Self {
            head: head.into(),
            x_name: x_name.into(),
            y_name: y_name.into(),
            x,
            y,
            steps: Vec::new(),
            curves: Vec::new(),
            points: Vec::new(),
            notes: Vec::new(),
            notes_left: false,
        }
    }

    fn left_px(&self) -> f64 {
        Frame::number_width(&self.y) + 30.0
    }

    fn draw(&self, left: f64, top: f64, width: f64, height: f64) -> Markup {
        let (x, y) = (self.x.clone(), self.y.clone());
        let frame = Frame { left, top, width, height, x, y };
        let (at, anchor) = if self.notes_left { (8.0, "start") } else { (width - 8.0, "end") };
        let content = html! {
            @for steps in &self.steps { (steps.draw(&frame)) }
            @for curve in &self.curves { (frame.curve(curve)) }
            @for points in &self.points { (points.draw(&frame)) }
            @for (i, note) in self.notes.iter().enumerate() {
                text x=(px(at)) y=(px(17.0 + 15.0 * i as f64)) text-anchor=(anchor) font-size="11.5" fill="#5f6670"
                    stroke="#ffffff" stroke-width="3" paint-order="stroke" { (note) }
            }
        };
        frame.draw_around(Names { head: &self.head, x: &self.x_name, y: &self.y_name }, content)
    }
}

impl Points {
    fn draw(&self, frame: &Frame) -> Markup {
        let place = |&(x, y, _): &(f64, f64, f64)| frame.at([x, y]);
        let finite = |(x, y, _): &&(f64, f64, f64)| x.is_finite() && y.is_finite();
        let places: Vec<[f64; 2]> = self.at.iter().filter(finite).map(place).collect();
        let close =
            |pair: &&[[f64; 2]]| (pair[0][0] - pair[1][0]).hypot(pair[0][1] - pair[1][1]) < 2.0 * POINT_PX;
        // Their white rims would cover them.
        let is_crowded = places.windows(2).filter(close).count() > 2;
        let radius = if is_crowded { CROWDED_PX } else { POINT_PX };
        let shapes = self.marker.path(places, radius);
        let mut bars = String::new();
        for &(x, y, se) in self.at.iter().filter(finite) {
            let ([at, low], [_, high]) = (frame.at([x, y - se]), frame.at([x, y + se]));
            if se > 0.0 && low - high > 2.0 * radius {
                bars += &format!("M{} {}V{}", px(at), px(low), px(high));
            }
        }
        html! {
            @if !bars.is_empty() { path d=(bars) stroke=(self.colour) stroke-width="1.1" {} }
            @if self.is_hollow || self.marker.is_open() {
                path class="points" d=(shapes) stroke=(self.colour) stroke-width="1.3" fill="#ffffff" {}
            } @else {
                path class="points" d=(shapes) fill=(self.colour) stroke="#ffffff" stroke-width=(if is_crowded { "0" } else { "0.7" }) {}
            }
        }
    }
}

impl Steps {
    fn draw(&self, frame: &Frame) -> Markup {
        let mut path = String::new();
        for (i, height) in self.heights.iter().enumerate().take(self.edges.len().saturating_sub(1)) {
            let ([left, y], [right, _]) =
                (frame.at([self.edges[i], *height]), frame.at([self.edges[i + 1], 0.0]));
            // What is below a logarithmic axis goes to its foot.
            let y = y.min(frame.height + 2.0);
            path += &match i {
                0 => format!("M{} {}V{}H{}", px(left), px(frame.height + 2.0), px(y), px(right)),
                _ => format!("V{}H{}", px(y), px(right)),
            };
        }
        if !path.is_empty() {
            path += &format!("V{}z", px(frame.height + 2.0));
        }
        html! { path class="steps" d=(path) fill=(self.colour) fill-opacity="0.22" stroke=(self.colour) stroke-width="0.8" {} }
    }
}

/// Panels in rows of so many, on a width; returns the height too, px. Frames of a column have one left edge.
pub(super) fn grid(panels: &[Panel], columns: usize, width: f64, frame_height: f64) -> (Markup, f64) {
    let columns = columns.max(1).min(panels.len().max(1));
    let cell = width / columns as f64;
    let has_heads = panels.iter().any(|panel| !panel.head.is_empty());
    let above = ABOVE_PX[usize::from(has_heads)];
    let rows = panels.len().div_ceil(columns);
    let left_of =
        |column: usize| panels.iter().skip(column).step_by(columns).map(Panel::left_px).fold(0.0, f64::max);
    let row_height = above + frame_height + BELOW_PX - above.min(16.0);
    let body = html! {
        @for (i, panel) in panels.iter().enumerate() {
            @let (row, column) = (i / columns, i % columns);
            @let left = left_of(column);
            (panel.draw(
                cell * column as f64 + left,
                row_height * row as f64 + above,
                cell - left - RIGHT_PX,
                frame_height,
            ))
        }
    };
    (body, row_height * rows as f64)
}
