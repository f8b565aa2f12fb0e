//! Panels: frames with measured points, models and step-shaped histograms, one or several on a sheet.

use maud::{Markup, html};

use super::{Axis, Curve, Frame, Names, Points, Steps, px};
use crate::palette::{MUTED, PAPER};

/// Space right of a frame, and between its lower edge and the next head, px.
const RIGHT_PX: f64 = 22.0;
const BELOW_PX: f64 = 76.0;
/// Space above a frame without and with a head, px.
const ABOVE_PX: [f64; 2] = [14.0, 30.0];

/// A pair of axes with its content.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
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
    /// Whether it is the left corner.
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

    fn draw(&self, left: f64, top: f64, width: f64, height: f64) -> Markup {
        let (x, y) = (self.x.clone(), self.y.clone());
        let frame = Frame { left, top, width, height, x, y };
        let (at, anchor) = if self.notes_left { (8.0, "start") } else { (width - 8.0, "end") };
        let content = html! {
            @for steps in &self.steps { (steps.draw(&frame)) }
            @for curve in &self.curves { (frame.curve(curve)) }
            @for points in &self.points { (points.draw(&frame)) }
            @for (i, note) in self.notes.iter().enumerate() {
                text x=(px(at)) y=(px(17.0 + 15.0 * i as f64)) text-anchor=(anchor) font-size="11.5" fill=(MUTED)
                    stroke=(PAPER) stroke-width="3" paint-order="stroke" { (note) }
            }
        };
        frame.draw_around(Names { head: &self.head, x: &self.x_name, y: &self.y_name }, content)
    }
}

/// Panels in rows of a number of panels, on a given width; also returns the height, px. Frames of a column have a
/// common left edge.
pub(crate) fn grid(panels: &[Panel], columns: usize, width: f64, frame_height: f64) -> (Markup, f64) {
    let columns = columns.max(1).min(panels.len().max(1));
    let cell = width / columns as f64;
    let has_heads = panels.iter().any(|panel| !panel.head.is_empty());
    let above = ABOVE_PX[usize::from(has_heads)];
    let rows = panels.len().div_ceil(columns);
    let left_of = |column: usize| {
        panels.iter().skip(column).step_by(columns).map(|p| Frame::names_width(&p.y)).fold(0.0, f64::max)
    };
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
