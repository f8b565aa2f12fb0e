//! The characterisation of a sensor as pictures and as one page: the plots of EMVA 1288, and those of the calibration over
//! several gains (Tseng et al. 2021, supplement, Figures 5 to 8).
//!
//! The input is a [`Characterization`] and the output is text: nothing here measures. Captured points are markers, fits
//! and models are lines; colours are those of the mosaic.

mod calibration;
mod dark;
mod front;
mod gains;
mod goodness;
mod histograms;
mod linearity;
mod page;
mod profiles;
mod reasons;
mod sheets;
mod shown;
mod signal_to_noise;
mod spatial;
mod style;
mod table;
mod transfer;

use petzval_camera::sensor::Colour;
use petzval_lab::emva::Characterization;

use self::sheets::sheets;
use self::shown::Shown;
use crate::plot::Sheet;

pub use page::page;

/// What stands in front of the page, for readers who see nothing else.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    /// Linear gain of the figures and plots.
    pub linear_gain: f64,
    /// Colour of the figures.
    pub colour: Colour,
    /// What a figure is, and its value with standard error and unit.
    pub figures: Vec<(String, String)>,
    /// The plots behind them, as SVG.
    pub plots: Vec<String>,
}

/// The front of the page; none without flat frames.
pub fn front(characterization: &Characterization) -> Option<Front> {
    let shown = Shown::choose(characterization)?;
    let colour = gains::standing_for(shown.channels())?.colour;
    let figures = front::figures(&shown).into_iter().map(|tile| (tile.label, tile.value));
    let sheets = sheets(characterization);
    let plot = |class: &&str| sheets.iter().find(|sheet| sheet.class == *class).map(Sheet::svg);
    Some(Front {
        linear_gain: shown.gain.linear_gain,
        colour,
        figures: figures.collect(),
        plots: front::PLOTS.iter().filter_map(plot).collect(),
    })
}

/// Names of the pictures, in the order of the page.
pub fn picture_names(characterization: &Characterization) -> Vec<&'static str> {
    sheets(characterization).iter().map(|sheet| sheet.class).collect()
}

/// Names and contents of all files of the sheet: `report.html`, one self-contained page, and every picture of
/// it as an SVG.
pub fn files(characterization: &Characterization) -> Vec<(String, String)> {
    let page = ("report.html".to_owned(), page(characterization));
    let pictures =
        sheets(characterization).into_iter().map(|sheet| (format!("{}.svg", sheet.class), sheet.svg()));
    std::iter::once(page).chain(pictures).collect()
}

#[cfg(test)]
mod tests;
