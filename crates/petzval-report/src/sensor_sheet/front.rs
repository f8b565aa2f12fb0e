//! What a reader wants first: six figures of the sensor, and the two plots behind them.

use maud::{Markup, html};

use super::gains::standing_for;
use super::shown::Shown;
use super::style::{colour_name, with_error};
use super::table::unit;
use crate::page::{Tile, figure, numbers};
use crate::plot::Sheet;

/// Classes of the pictures in front.
pub(super) const PLOTS: [&str; 2] = ["photon-transfer", "snr"];

/// Number of figures in front.
const COUNT: usize = 6;

/// Figures for the front, the first of these that the captures resolve: computer name, and name for a reader.
const FIGURES: [(&str, &str); 10] = [
    ("QE", "quantum efficiency"),
    ("K", "system gain"),
    ("sigma_d", "temporal dark noise"),
    ("u_e_sat", "saturation capacity"),
    ("DR_dB", "dynamic range"),
    ("PRNU1288", "PRNU"),
    ("DSNU1288", "DSNU"),
    ("u_e_min", "absolute sensitivity threshold"),
    ("SNR_max_dB", "largest signal-to-noise ratio"),
    ("u_I_mean", "dark current"),
];

/// Each figure with its error and unit, and its name.
pub(super) fn figures(shown: &Shown<'_>) -> Vec<Tile> {
    let Some(channel) = standing_for(shown.channels()) else { return Vec::new() };
    let of = |(name, words): (&str, &'static str)| {
        let found = channel.figure(name)?;
        let best = found.best();
        // A figure without an error is no measurement.
        best.standard_error()?;
        let value = with_error(&best)?;
        let unit = unit(found.unit);
        let value = if unit.is_empty() { value } else { format!("{value}\u{a0}{unit}") };
        Some(Tile { value, label: words.to_owned(), is_gain: None })
    };
    FIGURES.into_iter().filter_map(of).take(COUNT).collect()
}

/// The figures, and the plots among these sheets.
pub(super) fn front(shown: &Shown<'_>, sheets: &[Sheet]) -> Markup {
    let colour = standing_for(shown.channels()).map_or("", |channel| colour_name(channel.colour));
    html! {
        (numbers(&figures(shown)))
        p.muted {
            "Of " (if colour == "all pixels" { "all pixels".to_owned() } else { format!("the {colour} pixels") }) " at linear "
            (super::style::gain_name(shown.gain.linear_gain)) ", ± standard error. All figures are in the table below."
        }
        div.front-plots {
            @for class in PLOTS {
                @for sheet in sheets.iter().filter(|sheet| sheet.class == class) { (figure(&sheet.svg())) }
            }
        }
    }
}
