//! A lens at one wavelength: the numbers a ray needs, and nothing else.

use crate::lens::{Lens, ObjectDistance, SurfaceShape};

/// A surface with the indices on both of its sides.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceAtWavelength {
    /// Shape.
    pub shape: SurfaceShape,
    /// Whether the shape has no polynomial part (closed-form intersection).
    pub is_conic: bool,
    /// Number of coefficients up to the last that is not zero.
    pub(crate) terms: usize,
    /// Index in front.
    pub n_before: f64,
    /// Index behind.
    pub n_after: f64,
    /// Distance to the next vertex, mm.
    pub thickness_mm: f64,
    /// Clear semi-diameter, mm.
    pub semi_diameter_mm: f64,
}

/// A lens at one wavelength.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Surfaces in the order that light meets them.
    pub surfaces: Vec<SurfaceAtWavelength>,
    /// Index of the stop.
    pub stop: usize,
    /// Object plane.
    pub object: ObjectDistance,
    /// Entrance pupil diameter, mm.
    pub entrance_pupil_mm: f64,
    /// The wavelength, um.
    pub wavelength_um: f64,
}

impl SurfaceAtWavelength {
    /// Coefficients a_2, a_4, ... up to the last that is not zero.
    #[inline]
    pub(crate) fn polynomial(&self) -> &[f64] {
        &self.shape.asphere[..self.terms]
    }
}

impl Sequence {
    /// Evaluates every index of the lens at the wavelength.
    pub fn new(lens: &Lens, wavelength_um: f64) -> Self {
        let mut n_before = 1.0;
        let surfaces = lens
            .surfaces
            .iter()
            .map(|s| {
                let n_after = s.glass.index(wavelength_um);
                let surface = SurfaceAtWavelength {
                    shape: s.shape,
                    is_conic: s.shape.is_conic(),
                    terms: s.shape.asphere.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1),
                    n_before,
                    n_after,
                    thickness_mm: s.thickness_mm,
                    semi_diameter_mm: s.semi_diameter_mm,
                };
                n_before = n_after;
                surface
            })
            .collect();
        Self {
            surfaces,
            stop: lens.stop,
            object: lens.object,
            entrance_pupil_mm: lens.entrance_pupil_mm,
            wavelength_um,
        }
    }
}
