//! Forward derivatives of point-spread functions: the transpose of the gradient, and central differences.

use std::sync::Arc;

use super::knobs::shift_index;
use super::{near, vignetted};
use crate::common::{nominal_triplet, special_lenses};
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::number::Number;
use petzval_optics::psf::{
    FieldPsf, PsfCotangent, PsfKind, PsfMethod, PsfOptions, PsfTangent, PsfTape, psf_traced_with_tape,
    psf_with_tape,
};
use petzval_optics::pupil::{Quadrature, chief_ray, pull_back_chief};

type MakePsf = fn(&Lens, f64, &[f64], &Quadrature, &PsfOptions) -> Option<(FieldPsf, PsfTape)>;

/// Numbers between -1 and 1 that look random.
fn noise(seed: f64) -> impl Iterator<Item = f64> {
    (0..).map(move |i| 2.0 * (f64::from(i) * 0.618_033_988_7 + seed).fract() - 1.0)
}

/// A change of every number of the lens.
fn direction(lens: &Lens, seed: f64) -> LensGradient {
    let mut noise = noise(seed);
    let mut change = LensGradient::zero(lens.surfaces.len());
    change.entrance_pupil = 1e-2 * noise.next().unwrap();
    for (i, surface) in lens.surfaces.iter().enumerate() {
        for number in Number::ALL.into_iter().filter(|n| surface.has_number(*n)) {
            let size = match number {
                Number::Conic | Number::Thickness | Number::Phase(_) => 1.0,
                Number::SemiDiameter | Number::Departure(_) | Number::Power => 1e-3,
                Number::Asphere(j) => 10f64.powi(-3 - 2 * j as i32),
                Number::Curvature | Number::Index | Number::Decenter(_) | Number::Tilt(_) => 1e-2,
            };
            change[(i, number)] = size * noise.next().unwrap();
        }
    }
    change
}

/// Holds `<w, J u> = <J^T w, u>` for a random loss w of the PSFs and a random change u of the lens.
fn check_transpose(make: MakePsf, lens: &Lens, field: f64, options: PsfOptions) -> PsfMethod {
    let quadrature = Quadrature::grid(24).unwrap();
    let (psf, tape) = make(lens, field, &lens.wavelengths_um, &quadrature, &options).unwrap();
    let (mut bar, colours) = (noise(0.3), lens.wavelengths_um.len());
    let cotangent = PsfCotangent {
        values: (0..colours).map(|_| bar.by_ref().take(options.grid * options.grid).collect()).collect(),
        illumination: bar.by_ref().take(colours).collect(),
        chief_y: bar.next().unwrap(),
    };
    let mut gradient = tape.gradient(&psf, &quadrature, &cotangent);
    let (reference, chief_x) = (lens.at_wavelength(lens.reference_um), bar.next().unwrap());
    let chief = chief_ray(&reference, field).unwrap();
    pull_back_chief(&reference, &chief, [chief_x, 0.0], &mut gradient);

    let change = direction(lens, 0.1);
    let found = tape.push_forward(&psf, &quadrature, &change);
    let (mut left, mut scale) = (0.0, 0.0);
    let mut add = |a: f64, b: f64| {
        left += a * b;
        scale += (a * b).abs();
    };
    add(found.chief_mm[0], chief_x);
    add(found.chief_mm[1], cotangent.chief_y);
    for k in 0..colours {
        add(found.illumination[k], cotangent.illumination[k]);
        found.values[k].iter().zip(&cotangent.values[k]).for_each(|(a, b)| add(*a, *b));
    }
    let right = gradient.along(&change);
    let which = format!("{} at {field}, {:?}", lens.name, psf.method[0]);
    assert!(left != 0.0 && (left - right).abs() < 1e-10 * scale, "{which}: {left} {right} of {scale}");
    psf.method[0]
}

const RAYS: PsfOptions = PsfOptions { grid: 32, pitch_um: 4.0, kind: PsfKind::Geometric };
const WAVES: PsfOptions = PsfOptions { grid: 16, pitch_um: 3.0, kind: PsfKind::Diffraction };

/// One surface of every special kind that has no symmetry, mirrors, and others.
fn special() -> impl Iterator<Item = Lens> {
    const CHOSEN: [&str; 6] = [
        "odd",
        "xy without symmetry",
        "binary",
        "tilted in the plane of symmetry",
        "tilted and decentred",
        "folded",
    ];
    special_lenses().into_iter().filter(|l| CHOSEN.contains(&l.name.as_str()))
}

#[test]
fn changes_of_ray_psfs_are_the_transpose_of_the_gradient() {
    let plain = [nominal_triplet(), near(nominal_triplet())];
    for lens in plain.into_iter().chain(special()) {
        for field in [0.0, 0.15] {
            // No polynomial follows odd powers of the radius.
            let fast = check_transpose(psf_with_tape, &lens, field, RAYS);
            assert_eq!(
                matches!(fast, PsfMethod::Polynomial { .. }),
                lens.name != "odd",
                "{} {fast:?}",
                lens.name
            );
            check_transpose(psf_traced_with_tape, &lens, field, RAYS);
        }
    }
    let (lens, fields) = vignetted();
    check_transpose(psf_with_tape, &lens, fields[0], RAYS);
    check_transpose(psf_traced_with_tape, &lens, fields[0], RAYS);
}

