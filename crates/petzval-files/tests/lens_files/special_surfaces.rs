//! Special surfaces: written and read, named as variables, and refused with their line.

use petzval_files::{LensFile, parse_lens, write_lens};
use petzval_optics::design_space::{Pickup, Variable};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::xy_index;
use petzval_optics::number::Number;

use crate::common::special_lenses;
use crate::support::{catalog, nominal};

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
