//! What may be other than drawn: a quantity, and the surfaces that it belongs to.

use std::fmt;

use super::ToleranceError;
use crate::lens::{Action, Axis, Departure, Lens};

/// Wavelength in which fringes are counted, um: a helium-neon laser.
pub const FRINGE_UM: f64 = 0.6328;

/// Arc minutes per radian.
pub const ARCMIN_PER_RAD: f64 = 180.0 * 60.0 / std::f64::consts::PI;

/// A quantity that may be other than drawn. Each is counted from its nominal value, in the unit that is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Vertex radius, mm.
    Radius,
    /// Vertex radius, percent of itself.
    RadiusPercent,
    /// Power in fringes: over the clear semi-diameter r the surface departs by `N lambda / 2` from its test plate, so that the
    /// curvature changes by `N lambda / r^2`.
    Power,
    /// Conic constant.
    Conic,
    /// Irregularity that is alike all round, peak to valley in fringes, without power: `A (p^4 - p^2)` with p the height as a share
    /// of the clear semi-diameter and `A = 2 N lambda`.
    Irregularity,
    /// A form error `A p^n` with p the height as a share of the clear semi-diameter, n = 2, 4, ..., 16 and A in um.
    Form(usize),
    /// Distance to the next vertex, mm; all that follows moves along.
    Thickness,
    /// Index of the medium behind, alike at every wavelength.
    Index,
    /// Abbe number of the medium behind, percent of itself, at a fixed index of the d line.
    Abbe,
    /// Shift along x, mm.
    DecenterX,
    /// Shift along y, mm.
    DecenterY,
    /// Turn about the x axis through the vertex of the first of the surfaces, arc minutes.
    TiltX,
    /// Turn about the y axis through the vertex of the first of the surfaces, arc minutes.
    TiltY,
    /// Shift along the axis, mm, between neighbours that stay.
    Shift,
}

impl Quantity {
    /// The unit; empty for a plain number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Radius | Self::Thickness | Self::DecenterX | Self::DecenterY | Self::Shift => "mm",
            Self::RadiusPercent | Self::Abbe => "%",
            Self::Power | Self::Irregularity => "fringes",
            Self::Form(_) => "um",
            Self::TiltX | Self::TiltY => "arcmin",
            Self::Conic | Self::Index => "",
        }
    }

    /// Whether it moves surfaces as a rigid body.
    pub fn is_motion(self) -> bool {
        matches!(self, Self::DecenterX | Self::DecenterY | Self::TiltX | Self::TiltY | Self::Shift)
    }

    /// Whether a rotationally symmetric lens keeps its symmetry.
    pub fn keeps_symmetry(self) -> bool {
        !matches!(self, Self::DecenterX | Self::DecenterY | Self::TiltX | Self::TiltY)
    }

    /// A change that is small against what matters, and large against rounding, in its unit.
    pub(super) fn step(self) -> f64 {
        match self {
            Self::Radius => 1e-4,
            Self::RadiusPercent | Self::Conic | Self::Thickness | Self::Shift => 1e-3,
            Self::DecenterX | Self::DecenterY => 1e-3,
            Self::Power | Self::Irregularity | Self::Form(_) | Self::TiltX | Self::TiltY => 0.03,
            Self::Index => 1e-5,
            Self::Abbe => 0.01,
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Radius | Self::RadiusPercent => f.write_str("radius"),
            Self::Power => f.write_str("power"),
            Self::Conic => f.write_str("conic"),
            Self::Irregularity => f.write_str("irregularity"),
            Self::Form(n) => write!(f, "form r^{n}"),
            Self::Thickness => f.write_str("thickness"),
            Self::Index => f.write_str("index"),
            Self::Abbe => f.write_str("Abbe number"),
            Self::DecenterX => f.write_str("decentre x"),
            Self::DecenterY => f.write_str("decentre y"),
            Self::TiltX => f.write_str("tilt x"),
            Self::TiltY => f.write_str("tilt y"),
            Self::Shift => f.write_str("shift"),
        }
    }
}

/// A quantity of a surface, or of a group of surfaces that move as one body. Surfaces count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Freedom {
    /// What changes.
    pub quantity: Quantity,
    /// The first surface of the group.
    pub first: usize,
    /// The last, which is the first for one surface alone.
    pub last: usize,
}

