//! `petzval psf`: arrays of unit sum, a picture, and their axes.

use std::path::Path;

use crate::common::{data, read, read_json, run, run_fails, run_ok};

const LENS: &str = "cooke-triplet-nominal";
const QUICK: [&str; 6] = ["--fields", "3", "--grid", "32", "--pupil-cells", "32"];

fn npy(path: &Path) -> (Vec<u64>, Vec<f64>) {
    let bytes = std::fs::read(path).unwrap();
    let file = npyz::NpyFile::new(&bytes[..]).unwrap();
    (file.shape().to_vec(), file.into_vec().unwrap())
}

#[test]
fn psfs_have_unit_sum_and_named_axes() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_ok(folder.path(), &[&["psf", LENS, "--out", "new/psf", "--json"], &QUICK[..]].concat());
    let out = folder.path().join("new/psf");
    let (shape, values) = npy(&out.join("psf.npy"));
    assert_eq!(shape, [3, 3, 32, 32]);
    for psf in values.chunks_exact(32 * 32) {
        assert!(psf.iter().all(|v| *v >= 0.0));
        assert!((psf.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
    let (shape, illumination) = npy(&out.join("illumination.npy"));
    assert_eq!(shape, [3, 3]);
    assert!(illumination.iter().all(|v| *v > 0.3 && *v <= 1.0), "{illumination:?}");
    assert!(illumination[0] > illumination[6], "the corner is darker than the middle");

    // Three cells a pixel, so that labels fit, in three columns and four rows, with labels around them.
    let picture = image::open(out.join("psf.png")).unwrap();
    assert!(picture.width() > 3 * 96 && picture.height() > 4 * 96);
    let axes = read_json(&out.join("psf.json"));
    assert_eq!(axes, shown.json());
    assert_eq!(axes["axes"], serde_json::json!(["field", "wavelength", "row", "column"]));
    assert_eq!(axes["wavelengths_um"], serde_json::json!([0.62, 0.55, 0.486]));
    let corner = axes["field_deg"][2].as_f64().unwrap();
    // 14.84 degrees without the distortion of 5.9 %.
    assert!((corner - 15.77).abs() < 0.01, "{corner}");
    // Such a small grid cuts off the corner's PSF, which is reported.
    assert!(shown.says("warning: at 15.77 degrees the grid of 32 um holds"));
}

#[test]
fn the_default_is_thirteen_fields_of_128_cells() {
    let folder = tempfile::tempdir().unwrap();
    let shown =
        run_ok(folder.path(), &["psf", LENS, "--out", "psf", "--pupil-cells", "32", "--pupil-error", "2"]);
    let (shape, values) = npy(&folder.path().join("psf/psf.npy"));
    assert_eq!(shape, [13, 3, 128, 128]);
    for psf in values.chunks_exact(128 * 128) {
        assert!((psf.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
    // The PSFs at the corner are larger than the grid.
    assert!(shown.says("degrees the grid of 128 um holds 99 % of the light"), "{}", shown.stderr);
}

#[test]
fn psfs_do_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    for threads in ["1", "2", "3"] {
        let args = ["psf", LENS, "--out", threads, "--threads", threads];
        run_ok(folder.path(), &[&args, &QUICK[..]].concat());
    }
    let bytes = |threads: &str| std::fs::read(folder.path().join(threads).join("psf.npy")).unwrap();
    assert!(bytes("1") == bytes("2") && bytes("1") == bytes("3"));
}

#[test]
fn wavelengths_are_three_numbers_with_commas() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["psf", LENS, "--out", "psf", "--wavelengths", "0.6,0.5,0.45"];
    run_ok(folder.path(), &[&args, &QUICK[..]].concat());
    let axes = read_json(&folder.path().join("psf/psf.json"));
    assert_eq!(axes["wavelengths_um"], serde_json::json!([0.6, 0.5, 0.45]));
}

#[test]
fn wrong_requests_for_psfs_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for (option, value, needles) in [
        (
            "--wavelengths",
            "550,500,450",
            ["--wavelengths 550: must lie between 0.2 and 20 um", "did you mean 0.55?"],
        ),
        ("--wavelengths", "0.6,0.5", ["--wavelengths: needs three numbers", "0.62,0.55,0.486"]),
        ("--fields", "1", ["--fields 1: must lie between 2 and 201", "2 to 201"]),
        ("--grid", "8", ["--grid 8: must lie between 16 and 1024", "16 to 1024"]),
        ("--pitch-um", "0", ["--pitch-um 0: must lie between 1e-6 and 1000 um", "a length"]),
        ("--pitch-um", "nan", ["--pitch-um NaN: must lie between", "um"]),
        ("--pupil-cells", "33", ["--pupil-cells", "even"]),
        ("--corner-mm", "100", ["no chief ray lands 16.667 mm from the axis", "try a smaller --corner-mm"]),
    ] {
        let value = format!("{option}={value}");
        run_fails(folder.path(), &["psf", LENS, "--out", "psf", &value], 2, &needles);
    }
}

/// PSFs of a part of the lens say so, and fields beyond those of the lens file are no fault of the grid.
#[test]
fn fields_are_compared_with_those_of_the_lens_file() {
    let folder = tempfile::tempdir().unwrap();
    let with_corner = |mm: &'static str, out: &'static str| {
        run(folder.path(), &[&["psf", LENS, "--corner-mm", mm, "--out", out], &QUICK[..]].concat())
    };
    let part = with_corner("2", "part");
    assert_eq!(part.code, Some(0), "{}", part.stderr);
    // 25.0 mm of focal length: 2 mm are 4.6 degrees.
    assert!(
        part.says("the PSFs go to 4.") && part.says(" of the 15 degrees of the lens file"),
        "{}",
        part.stderr
    );
    let whole = with_corner("6.634", "whole");
    assert!(!whole.says("the PSFs go to"), "{}", whole.stderr);

    let beyond = with_corner("10", "beyond");
    assert_eq!(beyond.code, Some(2), "{}", beyond.stderr);
    assert!(beyond.says("no light reaches the image at 25.1"), "{}", beyond.stderr);
    assert!(
        beyond.says("fields to 15 degrees, 6.") && beyond.says("a smaller --corner-mm"),
        "{}",
        beyond.stderr
    );
    assert!(!beyond.says("a larger --grid"), "{}", beyond.stderr);
}

/// A larger grid is no remedy for a lens 1 mm out of focus.
#[test]
fn light_beyond_the_grid_of_a_lens_out_of_focus_has_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let text = read(&data("lenses/cooke-triplet-nominal.toml")).replacen("24.525171", "25.525171", 1);
    std::fs::write(folder.path().join("moved.toml"), text).unwrap();
    let shown = run_ok(folder.path(), &[&["psf", "moved.toml", "--out", "psf"], &QUICK[..]].concat());
    assert!(shown.says("of the light") && shown.says("moved.toml: out of focus"), "{}", shown.stderr);
    assert!(
        shown.says("`petzval lens focus moved.toml OUT.toml`") && !shown.says("--focus best"),
        "{}",
        shown.stderr
    );
    let sharp = run_ok(folder.path(), &[&["psf", LENS, "--out", "sharp"], &QUICK[..]].concat());
    assert!(!sharp.says("out of focus"), "{}", sharp.stderr);
}

#[test]
fn a_path_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    let failed = run(folder.path(), &[&["psf", LENS, "--out", "file/psf"], &QUICK[..]].concat());
    assert_eq!(failed.code, Some(2), "{}", failed.stderr);
    assert!(failed.says("file/psf: nothing can be written there: file is no folder"), "{}", failed.stderr);
}
