//! Axial colour and longitudinal aberration: paraxial focus over wavelength, and crossings of rays over the pupil.

use maud::html;
use petzval_optics::analysis::Analysis;

use super::style::{axis_with_zero, blank, field_name, wavelength_keys, wavelength_name, wavelength_pen};
use crate::palette::INK;
use crate::plot::{Axis, Curve, Frame, Names, Pen, Sheet, span};

/// Height of both frames, px.
const HEIGHT_PX: f64 = 420.0;

/// Chromatic focal shift beside longitudinal aberration.
pub(super) fn axial_colour(analysis: &Analysis) -> Sheet {
    let shift = &analysis.axial_colour;
    let pen = Pen { width: 1.9, ..Pen::thin(INK) };
    let over_wavelength = [Curve::beside(pen, 0, &shift.wavelength_um, shift.shift_mm.iter().copied())];
    let crossings = &analysis.longitudinal_aberration;
    let over_pupil: Vec<Curve> = crossings
        .crossing_mm
        .iter()
        .enumerate()
        .map(|(i, mm)| Curve::beside(wavelength_pen(analysis, i), i, &crossings.pupil, mm.iter().copied()))
        .collect();
    let (low, high) = span(shift.wavelength_um.iter().copied()).unwrap_or((0.0, 1.0));
    let frame = |left: f64, y: Axis, curves: &[Curve]| Frame {
        left,
        top: 30.0,
        width: 360.0,
        height: HEIGHT_PX,
        x: axis_with_zero(curves),
        y,
    };
    let focus = Names { head: "chromatic focal shift", x: "paraxial focus, mm", y: "wavelength, µm" };
    let zones = Names { head: "longitudinal aberration", x: "crossing from the image plane, mm", y: "pupil" };
    let body = html! {
        (frame(76.0, Axis::between(low, high, 6), &over_wavelength).draw(focus, &over_wavelength))
        (frame(526.0, Axis::between(0.0, 1.0, 5), &over_pupil).draw(zones, &over_pupil))
    };
    Sheet {
        remark: format!(
            "Left: paraxial focus from that at {}. Right: where {}, by height in the stop.",
            wavelength_name(analysis.reference_um),
            match analysis.first_order.image_na_field_deg {
                None => "rays of the axis cross it".to_owned(),
                Some(field_deg) => format!("rays of {} cross their chief ray", field_name(field_deg)),
            }
        ),
        keys: wavelength_keys(analysis),
        alt: format!("Focus of {} over wavelength and over the pupil", analysis.name),
        height: HEIGHT_PX + 80.0,
        body,
        ..blank(analysis, "axial-colour", "Axial colour and longitudinal aberration")
    }
}
