//! What `petzval lens` says of lenses that people bring: afocal ones, fast ones, folded ones, stops at concave surfaces.

use std::path::Path;

use crate::common::{run_fails, run_ok};
use serde_json::Value;

/// A lens file for 0.5 um.
fn lens(folder: &Path, name: &str, head: &str, surfaces: &str) -> String {
    let text = format!(
        "name = \"{name}\"\nunits = \"mm\"\n{head}[wavelengths]\num = [0.5]\nreference_um = 0.5\n[fields]\nangle_deg = [0.0, 0.5]\n{surfaces}"
    );
    let file = format!("{name}.toml");
    std::fs::write(folder.join(&file), text).unwrap();
    file
}

fn pupil(diameter_mm: f64) -> String {
    format!("[aperture]\nentrance_pupil_diameter_mm = {diameter_mm:?}\n")
}

fn shown(folder: &Path, file: &str) -> (Value, String) {
    let json = run_ok(folder, &["lens", "show", file, "--json"]).json();
    (json, run_ok(folder, &["lens", "show", file]).stdout)
}

/// Kepler's telescope of 200 and 40 mm.
fn telescope(folder: &Path) -> String {
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthin_lens = { focal_length_mm = 200.0 }\nthickness_mm = 240.0\nsemi_diameter_mm = 10.0\n\
        [[surface]]\nradius_mm = inf\nthin_lens = { focal_length_mm = 40.0 }\nthickness_mm = 48.0\nsemi_diameter_mm = 10.0\n";
    lens(folder, "telescope", &pupil(20.0), surfaces)
}

#[test]
fn an_afocal_lens_is_called_afocal_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let file = telescope(folder.path());
    let (json, text) = shown(folder.path(), &file);
    for key in ["efl_mm", "bfl_mm", "f_number", "working_f_number", "total_track_mm", "defocus_mm"] {
        assert!(json[key].is_null(), "{key}: {}", json[key]);
    }
    assert_eq!(json["image_na"], 0.0);
    assert!((json["angular_magnification"].as_f64().unwrap() + 5.0).abs() < 1e-9);
    assert!((json["exit_pupil_mm"].as_f64().unwrap() - 4.0).abs() < 1e-9);
    // No number is longer than a length can be.
    let longest =
        text.split_whitespace().filter(|word| word.parse::<f64>().is_ok()).map(str::len).max().unwrap();
    assert!(longest < 12, "{text}");
    for says in
        ["afocal at 0.5 um", "angular magnification", "the lens is afocal in the y-z plane", "parallel"]
    {
        assert!(text.contains(says), "{says}\n{text}");
    }
    assert!(!text.contains("virtual"), "{text}");
    // What is not listed is not spoken of as if it were.
    assert_eq!(json["rms_spot_um"].as_array().unwrap().len(), 0);
    assert!(text.contains("neither spots nor illumination are listed"), "{text}");
    assert!(!text.contains("beam widths") && !text.contains("RMS spot radius"), "{text}");
    for args in [
        &["lens", "analyze", &file][..],
        &["lens", "show", &file, "--focus", "paraxial"],
        &["lens", "show", &file, "--focus", "best"],
        &["lens", "tolerance", &file, "--trials", "0"],
        &["lens", "optimize", &file, "--vary", "air", "--out", "optimised"],
        &["psf", &file, "--out", "psf"],
    ] {
        run_fails(folder.path(), args, 2, &["the lens is afocal in the y-z plane"]);
    }
    assert!(!folder.path().join("optimised").exists());
}

/// A cylinder with its power in x and an axicon have no paraxial focus in the y-z section, but light does not leave them parallel.
#[test]
fn lenses_that_focus_beside_the_paraxial_section_have_spots() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, shape: &str| {
        let surfaces = format!(
            "[glass.M15]\nn = 1.5\n[[surface]]\nstop = true\nradius_mm = inf\n{shape}\nthickness_mm = 3.0\nglass = \"M15\"\nsemi_diameter_mm = 6.0\n\
             [[surface]]\nradius_mm = inf\nthickness_mm = 49.0\nsemi_diameter_mm = 8.0\n"
        );
        lens(folder.path(), name, &pupil(10.0), &surfaces)
    };
    let cylinder = made("cylinder", "toroid = { radius_x_mm = 50.0 }");
    let axicon = made("axicon", "odd = { b1 = 0.1 }");
    for (file, hint) in [(&cylinder, "exchange x and y"), (&axicon, "as those of an axicon do")] {
        let (json, text) = shown(folder.path(), file);
        assert!(text.contains("in its paraxial y-z section alone"), "{text}");
        assert_eq!(json["rms_spot_um"].as_array().unwrap().len(), 2);
        run_fails(folder.path(), &["lens", "analyze", file], 2, &["afocal in the y-z plane", hint]);
    }
    // In y the beam keeps its width. In x the focus lies 98 mm behind the cylinder, and half of the light's way leaves 0.49 of the width.
    let (json, _) = shown(folder.path(), &cylinder);
    let wanted_um = 2500.0 * 1.0_f64.hypot(0.49);
    let found_um = json["rms_spot_poly_um"][0].as_f64().unwrap();
    assert!((found_um / wanted_um - 1.0).abs() < 0.01, "{found_um} {wanted_um}");
}

