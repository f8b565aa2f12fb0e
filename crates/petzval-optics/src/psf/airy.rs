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

/// The focal length of a lens that is one thin lens with the image plane at its focus, mm; `None` of any other.
pub fn focused_thin_lens_mm(lens: &Lens) -> Option<f64> {
    let [surface] = lens.surfaces.as_slice() else { return None };
    let Action::ThinLens { power_per_mm } = surface.action else { return None };
    let efl_mm = 1.0 / power_per_mm;
    let is_plain = surface.phase.is_none() && surface.placement.is_none() && surface.glass.is_air();
    let is_focused = (surface.thickness_mm / efl_mm - 1.0).abs() < 1e-9;
    (is_plain && is_focused && lens.object == ObjectDistance::Infinity).then_some(efl_mm)
}
