//! Photon transfer of all gains in one frame (Fig. 5 of Tseng et al.).

use petzval_camera::sensor::Colour;
use petzval_lab::emva::transfer::TransferPoint;
use petzval_lab::emva::{ChannelResult, Characterization};

use super::style::{Around, axis_from_zero, colour_name, gain_look, gain_name, sheet, straight};
use super::transfer::HEIGHT_PX;
use crate::number;
use crate::plot::{Key, KeyLine, Panel, Pen, Points, Sheet};

/// The colour that represents a gain: green if the mosaic has it.
pub(super) fn standing_for(channels: &[ChannelResult]) -> Option<&ChannelResult> {
    channels.iter().find(|c| c.colour == Colour::Green).or_else(|| channels.first())
}

/// Variance over signal at every gain, with the fitted gains. For a single gain, the photon transfer shows the same.
pub(super) fn all_gains(all: &Characterization) -> Option<Sheet> {
    if all.gains.len() < 2 {
        return None;
    }
    let of_gain = all.gains.iter().enumerate();
    let channels: Vec<(usize, f64, &ChannelResult)> =
        of_gain.filter_map(|(i, g)| Some((i, g.linear_gain, standing_for(&g.channels)?))).collect();
    let colour = channels.first()?.2.colour;
    let every = || channels.iter().flat_map(|(_, _, c)| &c.points);
    let x = axis_from_zero(every().map(TransferPoint::signal_dn), 8);
    let y = axis_from_zero(every().map(TransferPoint::shot_variance_dn2), 6);
    let names = ["mean signal above dark, DN", "temporal variance above dark, DN²"];
    let mut panel = Panel::new("", names, x, y);
    let mut keys = Vec::new();
    for (i, linear_gain, channel) in &channels {
        let (look, marker) = gain_look(*i);
        let used = channel.transfer.range;
        for is_hollow in [true, false] {
            let points = channel.points.iter().enumerate();
            let at: Vec<_> = points
                .filter(|(i, _)| (used.0..=used.1).contains(i) != is_hollow)
                .map(|(_, p)| (p.signal_dn(), p.shot_variance_dn2(), p.shot_variance_se_dn2()))
                .collect();
            if !at.is_empty() {
                panel.points.push(Points { colour: look.into(), marker, is_hollow, at });
            }
        }
        let name = match channel.transfer.gain_dn_per_e.value() {
            Some(gain) => {
                let last = channel.points.get(used.1).map_or(0.0, TransferPoint::signal_dn);
                panel.curves.push(straight(Pen::thin(look).dashed(), gain, 0.0, [0.0, last]));
                format!("{}: K/g = {} DN/e⁻", gain_name(*linear_gain), number::fixed(gain / linear_gain, 4))
            }
            None => format!("{}: not resolved", gain_name(*linear_gain)),
        };
        keys.push(Key { line: KeyLine::Marker(look.into(), marker), name });
    }
    let around = Around {
        class: "gain-fit",
        title: "System gain at every linear gain",
        remark: format!(
            "{}. Dashed: K through the origin, over the points of the fit; hollow points are beyond it.",
            match colour {
                Colour::Clear => "All pixels".to_owned(),
                colour => format!("The {} pixels", colour_name(colour)),
            }
        ),
        keys,
        linear_gain: None,
    };
    Some(sheet(all, around, &[panel], 1, HEIGHT_PX))
}
