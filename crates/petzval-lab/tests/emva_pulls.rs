//! Figures of simulated linear sensors of many kinds: deviations from the truth, in their standard errors, scatter by one about zero.

mod common;

use std::collections::BTreeMap;

use common::bench::{Bench, Correlation, FULL_E};
use petzval_lab::emva::figures::of_light;
use petzval_lab::emva::goodness::ALPHA;
use petzval_lab::emva::{Measured, Verdict, fits};
use rayon::prelude::*;

fn shares(first: f64, last: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| (first + (last - first) * i as f64 / (count - 1) as f64) * FULL_E).collect()
}

/// Linear sensors, from small to large gain, of all that a figure may depend on.
fn sensors() -> Vec<(&'static str, Bench)> {
    let base = Bench {
        size: [48, 72],
        linear_gains: vec![1.0, 2.0, 4.0],
        dsnu_e: 3.0,
        prnu: 0.01,
        dark_current_e_per_s: 200.0,
        stack: 8,
        ..Bench::default()
    };
    let of = |change: &dyn Fn(&mut Bench)| {
        let mut bench = base.clone();
        change(&mut bench);
        bench
    };
    vec![
        ("base", base.clone()),
        (
            "electronics noise",
            of(&|b| {
                b.linear_gains = vec![1.0, 2.0, 4.0, 8.0];
                b.read_noise_e = 4.0;
                b.electronics_noise_dn = 3.0;
            }),
        ),
        (
            "8 bits",
            of(&|b| {
                b.bits = 8;
                b.gain_dn_per_e = 0.03;
                b.read_noise_e = 20.0;
                b.black_dn = vec![8.3];
                b.linear_gains = vec![1.0, 2.0, 4.0];
                b.dsnu_e = 25.0;
            }),
        ),
        (
            "8 bits, rounding",
            of(&|b| {
                b.bits = 8;
                b.gain_dn_per_e = 0.03;
                b.read_noise_e = 8.0;
                b.black_dn = vec![8.3, 8.7, 9.1];
                b.dsnu_e = 12.0;
            }),
        ),
        (
            "16 bits, one gain",
            of(&|b| {
                b.bits = 16;
                b.gain_dn_per_e = 5.0;
                b.linear_gains = vec![1.0];
                b.read_noise_e = 1.2;
                b.black_dn = vec![500.0];
                b.dsnu_e = 0.6;
                b.prnu = 0.004;
            }),
        ),
        (
            "full well",
            of(&|b| {
                b.full_well_e = 6000.0;
                b.flat_e = shares(0.05, 0.9, 12);
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "converter ends",
            of(&|b| {
                b.flat_e = shares(0.1, 1.5, 10);
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "full well, coarse",
            of(&|b| {
                b.full_well_e = 6000.0;
                b.flat_e = shares(0.1, 1.1, 6);
                b.linear_gains = vec![1.0];
                b.prnu = 0.02;
            }),
        ),
        (
            "no photons",
            of(&|b| {
                b.bits = 14;
                b.gain_dn_per_e = 1.0;
                b.has_photons = false;
                b.full_well_e = 5000.0;
                b.flat_e = shares(0.05, 0.8, 10);
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "three exposures",
            of(&|b| {
                b.flat_e = shares(0.2, 0.6, 3);
                b.linear_gains = vec![1.0];
                b.dark_s = vec![0.08];
            }),
        ),
        (
            "many exposures",
            of(&|b| {
                b.flat_e = shares(0.02, 0.6, 25);
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "four frames",
            of(&|b| {
                b.frames = 4;
                b.flat_e = shares(0.1, 0.6, 4);
                b.stack = 16;
            }),
        ),
        (
            "large DSNU",
            of(&|b| {
                b.dsnu_e = 20.0;
                b.prnu = 0.004;
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "rows",
            of(&|b| {
                b.row_noise_e = 1.7;
                b.dsnu_row_e = 2.0;
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "rows wander",
            of(&|b| {
                b.size = [96, 48];
                b.row_noise_e = 1.7;
                b.rows = Correlation::Wanders(0.8);
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "pairs of rows",
            of(&|b| {
                b.row_noise_e = 1.7;
                b.rows = Correlation::Groups(2);
                b.linear_gains = vec![1.0];
            }),
        ),
        (
            "colours",
            of(&|b| {
                b.size = [96, 144];
                b.cfa = "RGGB";
                b.linear_gains = vec![1.0, 4.0];
            }),
        ),
        (
            "dark current",
            of(&|b| {
                b.dark_current_e_per_s = 5000.0;
                b.linear_gains = vec![1.0];
            }),
        ),
    ]
}

/// Deviations of the figures from the truth in their standard errors, and the tests of the fits.
struct Series {
    pulls: Vec<(String, f64)>,
    p_values: Vec<(&'static str, f64)>,
    alarms: Vec<&'static str>,
    unresolved: Vec<String>,
}

fn series(bench: &Bench) -> Series {
    let found = bench.measured();
    let (mut pulls, mut unresolved): (Vec<(String, f64)>, Vec<String>) = Default::default();
    let mut add = |name: &str, found: Measured, truth: f64| match (found.value(), found.standard_error()) {
        (Some(value), Some(error)) => pulls.push((name.to_owned(), (value - truth) / error)),
        _ => unresolved.push(name.to_owned()),
    };
    let b = bench;
    let lines2 = b.row_noise_e.powi(2) + b.column_noise_e.powi(2);
    let read2 = b.read_noise_e.powi(2) + lines2;
    let el2 = b.electronics_noise_dn.powi(2);
    for (i, gain) in found.gains.iter().enumerate() {
        let k = b.gain_dn_per_e * gain.linear_gain;
        add("dark mean slope", gain.dark.mean.slope, b.dark_current_e_per_s * k);
        add("dark mean intercept", gain.dark.mean.intercept, b.black_dn[i % b.black_dn.len()]);
        add("dark variance slope", gain.dark.variance.slope, b.dark_current_e_per_s * k * k);
        add("dark variance intercept", gain.dark.variance.intercept, read2 * k * k + el2 + 1.0 / 12.0);
        add("row noise", gain.line_noise.row_dn2, (b.row_noise_e * k).powi(2));
        add("column noise", gain.line_noise.column_dn2, (b.column_noise_e * k).powi(2));
        for channel in &gain.channels {
            let mut figure = |name: &str, truth: f64| add(name, channel.figure(name).unwrap().best(), truth);
            let sigma_y = (read2 * k * k + el2 + 1.0 / 12.0).sqrt();
            let u_e_min = sigma_y / k + 0.5;
            figure("K", k);
            figure("inverse_K", 1.0 / k);
            if b.has_photons {
                figure("R", 0.5 * k);
                figure("QE", 50.0);
                figure("u_p_min", 2.0 * u_e_min);
            }
            figure("sigma_d", (read2 + el2 / (k * k)).sqrt());
            figure("sigma_y_dark", sigma_y);
            figure("u_I_mean", b.dark_current_e_per_s);
            figure("u_I_var", b.dark_current_e_per_s);
            let full = b.full_well_e.min((f64::from((1u32 << b.bits) - 1) - b.black_dn[0]) / k);
            // The signal is above the dark of its exposure time.
            let full = full - full * 1e-6 * b.dark_current_e_per_s;
            figure("u_e_min", u_e_min);
            if channel.transfer.saturated {
                figure("u_e_sat", full);
                if b.has_photons {
                    figure("u_p_sat", 2.0 * full);
                }
                figure("SNR_max", full.sqrt());
                figure("DR", full / u_e_min);
            }
            if let Some(linearity) = &channel.transfer.linearity {
                let [least, largest] = linearity.response_percent;
                add("least deviation of the response", least, 0.0);
                add("largest deviation of the response", largest, 0.0);
            }
            let Some(spatial) = &channel.spatial else { continue };
            let half = spatial.exposure_s * 1e6;
            let (pixel, row) = ((b.dsnu_e * k).powi(2), (b.dsnu_row_e * k).powi(2));
            let light = (b.prnu * half * k).powi(2);
            let (dark, flat) = (&spatial.dark_components, &spatial.flat_components);
            add("dark total", dark.total, pixel + row);
            add("dark pixel", dark.pixel, pixel);
            add("dark row", dark.row, row);
            add("dark column", dark.column, 0.0);
            add("flat total", flat.total, pixel + row + light);
            add("flat pixel", flat.pixel, pixel + light);
            add("flat row", flat.row, row);
            add("flat column", flat.column, 0.0);
            let [light_total, light_row, light_column, light_pixel] = of_light(flat, dark, spatial.shared);
            add("light total", light_total, light);
            add("light row", light_row, 0.0);
            add("light column", light_column, 0.0);
            add("light pixel", light_pixel, light);
            let mut figure = |name: &str, truth: f64| add(name, channel.figure(name).unwrap().best(), truth);
            figure("DSNU1288", (pixel + row).sqrt() / k);
            figure("DSNU1288_DN", (pixel + row).sqrt());
            figure("DSNU1288_pixel", b.dsnu_e);
            if row > 0.0 {
                figure("DSNU1288_row", b.dsnu_row_e);
            }
            figure("PRNU1288", 100.0 * b.prnu);
            figure("PRNU1288_pixel", 100.0 * b.prnu);
        }
    }
    let joint = &found.joint;
    add("joint K", joint.gain_dn_per_e, b.gain_dn_per_e);
    add("joint mu_I", joint.dark_current_e_per_s, b.dark_current_e_per_s);
    add("joint mu_I of the variance", joint.dark_current_variance_e_per_s, b.dark_current_e_per_s);
    add("joint mu_I of the median", joint.dark_current_median_e_per_s, b.dark_current_e_per_s);
    add("joint mu_I of the ordinary", joint.dark_current_ordinary_e_per_s, b.dark_current_e_per_s);
    add("joint mu_I difference", joint.dark_current_difference_e_per_s, 0.0);
    if b.row_noise_e > 0.0 {
        add("joint row noise", joint.row_noise_e, b.row_noise_e);
    }
    if found.gains.len() > 2 {
        add("joint sigma_r^2", joint.variance_line.slope, read2);
        add("joint sigma_el^2", joint.variance_line.intercept, el2 + 1.0 / 12.0);
        if b.black_dn.len() == 1 {
            add("joint mu_r", joint.mean_line.slope, 0.0);
            add("joint BL", joint.mean_line.intercept, b.black_dn[0]);
        }
    }
    let all = fits(&found);
    let tested = || all.iter().filter(|fit| fit.test.verdict != Verdict::Untested);
    let alarms = tested().filter(|fit| fit.test.verdict != Verdict::Holds).map(|fit| fit.name).collect();
    let p_values = tested()
        .flat_map(|fit| [Some(fit.test.p_value), fit.test.curvature_p_value].map(|p| Some((fit.name, p?))))
        .flatten()
        .collect();
    Series { pulls, p_values, alarms, unresolved }
}

/// Where the noise of rounding rules, its error is that of an unknown phase: no pull is larger, most are smaller.
const ROUNDED: &str = "8 bits, rounding";

/// Mean and scatter of pulls.
struct Pulls {
    mean: f64,
    scatter: f64,
}

impl Pulls {
    fn of(pulls: &[f64]) -> Self {
        let n = pulls.len() as f64;
        let mean = pulls.iter().sum::<f64>() / n;
        Self { mean, scatter: (pulls.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / n).sqrt() }
    }

    /// A mean within 0.3 and a scatter of 0.8 to 1.25, but for the chance of so many series: 3.9 standard errors of either, once in ten thousand.
    fn are_right(&self, series: f64, may_be_small: bool) -> bool {
        let (of_mean, of_scatter) = (3.9 / series.sqrt(), 3.9 / (2.0 * series).sqrt());
        self.mean.abs() < 0.3 + of_mean
            && self.scatter < 1.25 + of_scatter
            && (may_be_small || self.scatter > 0.8 - of_scatter)
    }
}

/// Series of each sensor: as many as `PETZVAL_SEEDS` says.
fn seeds_or(few: u64) -> u64 {
    std::env::var("PETZVAL_SEEDS").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}

#[test]
fn figures_scatter_about_the_truth_by_their_standard_errors() {
    let seeds = seeds_or(6);
    let sensors = sensors();
    let plan: Vec<(usize, u64)> =
        (0..sensors.len()).flat_map(|i| (0..seeds).map(move |seed| (i, seed))).collect();
    let found: Vec<Series> = plan
        .par_iter()
        .map(|(i, seed)| series(&Bench { seed: 1 + 100_000 * *i as u64 + seed, ..sensors[*i].1.clone() }))
        .collect();

    // Sort the pulls by figure and sensor.
    let mut by_figure: BTreeMap<&str, BTreeMap<&str, Vec<f64>>> = BTreeMap::new();
    for ((i, _), series) in plan.iter().zip(&found) {
        for (figure, pull) in &series.pulls {
            by_figure.entry(figure).or_default().entry(sensors[*i].0).or_default().push(*pull);
        }
    }
    let mut wrong = Vec::new();
    for (figure, by_sensor) in &by_figure {
        let is_hidden = |sensor: &str| {
            found.iter().zip(&plan).any(|(series, (i, _))| {
                sensors[*i].0 == sensor && series.unresolved.iter().any(|name| name == figure)
            })
        };
        let mut check = |sensor: &str, pulls: &[f64], series: f64| {
            let of = Pulls::of(pulls);
            let line = format!(
                "{figure:28} {sensor:20} mean {:+.2}, scatter {:.2} of {}",
                of.mean,
                of.scatter,
                pulls.len()
            );
            let is_right = of.are_right(series, sensor == ROUNDED);
            if sensor == "all" || !is_right {
                println!("{line}");
            }
            if !is_right {
                wrong.push(line);
            }
        };
        // What is not resolved within noise leaves a choice of the larger values, whose pulls say nothing.
        let resolved: Vec<(&&str, &Vec<f64>)> =
            by_sensor.iter().filter(|(sensor, _)| !is_hidden(sensor)).collect();
        for (sensor, pulls) in &resolved {
            check(sensor, pulls, seeds as f64);
        }
        let free = || resolved.iter().filter(|(sensor, _)| **sensor != ROUNDED);
        let pooled: Vec<f64> = free().flat_map(|(_, pulls)| pulls.iter().copied()).collect();
        if !pooled.is_empty() {
            check("all", &pooled, (seeds as usize * free().count()) as f64);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");

    // Tests of a model that holds fail as often as their level says.
    let p_values: Vec<f64> = found.iter().flat_map(|series| &series.p_values).map(|(_, p)| *p).collect();
    let tests = p_values.len() as f64;
    for level in [0.1, 0.01, 0.001] {
        let share = p_values.iter().filter(|p| **p < level).count() as f64 / tests;
        println!("{share:.4} of {tests} tests below {level}");
        // Fits of one series have points in common: their counts scatter as those of a third of as many.
        let chance = 3.9 * (3.0 * level * (1.0 - level) / tests).sqrt();
        assert!((share - level).abs() < chance + 0.3 * level, "{share} of {tests} tests are below {level}");
    }
    let alarms: Vec<&str> = found.iter().flat_map(|series| &series.alarms).copied().collect();
    let expected = ALPHA * tests;
    println!("{} false alarms in {tests} tests: {alarms:?}", alarms.len());
    assert!(alarms.len() as f64 <= 1.0 + expected + 3.9 * expected.sqrt(), "{alarms:?}");
}

/// Deviations of a response from its line, percent: the line with weights of one over the squared signal.
fn deviations_percent(light: &[f64], signal: &[f64]) -> Vec<f64> {
    let weight: Vec<f64> = signal.iter().map(|y| y.powi(-2)).collect();
    let mean = |of: &dyn Fn(usize) -> f64| {
        (0..light.len()).map(|i| weight[i] * of(i)).sum::<f64>() / weight.iter().sum::<f64>()
    };
    let (x, y) = (mean(&|i| light[i]), mean(&|i| signal[i]));
    let slope = mean(&|i| (light[i] - x) * (signal[i] - y)) / mean(&|i| (light[i] - x).powi(2));
    light.iter().zip(signal).map(|(l, s)| 100.0 * (s / (y + slope * (l - x)) - 1.0)).collect()
}

#[test]
fn errors_of_linearity_are_those_of_the_response() {
    for compression in [0.01, 0.03] {
        let bench = Bench { size: [48, 72], flat_e: shares(0.05, 0.6, 10), compression, ..Bench::default() };
        let signal: Vec<f64> =
            bench.flat_e.iter().map(|e| e * (1.0 - compression * (e + 1.0) / FULL_E)).collect();
        // The brightest point is beyond 95 % of itself.
        let last = signal.len() - 1;
        let truth = deviations_percent(&bench.flat_e[..last], &signal[..last]);
        let ends = [f64::min, f64::max].map(|f| truth.iter().copied().reduce(f).unwrap());
        let seeds = seeds_or(30);
        let pulls: Vec<[f64; 2]> = (1..=seeds)
            .into_par_iter()
            .map(|seed| {
                let found = Bench { seed, ..bench.clone() }.measured();
                let channel = &found.gains[0].channels[0];
                let linearity = channel.transfer.linearity.as_ref().unwrap();
                // The figures are the extremes of the points: never crossed, and resolved where the response bends by more than noise.
                let [least, largest] = ["LE_min", "LE_max"].map(|name| channel.figure(name).unwrap().best());
                assert!(least.value().is_none_or(|v| v == linearity.min_percent), "{least:?}");
                assert!(largest.value().is_none_or(|v| v == linearity.max_percent), "{largest:?}");
                [0, 1].map(|k| {
                    let response = linearity.response_percent[k];
                    (response.value().unwrap() - ends[k]) / response.standard_error().unwrap()
                })
            })
            .collect();
        for k in [0, 1] {
            let of = Pulls::of(&pulls.iter().map(|p| p[k]).collect::<Vec<f64>>());
            println!("{compression}: LE {:.3} %, mean {:+.2}, scatter {:.2}", ends[k], of.mean, of.scatter);
            assert!(
                of.are_right(seeds as f64, false),
                "{compression}, {k}: {:+.2} {:.2}",
                of.mean,
                of.scatter
            );
        }
    }
}

#[test]
fn figures_of_linearity_are_the_extremes_of_the_points_where_they_are_resolved() {
    let bench = |compression| Bench {
        size: [48, 72],
        flat_e: shares(0.05, 0.6, 10),
        compression,
        ..Bench::default()
    };
    let figures = |found: &petzval_lab::emva::Characterization| {
        ["LE_min", "LE_max"].map(|name| found.gains[0].channels[0].figure(name).unwrap().best())
    };
    let bent = bench(0.03).measured();
    let [least, largest] = figures(&bent).map(|figure| figure.value().unwrap());
    let linearity = bent.gains[0].channels[0].transfer.linearity.as_ref().unwrap();
    assert_eq!([least, largest], [linearity.min_percent, linearity.max_percent]);
    assert!(least < 0.0 && largest > 0.0, "{least} {largest}");
    // A straight response: noise alone has extremes.
    let resolved = (1..=8).map(|seed| Bench { seed, ..bench(0.0) }.measured());
    let resolved: usize =
        resolved.map(|found| figures(&found).iter().filter(|figure| figure.value().is_some()).count()).sum();
    assert!(resolved <= 3, "{resolved} of 16");
}
