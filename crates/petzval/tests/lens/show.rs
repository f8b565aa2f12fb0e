//! `petzval lens`: the figures of the nominal triplet, and single rays through it.

use crate::common::{data, read, run, run_fails, run_ok};
use serde_json::Value;

const LENS: &str = "cooke-triplet-nominal";

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn trace(field: &str, pupil: &str, more: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let ray = ["lens", "trace", LENS, "--field", field, "--wavelength", "0.55", "--pupil", pupil, "--json"];
    run_ok(folder.path(), &[&ray, more].concat()).json()
}

#[test]
fn show_gives_the_published_figures_by_name_and_by_path() {
    let folder = tempfile::tempdir().unwrap();
    let by_path = data("lenses/cooke-triplet-nominal.toml").display().to_string();
    // The path below `data/` names the built-in file where there is no such folder, as here.
    for name in [LENS, "data/lenses/cooke-triplet-nominal.toml", &by_path] {
        let shown = run_ok(folder.path(), &["lens", "show", name, "--json"]).json();
        for (key, published) in
            [("efl_mm", 25.04), ("bfl_mm", 24.44), ("f_number", 4.39), ("total_track_mm", 46.64)]
        {
            let value = shown[key].as_f64().unwrap();
            assert!((value - published).abs() < 0.02, "{name}: {key} is {value}, not {published}");
        }
        let spots = numbers(&shown["rms_spot_poly_um"]);
        assert_eq!(spots.len(), 4);
        for (spot, published) in spots.iter().zip([4.0, 7.7, 16.4, 22.3]) {
            assert!((spot / published - 1.0).abs() < 0.03, "{name}: {spot} um, not {published}");
        }
    }
}

#[test]
fn the_json_of_show_has_every_key() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_ok(folder.path(), &["lens", "show", LENS, "--json"]).json();
    assert_eq!(shown["name"], "Cooke triplet, nominal");
    assert_eq!(shown["epd_mm"], 5.7);
    assert_eq!(numbers(&shown["wavelengths_um"]), [0.486, 0.55, 0.62]);
    assert_eq!(numbers(&shown["fields_deg"]), [0.0, 5.0, 10.0, 15.0]);
    assert_eq!(shown["surfaces"].as_array().unwrap().len(), 7);
    assert_eq!(shown["surfaces"][4]["stop"], true);
    assert_eq!(shown["surfaces"][4]["radius_mm"], Value::Null);
    assert_eq!(shown["surfaces"][2]["glass"], "N-SF11");
    assert!((shown["surfaces"][0]["radius_mm"].as_f64().unwrap() - 11.34).abs() < 1e-9);

    // Keys of a near object are there for one at infinity, too.
    assert!(shown["object_distance_mm"].is_null() && shown["magnification"].is_null());
    assert!((shown["working_f_number"].as_f64().unwrap() / 4.4 - 1.0).abs() < 0.02);

    let by_field = shown["rms_spot_um"].as_array().unwrap();
    assert_eq!(by_field.len(), 4);
    for field in by_field {
        let spots = numbers(field);
        assert!(spots.len() == 3 && spots.iter().all(|s| *s > 0.1 && *s < 100.0), "{spots:?}");
    }
    let seidel = shown["seidel"].as_object().unwrap();
    assert_eq!(seidel.keys().collect::<Vec<_>>(), ["S1", "S2", "S3", "S4", "S5"]);
    assert!(seidel.values().all(|s| s.as_f64().is_some_and(|s| s.is_finite() && s != 0.0)));
    // The Petzval sum does not depend on the position of the aperture: H^2 sum(c dn / n n') of this lens.
    assert!(seidel["S4"].as_f64().unwrap() > 0.0);
}

#[test]
#[ignore = "draws every built-in lens; `cargo xtask full` runs it"]
fn every_built_in_lens_can_be_shown() {
    let folder = tempfile::tempdir().unwrap();
    let doctor = run_ok(folder.path(), &["doctor", "--json"]).json();
    let lenses = doctor["lenses"].as_array().unwrap();
    assert!(lenses.len() >= 8, "{lenses:?}");
    for lens in lenses {
        let shown = run_ok(folder.path(), &["lens", "show", lens.as_str().unwrap()]);
        assert!(shown.stdout.contains("focal length"), "{}", shown.stdout);
        assert!(!shown.stdout.contains("out of focus"), "{}", shown.stdout);
    }
}

