//! `petzval sensor`: show a sensor, simulate its captures, measure it from them.

use std::path::Path;

use crate::common::{self, read, run, run_fails, run_ok};

/// A small series of a built-in sensor; returns its folder's name.
fn capture(folder: &Path, name: &str, more: &[&str]) -> String {
    let args = ["sensor", "capture", "imx249-fitted", "--out", name, "--size", "60x80", "--format", "png"];
    run_ok(folder, &[&args[..], more].concat());
    name.to_owned()
}

#[test]
fn a_sensor_is_shown_with_its_derived_figures() {
    let folder = tempfile::tempdir().unwrap();
    let shown =
        run_ok(folder.path(), &["sensor", "show", "imx249-fitted", "--gains", "1,10", "--json"]).json();
    let at = |i: usize, key: &str| shown["derived"][i][key].as_f64().unwrap();
    assert_eq!(shown["sensor"]["gain_dn_per_e"], 0.14);
    assert!((at(0, "dark_noise_e") - 7.9646).abs() < 1e-4 && (at(1, "dark_noise_e") - 4.0589).abs() < 1e-4);
    let text = run_ok(folder.path(), &["sensor", "show", "imx249-fitted"]).stdout;
    assert!(text.contains("Sony IMX249") && text.contains("28389") && text.contains("converter"), "{text}");
    run_fails(
        folder.path(),
        &["sensor", "show", "imx249"],
        2,
        &["no sensor called `imx249`", "imx249-fitted"],
    );
    run_fails(
        folder.path(),
        &["sensor", "show", "imx249-fitted", "--gains", "0"],
        2,
        &["--gains 0", "positive"],
    );
}

/// A monochrome sensor with all figures of the standard; its converter ends before the full well.
const UNEVEN: &str = r#"name = "uneven"
source = "a test"
height = 120
width = 160
pixel_um = 3.45
bits = 12
black_level_dn = 64.0
gain_dn_per_e = 0.3799999999999999
full_well_e = 12000.0
dark_current_e_per_s = 25.0
read_noise_mean_e = 0.0
read_noise_e = 2.3
electronics_mean_dn = 0.0
electronics_noise_dn = 0.3
electronics = "before_adc"
relative_qe = [1.0, 1.0, 1.0]
cfa = "mono"
gain_steps = [1.0, 2.0]
[nonuniformity]
dsnu_pixel_e = 2.0
dsnu_row_e = 0.6
dsnu_column_e = 0.8
prnu_pixel_percent = 0.8
prnu_row_percent = 0.3
prnu_column_percent = 0.3
[quantum_efficiency]
wavelength_um = [0.4, 0.53, 0.9]
clear = [0.4, 0.65, 0.1]
"#;

#[test]
fn a_sensor_is_shown_and_listed_in_a_few_digits() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("uneven.toml"), UNEVEN).unwrap();
    let text = run_ok(folder.path(), &["sensor", "show", "uneven.toml"]).stdout;
    for line in [
        "system gain K 0.38 DN/e-",
        "colour filters none (monochrome)",
        "linear gains 1, 2",
        "quantum efficiency 65 % at 0.53 um, the highest",
        "DSNU, pixels 2 e-",
        "PRNU, columns 0.3 %",
        "pixels 160 x 120 of 3.45 um: 0.55 x 0.41 mm",
    ] {
        let is_it = |l: &str| l.split_whitespace().collect::<Vec<_>>().join(" ").starts_with(line);
        assert!(text.lines().any(is_it), "{line}:\n{text}");
    }
    assert!(!text.contains("over green") && !text.contains("hot pixels"), "{text}");
    let colour = run_ok(folder.path(), &["sensor", "show", "imx249-fitted"]).stdout;
    assert!(colour.contains("red over green") && colour.contains("non-uniformity"), "{colour}");

    let listed = run_ok(folder.path(), &["sensor", "list"]).stdout;
    let json = run_ok(folder.path(), &["sensor", "list", "--json"]).json();
    assert_eq!(json.as_array().unwrap().len() + 1, listed.lines().count());
    for sensor in json.as_array().unwrap() {
        let name = sensor["name"].as_str().unwrap();
        assert!(listed.lines().any(|l| l.starts_with(name)), "{name}: {listed}");
        assert!(sensor["source"].as_str().unwrap().len() > 20, "{name}");
        run_ok(folder.path(), &["sensor", "show", name]);
    }
}

