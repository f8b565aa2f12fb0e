//! Every number that the EMVA 1288 Python library derives from its simulated series, to 1e-6 relative.

use std::path::{Path, PathBuf};

use petzval_lab::emva::high_pass::{Plane, high_pass_5x5_times_25};
use petzval_lab::emva::histogram::{Histogram, histogram};
use petzval_lab::emva::spatial::StackVariances;
use petzval_lab::emva::spectrogram::{column_spectrogram, row_spectrogram};
use petzval_lab::emva::{Captures, ChannelResult, HighPass, Options, Unresolved, characterize};
use serde_json::Value;

const TOLERANCE: f64 = 1e-6;

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/emva")
}

fn reference(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("emva_reference.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn rows(value: &Value) -> Plane {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(list).collect();
    Plane { height: rows.len(), width: rows[0].len(), values: rows.concat() }
}

#[track_caller]
fn close(what: &str, ours: f64, theirs: f64) {
    assert!((ours - theirs).abs() <= TOLERANCE * theirs.abs(), "{what}: {ours} instead of {theirs}");
}

/// Lists may hold a zero (or a difference that cancels to one) beside large numbers.
#[track_caller]
fn all_close(what: &str, ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{what}: length");
    let largest = theirs.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (i, (a, b)) in ours.iter().zip(theirs).enumerate() {
        let tolerance = TOLERANCE * b.abs() + 1e-12 * largest;
        assert!((a - b).abs() <= tolerance, "{what}[{i}]: {a} instead of {b}");
    }
}

fn check_histogram(name: &str, ours: &Histogram, theirs: &Value) -> usize {
    all_close(&format!("{name} bins"), &ours.bins, &list(&theirs["bins"]));
    all_close(&format!("{name} values"), &ours.values, &list(&theirs["values"]));
    all_close(&format!("{name} model"), &ours.model, &list(&theirs["model"]));
    3 * ours.bins.len()
}

fn check_spatial(found: &StackVariances, suffix: &str, theirs: &Value) -> usize {
    let at = |name: &str| number(&theirs[format!("{name}{suffix}")]);
    close("L", found.frames as f64, at("L"));
    close("avg_mean", found.mean_dn, at("avg_mean"));
    close("var_mean", found.variances.temporal, at("var_mean"));
    close("avg_var", found.variances.measured, at("avg_var"));
    close("avg_var_cav", found.variances.column_means, at("avg_var_cav"));
    close("avg_var_rav", found.variances.row_means, at("avg_var_rav"));
    6
}

fn channel(folder: &Path, name: &str, options: &Options) -> ChannelResult {
    let mut captures = Captures::open(&folder.join("emva_dataset").join(name)).unwrap();
    captures.sensor.pixel_um = Some(34.3396_f64.sqrt());
    let found = characterize(&captures, options, &|_| Ok(())).unwrap();
    let [gain] = &found.gains[..] else { panic!("one gain") };
    let [channel] = &gain.channels[..] else { panic!("one colour") };
    channel.clone()
}

/// Compares all numbers of a series; returns how many.
fn check(folder: &Path, name: &str) -> usize {
    let all = reference(folder);
    let theirs = &all["datasets"][name];
    let ours = channel(folder, name, &Options { high_pass: HighPass::None, ..Options::default() });
    let mut compared = 0;

    let temporal = &theirs["temporal"];
    for (key, values) in [
        ("texp", ours.points.iter().map(|p| 1e9 * p.exposure_s).collect::<Vec<f64>>()),
        ("u_p", ours.points.iter().filter_map(|p| p.photons).collect()),
        ("u_y", ours.points.iter().map(|p| p.mean_dn).collect()),
        ("s2_y", ours.points.iter().map(|p| p.variance_dn2).collect()),
        ("u_ydark", ours.points.iter().map(|p| p.dark_mean_dn).collect()),
        ("s2_ydark", ours.points.iter().map(|p| p.dark_variance_dn2).collect()),
    ] {
        all_close(key, &values, &list(&temporal[key]));
        compared += values.len();
    }

    let spatial = ours.spatial.as_ref().unwrap();
    compared += check_spatial(&spatial.flat, "", &theirs["spatial_scalars"]);
    compared += check_spatial(&spatial.dark, "_dark", &theirs["spatial_scalars"]);

    let linearity = ours.library_transfer.linearity.as_ref().unwrap();
    close("fit_slope", linearity.slope, number(&theirs["linearity"]["fit_slope"]));
    close("fit_offset", linearity.offset_dn, number(&theirs["linearity"]["fit_offset"]));
    let deviations = list(&theirs["linearity"]["relative_deviation"]);
    all_close("relative_deviation", &linearity.deviation_percent, &deviations);
    close("LE min", linearity.min_percent, number(&theirs["linearity"]["linearity_error_min"]));
    close("LE max", linearity.max_percent, number(&theirs["linearity"]["linearity_error_max"]));
    compared += 4 + deviations.len();

    for (key, entry) in theirs["results"].as_object().unwrap() {
        if let Some(data) = entry.get("data") {
            let ours = match key.as_str() {
                "histogram_DSNU" => &spatial.dsnu.histogram,
                "histogram_DSNU_accumulated" => &spatial.dsnu.accumulated,
                "histogram_PRNU" => &spatial.prnu.histogram,
                "histogram_PRNU_accumulated" => &spatial.prnu.accumulated,
                other => panic!("{other} is not compared"),
            };
            compared += check_histogram(key, ours, data);
            continue;
        }
        let figure = ours.figure(key).unwrap_or_else(|| panic!("there is no figure {key}"));
        match entry["value"].as_f64() {
            Some(value) => close(key, figure.value.value().unwrap_or(f64::NAN), value),
            None => assert!(figure.value.reason().is_some(), "{key} is {:?}", figure.value),
        }
        compared += 1;
    }
    assert_eq!(ours.figures.len() + 4, theirs["results"].as_object().unwrap().len());
    compared
}

#[test]
fn the_series_of_the_papers_sensor_gives_the_numbers_of_the_library() {
    let compared = check(&fixtures(), "seed_parameters_exposure_series");
    assert!(compared > 1500, "{compared}");
}

/// The two longer series are not part of the project: `PETZVAL_EMVA` names the folder of `emva_reference.json`.
#[test]
fn longer_series_give_the_numbers_of_the_library_if_available() {
    let Some(folder) = std::env::var_os("PETZVAL_EMVA").map(PathBuf::from) else { return };
    for name in ["exposure_series", "illumination_series", "seed_parameters_exposure_series"] {
        let compared = check(&folder, name);
        assert!(compared > 1500, "{name}: {compared}");
        println!("{name}: {compared} numbers agree to {TOLERANCE:e}");
    }
}

#[test]
fn filters_spectra_and_histograms_give_the_numbers_of_the_library() {
    let all = reference(&fixtures());
    let input = rows(&all["high_pass_5x5"]["input"]);
    let whole: Vec<i64> = input.values.iter().map(|v| *v as i64).collect();
    let (filtered, ..) = high_pass_5x5_times_25(&whole, input.height, input.width);
    let theirs = rows(&all["high_pass_5x5"]["output"]);
    assert_eq!(filtered, theirs.values.iter().map(|v| *v as i64).collect::<Vec<i64>>());
    // The filter in real numbers is the same, 25 times smaller.
    let real = HighPass::R31.apply(&input).unwrap();
    let times_25: Vec<f64> = real.values.iter().map(|v| 25.0 * v).collect();
    all_close("high pass", &times_25, &theirs.values);

    let picture = rows(&all["FFT1288"]["input"]);
    all_close("FFT of rows", &row_spectrogram(&picture), &list(&all["FFT1288"]["rows"]));
    all_close("FFT of columns", &column_spectrogram(&picture), &list(&all["FFT1288"]["cols"]));

    check_histogram("histogram", &histogram(&whole, 16), &all["histogram1288"]);
}

#[test]
fn wrong_numbers_of_the_library_have_a_corrected_value() {
    // This simulator has no non-uniformity at all: what is found must be within noise of zero.
    let ours = channel(&fixtures(), "seed_parameters_exposure_series", &Options::default());
    for name in ["DSNU1288_row", "DSNU1288_col", "PRNU1288_row", "PRNU1288_col", "PRNU1288_pixel"] {
        let figure = ours.figure(name).unwrap();
        let reason = figure.best().reason();
        assert!(
            matches!(reason, Some(Unresolved::WithinNoise { .. } | Unresolved::NegativeVariance(_))),
            "{name}: {figure:?}"
        );
    }
    // The library calls 0.79 % PRNU what is mostly noise of the temporal variance.
    let prnu = ours.figure("PRNU1288").unwrap();
    assert!(prnu.value.value().is_some());
}