#[test]
fn illumination_is_relative_to_the_axis() {
    let folder = tempfile::tempdir().unwrap();
    // The soft edge of the triplet's stop and the aberration of a pupil change the light of the axis: it is the unit.
    for name in [LENS, "cooke-triplet-spot"] {
        let shown = run_ok(folder.path(), &["lens", "show", name, "--json"]).json();
        let light = shown["relative_illumination"].as_array().unwrap();
        assert_eq!(shown["fields_deg"][0], 0.0);
        assert!(numbers(&light[0]).iter().all(|on_axis| *on_axis == 1.0), "{name}: {light:?}");
        assert!(numbers(&light[1]).iter().all(|off_axis| *off_axis > 0.2 && *off_axis != 1.0), "{light:?}");
    }
    // Also where the file does not list the axis.
    let text = read(&data("lenses/cooke-triplet-nominal.toml"));
    let fields = text.replace("[0.0, 5.0, 10.0, 15.0]", "[5.0]").replace("[0, 5, 10, 15]", "[5]");
    assert_ne!(fields, text);
    // What is expected of every field has as many values.
    let lines = fields.lines().filter(|line| !line.starts_with("rms_spot_um"));
    let off_axis = lines.collect::<Vec<_>>().join("\n");
    std::fs::write(folder.path().join("off-axis.toml"), off_axis).unwrap();
    let whole = run_ok(folder.path(), &["lens", "show", LENS, "--json"]).json();
    let part = run_ok(folder.path(), &["lens", "show", "off-axis.toml", "--json"]).json();
    let [whole, part] = [&whole["relative_illumination"][1], &part["relative_illumination"][0]].map(numbers);
    assert!(whole.iter().zip(&part).all(|(a, b)| (a / b - 1.0).abs() < 2e-3), "{whole:?} {part:?}");
}

#[test]
fn a_lens_out_of_focus_gets_the_hint_to_focus_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = read(&data("lenses/cooke-triplet-nominal.toml"));
    let moved = text.replacen("24.525171", "29.525171", 1);
    assert_ne!(moved, text);
    std::fs::write(folder.path().join("moved.toml"), moved).unwrap();
    let hint = "`petzval lens focus moved.toml OUT.toml`";
    let shown = run_ok(folder.path(), &["lens", "show", "moved.toml", "--json"]).json();
    let warnings = shown["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains(hint)), "{warnings:?}");
    let args = ["lens", "analyze", "moved.toml", "--only", "json", "--out"];
    let analysed = run_ok(folder.path(), &[&args[..], &["out"]].concat());
    assert!(analysed.says("out of focus") && analysed.says(hint), "{}", analysed.stderr);
    let focused = run_ok(folder.path(), &[&args[..], &["focused", "--focus", "best"]].concat());
    assert!(!focused.says("out of focus"), "{}", focused.stderr);

    // The hint is a command that can be pasted, and writes a lens that needs it no more.
    std::fs::rename(folder.path().join("moved.toml"), folder.path().join("it's moved.toml")).unwrap();
    let shown = run_ok(folder.path(), &["lens", "show", "it's moved.toml"]);
    assert!(shown.stdout.contains(r"`petzval lens focus 'it'\''s moved.toml' OUT.toml`"), "{}", shown.stdout);
    run_ok(folder.path(), &["lens", "focus", "it's moved.toml", "OUT.toml"]);
    assert!(!run_ok(folder.path(), &["lens", "show", "OUT.toml"]).stdout.contains("out of focus"));
}

#[test]
fn a_virtual_focus_is_shown_and_no_file_has_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = "name = \"diverging lens\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 4.0\n[object]\ndistance_mm = inf\n\
                [wavelengths]\num = [0.5876]\nreference_um = 0.5876\n[fields]\nangle_deg = [0.0]\n\
                [[surface]]\nstop = true\nradius_mm = -50.0\nthickness_mm = 2.0\nglass = \"N-BK7\"\nsemi_diameter_mm = 3.0\n\
                [[surface]]\nradius_mm = 50.0\nthickness_mm = 30.0\nsemi_diameter_mm = 3.0\n";
    std::fs::write(folder.path().join("diverging.toml"), text).unwrap();
    let shown = run_ok(folder.path(), &["lens", "show", "diverging.toml"]);
    assert!(
        shown.stdout.contains("image is virtual") && !shown.stdout.contains("petzval lens focus"),
        "{}",
        shown.stdout
    );
    let focused = run_ok(folder.path(), &["lens", "focus", "diverging.toml", "--json"]).json();
    assert!(focused["image_distance_mm"].as_f64().unwrap() < -40.0, "{focused}");
    run_fails(
        folder.path(),
        &["lens", "focus", "diverging.toml", "out.toml"],
        2,
        &["the image is virtual", "mm in front"],
    );
    assert!(!folder.path().join("out.toml").exists());
}

#[test]
fn a_ray_has_a_position_and_a_direction_at_every_surface() {
    let ray = trace("10", "0.3,-0.6", &[]);
    assert_eq!(ray["status"], "ok");
    let surfaces = ray["surfaces"].as_array().unwrap();
    assert_eq!(surfaces.len(), 7);
    for place in surfaces.iter().chain([&ray["image"]]) {
        let f = |key: &str| place[key].as_f64().unwrap_or_else(|| panic!("no {key} in {place}"));
        assert!(f("x_mm").abs() < 10.0 && f("y_mm").abs() < 10.0 && f("z_mm").abs() < 5.0);
        assert!((f("l").powi(2) + f("m").powi(2) + f("n").powi(2) - 1.0).abs() < 1e-12);
        assert!(f("n") > 0.9);
    }
    // The ray lands near f tan(field), and its path is longer than the track.
    let height = ray["image"]["y_mm"].as_f64().unwrap().abs();
    assert!((height / (25.04 * 10f64.to_radians().tan()) - 1.0).abs() < 0.05, "{height}");
    let path = ray["opl_mm"].as_f64().unwrap();
    assert!(path > 46.64 && path < 60.0, "{path}");
}

