//! Which numbers of a lens may move, between which bounds, and what algebra settles exactly.
//!
//! A [`DesignSpace`] maps coordinates to a lens: every variable, then pickups, then the solves for length, focal length and
//! focus. It gives the slopes of the lens by its coordinates, which least squares need, and pulls a gradient of the lens back to
//! them. A [`SmoothSpace`] lays coordinates without bounds over it, for gradient steps.

mod error;
mod smooth;
mod space;
mod usual;
mod vary;

pub use error::DesignSpaceError;
pub use smooth::SmoothSpace;
pub use space::{DesignSpace, Mapped};
pub use usual::{near_variables, powered, wide_variables};
pub use vary::{Vary, varied};

use std::fmt;

use crate::lens::{Lens, ObjectDistance};
use crate::number::Number;
use crate::paraxial::first_order;
use crate::solve::magnification;

/// A number that may move within bounds, which are given as users state them ([`Number::stated`]): those of a curvature are
/// radii in mm, those of a tilt are in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variable {
    /// Surface, from 0.
    pub surface: usize,
    /// Which of its numbers.
    pub number: Number,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
}

impl Variable {
    /// The bounds of the number itself, ascending.
    ///
    /// Radii of both signs pass through the plane, not through zero: the curvature lies between those of the two bounds.
    pub(crate) fn bounds(&self) -> [f64; 2] {
        let [a, b] = [self.min, self.max].map(|bound| self.number.from_stated(bound));
        if self.number == Number::Curvature { [a.min(b), a.max(b)] } else { [a, b] }
    }
}

/// A variable that stands on one of its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtBound {
    /// Surface, from 0.
    pub surface: usize,
    /// Which of its numbers.
    pub number: Number,
    /// The bound, as users state it.
    pub bound: f64,
}

impl fmt::Display for AtBound {
    /// As a person names it; surfaces from 1.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Four significant digits, without the rounding of reciprocals.
        let digits = 3 - self.bound.abs().max(1e-12).log10().floor() as i32;
        let bound = if (0..=6).contains(&digits) {
            format!("{:.*}", digits as usize, self.bound)
        } else {
            format!("{:.3e}", self.bound)
        };
        write!(f, "{} of surface {} at {bound}", self.number, self.surface + 1)
    }
}

/// A number that follows another: `value = scale * other + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pickup {
    /// The surface whose number follows.
    pub surface: usize,
    /// Index of the variable that it follows; the number is of the same kind.
    pub variable: usize,
    /// Factor. Radii follow as curvatures, and tilts in radians.
    pub scale: f64,
    /// Offset in the unit of the number in the lens: of radii in 1/mm, of tilts in rad.
    pub offset: f64,
}

/// Solves one surface's curvature so that the effective focal length holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EflSolve {
    /// Surface, from 0.
    pub surface: usize,
    /// The wanted effective focal length at the reference wavelength, mm.
    pub efl_mm: f64,
    /// Bounds that the solved radius should keep, mm; a solve cannot, a penalty can.
    pub radius_mm: Option<[f64; 2]>,
}

/// Solves one surface's curvature so that the paraxial magnification of a near object holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagnificationSolve {
    /// Surface, from 0.
    pub surface: usize,
    /// The wanted magnification at the reference wavelength, negative if the image is upside down.
    pub magnification: f64,
    /// Bounds that the solved radius should keep, mm; a solve cannot, a penalty can.
    pub radius_mm: Option<[f64; 2]>,
}

/// Numbers that algebra settles, whatever the variables are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solves {
    /// A curvature holds the focal length.
    pub efl: Option<EflSolve>,
    /// The thickness of this surface holds the distance from the first vertex to the last, mm.
    pub length: Option<(usize, f64)>,
    /// A curvature holds the magnification of a near object. Only one of this and `efl` can be held.
    pub magnification: Option<MagnificationSolve>,
    /// The diameter of the entrance pupil holds the tangent of the angle between the axis and the paraxial marginal ray of a near object, and with it the
    /// numerical aperture: `EPD = 2 |tan (D + z)|`, with the object at D and the pupil at z.
    pub marginal_tangent: Option<f64>,
}

impl Solves {
    /// These, and a curvature that holds what a lens keeps while it moves: the focal length or, of a near object, the magnification. `None` if
    /// the lens has neither.
    pub fn holding(self, lens: &Lens, surface: usize, radius_mm: Option<[f64; 2]>) -> Option<Self> {
        if lens.object == ObjectDistance::Infinity {
            let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
            let efl = Some(EflSolve { surface, efl_mm, radius_mm });
            return efl_mm.is_finite().then_some(Self { efl, magnification: None, ..self });
        }
        let solve = MagnificationSolve { surface, magnification: magnification(lens)?, radius_mm };
        Some(Self { efl: None, magnification: Some(solve), ..self })
    }

    /// What a curvature holds: `the focal length` or `the magnification`; empty if nothing is held.
    pub fn held_in_words(&self) -> &'static str {
        match (&self.efl, &self.magnification) {
            (Some(_), _) => "the focal length",
            (None, Some(_)) => "the magnification",
            (None, None) => "",
        }
    }

    /// The surface of the curvature that is solved for, and the bounds of its radius, mm.
    pub fn curvature(&self) -> Option<(usize, Option<[f64; 2]>)> {
        let efl = self.efl.map(|s| (s.surface, s.radius_mm));
        efl.or(self.magnification.map(|s| (s.surface, s.radius_mm)))
    }
}

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focus {
    /// It stays where the last thickness puts it.
    Fixed,
    /// The distance from the last vertex is a coordinate without bounds.
    Free,
    /// At the paraxial image of the reference wavelength plus a defocus, which is a coordinate within
    /// plus and minus this many mm.
    Paraxial {
        /// Half-range of the defocus, mm.
        range_mm: f64,
    },
}
