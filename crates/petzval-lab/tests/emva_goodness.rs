//! Fits whose model does not hold say so, and their errors contain it; fits whose model holds have errors that match their scatter.

mod common;

use common::bench::{Bench, FULL_E};
use common::within;
use petzval_lab::emva::goodness::ALPHA;
use petzval_lab::emva::{
    Characterization, Limit, Measured, Options, Unresolved, Values, Verdict, fits, result_xml, sensor_toml,
};

fn warned(found: &Characterization, fit: &str) -> Vec<String> {
    let all = found.warnings.iter().filter(|w| w.name() == "fit-departs").map(ToString::to_string);
    all.filter(|text| text.contains(fit)).collect()
}

fn verdict(found: &Characterization, name: &str) -> Verdict {
    let all = fits(found);
    all.iter().find(|fit| fit.name == name).unwrap_or_else(|| panic!("no fit {name}")).test.verdict
}

#[track_caller]
fn share_of_error(measured: Measured) -> f64 {
    measured.standard_error().unwrap() / measured.value().unwrap().abs()
}

#[test]
fn a_response_that_bends_widens_the_error_of_k() {
    for (linear_gains, compression) in
        [(vec![1.0], 0.03), (vec![1.0], 0.08), (vec![1.0], -0.03), (vec![1.0, 2.0, 4.0], 0.03)]
    {
        for seed in 1..=3 {
            let bench = Bench { linear_gains: linear_gains.clone(), compression, seed, ..Bench::default() };
            let found = bench.measured();
            let (what, gain) = (format!("{linear_gains:?}, {compression}, seed {seed}"), &found.gains[0]);
            let transfer = &gain.channels[0].transfer;
            // Noise alone would be certain of a wrong gain.
            let k = transfer.gain_dn_per_e;
            let of_noise = share_of_error(transfer.straightened_gain_dn_per_e.unwrap());
            assert!((k.value().unwrap() / 0.38 - 1.0).abs() > 3.0 * of_noise, "{what}: {k:?}");
            within(&what, k, 0.38, 3.0);
            within(&format!("{what}: joint"), found.joint.gain_dn_per_e, 0.38, 3.0);
            within(&format!("{what}: straightened"), transfer.straightened_gain_dn_per_e.unwrap(), 0.38, 3.5);
            assert!(share_of_error(k) < 3.0 * compression.abs(), "{what}: {k:?}");
            assert_eq!(verdict(&found, "K"), Verdict::Widened, "{what}");
            // Errors of linearity are the bend itself.
            assert_eq!(verdict(&found, "linearity"), Verdict::Stated, "{what}");
            // What follows from K has its error.
            let qe = gain.channels[0].figure("QE").unwrap().best();
            within(&format!("{what}: QE"), qe, 50.0, 3.0);
            assert!(share_of_error(qe) > 0.5 * share_of_error(k), "{what}: {qe:?}");
            let said = warned(&found, "of K ");
            assert!(
                said.iter().any(|text| text.contains("the response bends")),
                "{what}: {:?}",
                found.warnings
            );
        }
    }
}

/// Exposures of a series of few, in electrons.
fn few_exposures() -> [Vec<f64>; 3] {
    let of = |shares: &[f64]| shares.iter().map(|share| share * FULL_E).collect();
    [of(&[0.3, 0.6]), of(&[0.2, 0.4, 0.6]), of(&[0.15, 0.3, 0.45, 0.6])]
}

#[test]
fn a_response_that_bends_widens_the_errors_of_few_exposures() {
    for flat_e in few_exposures() {
        for (linear_gains, compression) in
            [(vec![1.0], 0.03), (vec![1.0], 0.08), (vec![1.0], -0.03), (vec![1.0, 2.0, 4.0], 0.03)]
        {
            let what = format!("{} exposures, {linear_gains:?}, {compression}", flat_e.len());
            let bench = Bench { flat_e: flat_e.clone(), linear_gains, compression, ..Bench::default() };
            let found = bench.measured();
            let channel = &found.gains[0].channels[0];
            // The bend takes noise at the bright end, which is no knee.
            assert_eq!(channel.transfer.used, flat_e.len(), "{what}");
            within(&format!("{what}: K"), channel.transfer.gain_dn_per_e, 0.38, 3.0);
            within(&format!("{what}: joint"), found.joint.gain_dn_per_e, 0.38, 3.0);
            within(&format!("{what}: R"), channel.figure("R").unwrap().best(), 0.19, 3.0);
            within(&format!("{what}: QE"), channel.figure("QE").unwrap().best(), 50.0, 3.0);
            for fit in ["K", "R"] {
                assert_eq!(verdict(&found, fit), Verdict::Widened, "{what}");
                let said = warned(&found, &format!("of {fit} "));
                assert!(!said.is_empty(), "{what}: {:?}", found.warnings);
            }
        }
    }
}

