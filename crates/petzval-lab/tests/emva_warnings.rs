//! The texts of all warnings, compared with stored ones: users and programs search for them.

use petzval_camera::sensor::Colour;
use petzval_lab::emva::{Compression, FitTest, Measured, SharedNoise, Unresolved, Verdict, Warning};

/// At least one warning of each kind, and one for each variant of its text.
fn examples() -> Vec<Warning> {
    let point = || "flat, gain 2, 1.5 ms".to_owned();
    let (linear_gain, colour) = (2.0, Colour::Red);
    let known = |dn| Measured::new(dn, 0.01);
    let spreads = [known(0.1), known(0.25)];
    let departs = |place: &str, verdict, curvature_sigmas, model_share, cause| Warning::FitDeparts {
        fit: "photon transfer",
        place: place.to_owned(),
        test: FitTest { reduced_chi2: 3.456, curvature_sigmas, verdict, ..FitTest::untested(9, 7) },
        model_share,
        cause,
    };
    let steps = |dark_step_dn, percent| Warning::Compressed {
        linear_gain,
        colour,
        found: Compression {
            low_step_dn: 1.0,
            high_step_dn: 31.07,
            dark_step_dn,
            gain_error_dn_per_e: 0.0271,
        },
        percent,
    };
    let shares = |[along_rows, along_columns, diagonal]: [f64; 3], between_frames| Warning::SharedNoise {
        linear_gain,
        colour,
        found: SharedNoise { along_rows, along_columns, diagonal, between_frames },
    };
    vec![
        Warning::Saturated { linear_gain, points: 3, of: 9 },
        Warning::ClippedAtZero { point: point(), share: 0.01234 },
        Warning::Flicker { point: point(), difference_dn: 1.23456, standard_error_dn: 0.23456 },
        Warning::Moved { point: point(), frame: 3, difference_dn: -1.23456, standard_error_dn: 0.23456 },
        Warning::DefectPixels {
            linear_gain,
            colour,
            pixels: 2,
            first: [3, 4],
            dark_dn: [Measured::none(Unresolved::NoStack), known(7.0)],
            flat_dn: spreads,
            bias_percent: Some(-0.416_789),
            of_others: vec![("R", 0.150_000_4, "DN/p"), ("QE", 59.996, "%"), ("u_e_sat", 16_123.4, "e-")],
        },
        Warning::DefectPixels {
            linear_gain,
            colour: Colour::Clear,
            pixels: 1,
            first: [3, 4],
            dark_dn: spreads,
            flat_dn: spreads,
            bias_percent: Some(-0.001),
            of_others: Vec::new(),
        },
        Warning::DarkDefects { linear_gain, pixels: 80, mean_dn: 10.0827 },
        Warning::BlackLevelsOfColours {
            linear_gain,
            cfa: "RGGB".into(),
            levels_dn: vec![64.0, 67.0, 69.004, 73.0],
        },
        Warning::BrightPixels { linear_gain, pixels: 30, offset_dn: 75.0456, dark_dn: Some(spreads) },
        Warning::BrightPixels { linear_gain, pixels: 1, offset_dn: 75.0456, dark_dn: None },
        Warning::LightLeak { point: point(), difference_dn: 1.23456 },
        Warning::DarkNotLinear { linear_gain, exposure_ms: 1.5, off_dn: -1.23456, reduced_chi2: 3.456 },
        Warning::DarkCurrentDisagrees {
            mean_e_per_s: 12.345678,
            difference_e_per_s: 1.23456,
            standard_error_e_per_s: 0.23456,
        },
        Warning::HotPixels {
            share: 0.0012345,
            excess_e_per_s: 123.456,
            ordinary_e_per_s: 1.23456,
            mean_e_per_s: 2.34567,
        },
        Warning::NotUniform { point: point(), percent: 6.78 },
        Warning::OtherMosaic { linear_gain, percent: 33.4 },
        Warning::NoDark { point: point() },
        Warning::NoSignal { point: point(), signal_dn: -0.12345, standard_error_dn: 0.23456 },
        Warning::TooFewPoints { linear_gain, points: 2 },
        Warning::NotMonotonic { point: point() },
        Warning::GainNotProportional { linear_gain, gain_dn_per_e: 0.1234567, expected_dn_per_e: 0.2345678 },
        Warning::Rounding { linear_gain, noise_dn: 0.45678, error_dn2: 0.0123456 },
        Warning::DarkNoiseLimit { linear_gain },
        Warning::NotLinear { linear_gain, colour, percent: 6.78, mean_dn: 1234.5 },
        Warning::FullWellDiffers { stated_e: 10500.5, measured_e: 9876.54, standard_error_e: 12.34 },
        Warning::BlackLevelDiffers { linear_gain, stated_dn: 64.0, measured_dn: 119.456 },
        Warning::DarkTail { point: point(), share: 0.0012345, mean_dn: 12.345 },
        Warning::WiderThanNoise { fitted_dn: 1.234567, temporal_dn: 1.0 },
        Warning::HistogramFitStopped { steps: 40 },
        Warning::HistogramFitAmbiguous {},
        Warning::PoorHistogramFit { mean_chi2: 2.3456, worst_chi2: 6.789, point: point() },
        Warning::HistogramFitDiffers {
            parameter: "K",
            fitted: 0.1234567,
            joint: 0.2345678,
            standard_error: 0.0123456,
        },
        Warning::NoHistogramFit { lacks: "the read noise" },
        Warning::CommonFactor { factor: 3, max_dn: 4095 },
        Warning::CommonFactor { factor: 16, max_dn: 65535 },
        Warning::TopNotReached { largest_dn: 1000, max_dn: 4095, piled: false },
        Warning::TopNotReached { largest_dn: 3000, max_dn: 4095, piled: true },
        Warning::QuantumEfficiencyAboveOne { linear_gain, colour, percent: 106.78, standard_error: 0.1234 },
        Warning::NoSensorFile { why: Unresolved::NoFlat },
        Warning::MoreStacks { point: point() },
        departs("", Verdict::Widened, None, None, None),
        departs("gain 2, red", Verdict::Withdrawn, Some(5.678), Some(0.1), Some("hot pixels fill")),
        departs("gain 2, red", Verdict::Widened, None, Some(0.01234), None),
        Warning::LoneStack { point: point() },
        shares([0.12, 0.11, 0.0], 0.0),
        shares([0.02, 0.0, 0.0], 0.02),
        shares([-0.1, 0.0, 0.0], 0.0),
        Warning::Clamped { point: point(), level_dn: 97, share: 0.01234 },
        steps(1.0, Some(6.78)),
        steps(1.0, None),
        steps(4.041, Some(6.78)),
        Warning::RowFlicker { linear_gain, colour, points: 7, percent: 6.78 },
    ]
}

