//! Gradient estimators of shot noise against draws of another generator (NumPy, 2 million each) and exact sums.

use serde_json::Value;

use super::*;
use crate::sensor::noise::{FrameStreams, RATE_FLOOR_E, ShotScratch};
use petzval_base::random::place;

/// The functions of the study: name, value, derivative.
type Function = (&'static str, fn(f64) -> f64, fn(f64) -> f64);

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-(x - 10.0) / 3.0).exp())
}

const FUNCTIONS: [Function; 5] = [
    ("identity", |x| x, |_| 1.0),
    ("square", |x| x * x, |x| 2.0 * x),
    (
        "root",
        |x| (x + 1.0).max(0.0).sqrt(),
        |x| if x > -1.0 { 0.5 / (x + 1.0).max(1e-9).sqrt() } else { 0.0 },
    ),
    ("clip", |x| x.min(40.0), |x| if x < 40.0 { 1.0 } else { 0.0 }),
    ("sigmoid", sigmoid, |x| sigmoid(x) * (1.0 - sigmoid(x)) / 3.0),
];

const MODES: [(NoiseMode, &str); 4] = [
    (NoiseMode::StraightThrough, "straight_through"),
    (NoiseMode::HalfStep, "half_step"),
    (NoiseMode::Gaussian, "gaussian"),
    (NoiseMode::Dequantised, "dequantised"),
];

const ROWS: usize = 20;
const WIDTH: usize = 50_000;
const STUDY: f64 = 2e6;

/// Two-sided normal quantile of the family-wise alpha 1e-4 over 25 cases with 6 estimators and up to three tests each.
const Z: f64 = 5.1;

/// A million draws of electrons at one rate, and their derivatives with respect to it.
fn draws(mode: NoiseMode, rate: f64) -> (Vec<f64>, Vec<f64>) {
    let frame = Capture { frame: rate.to_bits(), ..capture(1.0, 1.0, 1.0) };
    let streams = FrameStreams::new(&noise(mode), &frame);
    let (rates, mut scratch) = (vec![rate; WIDTH], ShotScratch::default());
    let (mut x, mut d) = (vec![0.0; ROWS * WIDTH], vec![0.0; ROWS * WIDTH]);
    for (row, (x, d)) in x.chunks_exact_mut(WIDTH).zip(d.chunks_exact_mut(WIDTH)).enumerate() {
        streams.electrons_row(&rates, place(row, 0), &mut scratch, x, d);
    }
    (x, d)
}

fn study() -> Vec<Value> {
    let text = include_str!("../../../tests/fixtures/poisson_estimators.json");
    let fixture: Value = serde_json::from_str(text).unwrap();
    assert_eq!(fixture["samples"].as_f64(), Some(STUDY));
    let rows = fixture["results"].as_array().unwrap().clone();
    assert_eq!(rows.len(), 25);
    rows
}

/// Compares the mean and the spread of draws with the study; returns the mean and its standard error.
fn agrees(what: &str, draws: impl Iterator<Item = f64> + Clone, study: &Value) -> (f64, f64) {
    let [study_mean, study_std] = [0, 1].map(|i| study[i].as_f64().unwrap());
    let (n, mean, variance, fourth) = moments(draws);
    // Equal draws must equal those of the study, up to the rounding of the mean of a million numbers.
    if study_std < 1e-12 {
        assert!(variance < 1e-24 && (mean - study_mean).abs() <= 1e-12, "{what}: {mean} {study_mean}");
        return (mean, 0.0);
    }
    let inverse = 1.0 / n + 1.0 / STUDY;
    let z_mean = (mean - study_mean) / (variance * inverse).sqrt();
    assert!(z_mean.abs() < Z, "{what}: mean {mean} {study_mean}, z {z_mean}");
    // Skip the spread where rare draws dominate it: a million draws do not determine its error.
    let kurtosis = fourth / (variance * variance);
    if kurtosis < 100.0 {
        let error = ((fourth - variance * variance) * inverse).sqrt() / (2.0 * variance.sqrt());
        let z_std = (variance.sqrt() - study_std) / error.max(1e-12);
        assert!(z_std.abs() < Z, "{what}: std {} {study_std}, z {z_std}", variance.sqrt());
    }
    (mean, (variance / n).sqrt())
}

#[test]
fn every_mode_has_the_bias_and_spread_of_the_study() {
    for chunk in study().chunks(5) {
        let rate = chunk[0]["lambda"].as_f64().unwrap();
        for (mode, name) in MODES {
            let (x, d) = draws(mode, rate);
            for (row, (function, _, derivative)) in chunk.iter().zip(FUNCTIONS) {
                assert_eq!(row["f"], function);
                let what = format!("{function} at {rate}, {name}");
                let exact = row["exact"].as_f64().unwrap();
                let gradients = x.iter().zip(&d).map(|(x, d)| derivative(*x) * d);
                // Where the function is flat, only extremely rare draws have a gradient.
                if exact.abs() < 1e-20 {
                    assert!(gradients.sum::<f64>().abs() / (ROWS * WIDTH) as f64 <= 1e-15, "{what}");
                    continue;
                }
                let (mean, error) = agrees(&what, gradients, &row[name]);
                // The dequantised mode is unbiased for the mean of f over its own draws.
                if mode == NoiseMode::Dequantised {
                    let drawn = row["exact_dequantised"].as_f64().unwrap();
                    assert!((mean - drawn).abs() < Z * error, "{what}: {mean} {drawn}");
                }
            }
        }
    }
}