#[test]
fn a_straight_response_of_few_exposures_has_the_error_of_its_noise() {
    for flat_e in few_exposures().into_iter().chain([vec![0.6 * FULL_E]]) {
        let bench = Bench { flat_e, ..Bench::default() };
        let found = bench.measured();
        let what = format!("{} exposures", bench.flat_e.len());
        for fit in fits(&found) {
            assert_eq!(fit.test.model_error, 0.0, "{what}: {fit:?}");
        }
        within(&format!("{what}: K"), found.joint.gain_dn_per_e, 0.38, 4.0);
        assert!(share_of_error(found.joint.gain_dn_per_e) < 0.01, "{what}: {:?}", found.joint.gain_dn_per_e);
        assert!(warned(&found, "").is_empty(), "{what}: {:?}", found.warnings);
        // One exposure shows no bend, and a warning says so.
        let is_of_one = |text: String| text.contains("is 1 flat point") && text.contains("noise alone");
        let says_so = found.warnings.iter().any(|w| is_of_one(w.to_string()));
        assert_eq!(says_so, bench.flat_e.len() == 1, "{what}: {:?}", found.warnings);
    }
}

#[test]
fn a_straight_response_has_the_error_of_its_noise() {
    let found = Bench { linear_gains: vec![1.0, 2.0, 4.0], ..Bench::default() }.measured();
    for fit in fits(&found) {
        assert!(matches!(fit.test.verdict, Verdict::Holds | Verdict::Untested), "{fit:?}");
        assert_eq!(fit.test.model_error, 0.0, "{fit:?}");
    }
    assert!(share_of_error(found.joint.gain_dn_per_e) < 0.003, "{:?}", found.joint.gain_dn_per_e);
    assert!(warned(&found, "").is_empty(), "{:?}", found.warnings);
    // The tests are in the results.
    let json = serde_json::to_value(&found).unwrap();
    let test = &json["gains"][0]["channels"][0]["transfer"]["gain_test"];
    assert_eq!((&test["verdict"], &test["alpha"]), (&"holds".into(), &ALPHA.into()), "{test}");
    assert!(test["reduced_chi2"].as_f64().unwrap() > 0.0 && test["degrees_of_freedom"] == 5, "{test}");
    for line in ["variance_line", "mean_line", "gain", "dark_current"] {
        assert_eq!(json["joint"]["tests"][line]["verdict"], "holds", "{line}");
    }
}

#[test]
fn black_levels_that_differ_by_gain_are_no_mean_of_the_read_noise() {
    let linear_gains = vec![1.0, 2.0, 4.0, 8.0];
    for black_dn in [
        vec![64.0, 68.0, 72.0, 76.0],
        vec![64.0, 70.0, 64.0, 70.0],
        vec![64.0, 64.0, 64.0, 72.0],
        vec![64.0, 65.0, 64.0, 64.0],
    ] {
        let bench =
            Bench { linear_gains: linear_gains.clone(), black_dn: black_dn.clone(), ..Bench::default() };
        let found = bench.measured();
        let mean = found.joint.read_noise_mean_e;
        let why = mean.reason().unwrap_or_else(|| panic!("{black_dn:?}: {mean:?}")).to_string();
        assert!(why.contains("reduced chi^2"), "{black_dn:?}: {why}");
        assert!(found.joint.dark_offset_dn.reason().is_some(), "{black_dn:?}");
        assert_eq!(found.joint.tests.mean_line.verdict, Verdict::Withdrawn, "{black_dn:?}");
        let said = warned(&found, "dark mean over K");
        assert!(
            said.len() == 1 && said[0].contains("state black_level_dn in each [[point]]"),
            "{black_dn:?}: {said:?}"
        );
        // What the black level does not touch stays.
        within(&format!("{black_dn:?}: sigma_r^2"), found.joint.read_variance_e2, 9.0, 3.5);
        within(&format!("{black_dn:?}: K"), found.joint.gain_dn_per_e, 0.38, 3.5);
    }
    // Nearly in proportion to the gain: each point is less than a quarter of a digital number off the line.
    let bench =
        Bench { linear_gains: vec![1.0, 2.0, 4.0], black_dn: vec![64.0, 70.0, 83.0], ..Bench::default() };
    let joint = bench.measured().joint;
    assert!(joint.read_noise_mean_e.value().is_none(), "{:?}", joint.read_noise_mean_e);
    assert_eq!(joint.tests.mean_line.verdict, Verdict::Withdrawn);
    // Stated gain by gain they leave the mean of the read noise and the offset of the electronics.
    let black_dn = vec![64.0, 70.0, 64.5, 72.0];
    let bench = Bench {
        linear_gains: linear_gains.clone(),
        black_dn,
        states_black: true,
        electronics_noise_dn: 0.5,
        ..Bench::default()
    };
    let found = bench.measured_with(&Options { fit_histograms: true, ..Options::default() });
    assert_eq!(found.joint.tests.mean_line.verdict, Verdict::Holds);
    assert!(warned(&found, "dark mean over K").is_empty(), "{:?}", found.warnings);
    within("mu_r, black levels stated", found.joint.read_noise_mean_e, 0.0, 3.5);
    within("mu_el, black levels stated", found.joint.electronics_mean_dn, 0.0, 3.5);
    assert_eq!(found.joint.black_level_dn, Some(64.0));
    // The histograms of all gains have one model.
    let fitted = found.histogram_fit.as_ref().unwrap();
    within("BL + mu_el by the histograms", fitted.dark_offset_dn, 64.0, 3.5);
    let text = sensor_toml(&found).unwrap();
    assert!(text.contains("# Black levels of the gains, as stated: 64.0, 70.0, 64.5, 72.0 DN"), "{text}");
    // A drift by less than a quarter of a digital number widens the error.
    let bench = Bench { linear_gains, black_dn: vec![64.0, 64.06, 63.97, 64.05], ..Bench::default() };
    let found = bench.measured();
    within("mu_r", found.joint.read_noise_mean_e, 0.0, 3.5);
    assert_eq!(found.joint.tests.mean_line.verdict, Verdict::Widened);
}

