//! Steps: histograms.

use maud::{Markup, html};

use super::{Frame, px};

/// Bars from the lower edge of the frame without lines between them, as a histogram.
#[derive(Clone, Debug)]
pub(crate) struct Steps {
    pub colour: String,
    /// Left edge of each bar, and the right edge of the last.
    pub edges: Vec<f64>,
    pub heights: Vec<f64>,
}

impl Steps {
    /// The bars in a frame.
    pub fn draw(&self, frame: &Frame) -> Markup {
        let mut path = String::new();
        for (i, height) in self.heights.iter().enumerate().take(self.edges.len().saturating_sub(1)) {
            let ([left, y], [right, _]) =
                (frame.at([self.edges[i], *height]), frame.at([self.edges[i + 1], 0.0]));
            // Draw values below a logarithmic axis at its lower end.
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
