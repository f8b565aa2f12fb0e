//! `petzval lens analyze`: every file exists, has its format, and shows the lens's own numbers.

use std::path::Path;

use crate::common::{read, read_json, run, run_fails, run_ok};
use serde_json::Value;

const LENS: &str = "cooke-triplet-nominal";

const PICTURES: [&str; 15] = [
    "layout",
    "spots",
    "ray_fans",
    "opd_fans",
    "mtf",
    "mtf_geometric",
    "mtf_by_field",
    "mtf_through_focus",
    "field_curvature_distortion",
    "lateral_colour",
    "axial_colour",
    "encircled_energy",
    "relative_illumination",
    "wavefront",
    "seidel",
];

const TABLES: [&str; 9] = [
    "spots",
    "fans",
    "mtf",
    "mtf_by_field",
    "mtf_through_focus",
    "field_curves",
    "axial_colour",
    "longitudinal_aberration",
    "encircled_energy",
];

/// A telescope whose axis a flat mirror folds down.
const NEWTONIAN: &str = r#"
name = "Newton's <telescope> & \"fold\""
source = "a test"
units = "mm"
[aperture]
entrance_pupil_diameter_mm = 100.0
[object]
distance_mm = inf
[wavelengths]
um = [0.55]
reference_um = 0.55
[fields]
angle_deg = [0.0]
[[surface]]
label = "primary"
stop = true
mirror = true
radius_mm = -800.0
conic = -1.0
thickness_mm = -300.0
semi_diameter_mm = 51.0
[[surface]]
label = "fold"
mirror = true
radius_mm = inf
thickness_mm = 100.0
semi_diameter_mm = 20.0
placement = { tilt_deg = [45.0, 0.0, 0.0], axis = "bends" }
"#;

/// A grating that turns light of -40 degrees into the axis of a perfect lens, which light of the axis misses.
const SPECTROMETER: &str = r#"
name = "spectrometer"
units = "mm"
[aperture]
entrance_pupil_diameter_mm = 4.0
[object]
distance_mm = inf
[wavelengths]
um = [0.5]
reference_um = 0.5
[fields]
angle_deg = [-42.0, -40.0, -38.0]
[[surface]]
stop = true
radius_mm = inf
grating = { lines_per_mm = 1285.575219373079, order = 1 }
thickness_mm = 20.0
semi_diameter_mm = 3.0
[[surface]]
radius_mm = inf
thin_lens = { focal_length_mm = 100.0 }
thickness_mm = 100.0
semi_diameter_mm = 6.0
"#;

/// The SVG of a picture, parsed.
fn with_svg<T>(folder: &Path, name: &str, look: impl Fn(roxmltree::Node) -> T) -> T {
    let text = read(&folder.join(format!("{name}.svg")));
    let document = roxmltree::Document::parse(&text).unwrap_or_else(|e| panic!("{name}.svg: {e}"));
    look(document.root_element())
}

fn of_class(root: roxmltree::Node, class: &str) -> usize {
    root.descendants().filter(|n| n.attribute("class") == Some(class)).count()
}

fn texts(root: roxmltree::Node) -> Vec<String> {
    let texts = root.descendants().filter(|n| n.has_tag_name("text"));
    texts.map(|n| n.descendants().filter_map(|t| t.text().filter(|_| t.is_text())).collect()).collect()
}

#[test]
fn everything_is_written_and_well_formed() {
    let folder = tempfile::tempdir().unwrap();
    let said = run_ok(folder.path(), &["lens", "analyze", LENS]).stdout;
    assert!(
        said.contains("focal length 25.040 mm")
            && said.contains("26 files in cooke-triplet-nominal-analysis"),
        "{said}"
    );
    let out = folder.path().join("cooke-triplet-nominal-analysis");
    let mut files: Vec<String> =
        std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    let mut wanted: Vec<String> = PICTURES.iter().map(|p| format!("{p}.svg")).collect();
    wanted.extend(["analysis.html".to_owned(), "analysis.json".to_owned()]);
    wanted.extend(TABLES.map(|name| format!("{name}.csv")));
    wanted.sort();
    assert_eq!(files, wanted);
    for name in PICTURES {
        with_svg(&out, name, |root| {
            assert_eq!(root.attribute("role"), Some("img"));
            assert!(
                root.attribute("aria-label").is_some_and(|a| a.contains("Cooke triplet, nominal")),
                "{name}"
            );
            assert!(texts(root).iter().any(|t| t == "Cooke triplet, nominal"), "{name}");
        });
        let size = std::fs::metadata(out.join(format!("{name}.svg"))).unwrap().len();
        assert!(size < 400_000, "{name}: {size} bytes");
    }
    let page = read(&out.join("analysis.html"));
    assert!(page.len() < 2_000_000 && page.matches("<figure").count() == 15);
    assert!(page.contains("<h2>Prescription</h2>") && page.contains(" stop</th>"));

    // Four fields in three colours.
    with_svg(&out, "spots", |root| assert_eq!((of_class(root, "spot"), of_class(root, "rays")), (4, 12)));
    with_svg(&out, "ray_fans", |root| assert_eq!(of_class(root, "curve"), 24));
    with_svg(&out, "mtf", |root| assert_eq!(of_class(root, "curve"), 9));
    with_svg(&out, "layout", |root| assert_eq!((of_class(root, "element"), of_class(root, "fan")), (3, 8)));
}

