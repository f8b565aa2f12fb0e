//! The page: all pictures and tables of a lens in one self-contained HTML file.

use maud::{Markup, html};
use petzval_optics::analysis::Analysis;

use super::picture::Picture;
use super::style::{field_name, short};
use super::table::{by_field, first_order};
use crate::page::{Page, figure, section};

/// The page with some of the pictures. It is self-contained and suitable for printing.
pub fn page<'p>(analysis: &Analysis, pictures: impl IntoIterator<Item = &'p Picture>) -> String {
    let main = html! {
        (section("First order", first_order(analysis)))
        (section("By field", by_field(analysis)))
        section {
            @for picture in pictures {
                (figure(&picture.svg(analysis)))
                @if let Some(table) = picture.below { (table(analysis)) }
            }
        }
    };
    Page {
        title: format!("{} – analysis", analysis.name),
        headline: analysis.name.clone(),
        subtitle: conditions(analysis),
        main,
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
    }
}
