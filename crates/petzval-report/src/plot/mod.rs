//! Plots: axes, curves, bars, markers and keys as SVG.
//!
//! Coordinates are px from the upper left corner, y downwards. A sheet is a whole picture, a frame one pair of axes in it, a panel a
//! frame with measured points, curves and histograms, a pen how a curve is drawn. [`chart_svg`] and [`bars_svg`] draw the common
//! cases from plain data.

mod axis;
mod bars;
mod chart;
mod frame;
mod key;
mod marker;
mod panel;
mod pen;
mod points;
mod sheet;
mod smooth;
mod steps;

pub(crate) use axis::{Axis, round_up};
pub use bars::{Bar, BarChart, bars_svg};
pub use chart::{Chart, Series, chart_svg};
pub(crate) use frame::{Frame, Names};
pub(crate) use key::{Key, KeyLine};
pub(crate) use marker::Marker;
pub(crate) use panel::{Panel, grid};
pub(crate) use pen::{Curve, Pen};
pub(crate) use points::Points;
pub(crate) use sheet::{Sheet, WIDTH_PX};
pub(crate) use steps::Steps;

use maud::html;

/// Mean width of a character over the size of its font.
const CHARACTER: f64 = 0.56;

/// Farthest place from the page that is written; drawing programs stumble over larger numbers.
const FARTHEST_PX: f64 = 1e5;

/// A coordinate for SVG, to a hundredth; what is not finite goes to the corner.
pub(crate) fn px(value: f64) -> String {
    if !value.is_finite() {
        return "0".into();
    }
    let text = format!("{:.2}", value.clamp(-FARTHEST_PX, FARTHEST_PX));
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// Width of a text in a font of a size, px, as well as it can be estimated without the font.
pub(crate) fn width_of(text: &str, size: f64) -> f64 {
    CHARACTER * size * text.chars().count() as f64
}

/// A text without the characters that XML cannot hold.
pub(crate) fn plain(text: &str) -> String {
    let fits = |c: char| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}');
    text.chars().map(|c| if fits(c) { c } else { ' ' }).collect()
}

/// The least and the greatest of the finite numbers.
pub(crate) fn span(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
    })
}

/// A picture of a width that says that there are no data.
fn without_data(alt: &str, width: f64) -> Sheet {
    Sheet {
        class: "chart",
        title: String::new(),
        remark: String::new(),
        keys: vec![Key::remark("no data")],
        alt: alt.into(),
        width,
        height: 20.0,
        body: html! {},
        foot: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_finite() {
        assert_eq!(px(1.0), "1");
        assert_eq!(px(-0.001), "0");
        assert_eq!(px(-2.5), "-2.5");
        assert_eq!(px(100.0), "100");
        assert_eq!(px(f64::NAN), "0");
        assert_eq!(px(1e300), "100000");
    }

    #[test]
    fn a_name_loses_what_xml_cannot_hold() {
        assert_eq!(plain("a\u{7}b\u{ffff}µ"), "a b µ");
    }

    #[test]
    fn a_span_leaves_out_what_is_no_number() {
        assert_eq!(span([f64::NAN, 3.0, f64::INFINITY, -1.0]), Some((-1.0, 3.0)));
        assert_eq!(span([f64::NAN]), None);
    }
}
