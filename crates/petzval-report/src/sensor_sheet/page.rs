//! The page: all pictures and tables of a characterisation in one self-contained HTML file.

use maud::{PreEscaped, html};
use petzval_lab::emva::Characterization;

use super::style::gain_name;
use super::{Shown, calibration, sheets, table};
use crate::page::Page;
use crate::plot::plain;

/// The look of all reports, and what this one adds.
const STYLE: &str = concat!(include_str!("../lens_sheet/page.css"), include_str!("page.css"));

/// Pictures that show all gains rather than one.
const OF_ALL_GAINS: [&str; 4] = ["gain-fit", "dark-variance", "histograms-flat", "histograms-dark"];

/// The page. It needs nothing but itself, and prints well.
pub fn page(characterization: &Characterization) -> String {
    let name = plain(&characterization.sensor.name);
    let (of_all, of_one): (Vec<_>, Vec<_>) =
        sheets(characterization).into_iter().partition(|sheet| OF_ALL_GAINS.contains(&sheet.class));
    let shown = Shown::choose(characterization);
    let main = html! {
        section { h2 { "Basic data" } (table::basic_data(characterization)) }
        section { h2 { "Warnings" } (table::warnings(characterization)) }
        @if let Some(shown) = &shown {
            section { h2 { "Operating point" } (table::operating_point(shown)) }
            section { h2 { "EMVA 1288 at linear " (gain_name(shown.gain.linear_gain)) } (table::figures(shown)) }
        }
        @if !of_one.is_empty() { section { h2 { "Plots of EMVA 1288" } } }
        @for sheet in of_one { section { figure { (PreEscaped(sheet.svg())) } } }
        section {
            h2 { "Calibration over all gains" }
            (calibration::model(characterization))
            (calibration::gains(characterization))
        }
        @for sheet in of_all { section { figure { (PreEscaped(sheet.svg())) } } }
    };
    Page {
        title: html! { (name) " – characterisation" },
        style: STYLE,
        headline: html! { (name) },
        subtitle: html! { "Characterisation by EMVA 1288 release 4.0 Linear, and calibration over all gains." },
        main,
    }
    .html()
}