#[test]
fn a_response_that_bends_is_no_electronics_noise() {
    // At three gains K is off by three shares, which tilts the dark variance over K^2.
    for seed in 1..4 {
        let bench = Bench { linear_gains: vec![1.0, 2.0, 4.0], compression: 0.04, seed, ..Bench::default() };
        let joint = bench.measured().joint;
        let variance = joint.variance_line.intercept;
        let (value, error) = (variance.value().unwrap() - 1.0 / 12.0, variance.standard_error().unwrap());
        assert!((value / error).abs() < 3.0, "{seed}: {value} +- {error}");
    }
}

#[test]
fn dark_noise_below_the_converter_makes_limits_of_what_contains_it() {
    let limits = |gain_dn_per_e: f64| {
        let found = Bench { gain_dn_per_e, full_well_e: 4000.0, ..Bench::default() }.measured();
        let channel = &found.gains[0].channels[0];
        let limit = |name: &str| channel.figure(name).unwrap().limit;
        let xml = result_xml(channel, Values::Corrected).unwrap();
        (["sigma_d", "u_e_min", "DR_dB", "K"].map(limit), xml.matches("<limit>").count())
    };
    // 3 e- are 0.15 DN, and the converter resolves 0.49 DN. The pixel pitch is not known: nothing is per area.
    assert_eq!(limits(0.05), ([Some(Limit::Upper), Some(Limit::Upper), Some(Limit::Lower), None], 6));
    assert_eq!(limits(0.38), ([None; 4], 0));
}

#[test]
fn an_offset_and_a_lamp_that_drift_widen_the_errors() {
    for seed in 1..=6 {
        let found = Bench { drift_dn: 0.3, flicker: 0.005, seed, ..Bench::default() }.measured();
        let what = format!("seed {seed}");
        let gain = &found.gains[0];
        // 5 e-/s of dark current are 0.15 DN at the longest exposure, below the drift.
        within(&format!("{what}: slope of the dark mean"), gain.dark.mean.slope, 1.9, 4.0);
        assert_eq!(verdict(&found, "dark mean over time"), Verdict::Widened, "{what}");
        // So are the dark currents of the pixels, from the two ends of the series.
        let pixels = gain.pixel_dark_currents.as_ref().unwrap();
        within(&format!("{what}: pixels that are not hot"), pixels.ordinary_dn_per_s, 1.9, 4.0);
        within(&format!("{what}: median of the pixels"), pixels.median_dn_per_s, 1.9, 4.0);
        let transfer = &gain.channels[0].transfer;
        assert_eq!(transfer.responsivity_test.unwrap().verdict, Verdict::Widened, "{what}");
        within(&format!("{what}: R"), transfer.responsivity_dn, 0.19, 4.0);
        within(&format!("{what}: K"), found.joint.gain_dn_per_e, 0.38, 3.5);
    }
}

#[test]
fn a_dark_current_of_the_noise_that_is_none_has_the_reason_of_that_number() {
    let mut within_noise = 0;
    for seed in 1..=6 {
        let found = Bench { dark_current_e_per_s: 0.0, size: [48, 72], seed, ..Bench::default() }.measured();
        let figure = found.gains[0].channels[0].figure("u_I_var").unwrap().best();
        let joint = found.joint.dark_current_variance_e_per_s;
        match (figure.reason(), joint.reason()) {
            (
                Some(Unresolved::WithinNoise { value: one, .. }),
                Some(Unresolved::WithinNoise { value: other, .. }),
            ) => {
                assert!((one - other).abs() < 1e-9 * one.abs(), "seed {seed}: {figure:?} {joint:?}");
                within_noise += 1;
            }
            (why, _) => {
                assert!(!matches!(why, Some(Unresolved::NegativeVariance(_))), "seed {seed}: {why:?}")
            }
        }
    }
    assert!(within_noise > 3, "{within_noise}");
}
