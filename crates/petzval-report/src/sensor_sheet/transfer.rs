//! Signal over light, and noise over signal: responsivity and system gain.

use petzval_lab::emva::transfer::{TransferPoint, light};

use super::shown::Shown;
use super::style::{axis_from_zero, colour_name, points_of, short, straight, with_error};
use crate::palette;
use crate::palette::MUTED;
use crate::plot::{Key, KeyLine, Panel, Pen, Sheet};

/// Height of a frame alone on its sheet, px.
pub(super) const HEIGHT_PX: f64 = 400.0;

/// The light of each point as the horizontal axis has it, and the name of that axis: photons, or milliseconds where
/// photons are not known.
pub(super) fn light_axis(points: &[TransferPoint]) -> (Vec<f64>, &'static str) {
    let known = points.iter().all(|p| p.photons.is_some());
    let values = light(points);
    if known {
        (values, "photons per pixel")
    } else {
        (values.into_iter().map(|s| 1e3 * s).collect(), "exposure time, ms")
    }
}

/// Signal over light with the fitted responsivity.
pub(super) fn sensitivity(shown: &Shown<'_>) -> Option<Sheet> {
    let first = shown.channels().first()?;
    let names = [light_axis(&first.points).1, "mean signal above dark, DN"];
    let every = || shown.channels().iter().flat_map(|c| light_axis(&c.points).0);
    let signals = shown.channels().iter().flat_map(|c| c.points.iter().map(TransferPoint::signal_dn));
    let mut panel = Panel::new("", names, axis_from_zero(every(), 8), axis_from_zero(signals, 6));
    panel.notes_left = true;
    for channel in shown.channels() {
        let (x, _) = light_axis(&channel.points);
        let used = channel.transfer.range;
        let at = channel
            .points
            .iter()
            .zip(&x)
            .enumerate()
            .map(|(i, (p, x))| ((*x, p.signal_dn(), p.signal_se_dn()), (used.0..=used.1).contains(&i)));
        panel.points.extend(points_of(Some(channel.colour), at));
        if let Some(slope) = channel.transfer.responsivity_dn.value() {
            let last = x.get(used.1).copied().unwrap_or(0.0);
            let pen = Pen::thin(palette::mosaic(Some(channel.colour)));
            panel.curves.push(straight(pen, slope, 0.0, [0.0, last]));
            let r = with_error(&channel.transfer.responsivity_dn).unwrap_or_default();
            panel.notes.push(format!("{}: R = {r} DN per photon", colour_name(channel.colour)));
        }
    }
    let remark = if panel.curves.is_empty() {
        "The captures do not state photons: there is no responsivity."
    } else {
        "Lines: responsivity R, through the origin, over the points of the fit; hollow points are beyond it."
    };
    Some(shown.sheet(["sensitivity", "Sensitivity"], remark, shown.colour_keys(), &[panel], HEIGHT_PX))
}

/// Noise over signal with the fitted system gain.
pub(super) fn photon_transfer(shown: &Shown<'_>) -> Option<Sheet> {
    shown.channels().first()?;
    let all = || shown.channels().iter().flat_map(|c| &c.points);
    let mut panel = Panel::new(
        "",
        ["mean signal above dark, DN", "temporal variance above dark, DN²"],
        axis_from_zero(all().map(TransferPoint::signal_dn), 8),
        axis_from_zero(all().map(TransferPoint::shot_variance_dn2), 6),
    );
    panel.notes_left = true;
    let mut keys = shown.colour_keys();
    for channel in shown.channels() {
        let (transfer, colour) = (&channel.transfer, Some(channel.colour));
        let used = transfer.range;
        let at = channel.points.iter().enumerate().map(|(i, p)| {
            let place = (p.signal_dn(), p.shot_variance_dn2(), p.shot_variance_se_dn2());
            (place, (used.0..=used.1).contains(&i))
        });
        panel.points.extend(points_of(colour, at));
        let signal = |i: usize| channel.points.get(i).map_or(0.0, TransferPoint::signal_dn);
        if let Some(gain) = transfer.gain_dn_per_e.value() {
            panel.curves.push(straight(Pen::thin(palette::mosaic(colour)), gain, 0.0, [0.0, signal(used.1)]));
            let k = with_error(&transfer.gain_dn_per_e).unwrap_or_default();
            let last = short(signal(used.1), 0);
            let name = colour_name(channel.colour);
            panel.notes.push(format!("{name}: K = {k} DN/e⁻, fitted up to {last} DN"));
        }
        if let Some(at) = transfer.saturation_signal_dn.value() {
            let pen = Pen::thin(palette::mosaic(colour)).dashed();
            let upright = [panel.y.low, panel.y.high].map(|y| Some([at, y]));
            panel.curves.push(crate::plot::Curve { pen, index: 0, points: upright.into() });
        }
    }
    if shown.channels().iter().any(|c| c.transfer.saturation_signal_dn.value().is_some()) {
        let pen = Pen::thin(MUTED).dashed();
        keys.push(Key { line: KeyLine::Pen(pen), name: "saturation: the largest signal".into() });
    }
    let remark =
        "Lines: system gain K, through the origin, over the points of the fit; hollow points are beyond it.";
    Some(shown.sheet(["photon-transfer", "Photon transfer"], remark, keys, &[panel], HEIGHT_PX))
}
