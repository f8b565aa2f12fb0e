//! The common start of every analysis of a field.

use super::AnalysisError;
use crate::lens::Lens;
use crate::paraxial::first_order;
use crate::pupil::{Beam, ImageArea, Quadrature, chief_ray, trace_beam};
use crate::trace::Sequence;
use crate::wave::WaveChannel;

/// A field of a lens: its chief ray, and the lens at every wavelength.
pub(super) struct LensAtField<'a> {
    pub lens: &'a Lens,
    pub field_deg: f64,
    pub field_rad: f64,
    /// Radius of the stop, mm.
    pub stop_radius_mm: f64,
    /// Position of the chief ray of the reference wavelength on the image plane, mm.
    pub chief_mm: [f64; 2],
    /// Ideal image area per image area around the field.
    pub image_area: f64,
    /// By wavelength.
    pub colours: Vec<Sequence>,
}

impl<'a> LensAtField<'a> {
    pub fn new(lens: &'a Lens, field_deg: f64) -> Result<Self, AnalysisError> {
        let reference = lens.at_wavelength(lens.reference_um);
        let field_rad = field_deg.to_radians();
        let no_chief = || AnalysisError::NoChiefRay { field_deg, wavelength_um: lens.reference_um };
        let chief = chief_ray(&reference, field_rad).ok_or_else(no_chief)?;
        Ok(Self {
            lens,
            field_deg,
            field_rad,
            stop_radius_mm: first_order(&reference).stop_radius_mm,
            chief_mm: [chief.x_mm, chief.y_mm],
            image_area: ImageArea::new(&reference, field_rad, &chief).ok_or_else(no_chief)?.ratio,
            colours: lens.wavelengths_um.iter().map(|w| lens.at_wavelength(*w)).collect(),
        })
    }

    /// The traced beam of every colour; each must have light.
    pub fn beams(&self, quadrature: &Quadrature) -> Result<Vec<Beam>, AnalysisError> {
        self.colours
            .iter()
            .map(|colour| {
                let beam = trace_beam(colour, self.field_rad, self.stop_radius_mm, quadrature);
                if beam.light() > 0.0 {
                    Ok(beam)
                } else {
                    Err(AnalysisError::NoLight { field_deg: self.field_deg })
                }
            })
            .collect()
    }

    /// The wave of a colour, with the polynomials of another colour where they hold; `None` where none describe it.
    pub fn wave(&self, colour: &Sequence, like: Option<&WaveChannel>) -> Option<WaveChannel> {
        WaveChannel::new(colour, self.field_rad, self.stop_radius_mm, self.chief_mm, 0.0, like)
    }

    /// Radius of the first dark ring of a perfect image with the cone of the axis, at the reference wavelength, um.
    pub fn airy_radius_um(&self) -> f64 {
        super::cone::Cone::of(self.lens).airy_radius_um(self.lens.reference_um)
    }
}

/// The quadrature of an analysis, with the requested number of cells or the nearest possible one.
pub(super) fn pupil(cells: usize) -> Quadrature {
    let possible = cells.clamp(12, 4096).next_multiple_of(2);
    Quadrature::grid(possible).unwrap_or_else(|_| unreachable!("a possible number of cells"))
}