#[test]
fn the_nyquist_frequency_of_a_sensor_is_marked() {
    let folder = tempfile::tempdir().unwrap();
    let analyze = |more: &[&str]| {
        let args =
            [&["lens", "analyze", LENS, "--only", "mtf,html", "--out", "here", "--force", "--json"], more]
                .concat();
        run_ok(folder.path(), &args).json()
    };
    // Pixels of 5.86 um.
    let of_sensor = analyze(&["--sensor", "imx249-calibrated"]);
    assert!((of_sensor["nyquist_per_mm"].as_f64().unwrap() - 85.3242).abs() < 1e-3);
    with_svg(&folder.path().join("here"), "mtf", |root| {
        assert!(texts(root).iter().any(|t| t.contains("Nyquist frequency of the pixels, 85.3 cycles/mm")));
        assert_eq!(of_class(root, "curve"), 10);
    });
    assert_eq!(of_sensor, analyze(&["--pixel-um", "5.86"]));
    // Curves reach beyond the Nyquist frequency of small pixels; over the field they are at it.
    let fine = analyze(&["--pixel-um", "2"]);
    let highest = fine["mtf"][0]["frequency_per_mm"].as_array().unwrap().last().unwrap().as_f64().unwrap();
    assert!(highest > 250.0, "{highest}");
    assert_eq!(fine["mtf_by_field"]["frequency_per_mm"], serde_json::json!([62.5, 125.0, 250.0]));
    assert!(analyze(&[])["nyquist_per_mm"].is_null());
    let args = |more: &'static [&'static str]| [&["lens", "analyze", LENS], more].concat();
    run_fails(
        folder.path(),
        &args(&["--pixel-um", "0"]),
        2,
        &["--pixel-um 0: must lie between 0.1 and 1000 um"],
    );
    run_fails(
        folder.path(),
        &args(&["--pixel-um", "2", "--sensor", "imx249-calibrated"]),
        2,
        &["cannot be used with"],
    );
    run_fails(folder.path(), &args(&["--sensor", "imx24"]), 2, &["imx24"]);
}