#[test]
fn a_relay_without_a_focal_length_has_psfs_of_a_near_object() {
    let folder = tempfile::tempdir().unwrap();
    let head = pupil(10.0) + "[object]\ndistance_mm = 200.0\n";
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthin_lens = { focal_length_mm = 200.0 }\nthickness_mm = 240.0\nsemi_diameter_mm = 10.0\n\
        [[surface]]\nradius_mm = inf\nthin_lens = { focal_length_mm = 40.0 }\nthickness_mm = 40.0\nsemi_diameter_mm = 10.0\n";
    let file = lens(folder.path(), "relay", &head, surfaces);
    let (json, _) = shown(folder.path(), &file);
    assert!(
        json["efl_mm"].is_null() && (json["magnification"].as_f64().unwrap() + 0.2).abs() < 1e-9,
        "{json}"
    );
    run_ok(
        folder.path(),
        &["psf", &file, "--out", "psf", "--corner-mm", "0.2", "--fields", "2", "--grid", "32"],
    );
    // Thin lenses have no waves: every verb that takes waves names the first one.
    let no_waves = "surface 1 is a thin lens, which has no optical path for waves";
    for args in [
        &["psf", &file, "--out", "waves", "--corner-mm", "0.2", "--fields", "2", "--kind", "diffraction"][..],
        &["lens", "tolerance", &file, "--merit", "mtf", "--frequency", "10", "--kind", "diffraction"],
    ] {
        run_fails(folder.path(), args, 2, &[no_waves, "help: take rays: --kind geometric"]);
    }
    std::fs::write(folder.path().join("waves.toml"), "[[operand]]\nof = \"wavefront\"\nat_most = 0.1\n")
        .unwrap();
    let optimize = ["lens", "optimize", &file, "--vary", "air", "--operands", "waves.toml", "--out", "never"];
    run_fails(folder.path(), &optimize, 2, &[no_waves, "help: leave the operand out"]);
    let analyzed = run_ok(folder.path(), &["lens", "analyze", &file, "--only", "json", "--out", "analysis"]);
    assert!(analyzed.says(no_waves), "{}", analyzed.stderr);
    let axes: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("psf/psf.json")).unwrap()).unwrap();
    // The field at 1 mm of the object, as seen from the first vertex.
    let field_deg = axes["field_deg"][1].as_f64().unwrap().abs();
    assert!((field_deg - (1.0_f64 / 200.0).atan().to_degrees()).abs() < 1e-4, "{field_deg}");
}

#[test]
fn an_object_at_the_front_focus_has_its_image_at_infinity() {
    let folder = tempfile::tempdir().unwrap();
    let head = pupil(10.0) + "[object]\ndistance_mm = 100.0\n";
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthin_lens = { focal_length_mm = 100.0 }\nthickness_mm = 50.0\nsemi_diameter_mm = 6.0\n";
    let file = lens(folder.path(), "collimator", &head, surfaces);
    let (json, text) = shown(folder.path(), &file);
    assert!((json["efl_mm"].as_f64().unwrap() - 100.0).abs() < 1e-9);
    assert!(
        json["defocus_mm"].is_null() && json["magnification"].is_null() && json["total_track_mm"].is_null()
    );
    assert!(text.contains("the object is at the front focus") && !text.contains("virtual"), "{text}");
    run_fails(folder.path(), &["lens", "analyze", &file], 2, &["the object is at the front focus"]);
}

