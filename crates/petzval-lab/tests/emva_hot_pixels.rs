//! The loop closes for hot pixels: a sensor that has some is captured, characterised, and made again from its file.

mod common;

use common::{small_mono, within};
use petzval_camera::SensorModel;
use petzval_camera::sensor::NonUniformity;
use petzval_lab::emva::counts::Counts;
use petzval_lab::emva::{Captures, Characterization, Options, Plan, characterize, sensor_toml, write_series};

fn hot() -> SensorModel {
    small_mono(
        10_500.0,
        NonUniformity {
            specimen: 3,
            dsnu_pixel_e: 2.0,
            dsnu_row_e: 0.4,
            dsnu_column_e: 0.8,
            hot_pixel_share: 0.002,
            hot_pixel_e_per_s: 2000.0,
            ..NonUniformity::default()
        },
    )
}

fn plan() -> Plan {
    Plan {
        height: 200,
        width: 300,
        gains: vec![1.0, 2.0, 4.0],
        flat_ms: vec![0.5, 1.0, 2.0, 4.0],
        dark_ms: vec![10.0, 20.0, 100.0, 1000.0],
        stack: 8,
        seed: 1,
        ..Plan::default()
    }
}

fn captured(sensor: &SensorModel, plan: &Plan) -> Characterization {
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, plan, folder.path(), &|| Ok(())).unwrap();
    characterize(&Captures::open(folder.path()).unwrap(), &Options::default(), &|_| Ok(())).unwrap()
}

/// Histogram of the dark frames of a second at gain 1.
fn dark_second(found: &Characterization) -> &Counts {
    let histogram =
        found.histograms.iter().find(|h| h.colour.is_none() && h.linear_gain == 1.0 && h.exposure_s == 1.0);
    &histogram.unwrap().counts
}

