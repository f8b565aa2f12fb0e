//! Variables by kind: all numbers of one kind that a designer would let vary, with bounds about their own values.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Variable;
use super::usual::{gaps, powered, strongest};
use crate::lens::{Action, Departure, Lens};
use crate::number::Number;

/// A kind of numbers that may vary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Vary {
    /// Curvatures of surfaces with power, up to one and a half times the strongest of them, of either sign.
    Curvature,
    /// Thicknesses of glass, from a half to twice their own and 0.1 mm, so that those of next to nothing move too.
    Thickness,
    /// Gaps of air but the last, from a tenth to twice their own and 0.1 mm, so that those of next to nothing move too.
    Air,
    /// Conic constants of curved surfaces beside air, within 2 of their own.
    Conic,
    /// Coefficients a4 to a10 of curved surfaces beside air: each moves the sag at the clear radius by 2 % of that radius at most.
    Asphere,
}

/// How far a conic constant may move.
const CONIC: f64 = 2.0;

/// How far an aspheric term may move the sag at the clear radius, as a share of that radius.
const ASPHERE: f64 = 0.02;

/// Terms that vary: a4, a6, a8, a10. The r^2 term does what the curvature does.
const TERMS: std::ops::RangeInclusive<usize> = 1..=4;

/// The variables of some kinds, in the order of the kinds. None of a kind that the lens does not have.
pub fn varied(lens: &Lens, kinds: &[Vary]) -> Vec<Variable> {
    kinds.iter().flat_map(|kind| of_kind(lens, *kind)).collect()
}

fn of_kind(lens: &Lens, kind: Vary) -> Vec<Variable> {
    let about = |surface: usize, number: Number, half: f64| {
        let own = number.read(lens, surface);
        Variable { surface, number, min: own - half, max: own + half }
    };
    let shaped = || powered(lens).filter(|i| is_shaped(lens, *i));
    match kind {
        Vary::Curvature => {
            let Some(strongest) = strongest(lens) else { return Vec::new() };
            let (radius, number) = (1.0 / (1.5 * strongest), Number::Curvature);
            powered(lens).map(|surface| Variable { surface, number, min: -radius, max: radius }).collect()
        }
        Vary::Air => gaps(lens, [0.1, 2.0], true).collect(),
        Vary::Thickness => gaps(lens, [0.5, 2.0], false).collect(),
        Vary::Conic => shaped().map(|i| about(i, Number::Conic, CONIC)).collect(),
        Vary::Asphere => {
            let of_term = |i: usize, j: usize| {
                let radius_mm = lens.surfaces[i].semi_diameter_mm;
                about(i, Number::Asphere(j), ASPHERE * radius_mm / radius_mm.powi(2 * j as i32 + 2))
            };
            shaped().flat_map(|i| TERMS.map(move |j| of_term(i, j))).collect()
        }
    }
}

/// Whether a surface can be made with another shape than a sphere's: it is curved, and has air on one side.
fn is_shaped(lens: &Lens, surface: usize) -> bool {
    let s = &lens.surfaces[surface];
    let before = surface.checked_sub(1).is_none_or(|i| lens.surfaces[i].glass.is_air());
    let is_plain = !matches!(s.shape.departure, Departure::Biconic { .. } | Departure::Toroid { .. });
    let is_beside_air = before || s.glass.is_air() || s.action == Action::Reflect;
    s.shape.curvature != 0.0 && is_plain && is_beside_air
}
