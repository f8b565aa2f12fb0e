//! Non-uniformity: spectrograms, and histograms of the deviations.

use petzval_lab::emva::ChannelResult;
use petzval_lab::emva::histogram::Histogram;
use petzval_lab::emva::rounding::QUANTISATION_DN2;
use petzval_lab::emva::spatial::{Spatial, StackPlots};

use super::shown::Shown;
use super::style::{axis_of_amplitudes, colour_name};
use crate::palette;
use crate::palette::{IDEAL, MUTED};
use crate::plot::{Axis, Curve, Key, Pen, Sheet, span};
use crate::plot::{Panel, Steps};

/// The stack of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stack {
    /// Dark frames: DSNU.
    Dark,
    /// Flat minus dark frames: PRNU.
    Light,
}

impl Stack {
    pub fn plots(self, spatial: &Spatial) -> &StackPlots {
        match self {
            Self::Dark => &spatial.dsnu,
            Self::Light => &spatial.prnu,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Dark => "DSNU",
            Self::Light => "PRNU",
        }
    }
}

/// Colours with non-uniformity.
pub(super) fn channels<'a>(shown: &Shown<'a>) -> Vec<(&'a ChannelResult, &'a Spatial)> {
    shown.channels().iter().filter_map(|c| Some((c, c.spatial.as_ref()?))).collect()
}

/// Whether rows and columns are those of one colour of a mosaic rather than of the sensor.
fn is_mosaic(shown: &Shown<'_>) -> bool {
    shown.all.sensor.cfa.rows() * shown.all.sensor.cfa.cols() > 1
}

fn along_rows(plots: &StackPlots) -> &Vec<f64> {
    &plots.horizontal_spectrogram_dn2
}

fn along_columns(plots: &StackPlots) -> &Vec<f64> {
    &plots.vertical_spectrogram_dn2
}

/// Power of rows and columns over frequency.
pub(super) fn spectrograms(shown: &Shown<'_>, stack: Stack) -> Option<Sheet> {
    let channels = channels(shown);
    if channels.is_empty() {
        return None;
    }
    let quantisation = Pen::thin(IDEAL);
    let x_name = if is_mosaic(shown) { "periods per pixel of the colour" } else { "periods per pixel" };
    let panel = |head: &str, of: fn(&StackPlots) -> &Vec<f64>| {
        // Skip the first value, which is the remaining mean and not a pattern.
        let power = |spatial: &Spatial| {
            of(stack.plots(spatial)).iter().map(|p| p.max(0.0).sqrt()).collect::<Vec<_>>()
        };
        let lowest = (stack == Stack::Dark).then_some(QUANTISATION_DN2.sqrt());
        let all = || channels.iter().flat_map(|(_, s)| power(s).into_iter().skip(1)).chain(lowest);
        let (names, x) = ([x_name, "amplitude √power, DN"], Axis::between(0.0, 0.5, 5));
        let mut panel = Panel::new(head, names, x, axis_of_amplitudes(all()));
        for (channel, spatial) in &channels {
            let values = power(spatial);
            let last = values.len().saturating_sub(1).max(1) as f64;
            let x: Vec<f64> = (0..values.len()).map(|i| 0.5 * i as f64 / last).collect();
            let y = values.iter().enumerate().map(|(i, v)| (i > 0).then_some(*v));
            panel.curves.push(Curve::over(Pen::thin(palette::mosaic(Some(channel.colour))), 0, &x, y));
            // The white temporal noise that is left in the mean of the frames.
            let kept = match stack {
                Stack::Dark => spatial.dark.variances.temporal / spatial.dark.frames.max(1) as f64,
                Stack::Light => {
                    spatial.flat.variances.temporal / spatial.flat.frames.max(1) as f64
                        + spatial.dark.variances.temporal / spatial.dark.frames.max(1) as f64
                }
            };
            let pen = Pen::thin(palette::mosaic(Some(channel.colour))).dashed();
            panel.curves.push(Curve::over(pen, 0, &[0.0, 0.5], [Some(kept.max(0.0).sqrt()); 2]));
        }
        if stack == Stack::Dark {
            let level = [Some(QUANTISATION_DN2.sqrt()); 2];
            panel.curves.push(Curve::over(quantisation.clone(), 0, &[0.0, 0.5], level));
        }
        panel
    };
    let panels = [panel("horizontal", along_rows), panel("vertical", along_columns)];
    let mut keys = shown.colour_keys();
    keys.push(Key::pen(Pen::thin(MUTED).dashed(), "temporal noise left in the mean frame"));
    if stack == Stack::Dark {
        keys.push(Key::pen(quantisation, "quantisation of one frame, 1/√12 DN"));
    }
    let names = match stack {
        Stack::Dark => ["spectrogram-dsnu", "Spectrograms of the dark frames (DSNU)"],
        Stack::Light => ["spectrogram-prnu", "Spectrograms of the flat frames (PRNU)"],
    };
    let remark = match stack {
        Stack::Dark => "Mean over all rows (columns) of the mean dark frame, without a high-pass.",
        Stack::Light => {
            "Mean over all rows (columns) of the mean flat frame minus the dark one, without a high-pass."
        }
    };
    Some(shown.sheet(names, remark, keys, &panels, 300.0))
}

