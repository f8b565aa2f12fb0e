//! Stops that stand exactly at the focus of what is in front of them.

use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, paraxial_ray};

use super::item::Drafted;
use crate::loss::{Effect, Losses};

/// Step off the focus, as a share of the focal length in front of the stop. Chief rays are then parallel to the axis within this share of the
/// object's height over the focal length, far below any pupil aberration.
const STEP: f64 = 1e-6;

/// Moves the stop of a lens for a near object off the focus of what is in front of it.
///
/// Exactly there the entrance pupil is at infinity (telecentric), and no diameter says how large it is. Only a plane without effect can move.
pub(super) fn off_the_focus(mut lens: Lens, drafted: &[Drafted], losses: &mut Losses) -> Lens {
    let sequence = lens.at_wavelength(lens.reference_um);
    let stop = lens.stop;
    let is_exact = lens.object != ObjectDistance::Infinity && first_order(&sequence).stop_radius_mm == 0.0;
    let Some(before) = stop.checked_sub(1).filter(|_| is_exact && lens.is_idle_plane(stop)) else {
        return lens;
    };
    // A ray parallel to the axis crosses it at the stop, with the slope 1 / f.
    let slope = paraxial_ray(&sequence, 1.0, 0.0).w[stop];
    let light = if lens.light_goes_forwards(stop) { 1.0 } else { -1.0 };
    let step_mm = light * STEP / slope.abs();
    lens.surfaces[before].thickness_mm += step_mm;
    lens.surfaces[stop].thickness_mm -= step_mm;
    let record = &drafted[stop].record;
    let message = format!(
        "the stop is exactly at the focus in front of it (telecentric), and moves {:.1e} mm off it: an entrance pupil at infinity has no size",
        step_mm.abs()
    );
    losses.add(record.line, &record.text, Effect::Approximated, message);
    lens
}
