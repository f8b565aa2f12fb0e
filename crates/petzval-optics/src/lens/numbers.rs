//! Numbers of a lens by name: read, written, and what they do to its symmetry.

use super::{Action, Lens, SurfaceShape};
use crate::number::Number;

impl Number {
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

    /// Its value in a lens, as users state it.
    pub fn read_stated(self, lens: &Lens, surface: usize) -> f64 {
        self.stated(self.read(lens, surface))
    }

    /// Whether a change of it breaks the symmetry of the lens about the y-z plane, in which the fields lie.
    pub(crate) fn breaks_mirror_symmetry(self, shape: &SurfaceShape) -> bool {
        match self {
            Self::Departure(k) => !shape.departure.is_mirror_symmetric_in(k),
            Self::Decenter(axis) => axis == 0,
            Self::Tilt(axis) => axis != 0,
            _ => false,
        }
    }
}