#[test]
fn the_data_hold_every_analysis_and_the_pictures_show_them() {
    let folder = tempfile::tempdir().unwrap();
    let printed = run_ok(folder.path(), &["lens", "analyze", LENS, "--out", "here", "--json"]).json();
    let out = folder.path().join("here");
    assert_eq!(printed, read_json(&out.join("analysis.json")));
    let keys: Vec<&str> = printed.as_object().unwrap().keys().map(String::as_str).collect();
    for key in [
        "name",
        "wavelengths_um",
        "reference_um",
        "fields_deg",
        "first_order",
        "third_order",
        "layout",
        "spots",
        "fans",
        "wavefronts",
        "mtf",
        "mtf_by_field",
        "mtf_through_focus",
        "field_curves",
        "axial_colour",
        "longitudinal_aberration",
        "encircled_energy",
    ] {
        assert!(keys.contains(&key), "no {key} in {keys:?}");
    }
    let spots: Vec<f64> =
        printed["spots"].as_array().unwrap().iter().map(|s| s["rms_um"].as_f64().unwrap()).collect();
    assert_eq!(spots.len(), 4);
    let shown = with_svg(&out, "spots", texts);
    for rms in spots {
        assert!(shown.iter().any(|t| t.starts_with(&format!("RMS {rms:.2} µm"))), "{rms} in {shown:?}");
    }
    // Real-stop spots of `lens show` are the same numbers.
    let show = run_ok(folder.path(), &["lens", "show", LENS, "--json"]).json();
    for (a, b) in printed["spots"]
        .as_array()
        .unwrap()
        .iter()
        .zip(show["rms_spot_poly_real_stop_um"].as_array().unwrap())
    {
        assert!((a["rms_um"].as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-9);
    }
}

#[test]
fn the_tables_hold_the_numbers_of_the_data() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["lens", "analyze", LENS, "--out", "here", "--only", "csv", "--json"];
    let data = run_ok(folder.path(), &args).json();
    assert_eq!(std::fs::read_dir(folder.path().join("here")).unwrap().count(), TABLES.len());
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    };
    // The head of a table, and its columns.
    let table = |name: &str| -> (Vec<String>, Vec<Vec<f64>>) {
        let text = read(&folder.path().join(format!("here/{name}.csv")));
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let cell = |text: &String| text.parse::<f64>().unwrap_or(f64::NAN);
        let rows: Vec<Vec<f64>> = lines.map(|row| row.iter().map(cell).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == head.len()), "{name}");
        let columns = (0..head.len()).map(|i| rows.iter().map(|row| row[i]).collect()).collect();
        (head, columns)
    };
    let column = |name: &str, of: &str| -> Vec<f64> {
        let (head, columns) = table(name);
        columns[head.iter().position(|h| h == of).unwrap_or_else(|| panic!("{of} in {head:?}"))].clone()
    };
    // One curve after another, in the order of the fields.
    let joined = |analysis: &str, of: &dyn Fn(&Value) -> Value| -> Vec<f64> {
        data[analysis].as_array().unwrap().iter().flat_map(|field| numbers(&of(field))).collect()
    };
    assert_eq!(
        column("mtf", "tangential_by_waves"),
        joined("mtf", &|f| f["diffraction"]["tangential"].clone())
    );
    assert_eq!(column("mtf", "sagittal_by_rays"), joined("mtf", &|f| f["geometric"]["sagittal"].clone()));
    assert_eq!(
        column("encircled_energy", "by_rays"),
        joined("encircled_energy", &|f| f["geometric"].clone())
    );
    assert_eq!(
        column("mtf_through_focus", "sagittal_by_waves"),
        joined("mtf_through_focus", &|f| f["diffraction"]["sagittal"].clone())
    );
    let by_colour = |of: &str| -> Vec<f64> {
        data["field_curves"][of].as_array().unwrap().iter().flat_map(numbers).collect()
    };
    for of in ["tangential_focus_mm", "distortion_percent", "relative_illumination"] {
        assert_eq!(column("field_curves", of), by_colour(of));
    }
    let fan = |f: &Value| f["tangential_um"].as_array().unwrap().iter().flat_map(numbers).collect::<Vec<_>>();
    let fans: Vec<f64> = data["fans"].as_array().unwrap().iter().flat_map(fan).collect();
    assert_eq!(column("fans", "tangential_um"), fans);
    assert_eq!(column("axial_colour", "shift_mm"), numbers(&data["axial_colour"]["shift_mm"]));
}

#[test]
fn of_a_thousand_wavelengths_31_are_analysed() {
    let folder = tempfile::tempdir().unwrap();
    let lens =
        read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../petzval-data/data/lenses/{LENS}.toml")));
    let line = lens.lines().find(|line| line.starts_with("um = ")).unwrap().to_owned();
    let many: Vec<String> = (0..1000).map(|i| format!("{}", 0.45 + 2e-4 * f64::from(i))).collect();
    std::fs::write(
        folder.path().join("many.toml"),
        lens.replace(&line, &format!("um = [{}]", many.join(", "))),
    )
    .unwrap();
    let args = ["lens", "analyze", "many.toml", "--fields", "0", "--only", "json", "--json"];
    let run = run_ok(folder.path(), &args);
    assert!(run.stderr.contains("31 of the 1000 wavelengths are analysed, evenly chosen"), "{}", run.stderr);
    let data = run.json();
    let um = data["wavelengths_um"].as_array().unwrap();
    assert_eq!((um.len(), um[0].as_f64().unwrap()), (31, 0.45));
    assert!((um[30].as_f64().unwrap() - 0.6498).abs() < 1e-9);
}

#[test]
fn a_lens_is_analysed_at_its_own_fields_where_its_axis_is_dark() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("spectrometer.toml"), SPECTROMETER).unwrap();
    let analyze = ["lens", "analyze", "spectrometer.toml", "--fields=-40", "--only", "json", "--json"];
    let run = run_ok(folder.path(), &analyze);
    assert!(
        run.says("those of the nearest field, -40 degrees, and illumination is relative to it"),
        "{run:?}"
    );
    let data = run.json();
    assert_eq!(data["first_order"]["image_na_field_deg"], -40.0);
    // Round beams of 4 mm meet at 100 mm.
    let working = data["first_order"]["working_f_number"].as_f64().unwrap();
    assert!((working / 25.005 - 1.0).abs() < 1e-4, "{working}");
    let shown = run_ok(folder.path(), &["lens", "show", "spectrometer.toml", "--json"]).json();
    assert_eq!(shown["relative_illumination"][2][0], 1.0);
    assert!(shown["warnings"].to_string().contains("the nearest field, -38 degrees"), "{shown}");
}

