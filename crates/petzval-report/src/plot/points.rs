//! Points: measured values as markers with error bars.

use maud::{Markup, html};

use super::{Frame, Marker, px};
use crate::palette::PAPER;

/// Radius of a measured point, px, and that of points so close that they would hide each other.
const POINT_PX: f64 = 3.4;
const CROWDED_PX: f64 = 2.6;

/// Measured points.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    pub colour: String,
    pub marker: Marker,
    /// Whether they are drawn hollow: measured, but not part of the fit.
    pub is_hollow: bool,
    /// (x, y, standard error of y); errors are drawn where they are larger than the marker.
    pub at: Vec<(f64, f64, f64)>,
}

impl Points {
    /// The points in a frame.
    pub fn draw(&self, frame: &Frame) -> Markup {
        let place = |&(x, y, _): &(f64, f64, f64)| frame.at([x, y]);
        let finite = |(x, y, _): &&(f64, f64, f64)| x.is_finite() && y.is_finite();
        let places: Vec<[f64; 2]> = self.at.iter().filter(finite).map(place).collect();
        let close =
            |pair: &&[[f64; 2]]| (pair[0][0] - pair[1][0]).hypot(pair[0][1] - pair[1][1]) < 2.0 * POINT_PX;
        // Draw crowded points small: the white rims of larger ones would cover their neighbours.
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
                path class="points" d=(shapes) stroke=(self.colour) stroke-width="1.3" fill=(PAPER) {}
            } @else {
                path class="points" d=(shapes) fill=(self.colour) stroke=(PAPER)
                    stroke-width=(if is_crowded { "0" } else { "0.7" }) {}
            }
        }
    }
}
