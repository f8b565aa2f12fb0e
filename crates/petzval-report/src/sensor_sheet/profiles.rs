//! Profiles: values along rows and columns of the mean frames.

use petzval_camera::sensor::Colour;
use petzval_lab::emva::spatial::Profile;

use super::shown::Shown;
use super::spatial::{Stack, channels};
use super::style::colour_name;
use crate::palette;
use crate::palette::{LIMIT, MUTED};
use crate::plot::{Axis, Curve, Key, Panel, Pen, Sheet, span};

/// Largest number of points of a profile in a frame; with more, several are merged.
const MOST_PLACES: usize = 700;

/// Merges groups of points to their mean (or least, or largest), because a line of thousands of points is unreadable.
fn thinned(values: &[f64], fold: fn(&[f64]) -> f64) -> (Vec<f64>, Vec<f64>) {
    let each = values.len().div_ceil(MOST_PLACES).max(1);
    let at = |i: usize| (i * each) as f64 + 0.5 * (each - 1) as f64;
    values.chunks(each).enumerate().map(|(i, part)| (at(i), fold(part))).unzip()
}

fn mean(part: &[f64]) -> f64 {
    part.iter().sum::<f64>() / part.len() as f64
}

fn least(part: &[f64]) -> f64 {
    part.iter().copied().fold(f64::INFINITY, f64::min)
}

fn largest(part: &[f64]) -> f64 {
    part.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// Horizontal and vertical profiles of one colour: mean, least and largest, and the middle row or column.
pub(super) fn profiles(shown: &Shown<'_>, stack: Stack) -> Option<Sheet> {
    let channels = channels(shown);
    let (channel, spatial) =
        channels.iter().find(|(c, _)| c.colour == Colour::Green).or_else(|| channels.first())?;
    let plots = stack.plots(spatial);
    let colour = palette::mosaic(Some(channel.colour));
    let pens =
        [Pen::thin(LIMIT), Pen::thin(LIMIT), Pen::thin(MUTED), Pen { width: 1.6, ..Pen::thin(colour) }];
    let panel = |head: &str, x_name: &str, profile: &Profile| {
        type Part<'a> = (&'a Vec<f64>, fn(&[f64]) -> f64);
        let parts: [Part<'_>; 4] = [
            (&profile.min_dn, least),
            (&profile.max_dn, largest),
            (&profile.middle_dn, mean),
            (&profile.mean_dn, mean),
        ];
        let (low, high) = span(profile.min_dn.iter().chain(&profile.max_dn).copied()).unwrap_or((0.0, 1.0));
        let room = 0.04 * (high - low).max(1e-6 * high.abs());
        let last = profile.mean_dn.len().saturating_sub(1) as f64;
        let (x, y) = (Axis::between(0.0, last, 5), Axis::around(low - room, high + room, 5));
        let mut panel = Panel::new(head, [x_name, "DN"], x, y);
        for ((values, fold), pen) in parts.into_iter().zip(&pens) {
            let (x, y) = thinned(values, fold);
            panel.curves.push(Curve::over(pen.clone(), 0, &x, y.into_iter().map(Some)));
        }
        panel
    };
    let panels = [
        panel("horizontal", "column", &plots.horizontal_profile),
        panel("vertical", "row", &plots.vertical_profile),
    ];
    let (names, what) = match stack {
        Stack::Dark => (["profiles-dsnu", "Profiles of the dark frames (DSNU)"], "mean dark frame"),
        Stack::Light => {
            (["profiles-prnu", "Profiles of the flat frames (PRNU)"], "mean flat frame minus the dark one")
        }
    };
    let remark = match channel.colour {
        Colour::Clear => format!("Of the {what}, without a high-pass."),
        other => format!(
            "The {} pixels of the {what}, without a high-pass; rows and columns are those of this colour.",
            colour_name(other)
        ),
    };
    let keys = vec![
        Key::pen(pens[3].clone(), "mean over all rows (columns)"),
        Key::pen(pens[2].clone(), "middle row (column)"),
        Key::pen(pens[0].clone(), "least and largest"),
    ];
    Some(shown.sheet(names, remark, keys, &panels, 280.0))
}