#[test]
fn the_series_of_the_standard_gives_every_figure() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("uneven.toml"), UNEVEN).unwrap();
    let args = ["sensor", "capture", "uneven.toml", "--out", "series", "--emva", "--stack", "25"];
    let captured = run_ok(folder.path(), &args);
    // 60 flat and 60 + 10 dark pairs, one of which is among the 60, and two stacks of 25.
    assert!(captured.says("308 frames, 12 MB"), "{}", captured.stderr);
    let list = read(&at("series/captures.toml"));
    assert!(list.contains("wavelength_um = 0.53") && list.contains("photons"), "{list}");
    let measured =
        run_ok(folder.path(), &["sensor", "characterize", "series/captures.toml", "--json"]).json();
    let channel = &measured["gains"][0]["channels"][0];
    let figure = |name: &str| {
        let all = channel["figures"].as_array().unwrap();
        let found = all.iter().find(|f| f["name"] == name).unwrap();
        let best = found.get("corrected").unwrap_or(&found["value"]);
        let number = |key: &str| best[key].as_f64().unwrap_or_else(|| panic!("{name}: {best}"));
        (number("value"), number("standard_error"))
    };
    for (name, truth) in [
        ("K", 0.38),
        ("QE", 65.0),
        ("DSNU1288_pixel", 2.0),
        ("DSNU1288_row", 0.6),
        ("DSNU1288_col", 0.8),
        ("PRNU1288_pixel", 0.8),
        ("PRNU1288_row", 0.3),
        ("PRNU1288_col", 0.3),
    ] {
        let (value, se) = figure(name);
        // Eight figures at once: five standard errors, and for the specimen's own draw a share of its rows' number.
        let specimen = if name.contains("row") || name.contains("col") { 0.3 * truth } else { 0.03 * truth };
        assert!((value - truth).abs() < 5.0 * se + specimen, "{name}: {value} +- {se}, not {truth}");
    }
    // Every figure of the standard is printed; of a straight response the errors of linearity are noise.
    let text = run_ok(folder.path(), &["sensor", "characterize", "series"]).stdout;
    let sheet = text.split("gain 1, mono").nth(1).unwrap();
    let mut unresolved = sheet.lines().filter(|line| line.contains("not resolved"));
    let of_linearity = |line: &str| {
        let (why, names) = line.rsplit_once(": ").unwrap();
        why.ends_with("is within two standard errors of zero") && names.starts_with("LE_m")
    };
    assert!(unresolved.all(of_linearity), "{text}");
    assert!(text.contains("sensor capture --gains 1,2,4") && !text.contains("over green"), "{text}");

    // An interrupted series is reported, and is continued.
    std::fs::remove_file(at("series/captures.toml")).unwrap();
    let half = ["sensor", "characterize", "series"];
    run_fails(folder.path(), &half, 2, &["series.toml without captures.toml", "capture` again"]);
    run_ok(folder.path(), &args);
    assert_eq!(read(&at("series/captures.toml")), list);
    let frame = ["sensor", "characterize", "uneven.toml"];
    run_fails(folder.path(), &frame, 2, &["no list of captures", "captures.toml"]);
    // Light for which the sensor file has no curve.
    let args = ["sensor", "capture", "imx273-mono", "--out", "no", "--emva", "--wavelength", "0.5"];
    run_fails(folder.path(), &args, 2, &["wavelength", "no quantum efficiency"]);
}

