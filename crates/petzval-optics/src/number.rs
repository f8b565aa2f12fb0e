//! The numbers of a surface, by name: the one vocabulary of gradients, Jacobians, variables and tolerances.

use std::fmt;

use crate::lens::{ASPHERE_TERMS, Action, DEPARTURE_NUMBERS, Lens, PHASE_TERMS};

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

    /// Its value in a lens; NaN if the surface has no such number. An index is counted from that of the glass.
    pub fn read(self, lens: &Lens, surface: usize) -> f64 {
        let s = &lens.surfaces[surface];
        match self {
            Self::Curvature => s.shape.curvature,
            Self::Conic => s.shape.conic,
            Self::Thickness => s.thickness_mm,
            Self::Index => 0.0,
            Self::SemiDiameter => s.semi_diameter_mm,
            Self::Asphere(j) => s.shape.asphere[j],
            Self::Departure(k) => s.shape.departure.numbers().get(k).copied().unwrap_or(f64::NAN),
            Self::Phase(k) => s.phase.map_or(f64::NAN, |mut p| p.number_mut(k).map_or(f64::NAN, |v| *v)),
            Self::Power => match s.action {
                Action::ThinLens { power_per_mm } => power_per_mm,
                _ => f64::NAN,
            },
            Self::Decenter(axis) => s.placement.map_or(f64::NAN, |p| p.decenter_mm[axis]),
            Self::Tilt(axis) => s.placement.map_or(f64::NAN, |p| p.tilt_rad[axis]),
        }
    }

    /// Changes it in a lens, where the surface has such a number; an index stays that of the glass.
    pub fn write(self, lens: &mut Lens, surface: usize, value: f64) {
        let s = &mut lens.surfaces[surface];
        let to = match self {
            Self::Curvature | Self::Conic | Self::Asphere(_) | Self::Departure(_) => s.shape.number_mut(self),
            Self::Thickness => Some(&mut s.thickness_mm),
            Self::Index => None,
            Self::SemiDiameter => Some(&mut s.semi_diameter_mm),
            Self::Phase(k) => s.phase.as_mut().and_then(|p| p.number_mut(k)),
            Self::Power => match &mut s.action {
                Action::ThinLens { power_per_mm } => Some(power_per_mm),
                _ => None,
            },
            Self::Decenter(axis) => s.placement.as_mut().map(|p| &mut p.decenter_mm[axis]),
            Self::Tilt(axis) => s.placement.as_mut().map(|p| &mut p.tilt_rad[axis]),
        };
        if let Some(to) = to {
            *to = value;
        }
    }

    /// A value as users state it: the radius of a curvature, mm, and a tilt in degrees; any other number as it is.
    pub fn stated(self, value: f64) -> f64 {
        match self {
            Self::Curvature => 1.0 / value,
            Self::Tilt(_) => value.to_degrees(),
            _ => value,
        }
    }

    /// The inverse of [`Number::stated`].
    pub fn from_stated(self, stated: f64) -> f64 {
        match self {
            Self::Curvature => 1.0 / stated,
            Self::Tilt(_) => stated.to_radians(),
            _ => stated,
        }
    }

    /// Its value in a lens, as users state it.
    pub fn read_stated(self, lens: &Lens, surface: usize) -> f64 {
        self.stated(self.read(lens, surface))
    }

    /// Whether a change of it breaks the symmetry of the lens about the y-z plane, in which the fields lie.
    pub(crate) fn breaks_mirror_symmetry(self, lens: &Lens, surface: usize) -> bool {
        match self {
            Self::Departure(k) => !lens.surfaces[surface].shape.departure.is_mirror_symmetric_in(k),
            Self::Decenter(axis) => axis == 0,
            Self::Tilt(axis) => axis != 0,
            _ => false,
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
