//! Temporal noise that neighbouring rows, or columns, share: it is measured at its size, is no movement and no non-uniformity.

mod common;

use common::bench::{Bench, Correlation};
use common::within;
use petzval_lab::emva::{Characterization, Measured};

fn warned(found: &Characterization, name: &str) -> Vec<String> {
    found.warnings.iter().filter(|w| w.name() == name).map(ToString::to_string).collect()
}

/// What noise of lines must not be taken for.
#[track_caller]
fn nothing_moved(what: &str, found: &Characterization) {
    for name in ["moved", "light-leak", "not-uniform", "dark-not-linear"] {
        assert!(warned(found, name).is_empty(), "{what}: {:?}", found.warnings);
    }
}

#[track_caller]
fn relative_error(noise: Measured) -> f64 {
    noise.standard_error().unwrap() / noise.value().unwrap()
}

#[test]
fn rows_that_share_their_noise_have_all_of_it() {
    use Correlation::*;
    // Ten dark points of two frames at 160 rows: the variance of independent rows is known to 3.5 %, their noise to half of that.
    for (rows, least_certain) in [
        (Independent, 0.03),
        (Groups(2), 0.05),
        (Groups(5), 0.08),
        (Wanders(0.8), 0.1),
        (Every(8), 0.2),
        (Wave(13.0), 0.3),
    ] {
        for seed in 1..=3 {
            let found = Bench { row_noise_e: 1.7, rows, seed, ..Bench::default() }.measured();
            let (what, noise) = (format!("{rows:?}, seed {seed}"), found.joint.row_noise_e);
            within(&what, noise, 1.7, 3.5);
            assert!(relative_error(noise) < least_certain, "{what}: {noise:?}");
            within(&format!("{what}: K"), found.joint.gain_dn_per_e, 0.38, 3.5);
            assert!(found.joint.column_noise_e.value().is_none(), "{what}: {:?}", found.joint.column_noise_e);
            nothing_moved(&what, &found);
            assert!(warned(&found, "flicker").is_empty(), "{what}: {:?}", found.warnings);
            assert_eq!(found.gains[0].channels[0].points.len(), 6, "{what}: {:?}", found.warnings);
        }
    }
}

#[test]
fn columns_of_shared_converters_have_all_of_their_noise() {
    use Correlation::*;
    for (columns, least_certain) in [
        (Every(2), 0.35),
        (Every(4), 0.25),
        (Every(16), 0.1),
        (Every(48), 0.1),
        (Groups(4), 0.08),
        (Wanders(0.9), 0.12),
    ] {
        let found = Bench { column_noise_e: 1.2, columns, ..Bench::default() }.measured();
        let (what, noise) = (format!("{columns:?}"), found.joint.column_noise_e);
        within(&what, noise, 1.2, 3.5);
        assert!(relative_error(noise) < least_certain, "{what}: {noise:?}");
        nothing_moved(&what, &found);
        assert_eq!(found.gains[0].channels[0].points.len(), 6, "{what}: {:?}", found.warnings);
    }
}

#[test]
fn what_rows_share_is_no_non_uniformity_of_rows() {
    use Correlation::*;
    use petzval_lab::emva::{HighPass, Options};
    for rows in [Independent, Groups(2), Wanders(0.8), Wanders(0.95), Every(4), Wave(9.0)] {
        for high_pass in [HighPass::R4, HighPass::R31, HighPass::None] {
            let bench = Bench { row_noise_e: 1.7, rows, dsnu_e: 1.0, stack: 12, ..Bench::default() };
            let even = bench.measured_with(&Options { high_pass, ..Options::default() });
            let parts = |found: &Characterization| {
                let spatial = found.gains[0].channels[0].spatial.as_ref().unwrap();
                (spatial.dark_components, spatial.flat_components)
            };
            let (what, k2) = (format!("{rows:?}, {high_pass:?}"), 0.38 * 0.38);
            let (dark, flat) = parts(&even);
            within(&format!("{what}: rows in the dark"), dark.row, 0.0, 3.5);
            within(&format!("{what}: rows in the light"), flat.row, 0.0, 3.5);
            within(&format!("{what}: pixels"), dark.pixel, k2, 3.5);
        }
        let bench = Bench { row_noise_e: 1.7, rows, dsnu_row_e: 0.8, stack: 12, ..Bench::default() };
        let found = bench.measured();
        let figure = found.gains[0].channels[0].figure("DSNU1288_row").unwrap().best();
        within(&format!("{rows:?}: DSNU of rows"), figure, 0.8, 3.5);
    }
}

#[test]
fn drift_and_flicker_are_no_noise_of_rows() {
    use Correlation::*;
    for rows in [Independent, Groups(2), Wanders(0.8)] {
        let bench = Bench { row_noise_e: 1.7, rows, flicker: 0.01, drift_dn: 0.4, ..Bench::default() };
        let found = bench.measured();
        within(&format!("{rows:?}"), found.joint.row_noise_e, 1.7, 3.5);
        within(&format!("{rows:?}: K"), found.joint.gain_dn_per_e, 0.38, 3.5);
        assert!(!warned(&found, "flicker").is_empty(), "{rows:?}: {:?}", found.warnings);
        assert!(warned(&found, "moved").is_empty(), "{rows:?}: {:?}", found.warnings);
        assert_eq!(found.gains[0].channels[0].points.len(), 6, "{rows:?}: {:?}", found.warnings);
    }
    // Without noise of rows there is none in drifting frames.
    let found = Bench { flicker: 0.01, drift_dn: 0.4, ..Bench::default() }.measured();
    assert!(found.joint.row_noise_e.value().is_none(), "{:?}", found.joint.row_noise_e);
}

#[test]
fn rows_that_wander_over_the_whole_frame_are_not_resolved() {
    let found = Bench { row_noise_e: 1.7, rows: Correlation::Wanders(0.995), ..Bench::default() }.measured();
    let noise = found.joint.row_noise_e;
    match noise.reason() {
        Some(why) => assert!(why.to_string().contains("160 lines"), "{why}"),
        None => within("rows", noise, 1.7, 3.5),
    }
    nothing_moved("rows that wander", &found);
    assert_eq!(found.gains[0].channels[0].points.len(), 6, "{:?}", found.warnings);
}