/// Log histograms of deviations, DSNU and PRNU, beside normal distributions.
pub(super) fn defects(shown: &Shown<'_>) -> Option<Sheet> {
    let names = ["deviation, DN", "pixels"];
    let panels = histogram_panels(shown, names, |plots| &plots.histogram, true)?;
    let mut keys = shown.colour_keys();
    keys.push(Key::pen(Pen::thin(MUTED).dashed(), "normal distribution of the same spread"));
    let remark = "The mean dark frame, and the mean flat frame minus the dark one after the 5 × 5 high-pass of release 3.1.";
    Some(shown.sheet(["defects", "Histograms of deviations"], remark, keys, &panels, 300.0))
}

/// Accumulated log histograms of absolute deviations.
pub(super) fn accumulated_defects(shown: &Shown<'_>) -> Option<Sheet> {
    let names = ["absolute deviation, DN", "pixels at or beyond, %"];
    let panels = histogram_panels(shown, names, |plots| &plots.accumulated, false)?;
    let remark = "Share of the pixels that deviate from the mean by at least the value on the axis.";
    let names = ["defects-accumulated", "Accumulated histograms of deviations"];
    Some(shown.sheet(names, remark, shown.colour_keys(), &panels, 300.0))
}

/// Edges of the bins: the last is as wide as the one before it.
fn edges(histogram: &Histogram) -> Vec<f64> {
    let mut edges = histogram.bins.clone();
    let width = match edges[..] {
        [.., a, b] => b - a,
        _ => 1.0,
    };
    edges.extend(edges.last().map(|last| last + width));
    edges
}

fn histogram_panels(
    shown: &Shown<'_>,
    names: [&str; 2],
    of: fn(&StackPlots) -> &Histogram,
    with_model: bool,
) -> Option<Vec<Panel>> {
    let channels = channels(shown);
    if channels.is_empty() {
        return None;
    }
    let panel = |stack: Stack| {
        let found = || channels.iter().map(|(c, s)| (c, of(stack.plots(s))));
        let (low, high) = span(found().flat_map(|(_, h)| edges(h))).unwrap_or((0.0, 1.0));
        let counts = found().flat_map(|(_, h)| h.values.clone()).filter(|v| *v > 0.0);
        let (least, most) = span(counts).unwrap_or((1.0, 10.0));
        // Extend the axis below 1, so that a single pixel is visible as a bar.
        let y = Axis::decades(0.5 * least, most);
        let mut panel = Panel::new(stack.name(), names, Axis::between(low, high, 6), y);
        for (channel, histogram) in found() {
            let colour = palette::mosaic(Some(channel.colour));
            panel.steps.push(Steps {
                colour: colour.into(),
                edges: edges(histogram),
                heights: histogram.values.clone(),
            });
            if with_model && histogram.bins.len() > 1 {
                // The model is computed at the lower limits of the bins: draw it at their middles.
                let half = 0.5 * (histogram.bins[1] - histogram.bins[0]);
                let x: Vec<f64> = histogram.bins.iter().map(|b| b + half).collect();
                let y = histogram.model.iter().map(|m| (*m > 0.2 * least).then_some(*m));
                panel.curves.push(Curve::over(Pen::thin(colour).dashed(), 0, &x, y));
            }
            let worst = histogram.bins.last().zip(histogram.bins.first());
            if let Some((last, first)) = worst {
                let reach = last.abs().max(first.abs());
                panel.notes.push(format!("{}: up to {reach:.1} DN", colour_name(channel.colour)));
            }
        }
        panel
    };
    Some(vec![panel(Stack::Dark), panel(Stack::Light)])
}
