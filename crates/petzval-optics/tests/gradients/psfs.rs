//! Losses of point-spread functions.

use super::knobs::check;
use super::{near, vignetted};
use crate::common::{nominal_triplet, special_lenses};
use petzval_optics::lens::Lens;
use petzval_optics::psf::{
    FieldPsf, PsfCotangent, PsfKind, PsfOptions, PsfTape, psf_traced_with_tape, psf_with_tape,
};
use petzval_optics::pupil::Quadrature;

#[test]
fn psf_loss_with_special_surfaces() {
    let chosen = ["xy without symmetry", "toroid", "binary", "tilted and decentred", "coordinate breaks"];
    for lens in special_lenses().into_iter().filter(|l| chosen.contains(&l.name.as_str())) {
        // On a grid that holds all of their light.
        check_psf_loss_on(3.0, psf_with_tape, &lens, 0.1, 96, 1e-6);
        check_psf_loss_on(3.0, psf_traced_with_tape, &lens, 0.1, 48, 1e-6);
    }
}

type MakePsf = fn(&Lens, f64, &[f64], &Quadrature, &PsfOptions) -> Option<(FieldPsf, PsfTape)>;

fn check_psf_loss(make: MakePsf, lens: &Lens, field: f64, cells: usize, tolerance: f64) {
    check_psf_loss_on(1.0, make, lens, field, cells, tolerance);
}

fn check_psf_loss_on(pitch_um: f64, make: MakePsf, lens: &Lens, field: f64, cells: usize, tolerance: f64) {
    let options = PsfOptions { pitch_um, ..PsfOptions::default() };
    check_psf_loss_with(options, make, lens, field, cells, tolerance);
}

fn check_psf_loss_with(
    options: PsfOptions,
    make: MakePsf,
    lens: &Lens,
    field: f64,
    cells: usize,
    tolerance: f64,
) {
    let quadrature = Quadrature::grid(cells).unwrap();
    // A smooth template makes the loss smooth too: fit the PSF to a very wide Gaussian off centre.
    let side = options.grid as i32;
    let template: Vec<f64> = (0..side * side)
        .map(|i| {
            let scale = 128.0 / f64::from(side);
            let (x, y) = (f64::from(i % side) * scale - 60.0, f64::from(i / side) * scale - 66.0);
            (-(x * x + y * y) / 3200.0).exp()
        })
        .collect();
    let loss = |l: &Lens| -> f64 {
        let (p, _) = make(l, field, &l.wavelengths_um, &quadrature, &options).unwrap();
        let correlation: f64 =
            p.values.iter().map(|v| v.iter().zip(&template).map(|(a, b)| a * b).sum::<f64>()).sum();
        correlation + 0.3 * p.illumination.iter().map(|i| i * i).sum::<f64>() + 0.2 * p.chief_y_mm.powi(2)
    };
    let (p, tape) = make(lens, field, &lens.wavelengths_um, &quadrature, &options).unwrap();
    let cotangent = PsfCotangent {
        values: vec![template.clone(); 3],
        illumination: p.illumination.iter().map(|i| 0.6 * i).collect(),
        chief_y: 0.4 * p.chief_y_mm,
    };
    let gradient = tape.gradient(&p, &quadrature, &cotangent);
    // The splat's second derivative jumps between cells, so differences need short steps; waves have no such jumps.
    let steps: &[f64] = match options.kind {
        PsfKind::Geometric => &[0.03, 0.1, 0.3],
        PsfKind::Diffraction => &[0.3, 1.0, 3.0, 10.0, 30.0],
    };
    check(lens, &gradient, &loss, steps, tolerance);
}

#[test]
fn psf_loss() {
    for lens in [nominal_triplet(), near(nominal_triplet())] {
        check_psf_loss(psf_with_tape, &lens, 9.0_f64.to_radians(), 96, 1e-6);
    }
}

#[test]
fn diffraction_psf_loss() {
    let slow = Lens { entrance_pupil_mm: 2.5, ..nominal_triplet() };
    let options = PsfOptions { grid: 32, pitch_um: 2.0, kind: PsfKind::Diffraction };
    for lens in [slow.clone(), near(slow)] {
        check_psf_loss_with(options, psf_with_tape, &lens, 9.0_f64.to_radians(), 12, 1e-5);
    }
}

#[test]
fn psf_loss_with_vignetting() {
    // The soft edge's second derivative jumps too, and only many points across it make the sum smooth.
    let (lens, fields) = vignetted();
    check_psf_loss(psf_with_tape, &lens, fields[0], 768, 1e-4);
}

#[test]
fn psf_loss_of_traced_rays() {
    for lens in [nominal_triplet(), near(nominal_triplet()), vignetted().0] {
        check_psf_loss(psf_traced_with_tape, &lens, 9.0_f64.to_radians(), 48, 1e-6);
    }
}
