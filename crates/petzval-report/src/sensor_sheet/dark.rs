//! Dark frames over exposure time: their mean, and their variance at every gain.

use petzval_lab::emva::{Characterization, GainResult};

use super::shown::Shown;
use super::style::{Around, gain_look, gain_name, sheet, straight, with_error};
use super::transfer::HEIGHT_PX;
use crate::palette::INK;
use crate::plot::{Axis, Marker, Panel, Pen, Points, Sheet, span};

/// An axis about values and their errors, wide enough that noise does not look like a slope.
fn axis_about(values: &[(f64, f64, f64)], ticks: usize) -> Axis {
    let ends = values.iter().flat_map(|(_, y, se)| [y - 2.0 * se, y + 2.0 * se]);
    match span(ends) {
        Some((low, high)) => {
            let room = 0.08 * (high - low).max(1e-9 * high.abs());
            Axis::around(low - room, high + room, ticks)
        }
        None => Axis::between(0.0, 1.0, ticks),
    }
}

fn times_ms(gain: &GainResult) -> Vec<f64> {
    gain.dark.points.iter().map(|p| 1e3 * p.exposure_s).collect()
}

fn time_axis(gain: &GainResult, ticks: usize) -> Axis {
    // Add a margin, so that the last marker is complete.
    Axis::between(0.0, 1.04 * times_ms(gain).into_iter().fold(0.0, f64::max).max(1e-6), ticks)
}

/// Mean of the dark frames of the shown gain, with its line: dark current.
pub(super) fn mean_over_time(shown: &Shown<'_>) -> Option<Sheet> {
    let dark = &shown.gain.dark;
    if dark.points.len() < 2 {
        return None;
    }
    let at: Vec<_> = dark.points.iter().map(|p| (1e3 * p.exposure_s, p.mean_dn, p.mean_se_dn)).collect();
    let x = time_axis(shown.gain, 8);
    let mut panel = Panel::new("", ["exposure time, ms", "mean of dark frames, DN"], x, axis_about(&at, 6));
    if let (Some(slope), Some(intercept)) = (dark.mean.slope.value(), dark.mean.intercept.value()) {
        // The fit is over seconds.
        let ends = [panel.x.low, panel.x.high];
        panel.curves.push(straight(Pen::thin(INK), 1e-3 * slope, intercept, ends));
    }
    panel.notes_left = true;
    panel.notes.push(match with_error(&dark.mean.slope) {
        Some(slope) => format!("slope {slope} DN/s"),
        None => dark.mean.slope.reason().map_or(String::new(), |why| format!("slope not resolved: {why}")),
    });
    panel.points.push(Points { colour: INK.into(), marker: Marker::Circle, is_hollow: false, at });
    let remark = "All pixels. Bars: one standard error. The slope over K is the dark current.";
    let names = ["dark-mean", "Dark signal over exposure time"];
    Some(shown.sheet(names, remark, Vec::new(), &[panel], HEIGHT_PX))
}

/// Variance of the dark frames of every gain, with its line (Fig. 6 of Tseng et al.).
pub(super) fn variance_over_time(all: &Characterization) -> Option<Sheet> {
    let gains: Vec<&GainResult> = all.gains.iter().filter(|g| g.dark.points.len() > 1).collect();
    let panel = |(i, gain): (usize, &&GainResult)| {
        let dark = &gain.dark;
        let at: Vec<_> =
            dark.points.iter().map(|p| (1e3 * p.exposure_s, p.variance_dn2, p.variance_se_dn2)).collect();
        let (colour, marker) = gain_look(i);
        let names = ["exposure time, ms", "variance, DN²"];
        let mut panel =
            Panel::new(gain_name(gain.linear_gain), names, time_axis(gain, 3), axis_about(&at, 4));
        if let (Some(slope), Some(intercept)) = (dark.variance.slope.value(), dark.variance.intercept.value())
        {
            let ends = [panel.x.low, panel.x.high];
            panel.curves.push(straight(Pen::thin(colour).dashed(), 1e-3 * slope, intercept, ends));
            // Compute the reduced chi-square: about 1 if the line describes the points.
            let squares: f64 = at
                .iter()
                .filter(|(_, _, se)| *se > 0.0)
                .map(|(x, y, se)| ((y - 1e-3 * slope * x - intercept) / se).powi(2))
                .sum();
            if at.len() > 2 {
                panel.notes.push(format!("χ²/ν = {:.2}", squares / (at.len() - 2) as f64));
            }
        }
        panel.notes_left = true;
        panel.points.push(Points { colour: colour.into(), marker, is_hollow: false, at });
        panel
    };
    let panels: Vec<Panel> = gains.iter().enumerate().map(panel).collect();
    if panels.is_empty() {
        return None;
    }
    let around = Around {
        class: "dark-variance",
        title: "Temporal variance of dark frames over exposure time",
        remark:
            "Dashed: least-squares lines; bars: one standard error. The slope over K² is the dark current."
                .into(),
        keys: Vec::new(),
        linear_gain: None,
    };
    let (columns, height) = if panels.len() > 1 { (3, 190.0) } else { (1, HEIGHT_PX) };
    Some(sheet(all, around, &panels, columns, height))
}
