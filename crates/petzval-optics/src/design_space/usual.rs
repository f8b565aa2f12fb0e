//! Variables for a lens whose file names none.

use super::{Solves, Variable};
use crate::lens::{Action, Lens};
use crate::number::Number;

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

/// Gaps of air, or thicknesses of glass, but the last, from one share of their length to another and 0.1 mm, so that gaps of next to nothing move too. A gap against the light starts at nothing instead,
/// and a stop at the rim of a surface, or a plane without effect that stands behind what follows it, stays there.
pub(super) fn gaps(lens: &Lens, shares: [f64; 2], of_air: bool) -> impl Iterator<Item = Variable> + '_ {
    let stays = move |i: usize| lens.is_beside_stop_at_rim(i) || lens.steps_back_at_idle_plane(i);
    let is_one = move |i: &usize| lens.surfaces[*i].glass.is_air() == of_air && !stays(*i);
    (0..lens.surfaces.len() - 1).filter(is_one).map(move |surface| {
        let light = if lens.light_goes_forwards(surface) { 1.0 } else { -1.0 };
        let gap = light * lens.surfaces[surface].thickness_mm;
        let (near, far) = (light * shares[0] * gap.max(0.0), light * (shares[1] * gap.abs() + 0.1));
        Variable { surface, number: Number::Thickness, min: near.min(far), max: near.max(far) }
    })
}

/// The room of a search: every curvature with power, up to one and a half times the strongest of them, and every gap of air but the last, from
/// a tenth to twice its length and 0.1 mm. None if no surface is curved.
pub fn wide_variables(lens: &Lens) -> Option<Vec<Variable>> {
    let radius = 1.0 / (1.5 * strongest(lens)?);
    let number = Number::Curvature;
    let radii = powered(lens).map(|surface| Variable { surface, number, min: -radius, max: radius });
    Some(radii.chain(gaps(lens, [0.1, 2.0], true)).collect())
}

/// How far a surface that a lens has flat may bend, as a share of its strongest curvature.
const BEND: f64 = 0.2;

/// How far conic constants move.
const CONIC: f64 = 0.5;

/// How far coefficients of aspheres move, as a share of their value.
const COEFFICIENT: f64 = 0.5;

/// The neighbourhood in which a lens is refined:
///
/// - Curvatures within a fifth of their own value. A plane of an element that is curved elsewhere may bend by a fifth of the strongest curvature of
///   the lens; plates stay plates.
/// - Conic constants of aspheres, by a half, and the coefficients that the lens has, by a half of their value.
/// - Gaps of air but the last, from three quarters of their length to five quarters and 0.1 mm, so that gaps of next to nothing move too.
/// - A solve by which the last curved surface holds the focal length or, of a near object, the magnification.
///
/// None if no surface with power is curved, or the lens has no focal length. Numbers that the `solves` of the lens settle already are no variables, and
/// a solve for the focal length stays as it is.
pub fn near_variables(lens: &Lens, solves: &Solves) -> Option<(Vec<Variable>, Solves)> {
    let radius = |surface: usize| {
        let own = 1.0 / lens.surfaces[surface].shape.curvature;
        let (a, b) = (own / (1.0 + BEND), own / (1.0 - BEND));
        Variable { surface, number: Number::Curvature, min: a.min(b), max: a.max(b) }
    };
    let is_curved = |i: &usize| lens.surfaces[*i].shape.curvature != 0.0;
    let curved: Vec<usize> = powered(lens).filter(is_curved).collect();
    let (held, surface) = match solves.curvature() {
        Some((surface, _)) => (*solves, surface),
        None => {
            let Variable { surface, min, max, .. } = radius(*curved.last()?);
            (solves.holding(lens, surface, Some([min, max]))?, surface)
        }
    };
    let flattest = 1.0 / (BEND * strongest(lens)?);
    let bent =
        |surface: usize| Variable { surface, number: Number::Curvature, min: -flattest, max: flattest };
    let in_curved_element = |i: &usize| element(lens, *i).any(|of_it| is_curved(&of_it));
    let moved = powered(lens).filter(|i| *i != surface).filter(in_curved_element);
    let radii = moved.map(|i| if is_curved(&i) { radius(i) } else { bent(i) });
    let aspheres = powered(lens).flat_map(|i| aspheric(lens, i));
    let is_free = |gap: &Variable| solves.length.is_none_or(|(surface, _)| surface != gap.surface);
    let all = radii.chain(aspheres).chain(gaps(lens, [0.75, 1.25], true).filter(is_free)).collect();
    Some((all, held))
}

