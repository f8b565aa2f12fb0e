//! The common style: colours of the mosaic and of gains, sheets, and the foot of every picture.

use maud::{Markup, html};
use petzval_camera::sensor::Colour;
use petzval_lab::emva::{Characterization, Measured};

pub(super) use crate::number::short;
use crate::plot::{Axis, Curve, Key, Marker, Panel, Pen, Points, Sheet, WIDTH_PX, grid, span};
use crate::{number, palette};

/// Marker of a colour of the mosaic.
pub(super) fn marker_of(colour: Option<Colour>) -> Marker {
    match colour {
        Some(Colour::Red) => Marker::Square,
        Some(Colour::Blue) => Marker::Triangle,
        _ => Marker::Circle,
    }
}

/// Name of a colour of the mosaic.
pub(super) fn colour_name(colour: Colour) -> &'static str {
    match colour {
        Colour::Clear => "all pixels",
        filtered => filtered.name(),
    }
}

/// Colour and marker of the i-th gain.
pub(super) fn gain_look(i: usize) -> (&'static str, Marker) {
    (palette::field(i), Marker::nth(i))
}

/// Measured points of a colour of the mosaic; those that the fit leaves out are hollow.
pub(super) fn points_of(
    colour: Option<Colour>,
    at: impl IntoIterator<Item = ((f64, f64, f64), bool)>,
) -> Vec<Points> {
    let all: Vec<_> = at.into_iter().collect();
    [false, true]
        .into_iter()
        .map(|is_hollow| Points {
            colour: palette::mosaic(colour).to_owned(),
            marker: marker_of(colour),
            is_hollow,
            at: all.iter().filter(|(_, used)| *used != is_hollow).map(|(at, _)| *at).collect(),
        })
        .filter(|points| !points.at.is_empty())
        .collect()
}

/// The line `y = slope x + intercept` between two values of x.
pub(super) fn straight(pen: Pen, slope: f64, intercept: f64, [from, to]: [f64; 2]) -> Curve {
    Curve { pen, index: 0, points: [from, to].map(|x| Some([x, slope * x + intercept])).into() }
}

/// Most decimals of a measured number.
const MOST_DECIMALS: usize = 9;

/// A measured number that ends where its standard error begins, `0.1402 ± 0.0003`; `None` if it is not resolved.
pub(super) fn with_error(measured: &Measured) -> Option<String> {
    let value = measured.value()?;
    let Some(error) = measured.standard_error().filter(|e| *e > 0.0) else {
        return Some(significant(value, 5));
    };
    if value.abs().max(error) >= 1e6 || (error < 1e-8 && value != 0.0) {
        return Some(format!("{} ± {}", number::significant(value), number::significant(error)));
    }
    Some(number::with_error(value, error, MOST_DECIMALS))
}

/// A symbol with its index as a subscript: `σ_d`.
pub(super) fn symbol(text: &str) -> Markup {
    match text.split_once('_') {
        Some((base, index)) => html! { (base) sub { (index) } },
        None => html! { (text) },
    }
}

/// A number with a number of significant digits, without trailing zeros.
pub(super) fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return number::fixed(value, 0);
    }
    let exponent = value.abs().log10().floor() as i32;
    match exponent {
        -5..=6 => short(value, (digits - 1 - exponent).max(0) as usize),
        _ => number::significant(value),
    }
}

/// Text of a linear gain.
pub(super) fn gain_name(linear_gain: f64) -> String {
    format!("gain {}", short(linear_gain, 2))
}

/// Sensor and size of the frames, and the gain if a picture shows only one.
pub(super) fn foot(all: &Characterization, linear_gain: Option<f64>) -> Vec<Key> {
    let mut foot =
        vec![Key::name(&all.sensor.name), Key::remark(format!("{} × {} pixels", all.width, all.height))];
    foot.extend(linear_gain.map(|gain| Key::remark(format!("linear {}", gain_name(gain)))));
    foot
}

/// The texts around the panels of a sheet.
pub(super) struct Around {
    pub class: &'static str,
    pub title: &'static str,
    pub remark: String,
    pub keys: Vec<Key>,
    /// The gain, if there is only one.
    pub linear_gain: Option<f64>,
}

/// A sheet of panels in rows.
pub(super) fn sheet(
    all: &Characterization,
    around: Around,
    panels: &[Panel],
    columns: usize,
    frame_height: f64,
) -> Sheet {
    let (body, height) = grid(panels, columns, WIDTH_PX, frame_height);
    Sheet {
        class: around.class,
        title: around.title.into(),
        remark: around.remark,
        keys: around.keys,
        alt: format!("{} of {}", around.title, all.sensor.name),
        width: WIDTH_PX,
        height,
        body,
        foot: foot(all, around.linear_gain),
    }
}

/// An axis from 0 that includes all values; to 1 if there are none.
pub(super) fn axis_from_zero(values: impl IntoIterator<Item = f64>, ticks: usize) -> Axis {
    let high = span(values).map_or(1.0, |(_, high)| high);
    // Add a margin, so that markers of the last points are complete.
    Axis::around(0.0, if high > 0.0 { 1.02 * high } else { 1.0 }, ticks)
}

/// An axis for amplitudes: from 0, or logarithmic if they span a decade or more.
pub(super) fn axis_of_amplitudes(values: impl IntoIterator<Item = f64>) -> Axis {
    let (low, high) = span(values.into_iter().filter(|v| *v > 0.0)).unwrap_or((0.0, 1.0));
    if high < 10.0 * low { Axis::around(0.0, 1.15 * high, 5) } else { Axis::decades(low, high) }
}

/// A logarithmic axis that includes all positive values.
pub(super) fn axis_of_decades(values: impl IntoIterator<Item = f64>) -> Axis {
    let (low, high) = span(values.into_iter().filter(|v| *v > 0.0)).unwrap_or((1.0, 10.0));
    Axis::decades(low, high)
}
