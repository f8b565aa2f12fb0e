//! What lens files hold: built-in lenses, glasses, and every number to the bit.

use std::sync::Arc;

use petzval_files::{Expect, Expected, ExpectedSpots, LensFile, parse_lens, write_lens};
use petzval_optics::design_space::{EflSolve, Variable};
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{ObjectDistance, Surface, SurfaceShape, validate};
use petzval_optics::number::Number;

use crate::support::{catalog, data, nominal, odd_number, read};

#[test]
fn catalogue_holds_the_materials_of_the_triplet() {
    let catalog = catalog();
    let pmma = catalog.get("pmma").unwrap();
    assert!((pmma.nd() - 1.491_755_710_891_999_4).abs() < 1e-12);
    assert!((pmma.abbe_vd() - 57.440_791_425_729_84).abs() < 1e-9);
    assert!((catalog.get("N-SF11").unwrap().nd() - 1.78472).abs() < 1e-5);
}

#[test]
fn built_in_lenses_are_equal_after_writing_and_reading() {
    let catalog = catalog();
    let paths = data("lenses");
    assert!(paths.len() >= 8);
    for path in paths {
        let file = parse_lens(&read(&path), &catalog).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        validate(&file.lens).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert!(!file.lens.source.is_empty() && file.expect.is_some(), "{}", path.display());
        // The written file contains its glasses, so an empty catalogue is enough.
        let again = parse_lens(&write_lens(&file), &Catalog::default()).unwrap();
        assert_eq!(again, file, "{}", path.display());
    }
}

#[test]
fn a_written_lens_contains_all_data_of_its_glasses() {
    let file = parse_lens(&nominal().replace("\"N-SF11\"", "\"SCHOTT:N-SF11\""), &catalog()).unwrap();
    let flint = &file.lens.surfaces[2].glass;
    assert!(flint.thermal.is_some() && flint.absorption.is_some() && flint.range_um.is_some());
    let again = parse_lens(&write_lens(&file), &Catalog::default()).unwrap();
    assert_eq!(again.lens.surfaces[2].glass, *flint);
    assert_eq!(write_lens(&again), write_lens(&file));
}

#[test]
fn the_nominal_triplet_has_its_variables_and_its_solve() {
    let file = parse_lens(&nominal(), &catalog()).unwrap();
    assert_eq!(file.lens.stop, 4);
    assert_eq!(file.variables.len(), 18);
    let radius_mm = Some([-15.05, -11.5]);
    assert_eq!(file.efl_solve, Some(EflSolve { surface: 6, efl_mm: 25.04003827951391, radius_mm }));
    let l_12 = Variable { surface: 1, number: Number::Thickness, min: 4.58, max: 10.11 };
    assert!(file.variables.contains(&l_12));
    assert!(file.expect.unwrap().efl_mm.unwrap().agrees(25.04));
}

#[test]
fn infinity_may_be_quoted_and_a_file_may_define_its_own_glass() {
    let text = nominal().replacen("radius_mm = inf", "radius_mm = \"inf\"", 1).replacen(
        "[fields]",
        "[glass.N-SF11]\nnd = 1.7\nvd = 30\n[fields]",
        1,
    );
    let lens = parse_lens(&text, &catalog()).unwrap().lens;
    assert_eq!(lens.surfaces[4].shape.curvature, 0.0);
    assert_eq!(lens.surfaces[2].glass.dispersion, Dispersion::NdVd { nd: 1.7, vd: 30.0 });
}

