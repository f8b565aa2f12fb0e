//! Figures that an optimisation should reach, from a file of operands.

use std::path::Path;

use crate::common::{read, run_fails, run_ok};
use serde_json::Value;

/// The value of an operand, by the beginning of its name.
fn value(figures: &Value, of: &str) -> f64 {
    let all = figures["operands"].as_array().unwrap();
    let found = all.iter().find(|o| o["of"].as_str().unwrap().starts_with(of));
    found.unwrap_or_else(|| panic!("{of} in {all:?}"))["value"].as_f64().unwrap()
}

#[test]
fn contrast_is_raised_and_bounds_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(
        "mtf.toml",
        "spot_weight = 0.0\n[[operand]]\nof = \"mtf\"\nfrequency_per_mm = 60.0\nat_least = 1.0\n",
    );
    let lens = "cooke-triplet-spot";
    let optimize = |operands: &str, out: &str| {
        let limits = ["--iterations", "40", "--json"];
        run_ok(
            folder.path(),
            &[&["lens", "optimize", lens, "--operands", operands, "--out", out], &limits[..]].concat(),
        )
        .json()
    };
    let found = optimize("mtf.toml", "mtf");
    // One figure for each field; their mean rises although the spots are the least already.
    let mean = |figures: &Value| {
        let all = figures["operands"].as_array().unwrap();
        assert_eq!(all.len(), 4, "{all:?}");
        all.iter().map(|o| o["value"].as_f64().unwrap()).sum::<f64>() / 4.0
    };
    let (before, after) = (mean(&found["start"]), mean(&found["best"]));
    assert!(after > before + 0.01, "{before} {after}");
    assert!(value(&found["best"], "MTF at 60/mm, 15 deg") > 0.0);
    // At the start the image plane is where the spots are least.
    let rms = found["start"]["mean_rms_spot_um"].as_f64().unwrap();
    assert!(rms < 7.8, "{rms}");

    // The distortion of the spot lens is pressed below a bound, at the price of spots; its track keeps one that it has already.
    let bounds = "[[operand]]\nof = \"track\"\nat_most = 50.0\nweight_um = 1000.0\n\
        [[operand]]\nof = \"distortion\"\nfield_deg = 14.0\nat_most = 0.005\nweight_um = 1000.0\n";
    write("bounds.toml", bounds);
    let found = optimize("bounds.toml", "bounds");
    let [start, best] =
        ["start", "best"].map(|of| ["track", "distortion"].map(|figure| value(&found[of], figure)));
    assert!(start[0] == 0.0 && best[0] == 0.0 && start[1] > 0.1 && best[1] < 0.01, "{start:?} {best:?}");
    let rms = |of: &str| found[of]["mean_rms_spot_um"].as_f64().unwrap();
    assert!(rms("best") > rms("start"), "{} {}", rms("best"), rms("start"));
    // The goal is kept with the folder.
    let resumed = ["lens", "optimize", "--resume", "bounds", "--iterations", "2", "--json"];
    let track = value(&run_ok(folder.path(), &resumed).json()["best"], "track");
    assert!(track < 0.05, "{track}");
    // The printed table has the figure with its bound, beside the plain one.
    let again = ["lens", "optimize", "--resume", "bounds", "--iterations", "3"];
    let table = run_ok(folder.path(), &again).stdout;
    let row = |name: &str| table.lines().filter(|line| line.starts_with(name)).count();
    assert_eq!([row("track, at most 50 "), row("track to the image")], [1, 1], "{table}");
}

#[test]
fn a_bound_binds_whatever_its_weight_and_a_missed_one_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let optimize = |operands: &str, out: &str| {
        let args = ["lens", "optimize", "cooke-triplet-nominal", "--operands", operands, "--out", out];
        run_ok(folder.path(), &[&args[..], &["--iterations", "60"]].concat())
    };
    let distortion = |table: &str| {
        let row = table.lines().find(|line| line.starts_with("distortion  ")).unwrap().to_owned();
        row.split_whitespace().rev().nth(1).unwrap().parse::<f64>().unwrap()
    };
    for (name, weight) in [("plain", ""), ("light", "weight_um = 1.0\n")] {
        write(
            &format!("{name}.toml"),
            &format!("[[operand]]\nof = \"distortion\"\nat_most = 0.01\n{weight}"),
        );
        let table = optimize(&format!("{name}.toml"), name).stdout;
        assert!(distortion(&table).abs() <= 1.0, "{table}");
        assert!(!table.contains("not met: "), "{table}");
        assert!(table.contains("not met at the start: distortion: "), "{table}");
    }
    // No triplet of this speed reaches it.
    write(
        "mtf.toml",
        "[[operand]]\nof = \"mtf\"\nfield_deg = 15.0\nfrequency_per_mm = 60.0\nat_least = 0.99\n",
    );
    let table = optimize("mtf.toml", "mtf").stdout;
    assert!(table.contains("not met: MTF at 60/mm, 15 deg: 0.") && table.contains(" for 0.9900"), "{table}");
    assert!(table.contains("no lens was found that keeps every limit"), "{table}");
}

