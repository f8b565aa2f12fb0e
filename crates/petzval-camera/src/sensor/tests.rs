use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::noise::shot_noise;
use super::*;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;

pub(crate) fn imx249() -> SensorModel {
    SensorModel::from_toml(include_str!("../../../../data/sensors/imx249-fitted.toml")).unwrap()
}

fn capture(white_e: f32, time_s: f32, linear_gain: f32) -> Capture {
    Capture { exposure: Exposure { white_e, time_s, linear_gain }, placement: Placement::default(), frame: 0 }
}

fn noise(mode: NoiseMode) -> Noise {
    Noise { mode, seed: 20 }
}

/// Mean, variance and fourth central moment.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64, f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let central = |p: i32| values.clone().map(|v| (v - mean).powi(p)).sum::<f64>() / n;
    (n, mean, central(2), central(4))
}

#[test]
fn mean_and_variance_match_the_independent_model() {
    // Gain, exposure time (s), photoelectrons, mean (DN), variance (DN^2): analytic moments of an independent NumPy model
    // of the same sensor.
    const TABLE: [(f32, f32, f64, f64, f64); 12] = [
        (1.0, 0.0025, 0.0, 120.61375, 1.2445583333333332),
        (1.0, 0.0025, 20.0, 123.41375, 1.6365583333333336),
        (1.0, 0.03, 500.0, 190.71, 11.058033333333336),
        (1.77, 0.0025, 20.0, 125.9268375, 3.1441453758333338),
        (3.16, 0.03, 0.0, 121.9196, 4.208005813333334),
        (3.16, 0.0025, 500.0, 342.81545, 101.93232985333337),
        (5.62, 0.03, 20.0, 139.0332, 23.679976653333334),
        (10.0, 0.0025, 0.0, 124.7875, 32.41223333333334),
        (10.0, 0.03, 500.0, 825.75, 1013.7597333333335),
        (17.78, 0.0025, 20.0, 178.179475, 224.37718966333338),
        (31.62, 0.03, 0.0, 137.8572, 329.17208385333345),
        (31.62, 0.0025, 500.0, 2348.213775, 10113.978570063338),
    ];
    // Two tests a row, family-wise alpha 1e-4: two-sided quantile of the normal law at 1e-4 / 24.
    const Z: f64 = 4.606;
    let sensor = imx249();
    for (row, (gain, time_s, electrons, mean_dn, variance_dn2)) in TABLE.into_iter().enumerate() {
        let mut light = LinearImage::zeros(CHANNELS, 1000, 1000);
        for c in 0..CHANNELS {
            light.plane_mut(c).fill((electrons / (1000.0 * sensor.relative_qe[c])) as f32);
        }
        let frame = Capture { frame: row as u64, ..capture(1000.0, time_s, gain) };
        let raw = expose(&light, &sensor, &frame, &noise(NoiseMode::Exact)).unwrap();
        assert!(raw.dn.iter().all(|v| v.fract() == 0.0));
        let (n, mean, variance, fourth) = moments(raw.dn.iter().map(|&v| v as f64));
        let z_mean = (mean - mean_dn) / (variance / n).sqrt();
        let z_variance = (variance - variance_dn2) / ((fourth - variance * variance) / n).sqrt();
        assert!(z_mean.abs() < Z, "row {row}: mean {mean}, z {z_mean}");
        assert!(z_variance.abs() < Z, "row {row}: variance {variance}, z {z_variance}");
    }
}