#[test]
fn psfs_of_a_spectrometer_begin_with_the_field_that_lands_on_the_axis() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("spectrometer.toml"), SPECTROMETER).unwrap();
    let words =
        ["psf", "spectrometer.toml", "--out", "psf", "--fields", "2", "--corner-mm", "1", "--grid", "64"];
    let more = ["--wavelengths", "0.50001,0.5,0.49999", "--json"];
    let run = run_ok(folder.path(), &[&words[..], &more].concat());
    assert!(!run.says("of the lens file"), "{}", run.stderr);
    let axes = run.json();
    let number = |key: &str, i: usize| axes[key][i].as_f64().unwrap();
    assert!((number("field_deg", 0) + 40.0).abs() < 1e-6 && number("field_deg", 1) > -40.0, "{axes}");
    assert_eq!(axes["field_radius_mm"], serde_json::json!([0.0, 1.0]));
    assert!(number("chief_ray_y_mm", 0).abs() < 1e-6 && (number("chief_ray_y_mm", 1) - 1.0).abs() < 1e-6);
    // Near -40 degrees the height grows by 100 mm cos^3 a per tangent.
    let scale_mm = axes["image_scale_mm"].as_f64().unwrap();
    assert!((scale_mm / (100.0 * 40_f64.to_radians().cos().powi(3)) - 1.0).abs() < 1e-4, "{scale_mm}");
}

#[test]
fn a_best_focus_at_which_no_wavelength_is_in_focus_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let lines = SPECTROMETER.replace("um = [0.5]", "um = [0.49, 0.5, 0.51]");
    assert_ne!(lines, SPECTROMETER);
    std::fs::write(folder.path().join("lines.toml"), lines).unwrap();
    std::fs::write(folder.path().join("line.toml"), SPECTROMETER).unwrap();
    let said = "to focus single wavelengths, leave one of them in [wavelengths]";
    // The lens is perfect where it is; nearer to it the lines are wide, and nearer to each other.
    let focused = run_ok(folder.path(), &["lens", "focus", "lines.toml", "--json"]);
    assert!(focused.says(said), "{}", focused.stderr);
    let found = focused.json();
    let um = |key: &str| found[key].as_f64().unwrap();
    assert!(um("largest_colour_spot_before_um") < 0.01 && um("largest_colour_spot_um") > 100.0, "{found}");
    assert!(um("rms_spot_um") < um("rms_spot_before_um"), "{found}");
    let plain = run_ok(folder.path(), &["lens", "focus", "lines.toml"]).stdout;
    assert!(plain.contains("of one wavelength"), "{plain}");
    let shown = run_ok(folder.path(), &["lens", "show", "lines.toml", "--focus", "best", "--json"]).json();
    assert!(shown["warnings"].to_string().contains(said), "{shown}");
    for lens in ["line.toml", LENS] {
        let focused = run_ok(folder.path(), &["lens", "focus", lens, "--json"]);
        assert!(!focused.says("single wavelengths"), "{}", focused.stderr);
        assert_eq!(focused.json()["largest_colour_spot_um"].is_null(), lens != LENS);
    }
}

#[test]
fn fields_and_wavelengths_may_be_others_than_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let analyzed = |words: &[&str]| {
        let own = ["lens", "analyze", LENS, "--only", "json", "--json", "--force"];
        run_ok(folder.path(), &[&own[..], words].concat()).json()
    };
    let data = analyzed(&["--fields", "12,-3.5,0,12", "--wavelengths", "0.55"]);
    assert_eq!(data["fields_deg"], serde_json::json!([-3.5, 0.0, 12.0]));
    assert_eq!(data["wavelengths_um"], serde_json::json!([0.55]));
    // A field that the file states has the same spot.
    let (whole, one) = (analyzed(&[]), analyzed(&["--fields", "0"]));
    assert_eq!(whole["fields_deg"][0], 0.0);
    assert_eq!(whole["spots"][0]["rms_um"], one["spots"][0]["rms_um"]);
    for (words, hint) in [
        (["--fields", "180"], "degrees from the axis, less than 180"),
        (["--wavelengths", "550"], "did you mean 0.55?"),
    ] {
        run_fails(folder.path(), &[&["lens", "analyze", LENS][..], &words].concat(), 2, &[hint]);
    }
}