#[test]
fn every_number_of_a_lens_file_keeps_its_bits() {
    let mut state = 0x9e37_79b9_7f4a_7c15;
    for round in 0..400 {
        let mut any = || odd_number(&mut state);
        // Mantissas are arbitrary; exponents are those of possible lenses.
        let scaled = |value: f64, exponent: i32| {
            let mantissa = f64::from_bits(value.to_bits() & !(0x7ff << 52) | (1023 << 52));
            mantissa * 2f64.powi(exponent)
        };
        let size = |value: f64, exponent: i32| scaled(value, exponent).abs();
        let mut asphere = [0.0; 8];
        for (i, a) in asphere.iter_mut().enumerate() {
            *a = scaled(any(), -20 - 12 * i as i32);
        }
        asphere[round % 8] = -0.0;
        let glass = |dispersion| Arc::new(Glass::new(format!("g\"{}\\\n", round), dispersion));
        let glasses = [
            glass(Dispersion::Constant(size(any(), 0))),
            glass(Dispersion::Schott([3.0, scaled(any(), -9), scaled(any(), -9), 0.0, -0.0, 0.0])),
            glass(Dispersion::Sellmeier { b: vec![size(any(), 0)], c_um2: vec![size(any(), -9)] }),
            glass(Dispersion::NdVd { nd: 1.0 + size(any(), -1), vd: size(any(), 5) }),
            glass(Dispersion::Table { wavelength_um: vec![0.4, 0.7], index: vec![1.5, size(any(), 0)] }),
            Glass::air(),
        ];
        let surfaces: Vec<Surface> = glasses
            .into_iter()
            .enumerate()
            .map(|(i, glass)| Surface {
                label: format!("{i}\t\u{7f}'''\""),
                shape: SurfaceShape {
                    curvature: scaled(any(), -6 - i as i32),
                    conic: scaled(any(), -3),
                    asphere,
                    ..SurfaceShape::PLANE
                },
                thickness_mm: size(any(), 3),
                glass,
                semi_diameter_mm: size(any(), 0),
                ..Surface::default()
            })
            .collect();
        let mut surfaces = surfaces;
        surfaces[3].shape = SurfaceShape { curvature: -0.0, ..SurfaceShape::PLANE };
        let (conic, efl_mm) = (surfaces[0].shape.conic, scaled(any(), 5));
        let file = LensFile {
            lens: petzval_optics::lens::Lens {
                name: "odd\n\"\"\" lens".into(),
                source: String::new(),
                surfaces,
                stop: round % 6,
                entrance_pupil_mm: size(any(), 1),
                object: match round % 2 {
                    0 => ObjectDistance::Infinity,
                    _ => ObjectDistance::Finite(size(any(), 9)),
                },
                wavelengths_um: vec![0.4 + size(any(), -7), 0.5 + size(any(), -7)],
                reference_um: size(any(), -1),
                fields_deg: vec![-0.0, size(any(), 4)],
            },
            expect: Some(Expect {
                efl_mm: Some(Expected { value: any(), tolerance: size(any(), -10) }),
                rms_spot_um: Some(ExpectedSpots {
                    values_um: vec![size(any(), 1), size(any(), -3)],
                    relative_tolerance: size(any(), -5),
                }),
                ..Expect::default()
            }),
            field_weights: vec![size(any(), -2), size(any(), 3)],
            variables: vec![Variable {
                surface: 0,
                number: Number::Conic,
                min: conic - size(any(), -4),
                max: conic + size(any(), -4),
            }],
            pickups: Vec::new(),
            efl_solve: Some(EflSolve { surface: 0, efl_mm, radius_mm: None }),
            magnification_solve: None,
            length_solve: None,
        };
        let text = write_lens(&file);
        let again = parse_lens(&text, &Catalog::default()).unwrap_or_else(|e| panic!("{e}\n{text}"));
        // Glasses of equal names are renamed; everything else is unchanged to the bit.
        assert_eq!(write_lens(&again), text);
        let bits = |file: &LensFile| {
            let mut bits = Vec::new();
            for s in &file.lens.surfaces {
                bits.extend([s.shape.curvature, s.shape.conic, s.thickness_mm, s.semi_diameter_mm]);
                bits.extend(s.shape.asphere);
                bits.extend([0.4, 0.5, 0.7].map(|um| s.glass.index(um)));
            }
            bits.extend(&file.lens.wavelengths_um);
            bits.extend(&file.lens.fields_deg);
            bits.extend([file.lens.entrance_pupil_mm, file.lens.reference_um]);
            bits.into_iter().map(f64::to_bits).collect::<Vec<u64>>()
        };
        assert_eq!(bits(&again), bits(&file));
        assert_eq!((again.lens.object, &again.lens.name), (file.lens.object, &file.lens.name));
        assert_eq!((again.expect, again.variables), (file.expect, file.variables));
        assert_eq!(again.efl_solve, file.efl_solve);
    }
}
