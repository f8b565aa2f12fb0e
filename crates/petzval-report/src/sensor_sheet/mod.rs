//! The characterisation of a sensor as pictures and as one page: the plots that EMVA 1288 prescribes, and those of the
//! calibration over several gains (Tseng et al. 2021, supplement, Figures 5 to 8).
//!
//! [`Characterization`] goes in and text comes out: nothing here measures. Captured points are markers, fits and models are
//! lines; colours are those of the mosaic.

mod calibration;
mod dark;
mod gains;
mod histograms;
mod linearity;
mod page;
mod profiles;
mod reasons;
mod signal_to_noise;
mod spatial;
mod style;
mod table;
mod transfer;

use petzval_lab::emva::{ChannelResult, Characterization, GainResult};

use crate::plot::Sheet;

pub use page::page;

/// The operating point that the pictures of EMVA 1288 show: the gain with the richest captures.
struct Shown<'a> {
    all: &'a Characterization,
    gain: &'a GainResult,
}

impl<'a> Shown<'a> {
    /// The gain with non-uniformity, else that with most flat points; of several the one nearest to 1. `None` without gains.
    fn choose(all: &'a Characterization) -> Option<Self> {
        let rank = |g: &&GainResult| {
            let spatial = g.channels.iter().any(|c| c.spatial.is_some());
            let points = g.channels.iter().map(|c| c.points.len()).max().unwrap_or(0);
            (spatial, points, std::cmp::Reverse((g.linear_gain.ln().abs() * 1e6) as u64))
        };
        all.gains.iter().max_by_key(rank).map(|gain| Self { all, gain })
    }

    fn channels(&self) -> &'a [ChannelResult] {
        &self.gain.channels
    }
}

/// Name of the file (without `.svg`) and picture, in the order of the page; a picture for which there are no captures is
/// left out.
fn sheets(characterization: &Characterization) -> Vec<Sheet> {
    let Some(shown) = Shown::choose(characterization) else { return Vec::new() };
    let all: [Option<Sheet>; 16] = [
        transfer::sensitivity(&shown),
        dark::mean_over_time(&shown),
        transfer::photon_transfer(&shown),
        signal_to_noise::signal_to_noise(&shown),
        linearity::linearity(&shown),
        linearity::deviation(&shown),
        spatial::spectrograms(&shown, spatial::Stack::Dark),
        spatial::spectrograms(&shown, spatial::Stack::Light),
        spatial::defects(&shown),
        spatial::accumulated_defects(&shown),
        profiles::profiles(&shown, spatial::Stack::Dark),
        profiles::profiles(&shown, spatial::Stack::Light),
        gains::all_gains(characterization),
        dark::variance_over_time(characterization),
        histograms::flat(characterization),
        histograms::dark(characterization),
    ];
    all.into_iter().flatten().collect()
}

/// Names of the pictures that there are, in the order of the page.
pub fn picture_names(characterization: &Characterization) -> Vec<&'static str> {
    sheets(characterization).iter().map(|sheet| sheet.class).collect()
}

/// Names and contents of all files of the sheet: `report.html`, one page that needs nothing but itself, and every picture of
/// it as an SVG.
pub fn files(characterization: &Characterization) -> Vec<(String, String)> {
    let page = ("report.html".to_owned(), page(characterization));
    let pictures =
        sheets(characterization).into_iter().map(|sheet| (format!("{}.svg", sheet.class), sheet.svg()));
    std::iter::once(page).chain(pictures).collect()
}

#[cfg(test)]
mod tests;
