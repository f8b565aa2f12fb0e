//! The PSF of a thin lens without aberrations: the Airy pattern.
//!
//! Through a pupil of diameter D at the focal length f, the image of a far point at the field angle w is
//!
//! `P(x, y) ~ (2 J_1(v) / v)^2`, `v = (pi D / (lambda f)) sqrt((x cos w)^2 + (y cos^3 w)^2)`,
//!
//! with y away from the axis: the pupil looks narrower from the side, and the light arrives aslant. The light falls off with `cos^4 w`.
//! To first order in D / f; Born and Wolf, Principles of Optics, section 8.5.2 (w = 0).

use std::f64::consts::PI;

use super::PsfOptions;

/// Points along a side of a cell at which the pattern is sampled.
const SAMPLES: usize = 3;

/// `(2 J_1(v) / v)^2`.
fn airy(v: f64) -> f64 {
    if v < 1e-6 { 1.0 } else { (2.0 * libm::j1(v) / v).powi(2) }
}

/// The pattern at a field angle of cosine `cos`, of unit sum on the grid, and the share of its light that the grid holds. `airy_per_mm` is
/// `pi D / (lambda f)`.
pub(super) fn pattern(airy_per_mm: f64, cos: f64, options: &PsfOptions) -> (Vec<f64>, f64) {
    let (per_mm, centre) = options.scale();
    // Middles of the samples of a row of cells, mm from the chief ray.
    let sample = |i: usize| {
        let cell = ((i as f64 + 0.5) / SAMPLES as f64 - 0.5 - centre) / per_mm;
        cell.abs()
    };
    let samples: Vec<f64> = (0..options.grid * SAMPLES).map(sample).collect();
    let mut values = vec![0.0; options.grid * options.grid];
    for (r, y) in samples.iter().enumerate() {
        let row = &mut values[r / SAMPLES * options.grid..][..options.grid];
        for (c, x) in samples.iter().enumerate() {
            row[c / SAMPLES] += airy(airy_per_mm * (x * cos).hypot(y * cos.powi(3)));
        }
    }
    // The integral of the pattern over the plane is 4 pi in units of v.
    let per_sample = (airy_per_mm / (SAMPLES as f64 * per_mm)).powi(2) * cos.powi(4) / (4.0 * PI);
    let total: f64 = values.iter().sum();
    values.iter_mut().for_each(|v| *v /= total);
    (values, total * per_sample)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: PsfOptions =
        PsfOptions { grid: 128, pitch_um: 0.2, kind: crate::psf::PsfKind::Diffraction };

    /// `pi D / (lambda f)` of f/8 at 0.5 um, per mm.
    const F8_PER_MM: f64 = PI / (0.5e-3 * 8.0);

    /// Light within a radius, of the whole plane.
    fn within(values: &[f64], captured: f64, radius_um: f64) -> f64 {
        let centre = 0.5 * (OPTIONS.grid as f64 - 1.0);
        let inside = |i: usize| {
            let [y, x] = [i / OPTIONS.grid, i % OPTIONS.grid].map(|k| (k as f64 - centre) * OPTIONS.pitch_um);
            x.hypot(y) < radius_um
        };
        let light = values.iter().enumerate().filter(|(i, _)| inside(*i)).map(|(_, v)| v);
        captured * light.sum::<f64>()
    }

    #[test]
    fn the_dark_rings_hold_the_light_that_is_known_of_them() {
        let (values, captured) = pattern(F8_PER_MM, 1.0, &OPTIONS);
        // Dark rings at 1.2197 and 2.2331 wavelengths times f-number, with 83.8 % and 91.0 % of the light inside (Born and Wolf, table 8.2).
        for (ring, light) in [(1.2197, 0.838), (2.2331, 0.910)] {
            let found = within(&values, captured, ring * 0.5 * 8.0);
            assert!((found - light).abs() < 2e-3, "{ring}: {found}");
        }
        let row = &values[64 * 128..65 * 128];
        let dark = (1.2197 * 4.0 / 0.2 - 0.5_f64).round() as usize;
        assert!(row[64 + dark] < 1e-3 * row[64], "{} {}", row[64 + dark], row[64]);
        let is_even = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert!(row.iter().zip(row.iter().rev()).all(is_even));
    }

    #[test]
    fn off_the_axis_the_pattern_is_longer_away_from_it() {
        let cos = 0.6_f64.cos();
        let (values, _) = pattern(F8_PER_MM, cos, &OPTIONS);
        // The widths of the bright core along y and x are as the stretches.
        let first_below =
            |along: &dyn Fn(usize) -> f64| (0..60).find(|k| along(*k) < 0.5 * along(0)).unwrap() as f64;
        let (y, x) =
            (first_below(&|k| values[(64 + k) * 128 + 64]), first_below(&|k| values[64 * 128 + 64 + k]));
        assert!((y / x - 1.0 / cos.powi(2)).abs() < 0.15, "{y} {x}");
    }
}
