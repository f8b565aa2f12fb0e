//! Converts every kind of aperture to the diameter of the entrance pupil.

use super::item::{Clear, Drafted};
use super::record::Record;
use crate::decimal::shown;
use crate::loss::{Effect, Losses};
use petzval_base::FileError;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, paraxial_ray};

/// The aperture as a file specifies it. All kinds are first-order quantities at the reference wavelength.
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
    /// Numerical aperture at the image: the one at the object over the magnification (CODE V: NA).
    ImageNa(f64),
    /// Sine of the marginal ray's angle at the object.
    ObjectNa(f64),
    /// Angle of the marginal ray at the object, degrees.
    ObjectCone(f64),
    /// Given by the clear semi-diameter of the stop.
    StopSize,
    /// Height of the marginal ray at the stop, mm.
    StopRadius(f64),
}

impl Aperture {
    /// The number of the file and what it is; `None` where the file gives none.
    fn stated(self) -> Option<(f64, &'static str)> {
        match self {
            Self::EntrancePupil(mm) => Some((mm, "the diameter of the entrance pupil")),
            Self::FNumber(f) | Self::WorkingFNumber(f) | Self::ImageFNumber(f) => Some((f, "the f-number")),
            Self::ImageNa(na) => Some((na, "the numerical aperture at the image")),
            Self::ObjectNa(sine) => Some((sine, "the numerical aperture at the object")),
            Self::ObjectCone(deg) => Some((deg, "the angle of the marginal ray at the object")),
            Self::StopRadius(mm) => Some((mm, "the radius of the stop")),
            Self::StopSize => None,
        }
    }

    /// Refuses numbers of which no lens makes a beam.
    fn check(self, record: &Record) -> Result<(), FileError> {
        let Some((value, what)) = self.stated() else { return Ok(()) };
        if value <= 0.0 {
            let hint = if value < 0.0 { "leave the sign out" } else { "a beam without a width has no light" };
            return Err(record.error(format!("{what} must be positive, not {}", shown(value))).hint(hint));
        }
        match self {
            Self::ObjectNa(sine) if sine >= 1.0 => {
                let message = format!("{what} is below 1, not {}", shown(sine));
                Err(record.error(message).hint("it is the sine of an angle in air"))
            }
            Self::ObjectCone(deg) if deg >= 90.0 => {
                let message = format!("{what} is below 90 degrees, not {}", shown(deg));
                Err(record.error(message).hint("it is half of the cone of light"))
            }
            _ => Ok(()),
        }
    }
}

/// Diameters of the beam at the first vertex that can be traced, mm. Outside this range squares of ray coordinates lose their meaning
/// in floating point.
const PUPILS_MM: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// The diameter of the entrance pupil, mm.
///
/// For a near object, let D be its distance and e the distance of the entrance pupil from the first vertex. W is the final
/// optical slope of the ray that leaves the axial object point with slope 1, so 1 / W is the magnification. A marginal ray of
/// slope u at the object then fills a pupil of diameter `2 u (D + e)` and ends with the optical slope `u W`.
pub(super) fn entrance_pupil_mm(
    lens: &Lens,
    (aperture, record): &(Aperture, Record),
    stop: Clear,
) -> Result<f64, FileError> {
    aperture.check(record)?;
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let efl_mm = order.efl_mm.abs();
    let near = match lens.object {
        ObjectDistance::Infinity => None,
        ObjectDistance::Finite(distance) => {
            let slope = paraxial_ray(&sequence, distance, 1.0).w[sequence.surfaces.len()].abs();
            Some(((distance + order.entrance_pupil_at_mm).abs(), slope))
        }
    };
    let from_sine = |sine: f64, to_pupil: f64| 2.0 * to_pupil * sine.asin().tan();
    // The pupil of the provisional lens has a diameter of 1 mm.
    let from_stop = |semi: f64| semi / order.stop_radius_mm.abs() * lens.entrance_pupil_mm;
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
            let error = record.error("an aperture at the object needs an object at a finite distance");
            return Err(error.hint("give the diameter of the entrance pupil, or an f-number"));
        }
        (Aperture::StopSize, _) => {
            let (Clear::Edge(semi) | Clear::Beam(semi) | Clear::Open(semi)) = stop;
            if semi <= 0.0 {
                let message = "the stop's size is the aperture, but the stop has no semi-diameter";
                return Err(record.error(message).hint("give the stop its semi-diameter"));
            }
            from_stop(semi)
        }
        (Aperture::StopRadius(semi), _) => from_stop(semi),
    };
    // A beam from a near object to a pupil far behind it is no wider than at the lens.
    let at_vertex = match (lens.object, near) {
        (ObjectDistance::Finite(distance), Some((to_pupil, _))) => diameter * distance.abs() / to_pupil,
        _ => diameter,
    };
    if PUPILS_MM.contains(&at_vertex) && diameter.is_finite() {
        Ok(diameter)
    } else {
        let message = format!(
            "this aperture gives a beam of {} mm at the first vertex; {} to {} mm can be traced",
            shown(at_vertex),
            shown(*PUPILS_MM.start()),
            shown(*PUPILS_MM.end())
        );
        Err(record.error(message).hint(hint_about_beam(*aperture, near, efl_mm, diameter)))
    }
}

