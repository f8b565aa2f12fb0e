//! The numbers of a lens, by name.

use crate::gradient::LensGradient;
use crate::lens::{Action, Lens, ShapeNumber};

/// A number of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// Vertex curvature, 1/mm.
    Curvature,
    /// Conic constant.
    Conic,
    /// Coefficient of r^(2 + 2 j).
    Asphere(usize),
    /// Distance to the next vertex, mm.
    Thickness,
    /// Index of the medium behind.
    Index,
    /// A number of the departure of the shape.
    Departure(usize),
    /// A number of a diffractive structure.
    Phase(usize),
    /// Power of a thin lens, 1/mm.
    Power,
}

impl Number {
    /// Its value in a lens; no number if its surface has none such. An index is counted from that of the glass.
    pub fn read(self, lens: &Lens, surface: usize) -> f64 {
        let s = &lens.surfaces[surface];
        match self {
            Self::Curvature => s.shape.curvature,
            Self::Conic => s.shape.conic,
            Self::Asphere(j) => s.shape.asphere[j],
            Self::Thickness => s.thickness_mm,
            Self::Index => 0.0,
            Self::Departure(k) => s.shape.departure.numbers().get(k).copied().unwrap_or(f64::NAN),
            Self::Phase(k) => s.phase.map_or(f64::NAN, |mut p| p.number_mut(k).map_or(f64::NAN, |v| *v)),
            Self::Power => match s.action {
                Action::ThinLens { power_per_mm } => power_per_mm,
                _ => f64::NAN,
            },
        }
    }

    /// Changes it in a lens, where its surface has such a number; an index stays that of the glass.
    pub fn write(self, lens: &mut Lens, surface: usize, value: f64) {
        let s = &mut lens.surfaces[surface];
        let to = match self {
            Self::Curvature => s.shape.number_mut(ShapeNumber::Curvature),
            Self::Conic => s.shape.number_mut(ShapeNumber::Conic),
            Self::Asphere(j) => s.shape.number_mut(ShapeNumber::Asphere(j)),
            Self::Thickness => Some(&mut s.thickness_mm),
            Self::Index => None,
            Self::Departure(k) => s.shape.number_mut(ShapeNumber::Departure(k)),
            Self::Phase(k) => s.phase.as_mut().and_then(|p| p.number_mut(k)),
            Self::Power => match &mut s.action {
                Action::ThinLens { power_per_mm } => Some(power_per_mm),
                _ => None,
            },
        };
        if let Some(to) = to {
            *to = value;
        }
    }

    /// Adds to the derivative by it.
    pub fn add(self, gradient: &mut LensGradient, surface: usize, value: f64) {
        let g = &mut gradient.surfaces[surface];
        let to = match self {
            Self::Curvature => &mut g.curvature,
            Self::Conic => &mut g.conic,
            Self::Asphere(j) => &mut g.asphere[j],
            Self::Thickness => &mut g.thickness,
            Self::Index => &mut g.index,
            Self::Departure(k) => &mut g.departure[k],
            Self::Phase(k) => &mut g.phase[k],
            Self::Power => &mut g.power,
        };
        *to += value;
    }

    /// The derivative by it.
    pub fn derivative(self, gradient: &LensGradient, surface: usize) -> f64 {
        let g = &gradient.surfaces[surface];
        match self {
            Self::Curvature => g.curvature,
            Self::Conic => g.conic,
            Self::Asphere(j) => g.asphere[j],
            Self::Thickness => g.thickness,
            Self::Index => g.index,
            Self::Departure(k) => g.departure[k],
            Self::Phase(k) => g.phase[k],
            Self::Power => g.power,
        }
    }
}
