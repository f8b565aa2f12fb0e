//! Plots: axes, curves, bars, markers and keys as SVG.
//!
//! Coordinates are px from the upper left corner, y downwards. A sheet is a whole picture, a frame is one pair of axes
//! in it, a panel is a frame with measured points, curves and histograms, and a pen is the style of a curve.
//! [`chart_svg`] and [`bars_svg`] draw the common cases from plain data.

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
mod text;

pub(crate) use axis::{Axis, round_up, span};
pub use bars::{Bar, BarChart, BarKey, bars_svg};
pub use chart::{Axes, Chart, Mark, Series, chart_svg};
pub(crate) use frame::{Frame, Names};
pub(crate) use key::{Key, KeyLine};
pub(crate) use marker::Marker;
pub(crate) use panel::{Panel, grid};
pub(crate) use pen::{Curve, Pen};
pub(crate) use points::Points;
pub(crate) use sheet::{Sheet, WIDTH_PX};
pub(crate) use steps::Steps;
pub(crate) use text::{plain, px, width_of};