#[test]
fn biases_are_as_documented() {
    // Percent of the exact gradient of whole counts for sqrt(N + 1), as the documentation of the modes states them.
    let stated: [(f64, [f64; 4]); 3] =
        [(0.3, [18.7, -1.2, -6.8, 1.5]), (3.0, [8.1, -0.3, 1.0, 0.4]), (40.0, [0.6, 0.0, 0.0, 0.0])];
    let study = study();
    for (rate, biases) in stated {
        let row = study.iter().find(|r| r["lambda"].as_f64() == Some(rate) && r["f"] == "root").unwrap();
        let exact = row["exact"].as_f64().unwrap();
        for ((mode, name), bias) in MODES.into_iter().zip(biases) {
            let (x, d) = draws(mode, rate);
            let (n, mean, variance, _) =
                moments(x.iter().zip(&d).map(|(x, d)| FUNCTIONS[2].2(*x) * d / exact * 100.0));
            let off = mean - 100.0 - bias;
            assert!(off.abs() < 0.051 + 4.0 * (variance / n).sqrt(), "{name} at {rate}: {}", mean - 100.0);
        }
    }
}

#[test]
fn below_the_rate_floor_gradients_have_the_documented_bias() {
    // Gradients of x, x^2 and sqrt(x + 1) with respect to the rate, against exact sums: the gradient of the mean over the
    // mode's own draws plus the documented bias. Twelve tests, family-wise alpha 1e-4.
    const Z: f64 = 4.5;
    let test = |what: &str, gradients: Vec<f64>, expected: f64| {
        let (n, mean, variance, _) = moments(gradients.iter().copied());
        let z = (mean - expected) / (variance / n).sqrt();
        assert!(z.abs() < Z, "{what}: {mean} {expected}, z {z}");
    };
    for (rate, stated) in [(0.005, 20.5), (0.01, 18.2), (0.025, 11.3)] {
        let dark = 1.0 - rate / RATE_FLOOR_E;
        let law = |k: usize| (k as f64 * rate.ln() - rate - libm::lgamma(k as f64 + 1.0)).exp();
        // E over the count and over t in the middles of 2000 cells.
        let mean_of = |g: &dyn Fn(f64, f64) -> f64| -> f64 {
            let cells = (0..2000).map(|i| (i as f64 + 0.5) / 2000.0);
            (0..8).map(|k| law(k) * cells.clone().map(|t| g(k as f64, t)).sum::<f64>() / 2000.0).sum()
        };
        let (x, d) = draws(NoiseMode::Dequantised, rate);
        // The gradient of the mean over the draws, and the bias.
        let exact = |f: &dyn Fn(f64) -> f64, derivative: &dyn Fn(f64) -> f64| {
            let bend = mean_of(&|n, t| (1.0 - t) * (derivative(n + t + 0.5) - derivative(n + t - 0.5)));
            (mean_of(&|n, t| f(n + t + 0.5) - f(n + t - 0.5)), -dark * bend)
        };
        for (name, f, derivative) in &FUNCTIONS[..3] {
            let (drawn, bias) = exact(f, derivative);
            let gradients = x.iter().zip(&d).map(|(x, d)| derivative(*x) * d).collect();
            test(&format!("dequantised {name} at {rate}"), gradients, drawn + bias);
        }
        let (drawn, bias) = exact(&FUNCTIONS[2].1, &FUNCTIONS[2].2);
        assert!((100.0 * bias / drawn - stated).abs() < 0.05, "{bias} {drawn}");
        // A square root after read noise of 4 e-, summed over +-6 standard deviations in steps of one eighth.
        let read: Vec<(f64, f64)> =
            (-48..=48).map(|i| i as f64 / 8.0).map(|z| (4.0 * z, (-z * z / 2.0).exp())).collect();
        let total: f64 = read.iter().map(|(_, weight)| weight).sum();
        let behind = |g: &dyn Fn(f64) -> f64, x: f64| {
            read.iter().map(|(e, weight)| weight * g(x + e + 30.0)).sum::<f64>() / total
        };
        let (drawn, bias) = exact(&|x| behind(&f64::sqrt, x), &|x| behind(&|y| 0.5 / y.sqrt(), x));
        assert!(bias > 0.0 && bias < 0.01 * drawn, "{bias} {drawn}");
        // E x^2 = rate^2 + rate, and f'' = 2.
        let (x, d) = draws(NoiseMode::Gaussian, rate);
        let gradients = x.iter().zip(&d).map(|(x, d)| 2.0 * x * d).collect();
        let bias = -(1.0 - (rate / RATE_FLOOR_E).sqrt());
        test(&format!("gaussian square at {rate}"), gradients, 2.0 * rate + 1.0 + bias);
    }
}

#[test]
fn electrons_have_the_moments_of_their_mode() {
    // Mean and variance of the draws; ten tests, family-wise alpha 1e-4.
    for (mode, shift, extra) in [
        (NoiseMode::Exact, 0.0, 0.0),
        (NoiseMode::StraightThrough, 0.0, 0.0),
        (NoiseMode::HalfStep, 0.5, 0.0),
        (NoiseMode::Dequantised, 0.0, 1.0 / 12.0),
        (NoiseMode::Gaussian, 0.0, 0.0),
    ] {
        let rate = 30.0;
        let (x, d) = draws(mode, rate);
        let (n, mean, variance, fourth) = moments(x.iter().copied());
        let z_mean = (mean - rate - shift) / (variance / n).sqrt();
        let z_variance = (variance - rate - extra) / ((fourth - variance * variance) / n).sqrt();
        assert!(z_mean.abs() < 4.42 && z_variance.abs() < 4.42, "{mode:?}: {z_mean} {z_variance}");
        assert_eq!(d.iter().all(|d| *d == 0.0), mode == NoiseMode::Exact);
    }
}
