//! Where the image plane of a lens goes for a design, and how far it may move there.

use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::Quadrature;
use petzval_optics::solve::{with_best_focus, with_paraxial_focus};
use petzval_optics::spot::mean_square_spot_traced;

/// Pupil cells a side of the best focus.
const CELLS: usize = 48;

/// A plane whose RMS spot is larger than that of the best focus by this share or less stays.
const CLOSE: f64 = 0.02;

/// The half-range of the image plane as a share of the focal length: 0.5 mm of the 25 mm of the built-in triplet.
const RANGE: f64 = 0.02;

/// How many times as far as from the paraxial focus to its place an image plane may move.
const TWICE: f64 = 2.0;

/// Bounds of `optics.defocus_mm`.
const RANGE_MM: [f64; 2] = [1e-3, 100.0];

/// The place of an image plane.
pub(super) struct Focused {
    /// Distance from the last vertex, mm.
    pub distance_mm: f64,
    /// What to say if it has moved.
    pub note: Option<String>,
}

/// The best focus of a lens over some fields, rad; its own plane if that is as good. `start` is the lens in focus for any field, from which the search
/// begins. `None` if a field has no light.
pub(super) fn best(lens: &Lens, start: &Lens, fields_rad: &[f64]) -> Option<Focused> {
    let quadrature = Quadrature::grid(CELLS).ok()?;
    let at = with_best_focus(&lens.with_image_distance(start.image_distance_mm()), fields_rad, &quadrature)?;
    let rms_um =
        |lens: &Lens| Some(mean_square_spot_traced(lens, fields_rad, &quadrature)?.0.max(0.0).sqrt());
    let (own, best) = (rms_um(lens), rms_um(&at)?);
    if own.is_some_and(|own| own <= (1.0 + CLOSE) * best) {
        return Some(Focused { distance_mm: lens.image_distance_mm(), note: None });
    }
    let moved_mm = lens.away_from_lens_mm(at.image_distance_mm() - lens.image_distance_mm());
    let before = own.map_or("no image".to_owned(), |own| format!("{own:.1} um"));
    let note = format!(
        "focus: the image plane moves by {moved_mm:+.4} mm to the best focus over the sensor; RMS spot {best:.1} um, before {before}"
    );
    Some(Focused { distance_mm: at.image_distance_mm(), note: Some(note) })
}

/// The lens at its best focus over those fields; at its paraxial focus if no light of some of them arrives.
pub(super) fn roughly(lens: &Lens, fields_rad: &[f64]) -> Lens {
    let paraxial = with_paraxial_focus(lens, 0.0);
    let best = || with_best_focus(&paraxial, fields_rad, &Quadrature::grid(CELLS).ok()?);
    best().unwrap_or(paraxial)
}

/// Half-range of the image plane around the paraxial focus, mm: a share of the focal length, and enough for where the plane is.
pub(super) fn range_mm(lens: &Lens, usual_mm: f64) -> f64 {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let away_mm = (lens.image_distance_mm() - order.image_distance_mm).abs();
    let wanted_mm = if order.efl_mm.is_finite() { RANGE * order.efl_mm.abs() } else { usual_mm };
    let range_mm = wanted_mm.max(TWICE * away_mm).clamp(RANGE_MM[0], RANGE_MM[1]);
    round(range_mm)
}

/// A number to two significant digits, upwards.
pub(super) fn round(value: f64) -> f64 {
    let unit = 10.0_f64.powf(value.abs().log10().floor() - 1.0);
    let rounded = (value / unit - 1e-9).ceil() * unit;
    // Free of the error of the multiplication.
    format!("{rounded:.9}").parse().unwrap_or(rounded)
}
