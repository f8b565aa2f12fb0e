//! All pictures of the characterisation, in the order of the page.

use petzval_lab::emva::Characterization;

use super::shown::Shown;
use super::{dark, gains, histograms, linearity, profiles, signal_to_noise, spatial, transfer};
use crate::plot::Sheet;

/// Name of the file (without `.svg`) and picture, in the order of the page; a picture without captures is left out.
pub(super) fn sheets(characterization: &Characterization) -> Vec<Sheet> {
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