/// The lens, slower, so that waves need few nodes.
fn slow(lens: Lens) -> Lens {
    Lens { entrance_pupil_mm: 2.5, ..lens }
}

#[test]
fn changes_of_wave_psfs_are_the_transpose_of_the_gradient() {
    // An image in glass: its index enters the phases.
    let mut in_glass = slow(nominal_triplet());
    let glass = Glass::new("n 1.1", Dispersion::Schott([1.21, 0.0, 0.0, 0.0, 0.0, 0.0]));
    in_glass.surfaces[6].glass = Arc::new(glass);
    in_glass.name = "image in glass".into();
    let in_glass = petzval_optics::solve::with_paraxial_focus(&in_glass, 0.0);
    let (cut, _) = vignetted();
    let mut cut = Lens { name: "vignetted".into(), ..slow(cut) };
    cut.surfaces[0].semi_diameter_mm = 3.6;
    cut.surfaces[5].semi_diameter_mm = 1.4;
    let plain = [slow(nominal_triplet()), near(slow(nominal_triplet())), in_glass, cut];
    for lens in plain.into_iter().chain(special().map(slow)) {
        for field in [0.0, 0.15] {
            check_transpose(psf_with_tape, &lens, field, WAVES);
        }
    }
}

/// The lens moved along a change of its numbers.
fn moved(lens: &Lens, change: &LensGradient, step: f64) -> Lens {
    let mut moved = lens.clone();
    moved.entrance_pupil_mm += step * change.entrance_pupil;
    for i in 0..lens.surfaces.len() {
        for number in Number::ALL.into_iter().filter(|n| lens.surfaces[i].has_number(*n)) {
            let by = step * change[(i, number)];
            if number == Number::Index {
                shift_index(&mut moved, i, by);
            } else if by != 0.0 {
                number.write(&mut moved, i, number.read(lens, i) + by);
            }
        }
    }
    moved
}

/// Every output is within `tolerance` (of the norm of its change) of central differences.
fn check_differences(make: MakePsf, lens: &Lens, field: f64, options: PsfOptions, step: f64, tolerance: f64) {
    let quadrature = Quadrature::grid(96).unwrap();
    let make = |lens: &Lens| make(lens, field, &lens.wavelengths_um, &quadrature, &options).unwrap();
    let mut change = direction(lens, 0.7);
    for (i, surface) in lens.surfaces.iter().enumerate() {
        // The index of air and the sag of the stop stay.
        let held = |n: &Number| match n {
            Number::Index => surface.glass.is_air(),
            Number::Thickness | Number::Decenter(_) | Number::Tilt(_) => false,
            _ => i == lens.stop,
        };
        for number in Number::ALL.into_iter().filter(held) {
            change[(i, number)] = 0.0;
        }
    }
    let (psf, tape) = make(lens);
    let found = tape.push_forward(&psf, &quadrature, &change);
    let outputs = |values: &[Vec<f64>], light: &[f64], chief: [f64; 2], captured: &[f64]| -> [Vec<f64>; 4] {
        [values.concat(), light.to_vec(), chief.to_vec(), captured.to_vec()]
    };
    let PsfTangent { values, illumination, chief_mm, captured } = &found;
    let found = outputs(values, illumination, *chief_mm, captured);
    let [plus, minus] = [step, -step].map(|step| {
        let (psf, _) = make(&moved(lens, &change, step));
        outputs(&psf.values, &psf.illumination, [psf.chief_x_mm, psf.chief_y_mm], &psf.captured)
    });
    let names = ["values", "illumination", "chief_mm", "captured"];
    for ((name, found), (plus, minus)) in names.iter().zip(&found).zip(plus.iter().zip(&minus)) {
        let norm = |of: &mut dyn Iterator<Item = f64>| of.map(|v| v * v).sum::<f64>().sqrt();
        let differences: Vec<f64> = plus.iter().zip(minus).map(|(p, m)| (p - m) / (2.0 * step)).collect();
        let off = norm(&mut found.iter().zip(&differences).map(|(a, b)| a - b));
        let size = norm(&mut differences.iter().copied());
        assert!(size > 0.0 && off < tolerance * size, "{} {name}: {off:e} of {size:e}", lens.name);
    }
}

#[test]
fn changes_of_psfs_are_those_of_differences() {
    let tilted = special_lenses().into_iter().find(|l| l.name == "tilted and decentred").unwrap();
    check_differences(psf_with_tape, &tilted, 0.15, RAYS, 1e-6, 1e-4);
    check_differences(psf_with_tape, &slow(tilted), 0.15, WAVES, 1e-5, 1e-4);
}