#[test]
fn gradient_estimators_match_the_independent_study() {
    // Rate, function, estimator mean and standard deviation from 2 million NumPy samples: straight-through f'(N), then
    // dequantised f'(N + t - 1/2) (t + (1 - t) N / lambda); last the exact gradient of the dequantised objective.
    type Row = (f64, fn(f64) -> f64, [f64; 2], [f64; 2], f64);
    fn square(x: f64) -> f64 {
        2.0 * x
    }
    fn root(x: f64) -> f64 {
        if x > -1.0 { 0.5 / (x + 1.0).max(1e-9).sqrt() } else { 0.0 }
    }
    fn clip(x: f64) -> f64 {
        if x < 40.0 { 1.0 } else { 0.0 }
    }
    fn sigmoid(x: f64) -> f64 {
        let s = 1.0 / (1.0 + (-(x - 10.0) / 3.0).exp());
        s * (1.0 - s) / 3.0
    }
    const TABLE: [Row; 7] = [
        (0.3, square, [0.599828, 1.0946699824], [1.5967703231, 3.6490820913], 1.6),
        (0.3, root, [0.4595015154, 0.0695859868], [0.3928707679, 0.3407108896], 0.3930324235),
        (3.0, root, [0.2718692047, 0.0727690102], [0.2523191916, 0.0467811116], 0.2523892331),
        (3.0, sigmoid, [0.0288259365, 0.0135680649], [0.0326336365, 0.0263159258], 0.0326471744),
        (10.0, square, [19.989226, 6.3189217372], [20.9833348661, 10.0625355065], 21.0),
        (40.0, clip, [0.4791885, 0.4995666937], [0.4792351725, 0.4712175671], 0.4789711389),
        (200.0, root, [0.0353322917, 0.0012507217], [0.035289592, 0.0007222433], 0.0352890546),
    ];
    const SAMPLES: usize = 1_000_000;
    const STUDY: f64 = 2e6;
    // Five tests a row and estimator, family-wise alpha 1e-4 over 35 tests.
    const Z: f64 = 4.69;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut uniform = ChaCha8Rng::seed_from_u64(6);
    for (i, (lambda, derivative, straight, dequantised, exact)) in TABLE.into_iter().enumerate() {
        for (mode, [study_mean, study_std]) in
            [(NoiseMode::StraightThrough, straight), (NoiseMode::Dequantised, dequantised)]
        {
            let draws: Vec<f64> = (0..SAMPLES)
                .map(|_| {
                    let (x, factor) = shot_noise(mode, lambda, &mut rng, rand::RngExt::random(&mut uniform));
                    derivative(x) * factor
                })
                .collect();
            let (n, mean, variance, fourth) = moments(draws.iter().copied());
            let z_mean = (mean - study_mean) / (variance * (1.0 / n + 1.0 / STUDY)).sqrt();
            let std = variance.sqrt();
            let std_error = ((fourth - variance * variance) * (1.0 / n + 1.0 / STUDY)).sqrt() / (2.0 * std);
            let z_std = (std - study_std) / std_error;
            assert!(z_mean.abs() < Z && z_std.abs() < Z, "row {i} {mode:?}: {z_mean} {z_std}");
            if mode == NoiseMode::Dequantised {
                assert!(((mean - exact) / (variance / n).sqrt()).abs() < Z, "row {i}: biased");
            }
        }
    }
}

#[test]
fn full_well_and_converter_saturate_and_block_the_gradient() {
    let bright = LinearImage::filled(CHANNELS, 4, 4, 1.0);
    let (raw, tape) = expose_with_tape(
        &bright,
        &imx249(),
        &capture(60000.0, 0.01, 1.0),
        &noise(NoiseMode::StraightThrough),
    )
    .unwrap();
    assert!(raw.dn.iter().all(|&v| v == 4095.0) && tape.iter().all(|&v| v == 0.0));

    // With less gain the full well limits first.
    let sensor = SensorModel { gain_dn_per_e: 0.05, ..imx249() };
    let (raw, tape) =
        expose_with_tape(&bright, &sensor, &capture(60000.0, 0.01, 1.0), &noise(NoiseMode::Off)).unwrap();
    let expected = 0.05 * (33723.0 + 3.25) + 119.0 + 1.15;
    assert!(raw.dn.iter().all(|&v| (v as f64 - expected).abs() < 1e-3) && tape.iter().all(|&v| v == 0.0));
}

#[test]
fn each_pixel_sees_the_colour_of_its_place_on_the_sensor() {
    let sensor = imx249();
    for (row, col) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        for channel in 0..CHANNELS {
            let mut light = LinearImage::zeros(CHANNELS, 4, 6);
            light.plane_mut(channel).fill(0.5);
            let capture = Capture { placement: Placement { row, col }, ..capture(1000.0, 0.01, 1.0) };
            let raw = expose(&light, &sensor, &capture, &noise(NoiseMode::Off)).unwrap();
            for r in 0..4 {
                for c in 0..6 {
                    let (even_row, even_col) = ((row + r) % 2 == 0, (col + c) % 2 == 0);
                    let expected = match (even_row, even_col) {
                        (true, true) => 0,
                        (false, false) => 2,
                        _ => 1,
                    };
                    assert_eq!(raw.dn[r * 6 + c] > 130.0, channel == expected);
                }
            }
        }
    }
}