#[test]
fn real_aim_hits_the_given_point_of_the_stop() {
    let at_stop = |field: &str, pupil: &str, aim: &str| {
        let ray = trace(field, pupil, &["--aim", aim]);
        assert_eq!(ray["status"], "ok");
        ["x_mm", "y_mm"].map(|key| ray["surfaces"][4][key].as_f64().unwrap())
    };
    let radius = at_stop("0", "1,0", "real")[0];
    assert!((radius / 2.7298 - 1.0).abs() < 0.01, "{radius}");
    for field in ["0", "7.5", "15", "-15"] {
        for (pupil, target) in
            [("0,0", [0.0, 0.0]), ("0.3,-0.7", [0.3, -0.7]), ("-0.5,0.5", [-0.5, 0.5]), ("0,-1", [0.0, -1.0])]
        {
            let hit = at_stop(field, pupil, "real");
            for axis in 0..2 {
                let off = hit[axis] - target[axis] * radius;
                assert!(off.abs() < 1e-8, "field {field}, pupil {pupil}: {off} mm off");
            }
        }
    }
    // The paraxial pupil is another place off axis, where the pupil is aberrated.
    let off = at_stop("15", "0,-0.7", "paraxial")[1] - at_stop("15", "0,-0.7", "real")[1];
    assert!(off.abs() > 0.01, "{off}");
    let off = at_stop("0", "0.1,0", "paraxial")[0] - at_stop("0", "0.1,0", "real")[0];
    assert!(off.abs() < 1e-3, "{off}");
}

#[test]
fn a_lost_ray_reports_its_surface_and_is_not_a_failure() {
    let missed = trace("5", "0,5", &["--aim", "paraxial"]);
    assert_eq!(missed["status"], "missed surface 1");
    assert_eq!((&missed["image"], &missed["opl_mm"]), (&Value::Null, &Value::Null));
    let clipped = trace("5", "0,2", &["--aim", "paraxial"]);
    assert!(clipped["status"].as_str().unwrap().starts_with("clipped at surface "), "{clipped}");
    for pupil in ["0,5", "0,9", "1e300,0"] {
        let lost = trace("5", pupil, &[]);
        assert_eq!(lost["status"], "no ray passes this point of the stop");
        assert_eq!(lost["surfaces"].as_array().unwrap().len(), 0);
    }
    // The printed table states it too.
    let folder = tempfile::tempdir().unwrap();
    let ray = ["lens", "trace", LENS, "--field", "80", "--wavelength", "0.55", "--pupil", "0,0"];
    let table = run(folder.path(), &ray);
    assert_eq!(table.code, Some(0));
    assert!(table.stdout.starts_with("status: no ray passes"), "{}", table.stdout);
}

#[test]
fn wrong_requests_for_a_ray_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (field, wavelength, pupil, needles) in [
        ("5", "550", "0,0", ["--wavelength 550", "did you mean 0.55?"]),
        ("5", "nan", "0,0", ["--wavelength", "0.2"]),
        ("5", "0", "0,0", ["--wavelength 0", "between 0.2 and 20 um"]),
        ("180", "0.55", "0,0", ["--field 180", "180 degrees"]),
        ("5", "0.55", "0", ["--pupil 0: needs two numbers", "0,0.7"]),
        ("5", "0.55", "0,0,0", ["--pupil 0,0,0: needs two numbers", "0,0.7"]),
        ("5", "0.55", "a,b", ["invalid value", "--pupil"]),
        ("5", "0.55", "nan,0", ["--pupil NaN,0: not two finite numbers", "0,0.7"]),
    ] {
        let ray = ["lens", "trace", LENS, "--field", field, "--wavelength", wavelength, "--pupil", pupil];
        run_fails(folder.path(), &ray, 2, &needles);
    }
}

#[test]
fn fields_by_image_heights_are_named_with_few_digits() {
    let folder = tempfile::tempdir().unwrap();
    let text = "LEN NEW\nRDM\nFNO 2.4\nDIM I\nWL 587.56\nYIM 0 0.08\nSO 0 1e13\nS 0 0\nSTO\nS 0.06 0.025 544000.560000\nASP\nK -0.3\n\
        A 200; B -1e6\nS -0.5 0.05\nS -0.2 0.02 1.651:21.5\nS 0.5 0.05\nSI 0 0\nGO\n";
    std::fs::write(folder.path().join("steep.seq"), text).unwrap();
    let shown = run_ok(folder.path(), &["lens", "show", "steep.seq"]).stdout;
    assert!(
        shown.contains("warning: at 34.2902 degrees") && shown.contains("of the rays through the stop miss"),
        "{shown}"
    );
}