/// A lens of the tests of the jobs, with its image plane far from where its spots are least.
fn write_double_gauss(folder: &Path) {
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../petzval-jobs/tests/lenses/double-gauss.toml");
    std::fs::write(folder.join("lens.toml"), read(Path::new(lens))).unwrap();
}

/// A descent for operands ends no higher than the lens to which the spots alone lead.
#[test]
fn operands_do_not_stop_a_descent_that_the_spots_lead_on() {
    let folder = tempfile::tempdir().unwrap();
    write_double_gauss(folder.path());
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("spot.toml", "[[operand]]\nof = \"spot\"\nat_most = 4.0\nweight_um = 10.0\n");
    write("mtf.toml", "[[operand]]\nof = \"mtf\"\nfrequency_per_mm = 40.0\nat_least = 0.6\n");
    write("wavefront.toml", "[[operand]]\nof = \"wavefront\"\nat_most = 0.3\n");
    let merit_um = |lens: &str, iterations: &str, out: &str, more: &[&str]| {
        let args = ["lens", "optimize", lens, "--iterations", iterations, "--out", out];
        run_ok(folder.path(), &[&args[..], more].concat());
        let steps = read(&folder.path().join(out).join("history.jsonl"));
        let last: Value = serde_json::from_str(steps.lines().last().unwrap()).unwrap();
        last["merit_um"].as_f64().unwrap()
    };
    merit_um("lens.toml", "60", "plain", &[]);
    for of in ["spot", "mtf", "wavefront"] {
        let more = ["--operands", &format!("{of}.toml")];
        let known = merit_um("plain/best.toml", "0", &format!("known-{of}"), &more);
        let found = merit_um("lens.toml", "60", of, &more);
        assert!(found < 1.1 * known, "{of}: {found} against {known}");
    }
}

/// Limits and operands on the image do not move the image plane of the start from where its spots are least.
#[test]
fn the_start_stands_where_its_spots_are_least_whatever_is_demanded() {
    let folder = tempfile::tempdir().unwrap();
    write_double_gauss(folder.path());
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("distortion.toml", "[[operand]]\nof = \"distortion\"\nat_most = 0.01\n");
    write(
        "mtf.toml",
        "spot_weight = 0.0\n[[operand]]\nof = \"mtf\"\nfrequency_per_mm = 40.0\nat_least = 0.6\n",
    );
    let start_um = |out: &str, more: &[&str]| {
        let args = ["lens", "optimize", "lens.toml", "--iterations", "0", "--out", out, "--json"];
        let found = run_ok(folder.path(), &[&args[..], more].concat()).json();
        found["start"]["mean_rms_spot_um"].as_f64().unwrap()
    };
    let least = start_um("plain", &[]);
    for (out, more) in [
        ("a", ["--distortion", "1"]),
        ("b", ["--track", "130"]),
        ("c", ["--operands", "distortion.toml"]),
        ("d", ["--operands", "mtf.toml"]),
    ] {
        let found = start_um(out, &more);
        assert!((found / least - 1.0).abs() < 1e-4, "{more:?}: {found} against {least}");
    }
}

#[test]
fn files_that_say_nothing_sensible_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (text, needles) in [
        ("spot_weight = 1.0\noperand = []\n", &["there are no operands", "[[operand]]"][..]),
        ("[[operand]]\nof = \"mtf\"\nat_least = 0.5\n", &["frequency_per_mm", "a positive frequency"][..]),
        (
            "[[operand]]\nof = \"track\"\nat_least = 5.0\n",
            &["the figure has no such bound", "at_most for"][..],
        ),
        ("[[operand]]\nof = \"mft\"\nat_least = 5.0\n", &["mft", "mtf"][..]),
        ("[[operand]]\nof = \"spot\"\nat_most = 5.0\nwaves = true\n", &["only contrast"][..]),
        ("[[operand]]\nof = \"focal-length\"\nat_least = 9.0\nat_most = 8.0\n", &["is above at_most"][..]),
        ("[[operand]]\nof = \"spot\"\nat_most = nan\n", &["must be a number"][..]),
        (
            "[[operand]]\nof = \"spot\"\nat_most = 1.0\nfield_deg = 95.0\n",
            &["RMS spot, 95 deg", "no such figure"][..],
        ),
    ] {
        std::fs::write(folder.path().join("o.toml"), text).unwrap();
        let optimize =
            ["lens", "optimize", "cooke-triplet-nominal", "--operands", "o.toml", "--out", "never"];
        run_fails(folder.path(), &optimize, 2, needles);
        assert!(!folder.path().join("never").exists(), "{text}");
    }
}
