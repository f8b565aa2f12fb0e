//! The light of a field that the clear apertures of a lens let through.

use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::psf::{FieldPsf, PsfCotangent, PsfKind, PsfOptions, PsfTape, psf_with_tape};
use crate::pupil::Quadrature;

/// Pupil cells a side: the rim of an aperture is soft over 0.04 mm, and a share of the cells lies on it.
const CELLS: usize = 256;

/// A grid that holds any spot: nothing but the light on it counts.
const GRID: PsfOptions = PsfOptions { grid: 16, pitch_um: 500.0, kind: PsfKind::Geometric };

/// Clear apertures wider by this factor cut no beam.
const WIDE: f64 = 100.0;

/// The light of a field at the reference wavelength.
struct Light {
    psf: FieldPsf,
    tape: PsfTape,
}

impl Light {
    fn new(lens: &Lens, field_rad: f64, quadrature: &Quadrature) -> Option<Self> {
        let (psf, tape) = psf_with_tape(lens, field_rad, &[lens.reference_um], quadrature, &GRID)?;
        Some(Self { psf, tape })
    }

    fn illumination(&self) -> f64 {
        self.psf.illumination[0]
    }

    /// Adds the gradient of a loss that depends on the illumination.
    fn pull_back(&self, bar: f64, quadrature: &Quadrature, gradient: &mut LensGradient) {
        let values = vec![vec![0.0; GRID.grid * GRID.grid]];
        let cotangent = PsfCotangent { values, illumination: vec![bar], chief_y: 0.0 };
        *gradient += &self.tape.gradient(&self.psf, quadrature, &cotangent);
    }
}

/// The share of a field's light that the clear apertures let through: its illumination over that of the same lens with wide apertures. The fourth power
/// of the cosine, distortion and aberrations of the pupil do not count. Exactly 1 where no aperture cuts the beam; `None` if the field has no light.
pub fn passing_share(lens: &Lens, field_rad: f64) -> Option<f64> {
    share(lens, field_rad, None)
}

/// [`passing_share`]; with `pull` = (its cotangent, a gradient), adds to the gradient.
pub(super) fn share(lens: &Lens, field_rad: f64, pull: Option<(f64, &mut LensGradient)>) -> Option<f64> {
    let quadrature = Quadrature::grid(CELLS).ok()?;
    let mut wide = lens.clone();
    wide.surfaces.iter_mut().for_each(|surface| surface.semi_diameter_mm *= WIDE);
    let all = Light::new(&wide, field_rad, &quadrature)?;
    let passing = Light::new(lens, field_rad, &quadrature)?;
    let share = passing.illumination() / all.illumination();
    if let Some((bar, gradient)) = pull {
        passing.pull_back(bar / all.illumination(), &quadrature, gradient);
        all.pull_back(-bar * share / all.illumination(), &quadrature, gradient);
    }
    Some(share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::nominal_triplet;
    use crate::constraint::{Constraint, SemiDiameters, penalty};
    use crate::number::Number;
    use crate::paraxial::first_order;
    use crate::pupil::trace_beam;

    const FIELD_RAD: f64 = 0.26;

    /// The nominal triplet with a first surface that cuts beams off the axis.
    fn cut() -> Lens {
        let mut lens = nominal_triplet();
        lens.surfaces[0].semi_diameter_mm = 5.0;
        lens
    }

    #[test]
    fn a_lens_that_cuts_no_beam_passes_all_light() {
        assert_eq!(passing_share(&nominal_triplet(), FIELD_RAD), Some(1.0));
        assert_eq!(passing_share(&cut(), 0.0), Some(1.0));
    }

    /// The reference: a traced ray for every cell of the pupil, through the lens as it is and with wide apertures.
    #[test]
    fn the_share_is_that_of_traced_rays() {
        let lens = cut();
        let light = |lens: &Lens| {
            let sequence = lens.at_wavelength(lens.reference_um);
            let stop_mm = first_order(&sequence).stop_radius_mm;
            trace_beam(&sequence, FIELD_RAD, stop_mm, &Quadrature::grid(256).unwrap()).light()
        };
        let reference = light(&lens) / light(&nominal_triplet());
        let share = passing_share(&lens, FIELD_RAD).unwrap();
        assert!(share > 0.3 && share < 0.7, "{share}");
        assert!((share - reference).abs() < 5e-3, "{share} {reference}");
    }

    #[test]
    fn the_requirement_has_the_slopes_of_differences() {
        let lens = cut();
        let share = passing_share(&lens, FIELD_RAD).unwrap();
        let constraint = Constraint::Light { field_rad: FIELD_RAD, least: share + 0.1, scale_mm: 6.0 };
        let excess = |lens: &Lens| constraint.excess_mm(lens, &SemiDiameters(lens)).unwrap();
        assert!((excess(&lens) - 0.6).abs() < 1e-9);
        let (square, _) = penalty(&[constraint], &lens).unwrap();
        assert!((square - 0.36).abs() < 1e-9);
        let gradient = constraint.gradient(&lens, &SemiDiameters(&lens), 1.0).unwrap();
        for (surface, number, step) in [
            (1, Number::Thickness, 1e-4),
            (3, Number::Thickness, 1e-4),
            (1, Number::Curvature, 1e-7),
            (2, Number::Curvature, 1e-7),
        ] {
            let moved = |by: f64| {
                let mut lens = lens.clone();
                match number {
                    Number::Thickness => lens.surfaces[surface].thickness_mm += by,
                    _ => lens.surfaces[surface].shape.curvature += by,
                }
                excess(&lens)
            };
            let difference = (moved(step) - moved(-step)) / (2.0 * step);
            let slope = gradient[(surface, number)];
            assert!(
                (slope - difference).abs() < 1e-2 * difference.abs().max(1e-3),
                "{surface} {number:?}: {slope} {difference}"
            );
        }
        // What is kept costs nothing, to the bit.
        let kept = Constraint::Light { field_rad: FIELD_RAD, least: share - 0.01, scale_mm: 6.0 };
        assert_eq!(penalty(&[kept], &lens).unwrap().0, 0.0);
    }
}