#[test]
fn the_tape_is_the_derivative() {
    let sensor = imx249();
    let light = |value: f32| LinearImage::filled(CHANNELS, 2, 2, value);
    let frame = capture(5000.0, 0.01, 2.0);
    let (_, tape) = expose_with_tape(&light(0.4), &sensor, &frame, &noise(NoiseMode::Off)).unwrap();
    let dn = |v: f32| expose(&light(v), &sensor, &frame, &noise(NoiseMode::Off)).unwrap().dn;
    let (low, high) = (dn(0.375), dn(0.4375));
    let slope =
        |i: usize| tape[i] * sensor.response(sensor.cfa.colour(i / 2, i % 2)).iter().sum::<f64>() as f32;
    for i in 0..4 {
        let difference = (high[i] - low[i]) / 0.0625;
        assert!((difference - slope(i)).abs() < 1e-3 * slope(i), "{difference} {}", slope(i));
    }
    // The dequantised factor is noisy but has mean one.
    let many = LinearImage::filled(CHANNELS, 400, 400, 0.4);
    let (_, noisy) = expose_with_tape(&many, &sensor, &frame, &noise(NoiseMode::Dequantised)).unwrap();
    let green: Vec<f64> =
        (0..400 * 400).filter(|i| (i / 400 + i % 400) % 2 == 1).map(|i| noisy[i] as f64).collect();
    let (n, mean, variance, _) = moments(green.iter().copied());
    assert!(((mean - tape[1] as f64) / (variance / n).sqrt()).abs() < 4.0);
}

#[test]
fn electronics_noise_after_the_converter_adds_a_rounding() {
    let sensor = SensorModel { electronics: Electronics::AfterAdc, ..imx249() };
    let dark = LinearImage::zeros(CHANNELS, 1000, 1000);
    let raw = expose(&dark, &sensor, &capture(1000.0, 0.0025, 1.0), &noise(NoiseMode::Exact)).unwrap();
    let (n, _, variance, fourth) = moments(raw.dn.iter().map(|&v| v as f64));
    // The first rounding acts on a spread of 0.56 DN only, where 1/12 DN^2 is good to 1 %.
    let expected = 1.2445583333 + 1.0 / 12.0;
    let error = ((fourth - variance * variance) / n).sqrt();
    assert!((variance - expected).abs() < 4.0 * error + 0.01 / 12.0 + 0.002, "{variance} {expected}");
}

#[test]
fn noise_depends_on_seed_frame_and_pixel_only() {
    let sensor = imx249();
    let light = LinearImage::filled(CHANNELS, 30, 40, 0.01);
    let frame = capture(5000.0, 0.01, 4.0);
    for mode in [NoiseMode::Exact, NoiseMode::Dequantised] {
        let run = |threads: usize, noise: Noise, capture: Capture| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| expose_with_tape(&light, &sensor, &capture, &noise).unwrap())
        };
        let base = run(1, noise(mode), frame);
        assert!(base == run(2, noise(mode), frame));
        assert_ne!(base.0.dn, run(1, Noise { seed: 21, ..noise(mode) }, frame).0.dn);
        assert_ne!(base.0.dn, run(1, noise(mode), Capture { frame: 1, ..frame }).0.dn);

        // A crop of the sensor repeats the noise of the same pixels.
        let placement = Placement { row: 11, col: 7 };
        let crop = light.crop(0, 0, 10, 20).unwrap();
        let part = expose(&crop, &sensor, &Capture { placement, ..frame }, &noise(mode)).unwrap();
        for r in 0..10 {
            assert_eq!(part.dn[r * 20..(r + 1) * 20], base.0.dn[(r + 11) * 40 + 7..][..20]);
        }
    }
}

#[test]
fn wrong_calls_are_typed_errors() {
    let (sensor, light) = (imx249(), LinearImage::zeros(CHANNELS, 4, 4));
    let call = |light: &LinearImage, capture: &Capture| {
        expose(light, &sensor, capture, &noise(NoiseMode::Exact)).unwrap_err()
    };
    let good = capture(1000.0, 0.01, 1.0);
    assert!(matches!(
        call(&light, &capture(f32::NAN, 0.01, 1.0)),
        SensorError::Exposure { what: "white_e", .. }
    ));
    assert!(matches!(call(&LinearImage::zeros(1, 4, 4), &good), SensorError::Shape { .. }));
    let outside = Capture { placement: Placement { row: 1197, col: 0 }, ..good };
    assert!(matches!(call(&light, &outside), SensorError::OffSensor { .. }));
    let mut hole = light.clone();
    hole.data[21] = f32::NAN;
    assert!(matches!(call(&hole, &good), SensorError::Irradiance { row: 1, col: 1, .. }));
    let broken = SensorModel { bits: 0, ..sensor.clone() };
    assert!(matches!(expose(&light, &broken, &good, &noise(NoiseMode::Off)), Err(SensorError::Model(_))));
}