impl Freedom {
    /// A quantity of one surface.
    pub fn of_surface(quantity: Quantity, surface: usize) -> Self {
        Self { quantity, first: surface, last: surface }
    }

    /// A motion of surfaces `first` to `last` as one body.
    pub fn of_element(quantity: Quantity, first: usize, last: usize) -> Self {
        Self { quantity, first, last }
    }

    /// The distance from the last vertex to the image plane.
    pub fn focus(lens: &Lens) -> Self {
        Self::of_surface(Quantity::Thickness, lens.surfaces.len().saturating_sub(1))
    }

    /// Checks that the lens has what is to change.
    pub fn check(&self, lens: &Lens) -> Result<(), ToleranceError> {
        let count = lens.surfaces.len();
        if self.first > self.last || self.last >= count {
            return Err(ToleranceError::NoSuchSurface { surface: self.last.max(self.first) + 1, count });
        }
        let (s, surface) = (&lens.surfaces[self.first], self.first + 1);
        if self.quantity.is_motion() {
            let moves = |s: &usize| lens.surfaces[*s].placement.is_some_and(|p| p.axis != Axis::Returns);
            return match (self.first..=self.last).find(moves) {
                Some(at) => Err(ToleranceError::AxisMoves { surface: at + 1 }),
                None => Ok(()),
            };
        }
        if self.first != self.last {
            return Err(ToleranceError::NotOfAGroup { what: self.quantity.to_string() });
        }
        let has_shape = !matches!(s.action, Action::ThinLens { .. });
        let none = |what: &'static str| Err(ToleranceError::NoSuchNumber { surface, what });
        match self.quantity {
            Quantity::Radius | Quantity::RadiusPercent if !has_shape || s.shape.curvature == 0.0 => {
                none("radius")
            }
            Quantity::Power if !has_shape => none("shape"),
            Quantity::Conic if !s.has_number(crate::number::Number::Conic) => none("conic constant"),
            Quantity::Irregularity | Quantity::Form(_)
                if !has_shape || matches!(s.shape.departure, Departure::Toroid { .. }) =>
            {
                none("even polynomial")
            }
            Quantity::Form(n) if !(2..=16).contains(&n) || n % 2 == 1 => {
                Err(ToleranceError::NoSuchOrder { order: n })
            }
            Quantity::Index | Quantity::Abbe if s.glass.is_air() => none("glass behind it"),
            Quantity::Index | Quantity::Abbe if s.action == Action::Reflect => {
                none("glass of its own behind it")
            }
            Quantity::Abbe if !s.glass.abbe_vd().is_finite() => none("dispersion behind it"),
            _ => Ok(()),
        }
    }

    /// Room on the axis before parts touch, mm: of a thickness the distance itself, of a shift the smaller one on either side. Planes without
    /// effect are no parts. `None` for other quantities, and in front of the first part.
    pub fn room_mm(&self, lens: &Lens) -> Option<f64> {
        let gap_mm = |surface: usize| {
            let from = (0..=surface).rev().find(|i| !lens.is_idle_plane(*i))?;
            Some(lens.gap_behind_mm(from).abs())
        };
        match self.quantity {
            Quantity::Thickness => gap_mm(self.first),
            Quantity::Shift => {
                let in_front = self.first.checked_sub(1).and_then(gap_mm);
                in_front.into_iter().chain(gap_mm(self.last)).reduce(f64::min)
            }
            _ => None,
        }
    }

    /// Its name, surfaces counted from 1: `surface 3 radius`, `surfaces 1-2 tilt x`.
    pub fn name(&self) -> String {
        let quantity = self.quantity;
        if self.first == self.last {
            format!("surface {} {quantity}", self.first + 1)
        } else {
            format!("surfaces {}-{} {quantity}", self.first + 1, self.last + 1)
        }
    }
}

/// The elements of a lens: runs of surfaces with glass between them (a cemented group is one), and single surfaces that
/// reflect, diffract or are thin lenses.
pub fn elements(lens: &Lens) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < lens.surfaces.len() {
        let first = at;
        while at + 1 < lens.surfaces.len() && !lens.surfaces[at].glass.is_air() {
            at += 1;
        }
        let s = &lens.surfaces[first];
        if at > first || s.action != Action::Refract || s.phase.is_some() {
            found.push((first, at));
        }
        at += 1;
    }
    found
}