/// An object beside the front focus by the rounding of its distance, and a telescope out of adjustment by as much, have no image within reach.
#[test]
fn light_that_leaves_nearly_parallel_makes_no_image_for_any_verb() {
    let folder = tempfile::tempdir().unwrap();
    let thin = |stop: &str, focal: &str, thickness: &str| {
        format!(
            "[[surface]]\n{stop}radius_mm = inf\nthin_lens = {{ focal_length_mm = {focal} }}\nthickness_mm = {thickness}\nsemi_diameter_mm = 10.0\n"
        )
    };
    let stop = "stop = true\n";
    let near = pupil(10.0) + "[object]\ndistance_mm = 100.0001\n";
    let collimator = lens(folder.path(), "collimator", &near, &thin(stop, "100.0", "50.0"));
    let surfaces = thin(stop, "200.0", "240.0001") + &thin("", "40.0", "48.0");
    let telescope = lens(folder.path(), "telescope", &pupil(20.0), &surfaces);
    for (file, reason) in [
        (&collimator, "so near the front focus"),
        (&telescope, "so nearly afocal that light leaves it parallel"),
    ] {
        let (json, text) = shown(folder.path(), file);
        for key in ["defocus_mm", "magnification", "working_f_number", "total_track_mm"] {
            assert!(json[key].is_null(), "{key}: {}", json[key]);
        }
        assert!(text.contains("light leaves the lens parallel") && !text.contains("beam widths"), "{text}");
        for args in [&["lens", "focus", file, "focused.toml"][..], &["lens", "analyze", file]] {
            run_fails(folder.path(), args, 2, &[reason]);
        }
        run_fails(folder.path(), &["psf", file, "--out", "psf"], 2, &["light leaves the lens parallel"]);
    }
}

#[test]
fn a_stop_at_the_vertex_of_a_concave_mirror_is_read_and_analysed() {
    let folder = tempfile::tempdir().unwrap();
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 0.0\nsemi_diameter_mm = 25.0\n\
        [[surface]]\nmirror = true\nradius_mm = -400.0\nconic = -1.0\nthickness_mm = -200.0\nsemi_diameter_mm = 26.0\n";
    let file = lens(folder.path(), "newton", &pupil(50.0), surfaces);
    let (json, _) = shown(folder.path(), &file);
    assert!(
        json["rms_spot_poly_real_stop_um"][0].as_f64().unwrap() < 1e-6,
        "{}",
        json["rms_spot_poly_real_stop_um"]
    );
    // The ray at 25 mm meets the axis at the angle U with tan(U / 2) = 25 / 400.
    let na = (2.0 * (25.0 / 400.0_f64).atan()).sin();
    assert!((json["image_na"].as_f64().unwrap() - na).abs() < 1e-12);
    let analysis = run_ok(folder.path(), &["lens", "analyze", &file, "--only", "json", "--json"]).json();
    assert!(analysis["wavefronts"][0]["rms_waves"][0].as_f64().unwrap() < 1e-6);
}

#[test]
fn working_f_number_and_aperture_of_a_fast_mirror_are_those_of_its_real_cone() {
    let folder = tempfile::tempdir().unwrap();
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 120.0\nsemi_diameter_mm = 50.0\n\
        [[surface]]\nmirror = true\nradius_mm = -200.0\nconic = -1.0\nthickness_mm = -100.0\nsemi_diameter_mm = 60.0\n";
    let file = lens(folder.path(), "fast", &pupil(100.0), surfaces);
    let (json, text) = shown(folder.path(), &file);
    let number = |key: &str| json[key].as_f64().unwrap();
    // At f/1 the sine is 8 / 17, and the working f-number 17 / 16.
    assert!(
        (number("image_na") - 8.0 / 17.0).abs() < 1e-9 && (number("working_f_number") - 1.0625).abs() < 1e-9
    );
    assert!(text.contains("1.0625    NA 0.4706 at the image"), "{text}");
    let analysis = run_ok(folder.path(), &["lens", "analyze", &file, "--json"]).json();
    let first = |key: &str| analysis["first_order"][key].as_f64().unwrap();
    assert!(
        (first("airy_radius_um") - 0.609_835 * 0.5 * 17.0 / 8.0).abs() < 1e-6,
        "{}",
        first("airy_radius_um")
    );
    assert!((first("cutoff_per_mm") - 2.0 * 8.0 / 17.0 / 0.5e-3).abs() < 1e-6);
    let page = std::fs::read_to_string(folder.path().join("fast-analysis/analysis.html")).unwrap();
    assert!(page.contains("numerical aperture") && page.contains("0.4706"));
}

