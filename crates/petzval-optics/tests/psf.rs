//! PSFs from pupil polynomials against PSFs from a traced ray for every pupil cell.

mod built_in;
mod common;

use built_in::all_lenses;
use common::{nominal_triplet, special_lenses};
use petzval_optics::lens::{Lens, Placement};
use petzval_optics::number::Number;
use petzval_optics::psf::{FieldPsf, PsfKind, PsfMethod, PsfOptions, psf, psf_converged, psf_traced};
use petzval_optics::pupil::{PupilRefinement, Quadrature};
use petzval_optics::spot::{mean_square_spot, spot, spot_converged, spot_paraxial_pupil};

const WAVELENGTHS_UM: [f64; 3] = [0.62, 0.55, 0.486];

/// Mean over the wavelengths of the sum of absolute differences; every PSF sums to one.
fn distance(a: &FieldPsf, b: &FieldPsf) -> f64 {
    let l1 = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>();
    a.values.iter().zip(&b.values).map(|(a, b)| l1(a, b)).sum::<f64>() / a.values.len() as f64
}

fn both(lens: &Lens, field_deg: f64, cells: [usize; 2]) -> (FieldPsf, FieldPsf) {
    both_on(1.0, lens, field_deg, cells)
}

fn both_on(pitch_um: f64, lens: &Lens, field_deg: f64, cells: [usize; 2]) -> (FieldPsf, FieldPsf) {
    let options = PsfOptions { pitch_um, ..PsfOptions::default() };
    let [fast, reference] = cells.map(|c| Quadrature::grid(c).unwrap());
    let field = field_deg.to_radians();
    let polynomial = psf(lens, field, &WAVELENGTHS_UM, &fast, &options).unwrap();
    let traced = psf_traced(lens, field, &WAVELENGTHS_UM, &reference, &options).unwrap();
    (polynomial, traced)
}

fn is_polynomial(method: &PsfMethod) -> bool {
    matches!(method, PsfMethod::Polynomial { residual_um, .. } if *residual_um < 0.01)
}

#[test]
fn the_nominal_triplet_at_15_degrees_is_accurate_to_0_3_percent() {
    let (fast, reference) = both(&nominal_triplet(), 15.0, [160, 1024]);
    assert!(fast.method.iter().all(is_polynomial), "{:?}", fast.method);
    assert!(reference.method.iter().all(|m| *m == PsfMethod::Traced));
    let off = distance(&fast, &reference);
    assert!(off < 3e-3, "{off}");
    let (fine, _) = both(&nominal_triplet(), 15.0, [256, 12]);
    assert!(distance(&fine, &reference) < 1e-3);
}

#[test]
fn every_lens_agrees_with_traced_rays() {
    let (mut polynomial, mut compared) = (0, 0);
    for file in all_lenses() {
        for field_deg in [0.0, 7.0, 14.0] {
            let (fast, reference) = both(&file.lens, field_deg, [768, 768]);
            compared += 1;
            polynomial += usize::from(fast.method.iter().all(is_polynomial));
            let off = distance(&fast, &reference);
            assert!(off < 5e-3, "{} {field_deg}: {off} {:?}", file.lens.name, fast.method);
            for (a, b) in fast.illumination.iter().zip(&reference.illumination) {
                assert!((a / b - 1.0).abs() < 5e-4, "{} {field_deg}: {a} {b}", file.lens.name);
            }
            for (a, b) in fast.captured.iter().zip(&reference.captured) {
                assert!((a - b).abs() < 5e-4, "{} {field_deg}: {a} {b}", file.lens.name);
            }
        }
    }
    // The fall-back is for the exception.
    assert!(polynomial * 4 > compared * 3, "{polynomial} of {compared}");
}

