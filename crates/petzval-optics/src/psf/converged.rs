//! PSFs on as many pupil cells as a stated error needs.

use super::{FieldPsf, PsfKind, PsfOptions, psf};
use crate::lens::Lens;
use crate::pupil::{PupilRefinement, Refined, refine};

/// PSFs of a field on the coarsest pupil grid whose error is within the tolerance.
///
/// The error of a PSF P is `sum |P - P_true|` over its cells, at most 2 because both sums are 1, or the relative error of its
/// illumination if that is larger; the largest of all wavelengths counts. It is estimated from P on N and on 2N cells, see
/// [`PupilRefinement`]. It depends on the size of the PSF's cells: a grid of fewer pupil points than lit cells is an error of
/// the order of 1. Waves have no pupil grid: they are returned with the first number of cells and no error.
///
/// `None` if the field has no PSF, see [`psf`], or the first number of cells is not possible.
pub fn psf_converged(
    lens: &Lens,
    field_rad: f64,
    wavelengths_um: &[f64],
    options: &PsfOptions,
    refinement: &PupilRefinement,
) -> Option<Refined<FieldPsf>> {
    if options.kind == PsfKind::Diffraction {
        let first = PupilRefinement { most_cells: refinement.first_cells, ..*refinement };
        let waves = refine(&first, |q| psf(lens, field_rad, wavelengths_um, q, options), difference)?;
        return Some(Refined { error: 0.0, is_converged: true, ..waves });
    }
    refine(refinement, |q| psf(lens, field_rad, wavelengths_um, q, options), difference)
}

/// Largest difference of two PSFs of the same field over the wavelengths.
fn difference(a: &FieldPsf, b: &FieldPsf) -> f64 {
    let of_values = a.values.iter().zip(&b.values);
    let of_values = of_values.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>());
    let of_light = a.illumination.iter().zip(&b.illumination).map(|(a, b)| (a / b - 1.0).abs());
    of_values.chain(of_light).fold(0.0, f64::max)
}