#[test]
fn the_track_of_a_folded_lens_is_measured_in_space_and_an_f_number_has_no_sign() {
    let folder = tempfile::tempdir().unwrap();
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthin_lens = { focal_length_mm = 100.0 }\nthickness_mm = 60.0\nsemi_diameter_mm = 10.0\n\
        [[surface]]\nmirror = true\nradius_mm = inf\nthickness_mm = -40.0\nsemi_diameter_mm = 25.0\n\
        placement = { tilt_deg = [45.0, 0.0, 0.0], axis = \"bends\" }\n";
    let file = lens(folder.path(), "folded", &pupil(10.0), surfaces);
    let (json, text) = shown(folder.path(), &file);
    let track_mm = json["total_track_mm"].as_f64().unwrap();
    assert!((track_mm - 60_f64.hypot(40.0)).abs() < 1e-9 && json["is_folded"] == true, "{track_mm}");
    assert!(text.contains("to the paraxial focus, straight across the folds"), "{text}");
    assert!((json["f_number"].as_f64().unwrap() - 10.0).abs() < 1e-9);
    // A tilt is printed as the file has it.
    assert!(text.contains("tilt_deg = [45.0, 0.0, 0.0]"), "{text}");
}

/// Behind a mirror distances along z lead against the light: shifts of the image plane are positive away from the lens all the same.
#[test]
fn the_focus_behind_a_mirror_lies_nearer_where_the_plane_is_too_far() {
    let folder = tempfile::tempdir().unwrap();
    let surfaces = "[[surface]]\nstop = true\nradius_mm = inf\nthin_lens = { focal_length_mm = 100.0 }\nthickness_mm = 60.0\nsemi_diameter_mm = 10.0\n\
        [[surface]]\nmirror = true\nradius_mm = inf\nthickness_mm = -52.0\nsemi_diameter_mm = 25.0\n\
        placement = { tilt_deg = [45.0, 0.0, 0.0], axis = \"bends\" }\n";
    let file = lens(folder.path(), "far", &pupil(10.0), surfaces);
    let (json, text) = shown(folder.path(), &file);
    assert!((json["defocus_mm"].as_f64().unwrap() - 12.0).abs() < 1e-9, "{json}");
    assert!(text.contains("+12.0000 mm from the paraxial focus"), "{text}");
    let advice = text.lines().find(|line| line.contains("out of focus")).unwrap();
    assert!(advice.contains("where the image plane lies 1") && advice.contains(" mm nearer; "), "{advice}");
    let focused = run_ok(folder.path(), &["lens", "focus", &file, "--json"]).json();
    let figure = |key: &str| focused[key].as_f64().unwrap();
    assert!(
        (figure("moved_mm") + 12.0).abs() < 0.2 && (figure("image_distance_mm") + 40.0).abs() < 0.2,
        "{focused}"
    );
    let said = run_ok(folder.path(), &["lens", "focus", &file]).stdout;
    assert!(said.contains("mm from where it was; positive away from the lens"), "{said}");
    let analysis = run_ok(folder.path(), &["lens", "analyze", &file, "--json"]).json();
    assert!((analysis["first_order"]["defocus_mm"].as_f64().unwrap() - 12.0).abs() < 1e-9);
}

/// The track and the back focal length of a folded lens are one number each, in the limit and in the table.
#[test]
fn limits_of_a_folded_lens_are_those_of_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let surfaces = "[glass.M15]\nn = 1.5\n[[surface]]\nradius_mm = 60.0\nthickness_mm = 4.0\nglass = \"M15\"\nsemi_diameter_mm = 6.0\n\
        [[surface]]\nradius_mm = -60.0\nthickness_mm = 1.0\nsemi_diameter_mm = 6.0\n\
        [[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 30.0\nsemi_diameter_mm = 5.0\n\
        [[surface]]\nmirror = true\nradius_mm = inf\nthickness_mm = -28.0\nsemi_diameter_mm = 9.0\n\
        placement = { tilt_deg = [-45.0, 0.0, 0.0], axis = \"bends\" }\n";
    let file = lens(folder.path(), "bent", &pupil(8.0), surfaces);
    let limits = ["--track", "36", "--bfl", "20,30", "--iterations", "0", "--out", "run", "--json"];
    let args = [&["lens", "optimize", &file, "--vary", "curvature"], &limits[..]].concat();
    let found = run_ok(folder.path(), &args).json();
    let best = &found["best"];
    let track_mm = best["track_to_the_image_mm"].as_f64().unwrap();
    let shown = run_ok(folder.path(), &["lens", "show", "run/best.toml", "--json"]).json();
    let image_mm = shown["surfaces"][3]["thickness_mm"].as_f64().unwrap();
    assert!((track_mm - 35_f64.hypot(image_mm)).abs() < 1e-6, "{track_mm} {image_mm}");
    let violations: Vec<&str> =
        best["violations"].as_array().unwrap().iter().map(|said| said.as_str().unwrap()).collect();
    assert_eq!(violations, [format!("track: {track_mm:.4} mm, at most 36")]);
    // Within the bounds of the limit, with its sign.
    let back_mm = best["back_focal_length_mm"].as_f64().unwrap();
    assert!(
        (back_mm + shown["bfl_mm"].as_f64().unwrap()).abs() < 1e-6 && (20.0..30.0).contains(&back_mm),
        "{back_mm}"
    );
}