#[test]
fn hot_pixels_are_separated_from_the_dark_current_of_the_others() {
    let sensor = hot();
    let found = captured(&sensor, &plan());
    let joint = &found.joint;
    // EMVA's dark current is the mean of all pixels, 120 of 60000 of them hot: it is no number of the sensor file.
    assert!(joint.dark_current_e_per_s.value().unwrap() > 7.0, "{:?}", joint.dark_current_e_per_s);
    within("mu_I without hot pixels", joint.dark_current_ordinary_e_per_s, 5.0, 3.0);
    within("median mu_I", joint.dark_current_median_e_per_s, 5.0, 3.0);
    within("share of hot pixels", joint.hot_pixel_share, 0.002, 3.0);
    within("mean excess of hot pixels", joint.hot_pixel_e_per_s, 2000.0, 3.0);
    assert!(joint.hot_pixel_share.standard_error().unwrap() < 0.0003);
    let names: Vec<&str> = found.warnings.iter().map(|w| w.name()).collect();
    assert_eq!(names, ["hot-pixels"], "{:?}", found.warnings);

    // The one dark current of a gain: that of all its dark frames, in the figures as in the rows of the joint fit.
    for (gain, row) in found.gains.iter().zip(&joint.rows) {
        let figure = gain.channels[0].figure("u_I_mean").unwrap().best().value().unwrap();
        let of_row = row.dark_current_mean_e_per_s.value().unwrap();
        assert!((figure - of_row).abs() < 1e-9 * of_row, "{figure} {of_row}");
    }

    // The file makes a sensor whose dark frames are distributed as those that were captured, of another specimen.
    let text = sensor_toml(&found).unwrap();
    let back = petzval_files::parse_sensor(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let value = |m: petzval_lab::emva::Measured| m.value().unwrap();
    assert_eq!(back.dark_current_e_per_s, value(joint.dark_current_ordinary_e_per_s));
    assert_eq!(back.nonuniformity.hot_pixel_share, value(joint.hot_pixel_share));
    assert_eq!(back.nonuniformity.hot_pixel_e_per_s, value(joint.hot_pixel_e_per_s));
    let again = SensorModel { nonuniformity: NonUniformity { specimen: 99, ..back.nonuniformity }, ..back };
    let again = captured(&again, &Plan { seed: 2, ..plan() });
    let (one, two) = (dark_second(&found), dark_second(&again));
    for dn in [66, 70, 80, 100, 200, 500, 1000, 2000] {
        let above = |c: &Counts| (i64::from(dn)..4096).map(|v| c.at(v)).sum::<u64>() as f64;
        // Both frames of a pair show the same hot pixels; the file's numbers are as uncertain as one specimen.
        let (a, b) = (above(one) / 2.0, above(two) / 2.0);
        let standard_error = (a + 2.0 * b).sqrt() + 1e-3 * (a + b);
        assert!((a - b).abs() < 4.0 * standard_error, "above {dn} DN: {a} and {b} pixels");
    }
}

#[test]
fn hot_pixels_that_are_full_count_as_full() {
    // A third of the hot pixels are full after a second, far below the top of the converter.
    let sensor = SensorModel { full_well_e: 2200.0, ..hot() };
    let found = captured(&sensor, &Plan { seed: 4, ..plan() });
    let first = found.gains[0].pixel_dark_currents.as_ref().unwrap();
    assert!(first.full > 20 && first.outliers > 80, "{first:?}");
    within("share of hot pixels", found.joint.hot_pixel_share, 0.002, 3.0);
    within("mean excess of hot pixels", found.joint.hot_pixel_e_per_s, 2000.0, 3.0);
    within("mu_I without hot pixels", found.joint.dark_current_ordinary_e_per_s, 5.0, 3.0);
}

#[test]
fn the_dsnu_of_the_file_excludes_hot_pixels() {
    // Stacks of 100 ms: hot pixels add 2 0.002 200^2 = 160 e-^2 to 4.
    let plan = Plan { flat_ms: vec![50.0, 100.0, 150.0], dark_ms: vec![1000.0], gains: vec![1.0], ..plan() };
    let found = captured(&hot(), &plan);
    let measured = found.gains[0].channels[0].figure("DSNU1288_pixel").unwrap().best().value().unwrap();
    assert!(measured > 8.0, "{measured}");
    let text = sensor_toml(&found).unwrap();
    let back = petzval_files::parse_sensor(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let dsnu_e = back.nonuniformity.dsnu_pixel_e;
    assert!((dsnu_e - 2.0).abs() < 0.05, "{dsnu_e} of {measured}\n{text}");
}

#[test]
fn hot_pixels_that_are_full_in_the_dark_stack_are_left_out_of_dsnu_once() {
    // Hot pixels reach the full well of 500 e- in 25 ms on average, a quarter of the stack's time, and answer no light.
    let kind = NonUniformity { hot_pixel_e_per_s: 20_000.0, ..hot().nonuniformity };
    let sensor = SensorModel { full_well_e: 500.0, nonuniformity: kind, ..hot() };
    let plan = Plan {
        flat_ms: vec![50.0, 100.0, 150.0],
        dark_ms: vec![10.0, 20.0],
        gains: vec![1.0],
        stack: 30,
        ..plan()
    };
    let found = captured(&sensor, &plan);
    let spatial = found.gains[0].channels[0].spatial.as_ref().unwrap();
    let full = spatial.defects.iter().filter(|d| d.dark_dn > 0.95 * (64.0 + 0.38 * 500.0)).count();
    assert!(full > 20 && found.joint.hot_pixel_share.value().is_some(), "{full}");
    let text = sensor_toml(&found).unwrap();
    let back = petzval_files::parse_sensor(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let stated = |key: &str| {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap_or_else(|| panic!("{key}\n{text}"));
        line.split("+- ").nth(1).unwrap().split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    let off = (back.nonuniformity.dsnu_pixel_e - 2.0).abs() / stated("dsnu_pixel_e");
    assert!(off < 3.5, "{off}\n{text}");
}
