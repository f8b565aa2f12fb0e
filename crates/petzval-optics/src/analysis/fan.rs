//! Fans: aberrations along two diameters of the stop.

use schemars::JsonSchema;
use serde::Serialize;

use super::lens_at_field::LensAtField;
use super::options::evenly;
use super::{AnalysisError, AnalysisOptions};
use crate::lens::Lens;
use crate::wave::{PupilPlane, opd_about};

/// Ray and wavefront aberrations of a field along the vertical (tangential) and the horizontal (sagittal) diameter of the stop.
///
/// Ray aberrations are measured from the chief ray of the reference wavelength. Wavefronts are compared with the sphere
/// about that point through the exit pupil, and with the path of their own colour's chief ray, so lateral colour is a
/// tilt. They are positive where the wavefront is ahead of the sphere, as in Seidel's theory. A value is `None` if the
/// ray is lost or blocked; a wavefront is also `None` in a system with thin lenses, which have no optical paths.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Fan {
    /// The field, degrees.
    pub field_deg: f64,
    /// Coordinate on the stop in units of its radius, -1..1.
    pub pupil: Vec<f64>,
    /// `[wavelength][point]`: y of rays along the vertical diameter, um.
    pub tangential_um: Vec<Vec<Option<f64>>>,
    /// `[wavelength][point]`: x of rays along the horizontal diameter, um.
    pub sagittal_um: Vec<Vec<Option<f64>>>,
    /// `[wavelength][point]`: optical path difference along the vertical diameter, waves.
    pub tangential_waves: Vec<Vec<Option<f64>>>,
    /// `[wavelength][point]`: optical path difference along the horizontal diameter, waves.
    pub sagittal_waves: Vec<Vec<Option<f64>>>,
}

/// The fan of a field.
pub fn fan(lens: &Lens, field_deg: f64, options: &AnalysisOptions) -> Result<Fan, AnalysisError> {
    let field = LensAtField::new(lens, field_deg)?;
    let pupil = evenly(-1.0, 1.0, options.fan_points.max(3));
    let (mut tangential_um, mut sagittal_um) = (Vec::new(), Vec::new());
    let (mut tangential_waves, mut sagittal_waves) = (Vec::new(), Vec::new());
    for colour in &field.colours {
        for (axis, um, waves) in
            [(1, &mut tangential_um, &mut tangential_waves), (0, &mut sagittal_um, &mut sagittal_waves)]
        {
            let points: Vec<[f64; 2]> =
                pupil.iter().map(|p| if axis == 1 { [0.0, *p] } else { [*p, 0.0] }).collect();
            let no_chief = AnalysisError::NoChiefRay { field_deg, wavelength_um: colour.wavelength_um };
            let about = Some(field.chief_mm);
            let rays =
                opd_about(colour, field.field_rad, field.stop_radius_mm, &points, PupilPlane::Stop, about)
                    .ok_or(no_chief)?;
            let passes = |i: usize| rays.transmission[i] > 0.5;
            let from_chief = |i: usize| rays.landing_mm[i].map(|at| 1e3 * (at[axis] - field.chief_mm[axis]));
            um.push((0..points.len()).map(|i| from_chief(i).filter(|_| passes(i))).collect());
            let has_path = |i: usize| passes(i) && colour.has_optical_paths();
            waves.push((0..points.len()).map(|i| rays.waves[i].filter(|_| has_path(i))).collect());
        }
    }
    Ok(Fan { field_deg, pupil, tangential_um, sagittal_um, tangential_waves, sagittal_waves })
}
