//! The page: all pictures and tables of a lens in one self-contained HTML file.

use maud::{Markup, html};
use petzval_optics::analysis::Analysis;

use super::picture::Picture;
use super::style::{field_name, short};
use super::table::{by_field, first_order};
use crate::page::{Page, figure, section, with_contents};
use crate::prescription::{SurfaceView, prescription};

/// The page with some of the pictures. It is self-contained and suitable for printing.
pub fn page<'p>(
    analysis: &Analysis,
    surfaces: &[SurfaceView],
    pictures: impl IntoIterator<Item = &'p Picture>,
) -> String {
    let mut sections = vec![
        section("First order", first_order(analysis)),
        section("Prescription", prescription(surfaces)),
        section("By field", by_field(analysis)),
    ];
    for picture in pictures {
        // The headline of the picture becomes that of its section.
        let mut sheet = picture.sheet(analysis);
        let headline = std::mem::take(&mut sheet.title);
        let below = picture.below.map(|table| table(analysis));
        sections.push(section(
            headline,
            html! { (figure(&sheet.svg())) @if let Some(table) = below { (table) } },
        ));
    }
    Page {
        title: format!("{} – analysis", analysis.name),
        headline: analysis.name.clone(),
        subtitle: conditions(analysis),
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// Fields and wavelengths.
fn conditions(analysis: &Analysis) -> Markup {
    let fields: Vec<String> = analysis.fields_deg.iter().map(|f| field_name(*f)).collect();
    let colours: Vec<String> = analysis.wavelengths_um.iter().map(|um| short(*um, 4)).collect();
    html! {
        "Fields " (fields.join(", ")) "; wavelengths " (colours.join(", ")) " µm, reference "
        (short(analysis.reference_um, 5)) " µm."
        @if let Some(nyquist) = analysis.nyquist_per_mm { " Nyquist frequency of the pixels " (short(nyquist, 1)) " cycles/mm." }
    }
}