#[test]
fn special_surfaces_agree_with_traced_rays() {
    let mut compared = 0;
    for lens in special_lenses() {
        let far = *lens.fields_deg.last().unwrap();
        let other = if lens.is_rotationally_symmetric() { 0.0 } else { -0.5 * far };
        for field_deg in [other, 0.7 * far] {
            let (fast, reference) = both_on(3.0, &lens, field_deg, [512, 512]);
            // A PSF that the grid cannot hold is no PSF to compare.
            if reference.captured.iter().any(|c| *c < 0.98) {
                continue;
            }
            compared += 1;
            let off = distance(&fast, &reference);
            assert!(off < 5e-3, "{} {field_deg}: {off} {:?}", lens.name, fast.method);
            for (a, b) in fast.illumination.iter().zip(&reference.illumination) {
                assert!((a / b - 1.0).abs() < 5e-4, "{} {field_deg}: {a} {b}", lens.name);
            }
            for (a, b) in fast.captured.iter().zip(&reference.captured) {
                assert!((a - b).abs() < 5e-4, "{} {field_deg}: {a} {b}", lens.name);
            }
            let field = field_deg.to_radians();
            let sampled = mean_square_spot(&lens, &[field]).unwrap().0.sqrt();
            let traced = spot(&lens, field, &Quadrature::grid(64).unwrap()).unwrap().rms_poly_um;
            assert!((sampled / traced - 1.0).abs() < 2e-3, "{} {field_deg}: {sampled} {traced}", lens.name);
        }
    }
    assert!(compared >= 20, "{compared}");
}

/// A lens that is turned about its axis is the same lens, but has to be looked at on both sides of the pupil.
#[test]
fn both_halves_of_a_pupil_equal_one_half_and_its_mirror_image() {
    let lens = nominal_triplet();
    let mut turned = lens.clone();
    let tilt_rad = [0.0, 0.0, 0.4];
    turned.surfaces[2].placement = Some(Placement { tilt_rad, ..Placement::default() });
    assert!(lens.is_mirror_symmetric() && !turned.is_mirror_symmetric());
    for field_deg in [0.0, 13.0] {
        let [a, b] = [&lens, &turned].map(|l| both(l, field_deg, [128, 64]));
        for (half, whole) in [(&a.0, &b.0), (&a.1, &b.1)] {
            assert!(distance(half, whole) < 1e-9, "{}", distance(half, whole));
            assert!((half.illumination[1] - whole.illumination[1]).abs() < 1e-12);
            assert!((half.captured[1] - whole.captured[1]).abs() < 1e-12);
            assert!(whole.chief_x_mm.abs() < 1e-12 && (whole.chief_y_mm - half.chief_y_mm).abs() < 1e-12);
        }
        let fields = [f64::to_radians(field_deg)];
        let [(a, by_a), (b, by_b)] = [&lens, &turned].map(|l| mean_square_spot(l, &fields).unwrap());
        assert!((a / b - 1.0).abs() < 1e-11, "{a} {b}");
        for surface in 0..lens.surfaces.len() {
            for number in [Number::Curvature, Number::Asphere(3)] {
                let [a, b] = [&by_a, &by_b].map(|g| g[(surface, number)]);
                assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "surface {surface}, {number}: {a} {b}");
            }
        }
        let quadrature = Quadrature::grid(24).unwrap();
        let [a, b] = [&lens, &turned].map(|l| spot_paraxial_pupil(l, fields[0], &quadrature).unwrap());
        assert!((a.rms_poly_um / b.rms_poly_um - 1.0).abs() < 1e-11);
    }
}