#[test]
fn captures_are_simulated_and_measured() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let three = ["--gains", "1,5.62,31.62", "--stack", "6", "--quantum-efficiency", "0.6"];
    capture(folder.path(), "series", &three);
    assert!(read(&at("series/captures.toml")).contains("photons"));
    assert!(!at("series/gain-1/flat-5ms-0.partial.png").exists());

    // The same command keeps existing frames; another series is refused.
    let args =
        ["sensor", "capture", "imx249-fitted", "--out", "series", "--size", "60x80", "--format", "png"];
    let again = run_ok(folder.path(), &[&args[..], &three, &["--json"]].concat()).json();
    assert_eq!(again["kept"], again["frames"]);
    run_fails(
        folder.path(),
        &[&args[..], &["--seed", "9"]].concat(),
        2,
        &["another series", "choose another folder"],
    );

    let args = ["sensor", "characterize", "series", "--out", "found", "--fit-histograms"];
    let first = run_ok(folder.path(), &args);
    for needle in ["K at linear gain 1", "+-", "electronics noise sigma_el", "fitted to", "gain 31.62, blue"]
    {
        assert!(first.stdout.contains(needle), "{needle}: {}", first.stdout);
    }
    assert!(first.stdout.contains("not resolved: the series does not reach saturation"), "{}", first.stdout);
    // Every fit is tested, and says so.
    let tests = first.stdout.split("fits, tested at 1e-4").nth(1).unwrap();
    for fit in ["K over the gains", "dark mean over K", "dark mean over time", "linearity", "histograms"] {
        assert!(
            tests.lines().any(|line| line.trim().starts_with(fit) && line.contains("hold")),
            "{fit}: {tests}"
        );
    }
    let names = ["sensor.toml", "results.json", "histograms.csv", "emva-gain-1-green.xml"];
    let results: Vec<String> = names.iter().map(|name| read(&at(&format!("found/{name}")))).collect();
    // A result that cannot be written leaves no others.
    std::fs::create_dir_all(at("blocked/sensor.toml")).unwrap();
    let blocked = ["sensor", "characterize", "series", "--out", "blocked"];
    run_fails(folder.path(), &blocked, 1, &["sensor.toml"]);
    // The number of threads does not matter.
    let again = ["sensor", "characterize", "series", "--out", "again", "--fit-histograms", "--threads", "1"];
    assert_eq!(run_ok(folder.path(), &again).stdout, first.stdout);
    for (name, text) in names.iter().zip(&results) {
        assert_eq!(&read(&at(&format!("again/{name}"))), text, "{name}");
    }
    let json = run_ok(folder.path(), &["sensor", "characterize", "series", "--json"]).json();
    let k = json["joint"]["gain_dn_per_e"]["value"].as_f64().unwrap();
    assert!((k - 0.14).abs() < 0.005, "{k}");
    let xml = roxmltree::Document::parse(&results[3]).unwrap();
    assert!(xml.descendants().any(|node| node.has_tag_name("DSNU1288_row")));

    // The measured sensor can be shown and simulated: here the model of the histogram fit.
    let shown = run_ok(folder.path(), &["sensor", "show", "found/sensor.toml", "--json"]).json();
    let results: serde_json::Value = serde_json::from_str(&results[1]).unwrap();
    let fitted = &results["histogram_fit"]["gain_dn_per_e"]["value"];
    assert!((fitted.as_f64().unwrap() - 0.14).abs() < 0.005, "{fitted}");
    assert_eq!(&shown["sensor"]["gain_dn_per_e"], fitted);
    assert_eq!(shown["sensor"]["cfa"], "RGGB");

    // Its captures are made at its gain steps.
    let args = ["sensor", "capture", "found/sensor.toml", "--out", "next"];
    run_ok(folder.path(), &[&args[..], &["--exposures", "5", "--dark-exposures", "5"]].concat());
    assert_eq!(read(&at("next/captures.toml")).matches("linear_gain = 31.62").count(), 2);
}

#[test]
fn the_series_of_the_library_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let series = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../petzval-lab/tests/fixtures/emva/emva_dataset/seed_parameters_exposure_series");
    let series = series.display().to_string();
    let args = ["sensor", "characterize", &series, "--compatible", "--pixel-um", "5.86", "--json"];
    let json = run_ok(folder.path(), &args).json();
    let figures = json["gains"][0]["channels"][0]["figures"].as_array().unwrap();
    let figure = |name: &str| figures.iter().find(|f| f["name"] == name).unwrap();
    let k = figure("K")["value"]["value"].as_f64().unwrap();
    assert!((k - 0.141_097_231_5).abs() < 1e-9, "{k}");
    assert!(figure("PRNU1288_row")["value"]["not_resolved"].as_str().unwrap().contains("negative"));
    // The corrected values have the requested filter.
    assert_eq!(json["options"]["high_pass"], "r4");
    let other = run_ok(folder.path(), &[&args[..], &["--highpass", "r3.1"]].concat()).json();
    assert_eq!(other["options"]["high_pass"], "r3.1");
    assert_eq!(
        other["gains"][0]["channels"][0]["library_transfer"],
        json["gains"][0]["channels"][0]["library_transfer"]
    );
}