#[test]
fn names_and_texts_stay_as_stored() {
    let found = examples();
    let texts: Vec<String> = found.iter().map(|warning| format!("{warning}\n")).collect();
    assert_eq!(texts.concat(), include_str!("emva_warnings.txt"));
    for (warning, text) in found.iter().zip(&texts) {
        assert_eq!(serde_json::to_string(warning).unwrap(), serde_json::to_string(text.trim_end()).unwrap());
        assert_eq!(text.split_once(':').unwrap().0, warning.name());
    }
    let mut names: Vec<&str> = found.iter().map(Warning::name).collect();
    names.dedup();
    assert_eq!(names, Warning::NAMES);
}

#[test]
fn points_and_severities_stay_as_stored() {
    let of = |name: &str| examples().into_iter().find(|w| w.name() == name).unwrap();
    let severities: Vec<(&str, f64)> = Warning::NAMES.iter().map(|n| (*n, of(n).severity())).collect();
    let severe: Vec<(&str, f64)> = severities.into_iter().filter(|(_, severity)| *severity != 0.0).collect();
    assert_eq!(
        severe,
        [
            ("saturated", 3.0 / 9.0),
            ("clipped-at-zero", 0.01234),
            ("flicker", 1.23456),
            ("moved", 1.23456),
            ("dark-defects", 10.0827),
            ("black-levels-of-colours", 9.0),
            ("bright-pixels", 30.0),
            ("light-leak", 1.23456),
            ("dark-not-linear", 1.23456),
            ("not-uniform", 6.78),
            ("other-mosaic", 33.4),
            ("no-signal", 0.12345),
            ("gain-not-proportional", (0.1234567_f64 / 0.2345678 - 1.0).abs()),
            ("not-linear", 6.78),
            ("black-level-differs", 119.456 - 64.0),
            ("dark-tail", 0.0012345 * 12.345),
            ("histogram-fit-differs", ((0.1234567_f64 - 0.2345678) / 0.0123456).abs()),
            ("quantum-efficiency-above-one", 106.78),
            ("fit-departs", f64::INFINITY),
            ("shared-noise", 1.0 + 2.0 * (0.12 + 0.11) - 1.0),
            ("clamped", 0.01234),
            ("compressed", 31.07),
            ("row-flicker", 6.78),
        ]
    );
    let placed: Vec<&str> = Warning::NAMES.iter().copied().filter(|n| of(n).point().is_some()).collect();
    let stored = "clipped-at-zero flicker moved light-leak not-uniform no-dark no-signal not-monotonic dark-tail more-stacks lone-stack clamped";
    assert_eq!(placed.join(" "), stored);
}
