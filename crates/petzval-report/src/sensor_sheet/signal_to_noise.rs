//! Signal-to-noise ratio over light: measured, of the model, with non-uniformity, and of an ideal sensor.
//!
//! With `mu` electrons of light, dark noise `sigma_d`, system gain `K`, DSNU and PRNU:
//! `SNR = mu / sqrt(sigma_d^2 + 1/(12 K^2) + mu)`, `SNR_total = mu / sqrt(sigma_d^2 + DSNU^2 + 1/(12 K^2) + mu + (PRNU mu)^2)`
//! (EMVA 1288 release 4.0 Linear); the ideal sensor has `sqrt(photons)`.

use petzval_lab::emva::ChannelResult;
use petzval_lab::emva::rounding::QUANTISATION_DN2;
use petzval_lab::emva::transfer::TransferPoint;

use super::shown::Shown;
use super::style::{axis_of_decades, points_of};
use super::transfer::HEIGHT_PX;
use crate::palette;
use crate::palette::{IDEAL, LIMIT, MUTED};
use crate::plot::{Axis, Curve, Key, Panel, Pen, Sheet};

/// Points of a curve over the whole axis.
const STEPS: usize = 120;

fn figure(channel: &ChannelResult, name: &str) -> Option<f64> {
    channel.figure(name)?.best().value()
}

/// Light of a point in the units of the axis.
fn light(point: &TransferPoint, gain: Option<f64>) -> Option<f64> {
    match gain {
        None => point.photons,
        Some(gain) => Some(point.signal_dn() / gain),
    }
}

/// SNR over photons where they are known, else over electrons.
pub(super) fn signal_to_noise(shown: &Shown<'_>) -> Option<Sheet> {
    let channels: Vec<(&ChannelResult, f64)> =
        shown.channels().iter().filter_map(|c| Some((c, c.transfer.gain_dn_per_e.value()?))).collect();
    let (first, _) = channels.first()?;
    let in_photons = channels.iter().all(|(c, _)| {
        c.points.iter().all(|p| p.photons.is_some()) && c.transfer.responsivity_dn.value().is_some()
    });
    let unit = |gain: f64| (!in_photons).then_some(gain);
    let lights = || channels.iter().flat_map(|(c, k)| c.points.iter().filter_map(|p| light(p, unit(*k))));
    let ratio = |p: &TransferPoint| p.signal_dn() / p.variance_dn2.max(1e-12).sqrt();
    // Include the threshold, where the ratio is 1.
    let threshold = figure(first, if in_photons { "u_p_min" } else { "u_e_min" });
    let x = axis_of_decades(lights().chain(threshold));
    // Leave out points beyond saturation: clipping removes the noise, and the ratio is meaningless.
    fn before(channel: &ChannelResult) -> impl Iterator<Item = &TransferPoint> {
        channel.points.iter().take(channel.transfer.saturation + 1)
    }
    let largest = channels.iter().flat_map(|(c, _)| before(c)).map(ratio).fold(1.0, f64::max);
    let y = Axis::decades(0.5, largest.max(x.high.sqrt()));
    let name = if in_photons { "photons per pixel" } else { "photoelectrons per pixel" };
    let grid: Vec<f64> =
        (0..=STEPS).map(|i| x.low * (x.high / x.low).powf(i as f64 / STEPS as f64)).collect();
    let mut panel = Panel::new("", [name, "signal-to-noise ratio"], x, y);

    let ideal = Pen { width: 2.0, ..Pen::thin(IDEAL) };
    panel.curves.push(Curve::over(ideal.clone(), 0, &grid, grid.iter().map(|p| Some(p.sqrt()))));
    let marks = if in_photons {
        [("u_p_min", "threshold"), ("u_p_sat", "saturation capacity")]
    } else {
        [("u_e_min", "threshold"), ("u_e_sat", "saturation capacity")]
    };
    let (mut has_total, mut marked) = (false, Vec::new());
    for (channel, gain) in &channels {
        let colour = Some(channel.colour);
        // Electrons per unit of the axis.
        let efficiency = match channel.transfer.responsivity_dn.value() {
            Some(r) if in_photons => r / gain,
            _ => 1.0,
        };
        let brightest_dn = channel.points[channel.transfer.saturation].signal_dn();
        let end_dn = channel.transfer.saturation_signal_dn.value().unwrap_or(brightest_dn);
        let end = end_dn / gain / efficiency;
        if let Some(dark) = figure(channel, "sigma_d") {
            let fixed = dark * dark + QUANTISATION_DN2 / (gain * gain);
            let model = |offset: f64, share: f64| {
                grid.iter()
                    .map(|p| {
                        let e = efficiency * p;
                        (*p <= 1.001 * end).then(|| e / (fixed + offset + e + (share * e).powi(2)).sqrt())
                    })
                    .collect::<Vec<_>>()
            };
            panel.curves.push(Curve::over(Pen::thin(palette::mosaic(colour)), 0, &grid, model(0.0, 0.0)));
            if let (Some(dsnu), Some(prnu)) = (figure(channel, "DSNU1288"), figure(channel, "PRNU1288")) {
                has_total = true;
                let total = model(dsnu * dsnu, 0.01 * prnu);
                panel.curves.push(Curve::over(Pen::thin(palette::mosaic(colour)).dashed(), 0, &grid, total));
            }
        }
        for (name, called) in marks {
            let Some(mark) = figure(channel, name) else { continue };
            let upright = [panel.y.low, panel.y.high].map(|y| Some([mark, y])).into();
            panel.curves.push(Curve { pen: Pen::thin(LIMIT), index: 0, points: upright });
            if !marked.contains(&called) {
                marked.push(called);
            }
        }
        let at = before(channel).filter_map(|p| Some(((light(p, unit(*gain))?, ratio(p), 0.0), true)));
        panel.points.extend(points_of(colour, at));
    }
    let mut keys = shown.colour_keys();
    keys.push(Key::pen(Pen::thin(MUTED), "model"));
    if has_total {
        keys.push(Key::pen(Pen::thin(MUTED).dashed(), "with DSNU and PRNU"));
    }
    let best = if in_photons { "ideal sensor: √photons" } else { "shot noise alone: √electrons" };
    keys.push(Key::pen(ideal, best));
    if !marked.is_empty() {
        keys.push(Key::pen(Pen::thin(LIMIT), marked.join(", ")));
    }
    let remark = if has_total {
        "Temporal noise; points and lines up to saturation."
    } else {
        "Temporal noise; points and lines up to saturation. Without resolved DSNU and PRNU there is no total ratio."
    };
    Some(shown.sheet(["snr", "Signal-to-noise ratio"], remark, keys, &[panel], HEIGHT_PX))
}