#[test]
fn apertures_cut_polynomials_as_they_cut_rays() {
    let mut lens = nominal_triplet();
    lens.surfaces[0].semi_diameter_mm = 6.6;
    lens.surfaces[5].semi_diameter_mm = 3.1;
    let (fast, reference) = both(&lens, 14.0, [256, 512]);
    assert!(fast.method.iter().all(is_polynomial), "{:?}", fast.method);
    assert!(reference.illumination[0] / reference.image_area < 0.8);
    assert!(distance(&fast, &reference) < 1e-2, "{}", distance(&fast, &reference));
    for (a, b) in fast.illumination.iter().zip(&reference.illumination) {
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
}

#[test]
fn where_rays_of_the_stop_are_lost_every_cell_is_traced() {
    let mut lens = nominal_triplet();
    // So strong a first surface that some rays of the stop have no launch.
    lens.surfaces[0].shape.curvature = 1.0 / 8.0;
    lens.surfaces.iter_mut().for_each(|s| s.semi_diameter_mm = 9.0);
    let (fast, reference) = both(&lens, 5.73, [64, 64]);
    assert!(fast.method.contains(&PsfMethod::Traced), "{:?}", fast.method);
    assert!(distance(&fast, &reference) < 1e-12);
}

/// The number of pupil cells follows from the measured error: many for a broad PSF, few for a narrow one.
#[test]
fn the_pupil_grid_is_as_fine_as_the_error_needs() {
    let options = PsfOptions::default();
    let finest = Quadrature::grid(4096).unwrap();
    let lens_of =
        |part: &str| all_lenses().into_iter().map(|f| f.lens).find(|l| l.name.contains(part)).unwrap();
    let mut chosen = Vec::new();
    for (part, field_deg) in [
        ("larger field of view with a software", 21.0),
        ("larger field of view with a software", 3.0),
        ("nominal", 9.0),
        ("raffic", 12.0),
    ] {
        let (lens, field) = (lens_of(part), f64::to_radians(field_deg));
        let exact = psf(&lens, field, &[0.486], &finest, &options).unwrap();
        let refinement = PupilRefinement { tolerance: 0.02, ..PupilRefinement::default() };
        let found = psf_converged(&lens, field, &[0.486], &options, &refinement).unwrap();
        let error = distance(&found.value, &exact);
        let default = distance(
            &psf(&lens, field, &[0.486], &Quadrature::grid(256).unwrap(), &options).unwrap(),
            &exact,
        );
        println!(
            "{} {field_deg}: {} cells, error {error:.4} <= {:.4}, of 256 cells {default:.4}",
            lens.name, found.cells, found.error
        );
        assert!(error <= found.error, "{}: {error} {}", lens.name, found.error);
        assert_eq!(found.is_converged, found.error <= refinement.tolerance);
        chosen.push(found.cells);
    }
    assert!(chosen.iter().max() > chosen.iter().min(), "{chosen:?}");
    // A tolerance that cannot be reached is reported.
    let strict = PupilRefinement { tolerance: 1e-9, first_cells: 32, most_cells: 128 };
    let lens = lens_of("nominal");
    let found = psf_converged(&lens, 0.1, &[0.486], &options, &strict).unwrap();
    assert!(!found.is_converged && found.cells == 128 && found.error > strict.tolerance);
    // Waves need no pupil grid.
    let waves = PsfOptions { kind: PsfKind::Diffraction, ..options };
    let found =
        psf_converged(&Lens { entrance_pupil_mm: 1.0, ..lens }, 0.1, &[0.55], &waves, &strict).unwrap();
    assert!(found.is_converged && found.cells == 32);
}

/// RMS spots on a coarse grid are too small; with a stated error they are not.
#[test]
fn spots_are_as_accurate_as_stated() {
    let finest = Quadrature::grid(640).unwrap();
    for lens in all_lenses().into_iter().map(|f| f.lens) {
        let field = 0.7 * lens.fields_deg.last().unwrap().to_radians();
        let refinement = PupilRefinement { tolerance: 4e-3, first_cells: 32, most_cells: 320 };
        let found = spot_converged(&lens, field, &refinement).unwrap();
        let exact = spot(&lens, field, &finest).unwrap();
        let error = (found.value.rms_poly_um / exact.rms_poly_um - 1.0).abs();
        println!("{}: {} cells, error {error:.1e} <= {:.1e}", lens.name, found.cells, found.error);
        assert!(found.is_converged && error <= found.error, "{}: {error} {}", lens.name, found.error);
    }
}
