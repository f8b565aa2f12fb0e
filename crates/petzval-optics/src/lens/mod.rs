//! The lens: an immutable list of rotationally symmetric surfaces on one axis.

mod surface;
mod validate;

pub use surface::{ASPHERE_TERMS, Surface, SurfaceShape};
pub use validate::{LensDefect, validate};

use crate::trace::Sequence;

/// Where the object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectDistance {
    /// Collimated light; a field is the angle of the chief ray to the axis.
    Infinity,
    /// Distance from the object plane to the first vertex, mm, positive; a field is the angle under
    /// which the object point is seen from the first vertex.
    Finite(f64),
}

/// A compound lens. History is a list of lenses: nothing changes one in place.
///
/// The last surface's thickness reaches to the image plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// What it is called in tables and reports.
    pub name: String,
    /// Where its numbers come from.
    pub source: String,
    /// Refracting surfaces and the stop, in the order that light meets them.
    pub surfaces: Vec<Surface>,
    /// Index of the aperture stop in `surfaces`.
    pub stop: usize,
    /// Entrance pupil diameter, mm. The stop's radius follows from it to first order.
    pub entrance_pupil_mm: f64,
    /// Object plane.
    pub object: ObjectDistance,
    /// Wavelengths in which the lens is judged, um, ascending.
    pub wavelengths_um: Vec<f64>,
    /// Wavelength of first-order properties and of the reference chief ray, um.
    pub reference_um: f64,
    /// Fields at which the lens is judged, degrees, ascending.
    pub fields_deg: Vec<f64>,
}

impl Lens {
    /// The lens at one wavelength, ready for tracing.
    pub fn at_wavelength(&self, wavelength_um: f64) -> Sequence {
        Sequence::new(self, wavelength_um)
    }

    /// Distance from the first vertex to the image plane, mm.
    pub fn total_track_mm(&self) -> f64 {
        self.surfaces.iter().map(|s| s.thickness_mm).sum()
    }

    /// Distance from the last vertex to the image plane, mm.
    pub fn image_distance_mm(&self) -> f64 {
        self.surfaces.last().map_or(0.0, |s| s.thickness_mm)
    }

    /// A copy with another distance from the last vertex to the image plane, mm.
    pub fn with_image_distance(&self, distance_mm: f64) -> Self {
        let mut lens = self.clone();
        if let Some(last) = lens.surfaces.last_mut() {
            last.thickness_mm = distance_mm;
        }
        lens
    }
}
