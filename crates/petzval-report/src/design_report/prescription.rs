//! The prescription: the surfaces of a lens as a designer lists them.

use maud::Markup;
use petzval_files::lens_toml::special_lines;
use petzval_optics::lens::{Lens, Surface};
use petzval_optics::paraxial::first_order;

use crate::number::{fixed, significant};
use crate::table::{Column, Row, Table};

/// First-order data in one line.
pub(super) fn first_order_line(lens: &Lens) -> String {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    format!(
        "EFL {} mm, f/{}, entrance pupil {} mm, back focal length {} mm, total track {} mm",
        fixed(order.efl_mm, 2),
        fixed(order.f_number, 2),
        fixed(lens.entrance_pupil_mm, 2),
        fixed(order.bfl_mm, 2),
        fixed(lens.total_track_mm(), 2),
    )
}

/// One row a surface. Semi-diameters are clear ones; that of the stop follows from the entrance pupil.
pub(super) fn prescription(lens: &Lens) -> Markup {
    let stop_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    let columns = [
        Column::new("surface"),
        Column::new("radius").unit("mm"),
        Column::new("thickness").unit("mm"),
        Column::new("glass").text(),
        Column::new("semi-diameter").unit("mm"),
        Column::new("conic"),
        Column::new("asphere").unit("mm¹⁻ⁿ").text(),
    ];
    let rows = lens.surfaces.iter().enumerate().map(|(i, s)| {
        let is_stop = i == lens.stop;
        let cells = [
            significant(1.0 / s.shape.curvature),
            fixed(s.thickness_mm, 4),
            if s.glass.is_air() { String::new() } else { s.glass.name.clone() },
            fixed(if is_stop { stop_mm } else { s.semi_diameter_mm }, 3),
            if s.shape.conic == 0.0 { String::new() } else { fixed(s.shape.conic, 4) },
            asphere(s),
        ];
        Row::new(format!("{}{}", i + 1, if is_stop { " stop" } else { "" }), cells)
    });
    Table::new(columns).class("prescription").rows(rows).html()
}

/// The coefficients that are not zero, `a4 = -4.0600·10⁻⁵, a6 = ...`, and what else the surface is, as its file says it.
fn asphere(surface: &Surface) -> String {
    let terms = surface.shape.asphere.iter().enumerate().filter(|(_, a)| **a != 0.0);
    let terms = terms.map(|(i, a)| format!("a{} = {}", 2 * i + 2, significant(*a)));
    terms.chain(special_lines(surface).lines().map(str::to_owned)).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::triplet;

    #[test]
    fn every_surface_is_listed() {
        let table = prescription(&triplet()).into_string();
        assert_eq!(table.matches("<tr>").count(), 8);
        assert!(table.contains("5 stop") && table.contains("N-SF11") && table.contains("∞"));
        assert!(table.contains("a4 = \u{2212}4.0600·10⁻⁵"));
        assert!(first_order_line(&triplet()).starts_with("EFL 2"));
    }
}
