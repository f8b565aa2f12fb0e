//! Stops that stand exactly at the focus of what is in front of them.

use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, paraxial_ray};

use super::item::Drafted;
use crate::loss::{Effect, Losses};

/// Step off the focus, as a share of the focal length in front of the stop. Chief rays are then parallel to the axis within this share of the
/// object's height over the focal length, far below any pupil aberration.
const STEP: f64 = 1e-6;

/// Why no far object has a lens whose stop stands exactly at the focus of what is in front of it.
pub(crate) const FAR_PUPIL: &str = "the stop is exactly at the focus of what is in front of it: the entrance pupil of a far object lies at infinity, \
                                    and no diameter says how large it is";

/// Whether the stop of a lens stands exactly at the focus of what is in front of it: its entrance pupil is at infinity.
pub(crate) fn has_pupil_at_infinity(lens: &Lens) -> bool {
    first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm == 0.0
}

/// Whether the stop of a lens for a near object stands exactly at the focus of what is in front of it: its entrance pupil is at infinity
/// (telecentric), and no diameter says how large it is.
fn is_exactly_telecentric(lens: &Lens) -> bool {
    lens.object != ObjectDistance::Infinity && has_pupil_at_infinity(lens)
}

/// A lens whose stop stands exactly at that focus, with the stop a little behind it, and by how much it moved, mm; `None` if the stop is no
/// plane that can move.
pub(crate) fn with_stop_beside_focus(lens: &Lens) -> Option<(Lens, f64)> {
    let stop = lens.stop;
    let before = stop.checked_sub(1).filter(|_| lens.is_idle_plane(stop))?;
    // A ray parallel to the axis crosses it at the stop, with the slope 1 / f.
    let slope = paraxial_ray(&lens.at_wavelength(lens.reference_um), 1.0, 0.0).w[stop];
    let light = if lens.light_goes_forwards(stop) { 1.0 } else { -1.0 };
    let step_mm = light * STEP / slope.abs();
    let mut moved = lens.clone();
    moved.surfaces[before].thickness_mm += step_mm;
    moved.surfaces[stop].thickness_mm -= step_mm;
    Some((moved, step_mm))
}

/// Moves the stop of a lens for a near object off the focus of what is in front of it, if it stands exactly there and can move.
pub(super) fn off_the_focus(lens: Lens, drafted: &[Drafted], losses: &mut Losses) -> Lens {
    let found = is_exactly_telecentric(&lens).then(|| with_stop_beside_focus(&lens)).flatten();
    let Some((lens, step_mm)) = found else { return lens };
    let stop = lens.stop;
    let record = &drafted[stop].record;
    let message = format!(
        "the stop is exactly at the focus in front of it (telecentric), and moves {:.1e} mm off it: an entrance pupil at infinity has no size",
        step_mm.abs()
    );
    record.lose(losses, Effect::Approximated, message);
    lens
}