/// The surfaces of the element, single or cemented, that a surface with power belongs to.
fn element(lens: &Lens, surface: usize) -> std::ops::RangeInclusive<usize> {
    let is_glass_behind = |i: usize| !lens.surfaces[i].glass.is_air();
    let first = (0..surface).rev().take_while(|i| is_glass_behind(*i)).last().unwrap_or(surface);
    let last = (surface..lens.surfaces.len() - 1).take_while(|i| is_glass_behind(*i)).last();
    first..=last.map_or(surface, |i| i + 1)
}

/// The conic constant and the coefficients of a surface that is an asphere, as far as it has them.
fn aspheric(lens: &Lens, surface: usize) -> Vec<Variable> {
    let shape = &lens.surfaces[surface].shape;
    let semi_mm = lens.surfaces[surface].semi_diameter_mm;
    let terms = shape.asphere.iter().enumerate().map(|(i, a)| (Number::Asphere(i), *a));
    let departures = shape.departure.numbers().into_iter().enumerate();
    let departures = departures.map(|(k, value)| (Number::Departure(k), value));
    let found = terms.chain(departures).filter(|(_, value)| *value != 0.0).map(|(number, value)| {
        let reach = COEFFICIENT * value.abs();
        Variable { surface, number, min: value - reach, max: value + reach }
    });
    let mut found: Vec<Variable> = found.collect();
    let is_asphere = shape.conic != 0.0 || !found.is_empty();
    // With a conic constant too large, a steep surface ends within its clear edge.
    let reaches_edge = |conic: f64| (1.0 + conic) * (shape.curvature * semi_mm).powi(2) < 0.95;
    let conic =
        Variable { surface, number: Number::Conic, min: shape.conic - CONIC, max: shape.conic + CONIC };
    if is_asphere
        && shape.curvature != 0.0
        && lens.surfaces[surface].has_number(Number::Conic)
        && reaches_edge(conic.max)
    {
        found.push(conic);
    }
    found
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::glass::{Dispersion, Glass};
    use crate::lens::{ObjectDistance, Surface, SurfaceShape};

    /// A plano-convex lens, an asphere and a cover plate.
    fn lens() -> Lens {
        let glass = Arc::new(Glass::new("G", Dispersion::Constant(1.5)));
        let surface = |curvature: f64, thickness_mm: f64, is_glass: bool| Surface {
            shape: SurfaceShape { curvature, ..SurfaceShape::PLANE },
            thickness_mm,
            glass: if is_glass { glass.clone() } else { Glass::air() },
            semi_diameter_mm: 5.0,
            ..Surface::default()
        };
        let mut surfaces = vec![
            surface(0.04, 3.0, true),
            surface(0.0, 2.0, false),
            surface(0.02, 3.0, true),
            surface(-0.03, 10.0, false),
            surface(0.0, 1.0, true),
            surface(0.0, 20.0, false),
        ];
        surfaces[2].shape.asphere[1] = -2e-6;
        Lens {
            name: String::new(),
            source: String::new(),
            surfaces,
            stop: 0,
            entrance_pupil_mm: 8.0,
            object: ObjectDistance::Infinity,
            wavelengths_um: vec![0.55],
            reference_um: 0.55,
            fields_deg: vec![0.0],
        }
    }

    #[test]
    fn what_a_designer_varies() {
        let lens = lens();
        let (variables, solves) = near_variables(&lens, &Solves::default()).unwrap();
        let of = |number: Number| -> Vec<usize> {
            variables.iter().filter(|v| v.number == number).map(|v| v.surface).collect()
        };
        // The plane behind the first surface may bend, those of the plate stay, and the last curved surface holds the focal length.
        assert_eq!(of(Number::Curvature), [0, 1, 2]);
        assert_eq!((solves.curvature().unwrap().0, solves.held_in_words()), (3, "the focal length"));
        // Of a near object, the same surface holds the magnification.
        let near = Lens { object: ObjectDistance::Finite(300.0), ..lens.clone() };
        let (same, solves) = near_variables(&near, &Solves::default()).unwrap();
        let solve = solves.magnification.unwrap();
        assert_eq!(
            (same.len(), solve.surface, solves.held_in_words()),
            (variables.len(), 3, "the magnification")
        );
        assert!((-1.0..0.0).contains(&solve.magnification), "{}", solve.magnification);
        assert_eq!(of(Number::Thickness), [1, 3]);
        assert_eq!(of(Number::Asphere(1)), [2]);
        assert_eq!(of(Number::Conic), [2]);
        let plane = variables.iter().find(|v| v.surface == 1 && v.number == Number::Curvature).unwrap();
        let [low, high] = plane.bounds();
        assert!((low + 0.2 * 0.04).abs() < 1e-12 && (high - 0.2 * 0.04).abs() < 1e-12, "{low} {high}");
        // Each encloses the number of the lens.
        for v in &variables {
            let [low, high] = v.bounds();
            let own = v.number.read(&lens, v.surface);
            assert!(low < own && own < high, "{v:?}");
        }
    }
}
