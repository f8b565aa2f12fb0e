//! Apertures of every kind, as the diameter of the entrance pupil.

use super::item::Clear;
use super::record::Record;
use crate::decimal::shown;
use petzval_base::FileError;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, paraxial_ray};

/// How a file says how much light the lens takes. All are first-order quantities at the reference wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aperture {
    /// Diameter of the entrance pupil, mm.
    EntrancePupil(f64),
    /// Focal length over entrance pupil diameter, whatever the conjugates (Zemax: image space F/#).
    FNumber(f64),
    /// `1 / (2 n' tan)` of the marginal ray at the image (Zemax: paraxial working F/#).
    WorkingFNumber(f64),
    /// `1 / (2 NA)` at the conjugates of the file (CODE V: FNO), with NA as in [`Aperture::ImageNa`].
    ImageFNumber(f64),
    /// Numerical aperture at the image, that at the object over the magnification (CODE V: NA).
    ImageNa(f64),
    /// Sine of the marginal ray's angle at the object.
    ObjectNa(f64),
    /// Angle of the marginal ray at the object, degrees.
    ObjectCone(f64),
    /// The clear semi-diameter of the stop says it.
    StopSize,
}

/// Diameters of entrance pupils that lenses have, mm: beyond them the squares of a ray's coordinates are no numbers any more.
const PUPILS_MM: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// The diameter of the entrance pupil, mm.
///
/// With D the distance of a near object, e that of the entrance pupil from the first vertex, and W the final optical slope of
/// the ray that leaves the object's axial point with slope 1 (so that 1 / W is the magnification), a marginal ray of slope u at
/// the object fills a pupil of `2 u (D + e)` and ends with the optical slope `u W`.
pub(super) fn entrance_pupil_mm(
    lens: &Lens,
    (aperture, record): &(Aperture, Record),
    stop: Clear,
) -> Result<f64, FileError> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let efl_mm = order.efl_mm.abs();
    let near = match lens.object {
        ObjectDistance::Infinity => None,
        ObjectDistance::Finite(distance) => {
            let slope = paraxial_ray(&sequence, distance, 1.0).w[sequence.surfaces.len()].abs();
            Some((distance + order.entrance_pupil_at_mm, slope))
        }
    };
    let from_sine = |sine: f64, to_pupil: f64| 2.0 * to_pupil * sine.asin().tan();
    let diameter = match (*aperture, near) {
        (Aperture::EntrancePupil(mm), _) => mm,
        (Aperture::FNumber(f), _) => efl_mm / f,
        (Aperture::WorkingFNumber(f) | Aperture::ImageFNumber(f), None) => efl_mm / f,
        (Aperture::ImageNa(na), None) => 2.0 * na * efl_mm,
        (Aperture::WorkingFNumber(f), Some((to_pupil, slope))) => to_pupil / (f * slope),
        (Aperture::ImageFNumber(f), Some((to_pupil, slope))) => from_sine(0.5 / (f * slope), to_pupil),
        (Aperture::ImageNa(na), Some((to_pupil, slope))) => from_sine(na / slope, to_pupil),
        (Aperture::ObjectNa(sine), Some((to_pupil, _))) => from_sine(sine, to_pupil),
        (Aperture::ObjectCone(deg), Some((to_pupil, _))) => 2.0 * to_pupil * deg.to_radians().tan(),
        (Aperture::ObjectNa(_) | Aperture::ObjectCone(_), None) => {
            let message = "an aperture at the object needs an object at a finite distance";
            return Err(record.error(message));
        }
        (Aperture::StopSize, _) => {
            let (Clear::Edge(semi) | Clear::Open(semi)) = stop;
            if semi <= 0.0 {
                let message = "the stop's size is the aperture, but the stop has no semi-diameter";
                return Err(record.error(message));
            }
            // The pupil of the provisional lens has a diameter of 1 mm.
            semi / order.stop_radius_mm.abs() * lens.entrance_pupil_mm
        }
    };
    match PUPILS_MM.contains(&diameter) {
        true => Ok(diameter),
        false => {
            let message = format!(
                "this aperture makes an entrance pupil of {} mm, and {} to {} mm are traced",
                shown(diameter),
                shown(*PUPILS_MM.start()),
                shown(*PUPILS_MM.end())
            );
            Err(record.error(message).hint("is the lens afocal, or the stop at a focus?"))
        }
    }
}