#[test]
fn corrupt_and_incomplete_captures_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--gains", "1,2", "--dark-exposures", "2.5,20"];
    let whole = capture(folder.path(), "whole", &more);
    let lock = petzval::base::WorkLock::passing(&folder.path().join(&whole).join("work.lock"), b"").unwrap();
    let again =
        ["sensor", "capture", "imx249-fitted", "--out", whole.as_str(), "--size", "60x80", "--format", "png"];
    let again = [&again[..], &more].concat();
    run_fails(folder.path(), &again, 2, &["another process is working on this series of captures"]);
    drop(lock);
    run_ok(folder.path(), &again);
    assert!(!folder.path().join(&whole).join("work.lock").exists());
    // Each case changes a copy of the series.
    let case = |name: &str, change: &dyn Fn(&Path), needles: &[&str]| {
        let copy = folder.path().join(name);
        common::copy_folder(&folder.path().join(&whole), &copy);
        change(&copy);
        run_fails(folder.path(), &["sensor", "characterize", name, "--out", "never"], 2, needles);
    };
    let edit = |from: &'static str, to: &'static str| {
        move |copy: &Path| {
            let list = copy.join("captures.toml");
            let text = read(&list);
            assert!(text.contains(from), "{text}");
            std::fs::write(&list, text.replacen(from, to, 1)).unwrap();
        }
    };
    let frame = "gain-2/flat-5ms-1.png";
    case(
        "no-list",
        &|c| ["captures.toml", "series.toml"].iter().for_each(|f| std::fs::remove_file(c.join(f)).unwrap()),
        &["neither captures.toml nor"],
    );
    case(
        "no-frame",
        &|c| std::fs::remove_file(c.join(frame)).unwrap(),
        &["captures.toml:", frame, "is not there"],
    );
    case(
        "cut",
        &|c| {
            let bytes = std::fs::read(c.join(frame)).unwrap();
            std::fs::write(c.join(frame), &bytes[..bytes.len() / 2]).unwrap();
        },
        &[frame, "help:"],
    );
    let picture = |c: &Path, width: u32, dn: u16| {
        image::ImageBuffer::from_pixel(width, 60, image::Luma([dn])).save(c.join(frame)).unwrap();
    };
    case("size", &|c| picture(c, 70, 200), &[frame, "70 x 60 pixels", "80 x 60"]);
    case("value", &|c| picture(c, 80, 5000), &[frame, "5000", "12 bits", "4095"]);
    case("key", &edit("bits = 12", "bitts = 12"), &["captures.toml:", "bitts", "did you mean `bits`?"]);
    case("range", &edit("exposure_ms = 2.5", "exposure_ms = -2.5"), &["exposure_ms", "-2.5", "milliseconds"]);
    case(
        "single",
        &edit("\"gain-1/flat-2.5ms-0.png\", ", ""),
        &["captures.toml:", "1 frame: two are needed", "difference of two frames"],
    );
    case(
        "twice",
        &edit("exposure_ms = 5.0", "exposure_ms = 2.5"),
        &["flat, gain 1, 2.5 ms, 2 frames is listed already in line"],
    );
    case(
        "copy",
        &|c| {
            std::fs::copy(c.join("gain-2/flat-5ms-0.png"), c.join(frame)).unwrap();
        },
        &["captures.toml:", frame, "is a copy of", "one after the other"],
    );
    case("toml", &edit("[sensor]", "[sensor"), &["captures.toml:1"]);
    run_fails(folder.path(), &["sensor", "characterize", "nowhere"], 2, &["nowhere", "no such folder"]);
    run_fails(folder.path(), &["sensor", "characterize", "whole", "--pixel-um", "nan"], 2, &["--pixel-um"]);

    // Impossible series.
    for (args, needles) in [
        (&["--size", "60"][..], ["--size 60", "rows x columns"]),
        (&["--size", "5000x80"], ["--size: 5000x80 does not fit", "--help"]),
        (&["--gains", "1,1"], ["--gains: 1 is there twice", "--help"]),
        (&["--gains=-1"], ["--gains -1: must lie between", "0.001"]),
        (&["--stack", "2"], ["--stack: 2 frames", "3 to 4096"]),
        (&["--quantum-efficiency", "60"], ["--quantum-efficiency 60: must lie between", "60 % is 0.6"]),
        (&["--level", "nan"], ["--level NaN: must lie between 1e-4 and 10", "above 1 saturates"]),
    ] {
        let all = [&["sensor", "capture", "imx249-fitted", "--out", "new"][..], args].concat();
        run_fails(folder.path(), &all, 2, &needles);
    }
    // Warnings go to stderr, and the rest is measured.
    std::fs::remove_file(folder.path().join("whole/captures.toml")).unwrap();
    let flat = "\n[[point]]\nkind = \"flat\"\nexposure_ms = 5\nframes = [\"gain-1/flat-5ms-0.png\", \"gain-1/flat-5ms-1.png\"]\n";
    let list = format!("[sensor]\nname = \"x\"\nbits = 12\n{flat}");
    std::fs::write(folder.path().join("whole/captures.toml"), list).unwrap();
    let lone = run(folder.path(), &["sensor", "characterize", "whole", "--out", "lone"]);
    assert_eq!(lone.code, Some(0), "{}", lone.stderr);
    assert!(lone.says("warning: no-dark: flat, gain 1, 5 ms, 2 frames"), "{}", lone.stderr);
    assert!(lone.stdout.contains("not resolved"), "{}", lone.stdout);
    // K is not resolved: there are results, but no sensor file.
    assert!(lone.says("warning: no-sensor-file: K is not resolved"), "{}", lone.stderr);
    let there = |name: &str| folder.path().join("lone").join(name).exists();
    assert!(there("results.json") && there("report.html") && !there("sensor.toml"));
    // A sensor file of an earlier run is removed.
    std::fs::write(folder.path().join("lone/sensor.toml"), "# of another run").unwrap();
    run_ok(folder.path(), &["sensor", "characterize", "whole", "--out", "lone", "--force"]);
    assert!(!there("sensor.toml"));
}

