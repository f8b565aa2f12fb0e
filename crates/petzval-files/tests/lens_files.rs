//! The built-in lens files are possible lenses and keep their bits in a round trip; errors of bad files name place and reason.

#[path = "../../petzval-optics/tests/common/mod.rs"]
mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use common::special_lenses;
use petzval_base::FileError;
use petzval_files::{
    Effect, Expect, Expected, ExpectedSpots, Import, LensFile, parse_lens, parse_lens_start, parse_seq,
    parse_zmx, write_lens, write_seq, write_zmx,
};
use petzval_optics::design_space::{EflSolve, MagnificationSolve, Pickup, Variable};
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{
    Axis, Lens, LensDefect, ObjectDistance, Placement, Surface, SurfaceShape, validate, xy_index,
};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::paraxial_launch;
use petzval_optics::trace::{launch, trace_ray};

fn data(folder: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data").join(folder);
    let files = fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    for path in data("glasses") {
        let one =
            petzval_files::parse_catalog(&read(&path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        catalog.merge(one);
    }
    catalog
}

fn nominal() -> String {
    read(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/lenses/cooke-triplet-nominal.toml"),
    )
}

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

/// Finite doubles of every exponent, from bits by xorshift.
fn odd_number(state: &mut u64) -> f64 {
    loop {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        let value = f64::from_bits(*state);
        if value.is_finite() {
            return value;
        }
    }
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

/// Writing and reading keeps special surfaces, pickups and a length solve to the bit.
#[test]
fn writing_and_reading_keeps_special_surfaces() {
    for mut lens in special_lenses() {
        for (i, s) in lens.surfaces.iter_mut().enumerate() {
            // Awkward bits.
            s.thickness_mm *= 1.0 + f64::EPSILON * i as f64;
            if let Some(placement) = &mut s.placement {
                placement.tilt_rad[0] += 1e-17 * i as f64;
                placement.decenter_mm[1] /= 3.0;
            }
        }
        let two = lens.surfaces.len() > 3;
        let thickness = lens.surfaces[0].thickness_mm;
        let variable = Variable {
            surface: 0,
            number: Number::Thickness,
            min: thickness - 0.5 * thickness.abs(),
            max: thickness + 0.5 * thickness.abs(),
        };
        let pickup = Pickup { surface: 1, variable: 0, scale: -1.0 / 3.0, offset: 0.1 };
        let file = LensFile {
            lens,
            expect: None,
            field_weights: Vec::new(),
            variables: vec![variable],
            pickups: if two { vec![pickup] } else { Vec::new() },
            efl_solve: None,
            magnification_solve: None,
            length_solve: two.then_some((2, 50.3)),
        };
        let text = write_lens(&file);
        let mut again = parse_lens(&text, &Catalog::default()).unwrap_or_else(|e| panic!("{e}\n{text}"));
        for (a, b) in again.lens.surfaces.iter_mut().zip(&file.lens.surfaces) {
            // The file contains the formula of a glass; its name may differ.
            assert_eq!(a.glass.index(0.55), b.glass.index(0.55));
            a.glass = b.glass.clone();
        }
        assert_eq!(again, file, "{text}");
    }
}

/// Every number of a special surface can be named as a variable.
#[test]
fn numbers_of_special_surfaces_have_names() {
    let text = nominal();
    let catalog = catalog();
    let with = |surface: &str, name: &str, min: f64, max: f64| {
        let text = text.replace("label = \"V2 front\"", &format!("label = \"V2 front\"\n{surface}"));
        let variable =
            format!("\n[[variable]]\nsurface = 3\nparameter = \"{name}\"\nmin = {min:?}\nmax = {max:?}\n");
        let at = text.find("[[variable]]").unwrap();
        parse_lens(&format!("{}{variable}\n{}", &text[..at], &text[at..]), &catalog)
    };
    for (surface, name, number) in [
        ("odd = { b3 = 1e-5 }", "odd.b5", Number::Departure(2)),
        ("xy = { norm_radius_mm = 4.0, x2y0 = 1e-3 }", "xy.x0y2", Number::Departure(xy_index(0, 2))),
        ("q_bfs = { norm_radius_mm = 5.0, a = [1e-3] }", "q_bfs.a12", Number::Departure(12)),
        ("q_con = { norm_radius_mm = 5.0, a = [] }", "q_con.a0", Number::Departure(0)),
        ("biconic = { radius_x_mm = -40.0 }", "biconic.conic_x", Number::Departure(1)),
        ("toroid = { radius_x_mm = -40.0 }", "toroid.curvature_x_per_mm", Number::Departure(0)),
        ("grating = { lines_per_mm = 0.5, order = 1 }", "grating.lines_per_mm", Number::Phase(0)),
        ("binary = { norm_radius_mm = 5.0, order = 1, a_rad = [1.0] }", "binary.a1", Number::Phase(0)),
        ("placement = { decenter_mm = [0.1, 0.0] }", "decenter_x_mm", Number::Decenter(0)),
        ("placement = { decenter_mm = [0.1, 0.0] }", "decenter_y_mm", Number::Decenter(1)),
        ("placement = { tilt_deg = [0.0, 1.5, 0.0] }", "tilt_y_deg", Number::Tilt(1)),
    ] {
        let file = with(surface, name, -2.0, 2.0).unwrap_or_else(|e| panic!("{surface}: {e}"));
        let found = file.variables.iter().any(|v| v.surface == 2 && v.number == number);
        assert!(found, "{name}: {:?}", file.variables);
        let error = with("", name, -2.0, 2.0).unwrap_err();
        assert!(error.message.contains("no parameter"), "{error}");
        let of_placement = surface.starts_with("placement");
        assert_eq!(error.hint.unwrap().contains("placement = {"), of_placement, "{name}");
    }
}

/// A key that the reader always refuses is no part of the format.
#[test]
fn the_format_has_no_conic_constant_of_a_toroid() {
    let schema = petzval_files::lens_schema().to_value();
    let has_conic = |name: &str| {
        let keys = schema["$defs"][name]["properties"].as_object().unwrap();
        assert!(keys.contains_key("radius_x_mm") && keys.contains_key("curvature_x_per_mm"), "{name}");
        keys.contains_key("conic_x")
    };
    assert!(has_conic("BiconicText") && !has_conic("ToroidText"));
}

/// Bounds of a tilt are degrees, in a file and in the variable that it becomes; the lens has radians.
#[test]
fn tilts_are_variables_in_degrees() {
    let surface = "label = \"V2 front\"\nplacement = { tilt_deg = [0.0, 1.5, 0.0] }";
    let text = nominal().replace("label = \"V2 front\"", surface);
    let with = |min: f64, max: f64| {
        let bounds = format!("min = {min:?}\nmax = {max:?}\n");
        let variable = format!("[[variable]]\nsurface = 3\nparameter = \"tilt_y_deg\"\n{bounds}\n");
        let at = text.find("[[variable]]").unwrap();
        parse_lens(&format!("{}{variable}{}", &text[..at], &text[at..]), &catalog())
    };
    let file = with(-2.0, 2.0).unwrap();
    assert_eq!(file.variables[0], Variable { surface: 2, number: Number::Tilt(1), min: -2.0, max: 2.0 });
    assert!((file.lens.surfaces[2].placement.unwrap().tilt_rad[1] - 1.5_f64.to_radians()).abs() < 1e-15);
    let again = parse_lens(&write_lens(&file), &catalog()).unwrap();
    assert_eq!(again.variables, file.variables);
    assert_eq!(again.lens, file.lens);
    assert!(with(-1.0, 1.0).unwrap_err().message.contains("outside its bounds"));
    // The offset of a pickup is an angle as well: 0.5 degrees, whatever the factor.
    let follower = "label = \"V2 rear\"\nplacement = { tilt_deg = [0.0, 2.0, 0.0] }";
    let pickup = "[[pickup]]\nsurface = 4\nparameter = \"tilt_y_deg\"\nfollows = 3\noffset = 0.5\n\n";
    let variable = "[[variable]]\nsurface = 3\nparameter = \"tilt_y_deg\"\nmin = -2.0\nmax = 2.0\n\n";
    let text = text.replace("label = \"V2 rear\"", follower);
    let at = text.find("[[variable]]").unwrap();
    let file = parse_lens(&format!("{}{variable}{pickup}{}", &text[..at], &text[at..]), &catalog()).unwrap();
    assert_eq!(file.pickups[0].offset, 0.5_f64.to_radians());
    let written = write_lens(&file);
    assert!(written.contains("\noffset = 0.5\n"), "{written}");
    assert_eq!(parse_lens(&written, &catalog()).unwrap().pickups, file.pickups);
}

/// A pickup that gives a number another value than the file is named with its line and both values.
#[test]
fn pickups_that_contradict_the_file_are_named() {
    let text = nominal();
    let with = |scale: &str| {
        let pickup =
            format!("[[pickup]]\nsurface = 1\nparameter = \"thickness_mm\"\nfollows = 2\n{scale}\n\n");
        let at = text.find("[solve]").unwrap();
        let line = 2 + text[..at].matches('\n').count();
        let text = format!("{}{pickup}{}", &text[..at], &text[at..]);
        (parse_lens_start(&text, &catalog()).unwrap(), line)
    };
    let (import, line) = with("scale = 0.5");
    let said: Vec<String> = import.losses.iter().map(ToString::to_string).collect();
    let wanted = "thickness_mm of surface 1 is 4.014 in the file, and its pickup makes it 4.055: optimisations and designs begin with";
    assert!(
        said.len() == 1 && said[0].starts_with(&format!("line {line}: `[[pickup]]`: {wanted}")),
        "{said:?}"
    );
    // Sums are said without the digits of binary fractions.
    let sum = with("scale = 0.1\noffset = 0.7").0.losses[0].to_string();
    assert!(sum.contains("makes it 1.511:"), "{sum}");
    // A number that is rounded as tables round it contradicts nothing.
    assert!(with("offset = -4.0960001").0.losses.is_empty());
}

/// Errors of special surfaces name their line.
#[test]
fn bad_special_surfaces_are_refused() {
    let text = nominal();
    let catalog = catalog();
    for (lines, key, message) in [
        ("odd = { b4 = 1.0 }", "b4", "no odd term"),
        ("xy = { x2y0 = 1.0 }", "norm_radius_mm", "normalisation radius"),
        ("xy = { norm_radius_mm = 1.0, x9y0 = 1.0 }", "x9y0", "no term"),
        (
            "xy = { norm_radius_mm = 1.0, x18446744073709551615y9 = 1.0 }",
            "x18446744073709551615y9",
            "no term",
        ),
        ("xy = { norm_radius_mm = 1e-21 }", "norm_radius_mm", "clear semi-diameter"),
        ("xy = { norm_radius_mm = -1.0 }", "norm_radius_mm", "positive"),
        ("q_bfs = { norm_radius_mm = 1.0, a = [0,0,0,0,0,0,0,0,0,0,0,0,0,0] }", "a", "at most 13"),
        ("conic = 1.0\nq_bfs = { norm_radius_mm = 5.0, a = [1e-3] }", "q_bfs", "from a sphere"),
        ("odd = { b3 = 1.0 }\nxy = { norm_radius_mm = 1.0 }", "xy", "already"),
        ("toroid = { radius_x_mm = 10.0, conic_x = 1.0 }", "conic_x", "circle"),
        ("biconic = { conic_x = 1.0 }", "radius_x_mm", "no radius"),
        ("thin_lens = { focal_length_mm = 10.0 }", "thin_lens", "plane"),
        ("thin_lens = { power_per_mm = nan }", "power_per_mm", "finite"),
        ("mirror = true", "glass", "medium behind it"),
        ("placement = { axis = \"bends\" }", "placement", "no mirror"),
        ("placement = { axis = \"turns\" }", "axis", "cannot be"),
        ("placement = { decenter_mm = [1.0] }", "decenter_mm", "2 are needed"),
        ("placement = { tilt_deg = [0.0, 0.0, inf] }", "tilt_deg", "finite"),
        (
            "grating = { lines_per_mm = 1.0, order = 1 }\nbinary = { norm_radius_mm = 1.0, order = 1, a_rad = [] }",
            "binary",
            "already",
        ),
    ] {
        let text = text.replace("label = \"V2 front\"", &format!("label = \"V2 front\"\n{lines}"));
        let error = parse_lens(&text, &catalog).expect_err(lines);
        assert_eq!(error.key, key, "{error}");
        assert!(error.message.contains(message), "{error}");
        assert!(error.line.is_some(), "{error}");
    }
    let pickup = |lines: &str| {
        let at = text.find("[[variable]]").unwrap();
        parse_lens(&format!("{}[[pickup]]\n{lines}\n\n{}", &text[..at], &text[at..]), &catalog).unwrap_err()
    };
    let error = pickup("surface = 4\nfollows = 3\nparameter = \"radius_mm\"");
    assert!(error.message.contains("not a variable"), "{error}");
    let error = pickup("surface = 2\nfollows = 1\nparameter = \"radius_mm\"");
    assert!(error.message.contains("already"), "{error}");
    // A radius with a solve, and the distance to the image, cannot be pickups.
    for (surface, follows, parameter) in [(7, 1, "radius_mm"), (7, 2, "thickness_mm")] {
        let error = pickup(&format!("surface = {surface}\nfollows = {follows}\nparameter = \"{parameter}\""));
        assert!(error.message.contains("cannot follow"), "{error}");
    }
}

/// A bad file: a replacement in the nominal triplet, and the expected error.
struct Bad {
    from: &'static str,
    to: &'static str,
    /// Text on the line that the error must name.
    line_with: &'static str,
    key: &'static str,
    value: &'static str,
    message: &'static str,
    hint: &'static str,
}

#[rustfmt::skip]
const BAD: &[Bad] = &[
    Bad { from: "radius_mm = 11.45", to: "radius_mm = 0", line_with: "radius_mm = 0", key: "radius_mm", value: "0",
          message: "surface 2: a surface cannot have the radius 0", hint: "`radius_mm = inf`" },
    Bad { from: "radius_mm = 11.45", to: "radius_mm = nan", line_with: "radius_mm = nan", key: "radius_mm", value: "nan",
          message: "not a number", hint: "" },
    Bad { from: "radius_mm = 11.45", to: "radius_um = 11450 # long", line_with: "radius_um", key: "radius_um", value: "11450",
          message: "no such key", hint: "convert from um to mm and write `radius_mm`" },
    Bad { from: "thickness_mm = 8.11", to: "thickness_cm = 0.811", line_with: "thickness_cm", key: "thickness_cm", value: "0.811",
          message: "no such key", hint: "`thickness_mm`" },
    Bad { from: "thickness_mm = 8.11", to: "thicknes_mm = 8.11", line_with: "thicknes_mm", key: "thicknes_mm", value: "8.11",
          message: "no such key", hint: "did you mean `thickness_mm`?" },
    Bad { from: "thickness_mm = 8.11\n", to: "", line_with: "[[surface]]\nlabel = \"V1 rear\"", key: "thickness_mm", value: "",
          message: "the key `thickness_mm` is missing", hint: "" },
    Bad { from: "units = \"mm\"\n", to: "", line_with: "# The nominal Cooke triplet", key: "units", value: "",
          message: "the key `units` is missing", hint: "`units = \"mm\"`" },
    Bad { from: "glass = \"PMMA\"", to: "glass = { nd = 1.49, vd = 57.4 }", line_with: "glass = {", key: "glass", value: "{ nd = 1.49, vd = 57.4 }",
          message: "expected text in quotes", hint: "[glass.NAME]" },
    Bad { from: "thickness_mm = 8.11", to: "thickness_mm = \"thick\"", line_with: "\"thick\"", key: "thickness_mm", value: "\"thick\"",
          message: "expected a number", hint: "without a unit" },
    Bad { from: "thickness_mm = 4.014", to: "thickness_mm = -4.014", line_with: "-4.014", key: "thickness_mm", value: "-4.014",
          message: "surface 1: the thickness of -4.014 mm of PMMA goes against the light", hint: "it is at least 0" },
    Bad { from: "thickness_mm = 2.698", to: "thickness_mm = 0.3", line_with: "thickness_mm = 0.3", key: "thickness_mm", value: "0.3",
          message: "surface 6: the edge thickness of PMMA is -0.", hint: "semi-diameters" },
    Bad { from: "semi_diameter_mm = 4.56", to: "semi_diameter_mm = -4.56", line_with: "= -4.56", key: "semi_diameter_mm", value: "-4.56",
          message: "positive", hint: "" },
    Bad { from: "semi_diameter_mm = 6.415", to: "semi_diameter_mm = 11.5", line_with: "= 11.5", key: "semi_diameter_mm", value: "11.5",
          message: "surface 2: the shape ends 11.4500 mm from its vertex", hint: "flatten" },
    Bad { from: "glass = \"N-SF11\"", to: "glass = \"NSF11\"", line_with: "\"NSF11\"", key: "glass", value: "\"NSF11\"",
          message: "surface 3: no glass is called `NSF11`", hint: "N-SF11" },
    Bad { from: "stop = true\n", to: "", line_with: "[[surface]]", key: "stop", value: "",
          message: "no surface is the aperture stop", hint: "stop = true" },
    Bad { from: "label = \"V3 rear\"", to: "stop = true # V3 rear", line_with: "# V3 rear", key: "stop", value: "true",
          message: "surfaces 5 and 7", hint: "one stop" },
    Bad { from: "um = [0.486, 0.55, 0.62]", to: "um = [\n0.486,\n550,\n620]", line_with: "550", key: "um", value: "550",
          message: "a wavelength of 550 um", hint: "did you mean 0.55?" },
    Bad { from: "um = [0.486, 0.55, 0.62]", to: "um = [0.55, 0.486]", line_with: "0.486", key: "um", value: "0.486",
          message: "does not ascend", hint: "sort" },
    Bad { from: "angle_deg = [0.0, 5.0, 10.0, 15.0]", to: "angle_deg = []", line_with: "angle_deg", key: "angle_deg", value: "[]",
          message: "empty", hint: "" },
    Bad { from: "angle_deg = [0.0, 5.0, 10.0, 15.0]", to: "angle_deg = [-5]", line_with: "angle_deg", key: "angle_deg", value: "-5",
          message: "angle", hint: "mirror" },
    Bad { from: "units = \"mm\"", to: "units = \"inch\"", line_with: "units", key: "units", value: "\"inch\"",
          message: "in mm", hint: "convert to mm" },
    Bad { from: "distance_mm = inf", to: "distance_mm = 0", line_with: "distance_mm", key: "distance_mm", value: "0",
          message: "apart from the first vertex", hint: "" },
    Bad { from: "diameter_mm = 5.7", to: "diameter_mm = 0.0", line_with: "pupil_diameter", key: "entrance_pupil_diameter_mm", value: "0.0",
          message: "positive", hint: "" },
    Bad { from: "min = 9.85\nmax = 14.98", to: "min = 14.98\nmax = 9.85", line_with: "max = 9.85", key: "max", value: "9.85",
          message: "radius_mm of surface 1 are reversed", hint: "exchange" },
    Bad { from: "min = 9.85", to: "min = 12.0", line_with: "min = 12.0", key: "min", value: "12.0",
          message: "radius_mm of surface 1 is 11.34", hint: "widen" },
    Bad { from: "min = 9.85", to: "min = -9.85", line_with: "min = -9.85", key: "min", value: "-9.85",
          message: "include a radius of 0", hint: "" },
    Bad { from: "parameter = \"a10\"", to: "parameter = \"a9\"", line_with: "\"a9\"", key: "parameter", value: "\"a9\"",
          message: "no parameter `a9`", hint: "did you mean" },
    Bad { from: "surface = 7, efl_mm", to: "surface = 8, efl_mm", line_with: "efl = {", key: "surface", value: "8",
          message: "no surface 8", hint: "from 1 to 7" },
    Bad { from: "surface = 7, efl_mm", to: "surface = 6, efl_mm", line_with: "efl = {", key: "surface", value: "6",
          message: "a variable already", hint: "solved for or varied" },
    Bad { from: "values = [4.0,", to: "values = [", line_with: "rms_spot_um", key: "values", value: "[ 7.7, 16.4, 22.3]",
          message: "3 values do not fit the lens's 4 fields", hint: "one per field" },
    Bad { from: "efl_mm = { value = 25.04, tolerance = 0.005 }", to: "efl_mm = 25.04", line_with: "efl_mm = 25.04\n", key: "efl_mm", value: "25.04",
          message: "expected { value = ..., tolerance = ... }", hint: "" },
    Bad { from: "surface = 1\n", to: "surface = -1\n", line_with: "surface = -1", key: "surface", value: "-1",
          message: "expected a number from 0", hint: "a whole number" },
    Bad { from: "[aperture]", to: "[aperture", line_with: "[aperture", key: "", value: "",
          message: "", hint: "" },
    Bad { from: "[fields]", to: "[glass.MINE]\nnd = 1.5\n[fields]", line_with: "[glass.MINE]", key: "glass", value: "MINE",
          message: "no formula", hint: "`nd` and `vd`" },
    Bad { from: "[fields]", to: "[glass.MINE]\nnd = 1.5\nn = 1.6\n[fields]", line_with: "nd = 1.5", key: "nd", value: "1.5",
          message: "gives nd = 1.60000", hint: "mistyped" },
    Bad { from: "[fields]", to: "[glass.air]\nn = 1.6\n[fields]", line_with: "[glass.air]", key: "glass", value: "air",
          message: "already defined", hint: "AIR" },
];

#[test]
fn a_bad_file_names_line_key_value_and_hint() {
    let (good, catalog) = (nominal(), catalog());
    for bad in BAD {
        assert!(good.contains(bad.from), "the nominal triplet has no `{}`", bad.from);
        let text = good.replacen(bad.from, bad.to, 1);
        let error = parse_lens(&text, &catalog).map(|_| ()).expect_err(bad.to);
        let line = text[..text.find(bad.line_with).unwrap()].matches('\n').count() + 1;
        let place = format!("`{}` gave {error:?}", bad.to);
        assert_eq!(error.line, Some(line as u32), "{place}");
        assert!(error.column.is_some(), "{place}");
        assert_eq!((error.key.as_str(), error.value.as_str()), (bad.key, bad.value), "{place}");
        assert!(error.message.contains(bad.message), "{place}");
        assert!(error.hint.as_deref().unwrap_or("").contains(bad.hint), "{place}");
        assert!(error.to_string().starts_with(&format!("line {line}, column ")), "{place}");
    }
}

#[test]
fn an_error_prints_place_value_message_and_hint() {
    let text = nominal().replacen("radius_mm = 11.45", "radius_mm = 0", 1);
    let error: FileError = parse_lens(&text, &catalog()).unwrap_err();
    let (line, column) = (error.line.unwrap(), error.column.unwrap());
    assert_eq!(column, 13);
    assert_eq!(
        error.to_string(),
        format!(
            "line {line}, column 13: `radius_mm = 0`: surface 2: a surface cannot have the radius \
             0 (hint: a plane is `radius_mm = inf`)"
        )
    );
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
fn mutilated_files_never_panic() {
    let catalog = catalog();
    let good = nominal();
    let lines: Vec<&str> = good.lines().collect();
    let nasty = ["", "=", "nan", "-inf", "1e999", "[[surface]]", "{", "\"\"\"", "\u{fffd}=1", "-0.0", "[]"];
    let mut state = 1;
    for _ in 0..3000 {
        odd_number(&mut state);
        let (line, cut) = (state as usize % lines.len(), (state >> 20) as usize);
        let insert = nasty[(state >> 40) as usize % nasty.len()];
        let old = lines[line];
        let mut cut = cut % (old.len() + 1);
        while !old.is_char_boundary(cut) {
            cut -= 1;
        }
        let keep = if state >> 60 & 1 == 0 { &old[cut..] } else { "" };
        let new = format!("{}{insert}{keep}", &old[..cut]);
        let mut changed = lines.clone();
        changed[line] = &new;
        if let Err(error) = parse_lens(&changed.join("\n"), &catalog) {
            assert!(!error.to_string().is_empty());
        }
    }
}

#[test]
fn impossible_lenses_are_named() {
    let lens = parse_lens(&nominal(), &catalog()).unwrap().lens;
    let with = |change: &dyn Fn(&mut petzval_optics::lens::Lens)| {
        let mut lens = lens.clone();
        change(&mut lens);
        validate(&lens).unwrap_err()
    };
    assert_eq!(with(&|l| l.surfaces.clear()), LensDefect::NoSurface);
    assert_eq!(with(&|l| l.stop = 7), LensDefect::NoStop { stop: 8, surfaces: 7 });
    assert_eq!(with(&|l| l.fields_deg.clear()), LensDefect::Nothing { what: "field" });
    assert_eq!(with(&|l| l.entrance_pupil_mm = -1.0), LensDefect::Pupil { diameter_mm: -1.0 });
    let nan = with(&|l| l.surfaces[2].shape.conic = f64::NAN);
    assert!(matches!(nan, LensDefect::NotFinite { surface: 3, .. }), "{nan}");
    let far = with(&|l| l.surfaces[2].thickness_mm = 1e308);
    assert!(matches!(far, LensDefect::TooFar { surface: 3, .. }), "{far}");

    // A biconcave element is thinnest in the middle, a biconvex one at the edge.
    let thin = with(&|l| l.surfaces[2].thickness_mm = -0.1);
    assert!(matches!(thin, LensDefect::CentreThickness { surface: 3, thickness_mm: -0.1, .. }), "{thin}");
    let sharp = with(&|l| l.surfaces[5].thickness_mm = 0.5);
    assert!(matches!(sharp, LensDefect::EdgeThickness { surface: 6, .. }), "{sharp}");

    // A meniscus of even thickness keeps it where the axis follows its decentre; where the axis returns, its rear stands beside it.
    let meniscus = |axis: Axis| {
        let mut lens = lens.clone();
        lens.surfaces.truncate(2);
        for (surface, thickness_mm) in lens.surfaces.iter_mut().zip([1.0, 100.0]) {
            surface.shape = SurfaceShape { curvature: 0.05, ..SurfaceShape::PLANE };
            (surface.thickness_mm, surface.semi_diameter_mm) = (thickness_mm, 8.0);
        }
        let decenter_mm = [0.0, 5.0];
        lens.surfaces[0].placement = Some(Placement { decenter_mm, axis, ..Placement::default() });
        lens.stop = 0;
        validate(&lens)
    };
    assert_eq!(meniscus(Axis::Follows), Ok(()));
    let beside = meniscus(Axis::Returns).unwrap_err();
    assert!(matches!(beside, LensDefect::EdgeThickness { surface: 1, .. }), "{beside}");

    // S2 sags towards V2 by 0.95 mm at V2's edge, and V2 comes to meet it with 0.26 mm.
    let crossing = with(&|l| l.surfaces[1].thickness_mm = 1.0);
    let LensDefect::AirGap { surface: 2, gap_mm, .. } = crossing else { panic!("{crossing}") };
    assert!(gap_mm < 0.0 && crossing.surface() == Some(2));

    let short = with(&|l| l.surfaces[6].semi_diameter_mm = 13.06);
    assert!(matches!(short, LensDefect::SurfaceEnds { surface: 7, .. }), "{short}");
    let glass = Glass::new("BAD", Dispersion::Sellmeier { b: vec![1.0], c_um2: vec![0.3025] });
    let no_index = with(&|l| l.surfaces[0].glass = Arc::new(glass.clone()));
    assert!(matches!(no_index, LensDefect::Index { surface: 1, .. }), "{no_index}");
}

/// A stop of 10 mm, and 20 mm behind it a plate.
const PLATE: &str = "name = \"plate\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 10.0\n[wavelengths]\num = [0.55]\n\
    [fields]\nangle_deg = [0.0, 20.0]\n[[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 20.0\n\
    [[surface]]\nradius_mm = inf\nthickness_mm = 2.0\nglass = \"N-BK7\"\n\
    [[surface]]\nradius_mm = inf\nthickness_mm = 30.0\nsemi_diameter_mm = 9.0\n";

/// A concave mirror of 50 mm with its stop at the focus: chief rays of a near object are parallel to the axis.
#[test]
fn an_entrance_pupil_at_infinity_is_refused_with_the_numbers_of_one_far_away() {
    let text = |[to_stop, to_image, pupil]: [&str; 3]| {
        format!(
            "name = \"telecentric\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = {pupil}\n[object]\ndistance_mm = 150.0\n\
             [wavelengths]\num = [0.55]\n[fields]\nangle_deg = [0.0, 1.0]\n\
             [[surface]]\nradius_mm = -100.0\nthickness_mm = {to_stop}\nmirror = true\nsemi_diameter_mm = 12.0\n\
             [[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = {to_image}\nsemi_diameter_mm = 4.0\n"
        )
    };
    let error = parse_lens(&text(["-50.0", "-25.0", "8.0"]), &Catalog::default()).unwrap_err();
    assert_eq!((error.line, error.key.as_str()), (Some(4), "entrance_pupil_diameter_mm"), "{error}");
    // A far object has no such lens at all: the distance to the stop is at fault.
    let far = text(["-50.0", "-25.0", "8.0"]).replace("distance_mm = 150.0", "distance_mm = inf");
    let at_stop = parse_lens(&far, &Catalog::default()).unwrap_err();
    assert_eq!(
        (at_stop.line, at_stop.key.as_str(), at_stop.value.as_str()),
        (Some(13), "thickness_mm", "-50.0")
    );
    assert!(at_stop.message.contains("the entrance pupil of a far object lies at infinity"), "{at_stop}");
    let hint = error.hint.unwrap();
    assert!(error.message.contains("telecentric") && hint.contains("fills 4 mm"), "{hint}");
    // What the hint says is a lens whose beam fills the stop.
    let words: Vec<&str> = hint.split([' ', ',']).collect();
    let after = |word: &str, nth: usize| {
        let at = words.iter().enumerate().filter(|(_, w)| **w == word).map(|(i, _)| i).nth(nth).unwrap();
        words[at + 1]
    };
    let stated = [after("=", 0), after("and", 0), after("=", 1)];
    let lens = parse_lens(&text(stated), &Catalog::default()).unwrap().lens;
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    assert!((order.stop_radius_mm.abs() - 4.0).abs() < 1e-4, "{stated:?}: {}", order.stop_radius_mm);
    assert!(order.entrance_pupil_at_mm.abs() > 1e7);
}

#[test]
fn semi_diameters_that_a_file_leaves_out_follow_from_the_fields() {
    let import = parse_lens_start(PLATE, &catalog()).unwrap();
    let semi = |i: usize| import.file.lens.surfaces[i].semi_diameter_mm;
    assert_eq!(semi(0), 5.0);
    // The upper edge of the oblique beam, with 1 % of room and the soft edge.
    let edge = 5.0 + 20.0 * 20.0_f64.to_radians().tan();
    assert!((1.01 * edge..1.03 * edge).contains(&semi(1)), "{} for {edge}", semi(1));
    // What is stated stays.
    assert_eq!(semi(2), 9.0);
    let wider = parse_lens(&PLATE.replace("20.0]", "30.0]"), &catalog()).unwrap().lens;
    assert!(wider.surfaces[1].semi_diameter_mm > 5.0 + 20.0 * 30.0_f64.to_radians().tan());
    // Once written, they are as large, and still cut nothing. The stop cuts in any case.
    let written = parse_lens_start(&write_lens(&import.file), &Catalog::default()).unwrap();
    assert!(written.file.lens == import.file.lens);
}

/// The outermost beam meets the first surface of the plate at 12.28 mm.
#[test]
fn open_surfaces_keep_a_stated_size_that_holds_the_beams() {
    let stated = |mm: &str| {
        let plate = format!("glass = \"N-BK7\"\nsemi_diameter_mm = {mm}\nopen = true\n");
        let import = parse_lens_start(&PLATE.replace("glass = \"N-BK7\"\n", &plate), &catalog()).unwrap();
        assert!(import.losses.is_empty(), "{:?}", import.losses);
        import.file.lens.surfaces[1].semi_diameter_mm
    };
    assert_eq!([stated("12.3"), stated("15.0")], [12.3, 15.0]);
    // One that does not hold them gives way to the beams and their room.
    let [small, large] = [stated("12.0"), stated("0.1")];
    assert!(small == large && (12.4..12.7).contains(&small), "{small} {large}");
}

/// A lens on the limit of its edges: its beams reach 9.9 mm and its spheres meet at 9.95 mm, so that the stated size fits between, and the usual
/// room around the beams does not.
#[test]
fn a_lens_on_the_limit_of_its_edges_keeps_its_stated_sizes() {
    let text = "name = \"edge\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 19.8\n[wavelengths]\num = [0.5876]\n\
                [fields]\nangle_deg = [0.0]\n[[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 1.0\n\
                [[surface]]\nradius_mm = 50.0\nthickness_mm = 2.0\nglass = \"N-BK7\"\nsemi_diameter_mm = 9.93\nopen = true\n\
                [[surface]]\nradius_mm = -50.0\nthickness_mm = 48.0\nsemi_diameter_mm = 9.93\nopen = true\n";
    let semis = |import: &Import| [1, 2].map(|i: usize| import.file.lens.surfaces[i].semi_diameter_mm);
    let import = parse_lens_start(text, &catalog()).unwrap();
    assert_eq!(semis(&import), [9.93; 2]);
    assert!(import.losses.is_empty(), "{:?}", import.losses);
    // Surfaces that cross within their stated size are made smaller, with a message.
    let import = parse_lens_start(&text.replace("9.93", "9.97"), &catalog()).unwrap();
    assert!(semis(&import).iter().all(|mm| (9.89..9.91).contains(mm)), "{:?}", semis(&import));
    assert!(import.losses[0].message.contains("surfaces end or cross"), "{:?}", import.losses);
}

/// Light of fields that the file does not name passes surfaces without an edge; a stated edge of the same size cuts it.
#[test]
fn surfaces_without_an_edge_cut_no_light() {
    let import = parse_lens_start(PLATE, &catalog()).unwrap();
    let open = &import.file.lens;
    assert_eq!(open.surfaces.iter().map(|s| s.is_open).collect::<Vec<_>>(), [false, true, false]);
    let mut stated = open.clone();
    stated.surfaces[1].is_open = false;
    // The last surface has an edge of its own, which the oblique beams do not pass.
    let passes = |lens: &Lens, field_deg: f64| {
        let mut lens = lens.clone();
        lens.surfaces[2].is_open = true;
        let sequence = lens.at_wavelength(lens.reference_um);
        let at = paraxial_launch(&first_order(&sequence), &sequence, field_deg.to_radians(), [0.0, 0.99]);
        trace_ray(&sequence, launch(&sequence, field_deg.to_radians(), at).ray).transmission
    };
    assert_eq!([passes(open, 20.0), passes(&stated, 20.0)], [1.0; 2]);
    assert_eq!([passes(open, 24.0), passes(&stated, 24.0)], [1.0, 0.0]);
    let catalog = catalog();
    for read in [
        parse_zmx(&write_zmx(&import.file, &catalog).unwrap().text, &catalog).unwrap(),
        parse_seq(&write_seq(&import.file, &catalog).unwrap().text, &catalog).unwrap(),
    ] {
        assert_eq!(
            read.file.lens.surfaces.iter().map(|s| s.is_open).collect::<Vec<_>>(),
            [false, true, false]
        );
    }
}

/// A solve that the lens of the file does not fulfil is named with its line and both values.
#[test]
fn solves_that_contradict_the_file_are_named() {
    let text = nominal();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let changed = text.replace(from, to);
        let line = 1 + changed[..changed.find(to).unwrap()].matches('\n').count();
        (parse_lens_start(&changed, &catalog()).unwrap().losses, line)
    };
    let solve = "efl_mm = 25.04003827951391";
    assert!(with(solve, "efl_mm = 25.0401").0.is_empty());
    let (losses, line) = with(solve, "efl_mm = 26.0");
    let wanted = "the focal length is 25.04004 mm in the file, and its solve makes it 26 mm: optimisations and designs begin with";
    assert!(
        losses.len() == 1 && losses[0].to_string().starts_with(&format!("line {line}: `[solve]`: {wanted}")),
        "{losses:?}"
    );
    assert_eq!(losses[0].effect, Effect::Unsolved);
}

#[test]
fn a_radius_holds_the_magnification_of_a_near_object() {
    let near = nominal().replace("distance_mm = inf", "distance_mm = 120.0");
    let near = near.split("[expect]").next().unwrap().replace(
        "efl = { surface = 7, efl_mm = 25.04003827951391, radius_mm = [-15.05, -11.5] }",
        "magnification = { surface = 7, magnification = -0.25, radius_mm = [-15.05, -11.5] }",
    );
    let file = parse_lens(&near, &catalog()).unwrap();
    let solve = MagnificationSolve { surface: 6, magnification: -0.25, radius_mm: Some([-15.05, -11.5]) };
    assert_eq!((file.efl_solve, file.magnification_solve), (None, Some(solve)));
    assert_eq!(parse_lens(&write_lens(&file), &Catalog::default()).unwrap().magnification_solve, Some(solve));
    let refused = |from: &str, to: &str| {
        assert!(near.contains(from), "{from}");
        let error = parse_lens(&near.replace(from, to), &catalog()).unwrap_err();
        format!("{error} {}", error.hint.clone().unwrap_or_default())
    };
    let said = refused("distance_mm = 120.0", "distance_mm = inf");
    assert!(said.contains("no magnification") && said.contains("efl_mm"), "{said}");
    let both = "[solve]\nefl = { surface = 7, efl_mm = 25.0 }";
    assert!(refused("[solve]", both).contains("not both"));
    assert!(refused("magnification = -0.25", "magnification = 0.0").contains("magnification of 0"));
    assert!(refused("surface = 7, magn", "surface = 6, magn").contains("a variable already"));
}

#[test]
fn a_curvature_may_vary_through_the_plane() {
    let variable = "[[variable]]\nsurface = 3\nparameter = \"curvature_per_mm\"\nmin = -0.008\nmax = 0.004\n";
    let file = parse_lens(&format!("{PLATE}{variable}"), &catalog()).unwrap();
    let v = file.variables[0];
    assert_eq!((v.surface, v.number, v.min, v.max), (2, Number::Curvature, -125.0, 250.0));
    let written = write_lens(&file);
    assert!(written.contains("parameter = \"curvature_per_mm\"\nmin = -0.008\nmax = 0.004"), "{written}");
    assert_eq!(parse_lens(&written, &Catalog::default()).unwrap().variables, file.variables);
    for (from, to, said) in [
        ("min = -0.008", "min = 0.001", "on one side of the plane"),
        ("min = -0.008", "min = 0.008", "reversed"),
    ] {
        let error = parse_lens(&format!("{PLATE}{}", variable.replace(from, to)), &catalog()).unwrap_err();
        assert!(error.to_string().contains(said) && error.line.is_some(), "{error}");
    }
}