#[test]
fn focus_and_frequencies_follow_the_options() {
    let folder = tempfile::tempdir().unwrap();
    let args = [
        "lens",
        "analyze",
        LENS,
        "--out",
        "a",
        "--json",
        "--max-frequency",
        "85.32",
        "--frequency",
        "30",
        "--focus",
        "paraxial",
    ];
    let data = run_ok(folder.path(), &args).json();
    let last = |v: &Value| v.as_array().unwrap().last().unwrap().as_f64().unwrap();
    assert_eq!(last(&data["mtf"][0]["frequency_per_mm"]), 85.32);
    assert_eq!(data["mtf_through_focus"][0]["frequency_per_mm"], 30.0);
    assert!(data["first_order"]["defocus_mm"].as_f64().unwrap().abs() < 1e-9);
    let shown = with_svg(&folder.path().join("a"), "mtf_through_focus", texts);
    assert!(shown.iter().any(|t| t.starts_with("At 30 cycles/mm.")), "{shown:?}");
}

#[test]
fn only_the_requested_files_are_written() {
    let folder = tempfile::tempdir().unwrap();
    run_ok(folder.path(), &["lens", "analyze", LENS, "--out", "a", "--only", "mtf,spots,html"]);
    let out = folder.path().join("a");
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 3);
    assert_eq!(read(&out.join("analysis.html")).matches("<figure").count(), 2);
}

#[test]
fn a_folded_lens_is_drawn_below_its_axis() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("newton.toml"), NEWTONIAN).unwrap();
    run_ok(folder.path(), &["lens", "analyze", "newton.toml"]);
    let out = folder.path().join("newton-analysis");
    for name in PICTURES {
        with_svg(&out, name, |root| {
            assert!(!root.descendants().any(|n| n.text().is_some_and(|t| t.contains("NaN"))), "{name}")
        });
    }
    with_svg(&out, "layout", |root| {
        assert_eq!(
            (of_class(root, "mirror"), of_class(root, "mirror-back"), of_class(root, "element")),
            (2, 2, 0)
        );
    });
    let layout = &read_json(&out.join("analysis.json"))["layout"];
    let end = |i: usize| {
        layout["image"][i].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect::<Vec<_>>()
    };
    // The fold lies 300 mm in front of the primary, the image 100 mm to its side, across the axis.
    assert!((end(0)[1] + 200.0 - 100.0).abs() < 1e-9 || (end(0)[1] + 100.0).abs() < 1e-9, "{:?}", end(0));
    assert!((end(0)[1] - end(1)[1]).abs() < 1e-9 && (0.5 * (end(0)[0] + end(1)[0]) + 300.0).abs() < 1e-9);
    // One field: no curves over it.
    with_svg(&out, "lateral_colour", |root| assert_eq!(of_class(root, "curve"), 0));
}

#[test]
fn lenses_that_cannot_be_analysed_are_refused_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    for (more, needles) in [
        (&["--max-frequency", "0"][..], ["--max-frequency 0", "cycles/mm"]),
        (&["--frequency", "nan"], ["--frequency NaN", "cycles/mm"]),
        (&["--only", "pictures"], ["invalid value 'pictures'", "field_curvature_distortion"]),
        (&["--focus", "here"], ["invalid value 'here'", "paraxial"]),
    ] {
        let args = [&["lens", "analyze", LENS, "--out", "a"], more].concat();
        run_fails(folder.path(), &args, 2, &needles);
        assert!(!folder.path().join("a").exists());
    }
    run_fails(folder.path(), &["lens", "analyze", "no-such-lens"], 2, &["no-such-lens"]);
    std::fs::write(folder.path().join("file"), "").unwrap();
    run_fails(folder.path(), &["lens", "analyze", LENS, "--out", "file"], 2, &["this is a file"]);
    // A lens without an image.
    let flat = NEWTONIAN.replace("radius_mm = -800.0\nconic = -1.0", "radius_mm = inf");
    std::fs::write(folder.path().join("flat.toml"), flat).unwrap();
    run_fails(folder.path(), &["lens", "analyze", "flat.toml"], 2, &["afocal"]);
    // A lens whose first mirror is missed.
    let far = NEWTONIAN.replace("angle_deg = [0.0]", "angle_deg = [0.0, 40.0]");
    std::fs::write(folder.path().join("far.toml"), far).unwrap();
    let refused = run(folder.path(), &["lens", "analyze", "far.toml"]);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    for words in ["at 40 degrees", "is clipped at surface 2", "leave that field out"] {
        assert!(refused.says(words), "{}", refused.stderr);
    }
}