#[test]
fn a_useless_series_is_an_error_and_many_warnings_are_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let name = capture(folder.path(), "series", &["--gains", "1", "--dark-exposures", "18.3"]);
    let list = folder.path().join(&name).join("captures.toml");
    let whole = read(&list);
    let swapped = whole.replace("\"flat\"", "\"x\"").replace("\"dark\"", "\"flat\"");
    std::fs::write(&list, swapped.replace("\"x\"", "\"dark\"")).unwrap();
    let needles = ["captures.toml", "are flat and dark swapped?", "light fell on the sensor"];
    run_fails(folder.path(), &["sensor", "characterize", "series", "--out", "never"], 2, &needles);
    assert!(!folder.path().join("never").exists());

    // The dark frames of two points are missing: one line reports both, the results name each.
    let points: Vec<&str> = whole.split("[[point]]").collect();
    let lacks = |p: &&&str| p.contains("\"dark\"") && (p.contains("= 5.0") || p.contains("= 7.5"));
    let kept: Vec<&str> = points.iter().filter(|p| !lacks(p)).copied().collect();
    assert_eq!(points.len() - kept.len(), 2);
    std::fs::write(&list, kept.join("[[point]]")).unwrap();
    let done = run(folder.path(), &["sensor", "characterize", "series", "--json"]);
    let lines: Vec<&str> = done.stderr.lines().filter(|l| l.contains("no-dark")).collect();
    assert_eq!(lines.len(), 1, "{}", done.stderr);
    assert!(lines[0].contains("2 times, first: flat, gain 1, 5 ms"), "{}", lines[0]);
    let json = done.json();
    let each = json["warnings"].as_array().unwrap().iter();
    assert_eq!(each.filter(|w| w.as_str().unwrap().starts_with("no-dark")).count(), 2);
    // Exposure times are printed as in the list.
    assert!(done.stdout.contains("\"exposure_s\": 0.0183"), "{}", done.stdout);
}
