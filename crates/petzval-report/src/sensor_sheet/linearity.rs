//! Linearity of the response.

use petzval_lab::emva::ChannelResult;
use petzval_lab::emva::transfer::{Linearity, TransferPoint};

use super::shown::Shown;
use super::style::{axis_from_zero, colour_name, points_of, straight};
use super::transfer::{HEIGHT_PX, light_axis};
use crate::number;
use crate::palette;
use crate::plot::{Axis, Panel, Pen, Sheet};

fn fits<'a>(shown: &Shown<'a>) -> Vec<(&'a ChannelResult, &'a Linearity)> {
    shown.channels().iter().filter_map(|c| Some((c, c.transfer.linearity.as_ref()?))).collect()
}

/// Units of the horizontal axis per unit of the fit: exposure times are fitted in seconds and shown in milliseconds.
fn scale(channel: &ChannelResult) -> f64 {
    if channel.points.iter().all(|p| p.photons.is_some()) { 1.0 } else { 1e3 }
}

/// Signal over light with the regression line of 5 to 95 % of saturation.
pub(super) fn linearity(shown: &Shown<'_>) -> Option<Sheet> {
    let fits = fits(shown);
    let (first, _) = fits.first()?;
    let every = || shown.channels().iter().flat_map(|c| light_axis(&c.points).0);
    let signals = || shown.channels().iter().flat_map(|c| c.points.iter().map(TransferPoint::signal_dn));
    let names = [light_axis(&first.points).1, "mean signal above dark, DN"];
    let mut panel = Panel::new("", names, axis_from_zero(every(), 8), axis_from_zero(signals(), 6));
    for (channel, fit) in &fits {
        let (x, _) = light_axis(&channel.points);
        let at = channel.points.iter().zip(&x).enumerate().map(|(i, (p, x))| {
            ((*x, p.signal_dn(), p.signal_se_dn()), (fit.range.0..=fit.range.1).contains(&i))
        });
        panel.points.extend(points_of(Some(channel.colour), at));
        let ends = [x.get(fit.range.0), x.get(fit.range.1)].map(|x| x.copied().unwrap_or(0.0));
        let pen = Pen::thin(palette::mosaic(Some(channel.colour)));
        panel.curves.push(straight(pen, fit.slope / scale(channel), fit.offset_dn, ends));
    }
    let remark =
        "Lines: regression weighted by the inverse square of the signal, over 5 to 95 % of saturation.";
    Some(shown.sheet(["linearity", "Linearity"], remark, shown.colour_keys(), &[panel], HEIGHT_PX))
}

/// Deviation from that line.
pub(super) fn deviation(shown: &Shown<'_>) -> Option<Sheet> {
    let fits = fits(shown);
    let (first, _) = fits.first()?;
    let ends = |(_, fit): &(&ChannelResult, &Linearity)| {
        let of = |i: usize| fit.deviation_percent[i].abs() + fit.deviation_se_percent[i];
        (fit.range.0..=fit.range.1).map(of).fold(0.0, f64::max)
    };
    let reach = fits.iter().map(ends).fold(1e-3, f64::max);
    let every = || fits.iter().flat_map(|(c, _)| light_axis(&c.points).0);
    let y = Axis::around(-1.1 * reach, 1.1 * reach, 6);
    let names = [light_axis(&first.points).1, "deviation from the line, %"];
    let mut panel = Panel::new("", names, axis_from_zero(every(), 8), y);
    for (channel, fit) in &fits {
        let (x, _) = light_axis(&channel.points);
        let at = (fit.range.0..=fit.range.1)
            .map(|i| ((x[i], fit.deviation_percent[i], fit.deviation_se_percent[i]), true));
        panel.points.extend(points_of(Some(channel.colour), at));
        panel.notes.push(format!(
            "{}: {} … {} %",
            colour_name(channel.colour),
            number::fixed(fit.min_percent, 3),
            number::fixed(fit.max_percent, 3)
        ));
    }
    let remark = "Points of the regression; bars: one standard error.";
    let names = ["linearity-deviation", "Deviation from linearity"];
    Some(shown.sheet(names, remark, shown.colour_keys(), &[panel], HEIGHT_PX))
}
