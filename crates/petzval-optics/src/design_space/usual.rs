//! Variables for a lens whose file names none.

use super::{EflSolve, Solves, Variable};
use crate::lens::{Action, Lens};
use crate::number::Number;
use crate::paraxial::first_order;

/// Surfaces between two media, and mirrors that are not flat.
pub fn powered(lens: &Lens) -> impl Iterator<Item = usize> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let bends = |i: &usize| {
        let s = &lens.surfaces[*i];
        match s.action {
            Action::Refract => sequence.surfaces[*i].n_before != sequence.surfaces[*i].n_after,
            Action::Reflect => s.shape.curvature != 0.0,
            Action::ThinLens { .. } => false,
        }
    };
    (0..lens.surfaces.len()).filter(bends).collect::<Vec<_>>().into_iter()
}

/// The greatest curvature of a surface with power, 1/mm; none if all are flat.
pub(super) fn strongest(lens: &Lens) -> Option<f64> {
    let greatest = powered(lens).map(|i| lens.surfaces[i].shape.curvature.abs()).fold(0.0, f64::max);
    (greatest > 0.0).then_some(greatest)
}

/// Gaps of air, or thicknesses of glass, but the last, from one share of their length to another, at least 0.1 mm wide. A gap against the light starts at nothing instead,
/// and a stop at the rim of a surface stays there.
pub(super) fn gaps(lens: &Lens, shares: [f64; 2], of_air: bool) -> impl Iterator<Item = Variable> + '_ {
    let is_one =
        move |i: &usize| lens.surfaces[*i].glass.is_air() == of_air && !lens.is_beside_stop_at_rim(*i);
    (0..lens.surfaces.len() - 1).filter(is_one).map(move |surface| {
        let light = if lens.light_goes_forwards(surface) { 1.0 } else { -1.0 };
        let gap = light * lens.surfaces[surface].thickness_mm;
        let (near, far) = (light * shares[0] * gap.max(0.0), light * (shares[1] * gap.abs() + 0.1));
        Variable { surface, number: Number::Thickness, min: near.min(far), max: near.max(far) }
    })
}

/// The room of a search: every curvature with power, up to one and a half times the strongest of them, and every gap of air but the last, from
/// a tenth to twice its length. None if no surface is curved.
pub fn wide_variables(lens: &Lens) -> Option<Vec<Variable>> {
    let radius = 1.0 / (1.5 * strongest(lens)?);
    let number = Number::Curvature;
    let radii = powered(lens).map(|surface| Variable { surface, number, min: -radius, max: radius });
    Some(radii.chain(gaps(lens, [0.1, 2.0], true)).collect())
}

/// The neighbourhood in which a lens is refined: curvatures within a fifth of their own value, so that flat surfaces stay flat, and gaps of air
/// but the last from three quarters to five quarters of their length; and the solve by which the last curved surface holds the focal
/// length. None if no surface with power is curved, or the lens has no focal length.
///
/// Numbers that the `solves` of the lens settle already are no variables, and a solve for the focal length stays as it is.
pub fn near_variables(lens: &Lens, solves: &Solves) -> Option<(Vec<Variable>, EflSolve)> {
    let radius = |surface: usize| {
        let own = 1.0 / lens.surfaces[surface].shape.curvature;
        let (a, b) = (own / 1.2, own / 0.8);
        Variable { surface, number: Number::Curvature, min: a.min(b), max: a.max(b) }
    };
    let curved: Vec<usize> = powered(lens).filter(|i| lens.surfaces[*i].shape.curvature != 0.0).collect();
    let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
    let solve = match solves.efl {
        Some(solve) => solve,
        None => {
            let Variable { surface, min, max, .. } = radius(*curved.last()?);
            EflSolve { surface, efl_mm, radius_mm: Some([min, max]) }
        }
    };
    let radii = curved.iter().filter(|i| **i != solve.surface).map(|i| radius(*i));
    let is_free = |gap: &Variable| solves.length.is_none_or(|(surface, _)| surface != gap.surface);
    let moved = radii.chain(gaps(lens, [0.75, 1.25], true).filter(is_free)).collect();
    efl_mm.is_finite().then_some((moved, solve))
}
