//! The numbers of a surface, by name: the one vocabulary of gradients, Jacobians, variables and tolerances.

use std::fmt;

/// Number of even polynomial terms of a surface: a_2, a_4, ... a_16.
pub const ASPHERE_TERMS: usize = 8;

/// Numbers that the departure of a shape has at most.
pub const DEPARTURE_NUMBERS: usize = 44;

/// Number of coefficients of a radial phase: of r^2, r^4, ..., r^16.
pub const PHASE_TERMS: usize = 8;

/// A number of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// Vertex curvature, 1/mm. Users state it as a radius.
    Curvature,
    /// Conic constant.
    Conic,
    /// Distance to the next vertex, mm.
    Thickness,
    /// Index of the medium behind, shifted alike at every wavelength.
    Index,
    /// Clear semi-diameter, mm.
    SemiDiameter,
    /// Coefficient of r^(2 + 2 j), with j below [`ASPHERE_TERMS`].
    Asphere(usize),
    /// A number of the departure, see [`Departure::numbers`](crate::lens::Departure::numbers).
    Departure(usize),
    /// A number of a diffractive structure: lines per mm, or a coefficient.
    Phase(usize),
    /// Power of a thin lens, 1/mm.
    Power,
    /// Decentre along x (0) or y (1), mm, of a surface that has a placement.
    Decenter(usize),
    /// Tilt about x (0), y (1) or z (2), rad, of a surface that has a placement. Users state it in degrees.
    Tilt(usize),
}

/// Slots of the first of each group of numbers.
const ASPHERE: usize = 5;
const DEPARTURE: usize = ASPHERE + ASPHERE_TERMS;
const PHASE: usize = DEPARTURE + DEPARTURE_NUMBERS;
const POWER: usize = PHASE + PHASE_TERMS;
const DECENTER: usize = POWER + 1;
const TILT: usize = DECENTER + 2;

impl Number {
    /// How many numbers a surface can have.
    pub const COUNT: usize = TILT + 3;

    /// Slots below this one hold the numbers of a plain surface: a conic with an even polynomial, on the axis.
    pub(crate) const PLAIN: usize = DEPARTURE;

    /// Every number, in the order of the slots.
    pub const ALL: [Self; Self::COUNT] = {
        let mut all = [Self::Curvature; Self::COUNT];
        let mut slot = 0;
        while slot < Self::COUNT {
            all[slot] = match slot {
                0 => Self::Curvature,
                1 => Self::Conic,
                2 => Self::Thickness,
                3 => Self::Index,
                4 => Self::SemiDiameter,
                ASPHERE..DEPARTURE => Self::Asphere(slot - ASPHERE),
                DEPARTURE..PHASE => Self::Departure(slot - DEPARTURE),
                PHASE..POWER => Self::Phase(slot - PHASE),
                POWER => Self::Power,
                DECENTER..TILT => Self::Decenter(slot - DECENTER),
                _ => Self::Tilt(slot - TILT),
            };
            slot += 1;
        }
        all
    };

    /// Its place among the numbers of a surface, below [`Number::COUNT`].
    #[inline(always)]
    pub const fn slot(self) -> usize {
        match self {
            Self::Curvature => 0,
            Self::Conic => 1,
            Self::Thickness => 2,
            Self::Index => 3,
            Self::SemiDiameter => 4,
            Self::Asphere(j) => {
                debug_assert!(j < ASPHERE_TERMS);
                ASPHERE + j
            }
            Self::Departure(k) => {
                debug_assert!(k < DEPARTURE_NUMBERS);
                DEPARTURE + k
            }
            Self::Phase(k) => {
                debug_assert!(k < PHASE_TERMS);
                PHASE + k
            }
            Self::Power => POWER,
            Self::Decenter(axis) => {
                debug_assert!(axis < 2);
                DECENTER + axis
            }
            Self::Tilt(axis) => {
                debug_assert!(axis < 3);
                TILT + axis
            }
        }
    }

    /// A value as users state it: the radius of a curvature, mm, and a tilt in degrees; any other number as it is.
    pub fn stated(self, value: f64) -> f64 {
        match self {
            Self::Curvature => 1.0 / value,
            _ => self.stated_difference(value),
        }
    }

    /// The inverse of [`Number::stated`].
    pub fn from_stated(self, stated: f64) -> f64 {
        match self {
            Self::Curvature => 1.0 / stated,
            _ => self.from_stated_difference(stated),
        }
    }

    /// A difference of two values as users state it, such as the offset of a pickup: of tilts in degrees, any other as it is. Radii differ by
    /// their curvatures, 1/mm.
    pub fn stated_difference(self, difference: f64) -> f64 {
        match self {
            Self::Tilt(_) => difference.to_degrees(),
            _ => difference,
        }
    }

    /// The inverse of [`Number::stated_difference`].
    pub fn from_stated_difference(self, stated: f64) -> f64 {
        match self {
            Self::Tilt(_) => stated.to_radians(),
            _ => stated,
        }
    }
}

impl fmt::Display for Number {
    /// The name that lens files use for what users state; a departure or a phase by its place.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const AXES: [&str; 3] = ["x", "y", "z"];
        match self {
            Self::Curvature => f.write_str("radius_mm"),
            Self::Conic => f.write_str("conic"),
            Self::Thickness => f.write_str("thickness_mm"),
            Self::Index => f.write_str("index"),
            Self::SemiDiameter => f.write_str("semi_diameter_mm"),
            Self::Asphere(j) => write!(f, "a{}", 2 * j + 2),
            Self::Departure(k) => write!(f, "departure number {}", k + 1),
            Self::Phase(k) => write!(f, "phase number {}", k + 1),
            Self::Power => f.write_str("thin_lens.power_per_mm"),
            Self::Decenter(axis) => write!(f, "decenter_{}_mm", AXES[*axis]),
            Self::Tilt(axis) => write!(f, "tilt_{}_deg", AXES[*axis]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_the_places_in_the_list() {
        for (slot, number) in Number::ALL.into_iter().enumerate() {
            assert_eq!(number.slot(), slot, "{number:?}");
        }
    }
}
