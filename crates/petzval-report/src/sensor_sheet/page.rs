//! The page: all pictures and tables of a characterisation in one self-contained HTML file.

use maud::html;
use petzval_lab::emva::Characterization;

use super::sheets::sheets;
use super::shown::Shown;
use super::style::gain_name;
use super::{calibration, front, goodness, table};
use crate::page::{Page, figure, section, with_contents};
use crate::plot::Sheet;

/// Pictures of all gains.
const OF_ALL_GAINS: [&str; 4] = ["gain-fit", "dark-variance", "histograms-flat", "histograms-dark"];

/// The page. It is self-contained and suitable for printing.
pub fn page(characterization: &Characterization) -> String {
    let (of_all, of_one): (Vec<_>, Vec<_>) =
        sheets(characterization).into_iter().partition(|sheet| OF_ALL_GAINS.contains(&sheet.class));
    let pictures = |sheets: &[Sheet]| html! { @for sheet in sheets { (figure(&sheet.svg())) } };
    let mut lead = html! {};
    let mut sections = vec![
        section("Warnings", table::warnings(characterization)),
        section("Basic data", table::basic_data(characterization)),
    ];
    if let Some(shown) = &Shown::choose(characterization) {
        lead = front::front(shown, &of_one);
        let name = format!("EMVA 1288 at linear {}", gain_name(shown.gain.linear_gain));
        sections.push(section("Operating point", table::operating_point(shown)));
        sections.push(section(name, table::figures(shown)));
        sections.extend(table::defect_pixels(shown).map(|pixels| section("Defect pixels", pixels)));
    }
    let further: Vec<Sheet> =
        of_one.into_iter().filter(|sheet| !front::PLOTS.contains(&sheet.class)).collect();
    if !further.is_empty() {
        sections.push(section("Plots of EMVA 1288", pictures(&further)));
    }
    let of_all_gains = html! {
        (calibration::model(characterization))
        (calibration::gains(characterization))
        (pictures(&of_all))
    };
    sections.push(section("Calibration over all gains", of_all_gains));
    sections.extend(goodness::table(characterization).map(|table| section("Goodness of the fits", table)));
    Page {
        title: format!("{} – characterisation", characterization.sensor.name),
        style: include_str!("page.css"),
        headline: characterization.sensor.name.clone(),
        subtitle: html! { "Characterisation by EMVA 1288 release 4.0 Linear, and calibration over all gains." },
        lead,
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}
