//! The PSF of a thin lens without aberrations: a point by rays, the [Airy](super::airy) pattern by waves.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{FieldPsf, PsfKind, PsfMethod, PsfOptions, airy, splat};
use crate::lens::{Action, Lens, ObjectDistance};

/// What a lens without aberrations makes of a point of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PerfectImage {
    /// A point, which is where all of its rays meet.
    Point,
    /// The Airy disk, to which the waves of its pupil spread the point.
    AiryDisk,
}

impl PerfectImage {
    /// The image that fits PSFs of this kind: beside lenses without diffraction a perfect lens has none either.
    pub fn of(kind: PsfKind) -> Self {
        match kind {
            PsfKind::Geometric => Self::Point,
            PsfKind::Diffraction => Self::AiryDisk,
        }
    }
}

/// The PSFs of a field of a single thin lens, which is its own stop, for a far object in focus; `None` for any other lens.
///
/// The light falls off with `cos^4` of the field angle.
pub fn perfect_psf(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    options: &PsfOptions,
    image: PerfectImage,
) -> Option<FieldPsf> {
    let efl_mm = focused_thin_lens_mm(lens)?;
    let cos = field_rad.cos();
    let of_wavelength = |wavelength_um: &f64| match image {
        PerfectImage::Point => (point(options), 1.0),
        PerfectImage::AiryDisk => {
            airy::pattern(PI * lens.entrance_pupil_mm / (1e-3 * wavelength_um * efl_mm), cos, options)
        }
    };
    let method = match image {
        PerfectImage::Point => PsfMethod::Point,
        PerfectImage::AiryDisk => PsfMethod::Airy,
    };
    let (values, captured): (Vec<_>, Vec<_>) = wavelengths_um.iter().map(of_wavelength).unzip();
    Some(FieldPsf {
        field_rad,
        chief_x_mm: 0.0,
        chief_y_mm: efl_mm * field_rad.tan(),
        illumination: vec![cos.powi(4); values.len()],
        method: vec![method; values.len()],
        image_area: 1.0,
        captured,
        values,
    })
}

/// All light at the chief ray, shared among cells as that of any ray is.
fn point(options: &PsfOptions) -> Vec<f64> {
    let mut values = vec![0.0; options.grid * options.grid];
    let (_, centre) = options.scale();
    splat::add(&mut values, options.grid, centre, centre, 1.0);
    values
}

/// The focal length of a lens that is one thin lens, as wide as its pupil, with the image plane at its focus, mm; `None` of any other.
pub fn focused_thin_lens_mm(lens: &Lens) -> Option<f64> {
    let [surface] = lens.surfaces.as_slice() else { return None };
    let Action::ThinLens { power_per_mm } = surface.action else { return None };
    let efl_mm = 1.0 / power_per_mm;
    let is_plain = surface.phase.is_none() && surface.placement.is_none() && surface.glass.is_air();
    let is_focused = (surface.thickness_mm / efl_mm - 1.0).abs() < 1e-9;
    let is_open = surface.is_open || surface.semi_diameter_mm >= 0.5 * lens.entrance_pupil_mm * (1.0 - 1e-9);
    (is_plain && is_focused && is_open && lens.object == ObjectDistance::Infinity).then_some(efl_mm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Surface;
    use crate::psf::psf;
    use crate::pupil::Quadrature;

    /// f/8 at 100 mm.
    fn thin() -> Lens {
        let surface = Surface {
            action: Action::ThinLens { power_per_mm: 0.01 },
            semi_diameter_mm: 6.25,
            thickness_mm: 100.0,
            ..Surface::default()
        };
        Lens {
            name: String::new(),
            source: String::new(),
            surfaces: vec![surface],
            stop: 0,
            entrance_pupil_mm: 12.5,
            object: ObjectDistance::Infinity,
            wavelengths_um: vec![0.5],
            reference_um: 0.5,
            fields_deg: vec![0.0],
        }
    }

    #[test]
    fn off_the_axis_either_image_is_darker() {
        let options = PsfOptions { grid: 128, pitch_um: 0.2, ..PsfOptions::default() };
        let field = 0.6_f64;
        for image in [PerfectImage::Point, PerfectImage::AiryDisk] {
            let psf = perfect_psf(&thin(), field, &[0.5], &options, image).unwrap();
            assert!((psf.chief_y_mm - 100.0 * field.tan()).abs() < 1e-9);
            assert!((psf.illumination[0] - field.cos().powi(4)).abs() < 1e-12);
            assert!((psf.values[0].iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_point_is_what_traced_rays_of_the_lens_make() {
        for grid in [32, 33] {
            let options = PsfOptions { grid, pitch_um: 1.0, kind: PsfKind::Geometric };
            let quadrature = Quadrature::grid(32).unwrap();
            for field in [0.0, 0.3_f64] {
                let traced = psf(&thin(), field, &[0.5], &quadrature, &options).unwrap();
                let point = perfect_psf(&thin(), field, &[0.5], &options, PerfectImage::Point).unwrap();
                let off: f64 =
                    traced.values[0].iter().zip(&point.values[0]).map(|(a, b)| (a - b).abs()).sum();
                assert!(off < 1e-6, "{grid} {field}: {off}");
                assert_eq!(point.captured, [1.0]);
            }
        }
    }

    #[test]
    fn another_lens_has_no_such_image() {
        let none = |lens: Lens| focused_thin_lens_mm(&lens).is_none();
        let lens = thin();
        assert_eq!(focused_thin_lens_mm(&lens), Some(100.0));
        assert!(none(Lens { object: ObjectDistance::Finite(500.0), ..lens.clone() }));
        assert!(none(lens.with_image_distance(99.0)));
        assert!(none(Lens { entrance_pupil_mm: 13.0, ..lens }));
    }
}