/// What to do about a beam that cannot be traced: the number of the aperture is at fault, or the lens that it belongs to.
///
/// `near` holds, for a near object, its distance from the entrance pupil, mm, and the inverse of the magnification.
fn hint_about_beam(aperture: Aperture, near: Option<(f64, f64)>, efl_mm: f64, diameter_mm: f64) -> String {
    match aperture {
        Aperture::EntrancePupil(mm) if !PUPILS_MM.contains(&mm) => {
            "is the number a diameter in the lens unit of the file?".to_owned()
        }
        Aperture::FNumber(_)
        | Aperture::WorkingFNumber(_)
        | Aperture::ImageFNumber(_)
        | Aperture::ImageNa(_)
            if near.is_none() && PUPILS_MM.contains(&efl_mm) =>
        {
            format!("is the number right? the focal length is {} mm", rounded(efl_mm))
        }
        // Only an arc sine beyond 1 is no number where there is an image.
        Aperture::ImageFNumber(_) | Aperture::ImageNa(_)
            if diameter_mm.is_nan() && near.is_some_and(|(_, slope)| slope.is_normal()) =>
        {
            "is the number right? the magnification makes it a sine above 1 at the object".to_owned()
        }
        _ => "is the lens afocal, or the stop at a focus?".to_owned(),
    }
}

/// Share by which the beam may be wider than the edge of the stop: edges are printed with few digits.
pub(crate) const AS_WIDE: f64 = 1.0 + 1e-4;

/// The diameter of the entrance pupil, mm, within the clear aperture of the stop.
///
/// Programs clip at a narrower one, and go on to compute f-numbers from the aperture of the file. Here the stop is what limits the beam.
pub(super) fn within_stop(lens: &Lens, stop: &Drafted, losses: &mut Losses) -> f64 {
    let diameter = lens.entrance_pupil_mm;
    let beam = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    let Clear::Edge(edge) = stop.clear else { return diameter };
    if beam <= edge * AS_WIDE || !beam.is_finite() {
        return diameter;
    }
    let narrowed = diameter * edge / beam;
    let message = format!(
        "the clear aperture of the stop, {} mm from the axis, is narrower than the beam of {} mm: the entrance pupil is narrowed from {} to {} mm",
        shown(edge),
        rounded(beam),
        rounded(diameter),
        rounded(narrowed)
    );
    stop.clear_at().lose(losses, Effect::Approximated, message);
    narrowed
}

/// A length in a message, to a tenth of a micrometre.
pub(crate) fn rounded(mm: f64) -> String {
    shown((mm * 1e4).round() / 1e4)
}
