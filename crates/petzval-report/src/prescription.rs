//! The prescription: the table of the surfaces of a lens.

use maud::Markup;
use petzval_optics::analysis::FirstOrderTable;

use crate::number::{fixed, significant};
use crate::table::{Column, Row, Table};

/// A surface as a line of a prescription.
#[derive(Clone, Debug)]
pub struct SurfaceView {
    /// Radius of curvature, mm; infinite for a plane.
    pub radius_mm: f64,
    /// Distance to the next surface, mm.
    pub thickness_mm: f64,
    /// Name of the glass behind it, empty for air.
    pub glass: String,
    /// Clear semi-diameter, mm; that of the stop follows from the entrance pupil.
    pub semi_diameter_mm: f64,
    /// Conic constant.
    pub conic: f64,
    /// Aspheric coefficients that are not zero: order n and value, mm^(1-n).
    pub asphere: Vec<(usize, f64)>,
    /// Further properties of the surface, as lines of a lens file.
    pub more: Vec<String>,
    /// Whether it is the stop.
    pub is_stop: bool,
}

/// First-order properties in one line.
pub(crate) fn first_order_line(order: &FirstOrderTable) -> String {
    let known = |value: Option<f64>| fixed(value.unwrap_or(f64::NAN), 2);
    format!(
        "EFL {} mm, f/{}, entrance pupil {} mm, back focal length {} mm, total track {} mm",
        known(order.efl_mm),
        known(order.f_number),
        fixed(order.entrance_pupil_mm, 2),
        known(order.bfl_mm),
        fixed(order.total_track_mm, 2),
    )
}

/// One row a surface.
pub(crate) fn prescription(surfaces: &[SurfaceView]) -> Markup {
    let columns = [
        Column::new("surface"),
        Column::new("radius").unit("mm"),
        Column::new("thickness").unit("mm"),
        Column::new("glass").text(),
        Column::new("semi-diameter").unit("mm"),
        Column::new("conic"),
        Column::new("asphere").unit("mm¹⁻ⁿ").text(),
    ];
    let rows = surfaces.iter().enumerate().map(|(i, s)| {
        let cells = [
            significant(s.radius_mm),
            fixed(s.thickness_mm, 4),
            s.glass.clone(),
            fixed(s.semi_diameter_mm, 3),
            if s.conic == 0.0 { String::new() } else { fixed(s.conic, 4) },
            asphere(s),
        ];
        Row::new(format!("{}{}", i + 1, if s.is_stop { " stop" } else { "" }), cells)
    });
    Table::new(columns).class("prescription").rows(rows).html()
}

/// The coefficients, `a4 = -4.0600·10⁻⁵, a6 = ...`, and further properties of the surface.
fn asphere(surface: &SurfaceView) -> String {
    let terms = surface.asphere.iter().map(|(order, value)| format!("a{order} = {}", significant(*value)));
    terms.chain(surface.more.iter().cloned()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use petzval_optics::analysis::first_order_table;

    use super::*;
    use crate::sample::{surfaces, triplet};

    #[test]
    fn every_surface_is_listed() {
        let table = prescription(&surfaces()).into_string();
        assert_eq!(table.matches("<tr>").count(), 3);
        assert!(table.contains("2 stop") && table.contains("N-SF11") && table.contains("∞"));
        assert!(table.contains("a4 = \u{2212}4.0600·10⁻⁵, a6 = ") && table.contains(", mirror = true"));
        assert!(table.contains("\u{2212}1.0000") && !table.contains("NaN"));
    }

    #[test]
    fn the_first_order_line_has_every_number() {
        let line = first_order_line(&first_order_table(&triplet()));
        assert!(line.starts_with("EFL 2") && !line.contains('–'), "{line}");
    }
}
