//! One surface: its shape, what it does to light, the medium behind it, its place, and how far it is to the next.

use std::sync::Arc;

use super::action::{Action, Phase};
use super::departure::Departure;
use super::placement::Placement;
use super::shape::SurfaceShape;
use crate::glass::Glass;
use crate::number::{ASPHERE_TERMS, Number};

/// A surface in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// What it is called in tables, may be empty.
    pub label: String,
    /// Shape.
    pub shape: SurfaceShape,
    /// Vertex-to-vertex distance to the next surface (the last: to the image plane), mm.
    pub thickness_mm: f64,
    /// The medium behind the surface.
    pub glass: Arc<Glass>,
    /// Clear semi-diameter, mm: light beyond it is lost, unless the surface is [open](Self::is_open).
    pub semi_diameter_mm: f64,
    /// Whether light beyond the clear semi-diameter passes. Then it is a size for drawings and edges, such as that of the beams of the lens's
    /// fields, and no aperture. The stop cuts in any case.
    pub is_open: bool,
    /// What it does to light.
    pub action: Action,
    /// A diffractive structure on it.
    pub phase: Option<Phase>,
    /// How it is shifted and turned from its place on the axis; `None` for one that stays there.
    pub placement: Option<Placement>,
}

impl Surface {
    /// Whether the surface has a number: a thin lens has no shape, the best-fit sphere of Q_bfs no conic constant, and only a
    /// surface with a placement has decentres and tilts.
    pub fn has_number(&self, number: Number) -> bool {
        let has_shape = !matches!(self.action, Action::ThinLens { .. });
        match number {
            Number::Curvature => has_shape,
            Number::Asphere(j) => has_shape && j < ASPHERE_TERMS,
            Number::Conic => has_shape && !matches!(self.shape.departure, Departure::Qbfs { .. }),
            Number::Departure(k) => has_shape && k < self.shape.departure.numbers().len(),
            Number::Phase(k) => self.phase.is_some_and(|mut phase| phase.number_mut(k).is_some()),
            Number::Power => !has_shape,
            Number::Thickness | Number::Index | Number::SemiDiameter => true,
            Number::Decenter(axis) => self.placement.is_some() && axis < 2,
            Number::Tilt(axis) => self.placement.is_some() && axis < 3,
        }
    }
}

impl Default for Surface {
    /// A plane in air that does nothing.
    fn default() -> Self {
        Self {
            label: String::new(),
            shape: SurfaceShape::PLANE,
            thickness_mm: 0.0,
            glass: Glass::air(),
            semi_diameter_mm: 1.0,
            is_open: false,
            action: Action::Refract,
            phase: None,
            placement: None,
        }
    }
}
