//! The page: all pictures and tables of a lens in one self-contained HTML file.

use maud::{Markup, PreEscaped, html};
use petzval_optics::analysis::Analysis;

use super::style::{field_name, short};
use super::table::{by_field, first_order, third_order};
use super::{PictureKind, sheet};
use crate::page::Page;
use crate::plot::plain;

const STYLE: &str = include_str!("page.css");

/// The page with some of the pictures. It needs nothing but itself, and prints well.
pub fn page(analysis: &Analysis, kinds: &[PictureKind]) -> String {
    let name = plain(&analysis.name);
    let main = html! {
        section { h2 { "First order" } (first_order(analysis)) }
        section { h2 { "By field" } (by_field(analysis)) }
        @for kind in kinds {
            section {
                figure { (PreEscaped(sheet(analysis, *kind).svg())) }
                @if *kind == PictureKind::Seidel { (third_order(analysis)) }
            }
        }
    };
    Page {
        title: html! { (name) " – analysis" },
        style: STYLE,
        headline: html! { (name) },
        subtitle: html! { (conditions(analysis)) },
        main,
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
