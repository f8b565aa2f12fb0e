//! The PSF of a thin lens without aberrations: the Airy pattern.
//!
//! Through a pupil of diameter D at the focal length f, the image of a far point at the field angle w is
//!
//! `P(x, y) ~ (2 J_1(v) / v)^2`, `v = (pi D / (lambda f)) sqrt((x cos w)^2 + (y cos^3 w)^2)`,
//!
//! with y away from the axis: the pupil looks narrower from the side, and the light arrives aslant. The light falls off with `cos^4 w`.
//! To first order in D / f; Born and Wolf, Principles of Optics, section 8.5.2 (w = 0).

use std::f64::consts::PI;

use super::{FieldPsf, PsfMethod, PsfOptions};
use crate::lens::{Action, Lens, ObjectDistance};

/// Points along a side of a cell at which the pattern is sampled.
const SAMPLES: usize = 3;

/// `(2 J_1(v) / v)^2`.
fn airy(v: f64) -> f64 {
    if v < 1e-6 { 1.0 } else { (2.0 * libm::j1(v) / v).powi(2) }
}

/// The PSFs of a field of a single thin lens, which is its own stop, for a far object in focus; `None` for any other lens.
pub fn airy_psf(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    options: &PsfOptions,
) -> Option<FieldPsf> {
    let efl_mm = focused_thin_lens_mm(lens)?;
    let cos = field_rad.cos();
    let (per_mm, centre) = options.scale();
    // Middles of the samples of a row of cells, mm from the chief ray.
    let sample = |i: usize| {
        let cell = ((i as f64 + 0.5) / SAMPLES as f64 - 0.5 - centre) / per_mm;
        cell.abs()
    };
    let samples: Vec<f64> = (0..options.grid * SAMPLES).map(sample).collect();
    let of_wavelength = |wavelength_um: &f64| {
        let scale = PI * lens.entrance_pupil_mm / (1e-3 * wavelength_um * efl_mm);
        let mut values = vec![0.0; options.grid * options.grid];
        for (r, y) in samples.iter().enumerate() {
            let row = &mut values[r / SAMPLES * options.grid..][..options.grid];
            for (c, x) in samples.iter().enumerate() {
                row[c / SAMPLES] += airy(scale * (x * cos).hypot(y * cos.powi(3)));
            }
        }
        // The integral of the pattern over the plane is 4 pi in units of v.
        let per_sample = (scale / (SAMPLES as f64 * per_mm)).powi(2) * cos.powi(4) / (4.0 * PI);
        let total: f64 = values.iter().sum();
        values.iter_mut().for_each(|v| *v /= total);
        (values, total * per_sample)
    };
    let (values, captured): (Vec<_>, Vec<_>) = wavelengths_um.iter().map(of_wavelength).unzip();
    Some(FieldPsf {
        field_rad,
        chief_x_mm: 0.0,
        chief_y_mm: efl_mm * field_rad.tan(),
        illumination: vec![cos.powi(4); values.len()],
        method: vec![PsfMethod::Airy; values.len()],
        image_area: 1.0,
        captured,
        values,
    })
}

/// The focal length of a lens that is one thin lens, as wide as its pupil, with the image plane at its focus, mm; `None` of any other.
pub fn focused_thin_lens_mm(lens: &Lens) -> Option<f64> {
    let [surface] = lens.surfaces.as_slice() else { return None };
    let Action::ThinLens { power_per_mm } = surface.action else { return None };
    let efl_mm = 1.0 / power_per_mm;
    let is_plain = surface.phase.is_none() && surface.placement.is_none() && surface.glass.is_air();
    let is_focused = (surface.thickness_mm / efl_mm - 1.0).abs() < 1e-9;
    let is_open = surface.semi_diameter_mm >= 0.5 * lens.entrance_pupil_mm * (1.0 - 1e-9);
    (is_plain && is_focused && is_open && lens.object == ObjectDistance::Infinity).then_some(efl_mm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Surface;

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

    /// Light within a radius, of the whole plane.
    fn within(psf: &FieldPsf, options: &PsfOptions, radius_um: f64) -> f64 {
        let centre = 0.5 * (options.grid as f64 - 1.0);
        let inside = |i: usize| {
            let [y, x] = [i / options.grid, i % options.grid].map(|k| (k as f64 - centre) * options.pitch_um);
            x.hypot(y) < radius_um
        };
        let light = psf.values[0].iter().enumerate().filter(|(i, _)| inside(*i)).map(|(_, v)| v);
        psf.captured[0] * light.sum::<f64>()
    }

    #[test]
    fn the_dark_rings_hold_the_light_that_is_known_of_them() {
        let options = PsfOptions { grid: 128, pitch_um: 0.2, ..PsfOptions::default() };
        let psf = airy_psf(&thin(), 0.0, &[0.5], &options).unwrap();
        // Dark rings at 1.2197 and 2.2331 wavelengths times f-number, with 83.8 % and 91.0 % of the light inside (Born and Wolf, table 8.2).
        for (ring, light) in [(1.2197, 0.838), (2.2331, 0.910)] {
            let found = within(&psf, &options, ring * 0.5 * 8.0);
            assert!((found - light).abs() < 2e-3, "{ring}: {found}");
        }
        let row = &psf.values[0][64 * 128..65 * 128];
        let dark = (1.2197 * 4.0 / 0.2 - 0.5_f64).round() as usize;
        assert!(row[64 + dark] < 1e-3 * row[64], "{} {}", row[64 + dark], row[64]);
        let is_even = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert!(row.iter().zip(row.iter().rev()).all(is_even));
    }

    #[test]
    fn off_the_axis_the_pattern_is_longer_away_from_it_and_darker() {
        let options = PsfOptions { grid: 128, pitch_um: 0.2, ..PsfOptions::default() };
        let field = 0.6_f64;
        let psf = airy_psf(&thin(), field, &[0.5], &options).unwrap();
        assert!((psf.chief_y_mm - 100.0 * field.tan()).abs() < 1e-9);
        assert!((psf.illumination[0] - field.cos().powi(4)).abs() < 1e-12);
        // The variances of the bright core along y and x are as the squares of the stretches.
        let first_below =
            |along: &dyn Fn(usize) -> f64| (0..60).find(|k| along(*k) < 0.5 * along(0)).unwrap() as f64;
        let (y, x) = (
            first_below(&|k| psf.values[0][(64 + k) * 128 + 64]),
            first_below(&|k| psf.values[0][64 * 128 + 64 + k]),
        );
        assert!((y / x - 1.0 / field.cos().powi(2)).abs() < 0.15, "{y} {x}");
    }

    #[test]
    fn another_lens_has_no_such_pattern() {
        let none = |lens: Lens| focused_thin_lens_mm(&lens).is_none();
        let lens = thin();
        assert_eq!(focused_thin_lens_mm(&lens), Some(100.0));
        assert!(none(Lens { object: ObjectDistance::Finite(500.0), ..lens.clone() }));
        assert!(none(lens.with_image_distance(99.0)));
        assert!(none(Lens { entrance_pupil_mm: 13.0, ..lens }));
    }
}
