//! Compares means and variances of frames with formulas.

use super::*;

#[test]
fn mean_and_variance_match_the_closed_formulas_at_seven_gains() {
    // Two tests a row over 42 rows, family-wise alpha 1e-4: two-sided quantile of the normal law at 1e-4 / 84.
    const Z: f64 = 4.86;
    let text = include_str!("../../../tests/fixtures/sensor_moments.json");
    let table: serde_json::Value = serde_json::from_str(text).unwrap();
    let sensor = imx249();
    let rows = table["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 42);
    for (row, values) in rows.iter().enumerate() {
        let [gain, time_s, electrons, mean_dn, variance_dn2] =
            [0, 1, 2, 3, 4].map(|i| values[i].as_f64().unwrap());
        let mut light = LinearImage::zeros(CHANNELS, 1000, 1000);
        for c in 0..CHANNELS {
            light.plane_mut(c).fill((electrons / (1000.0 * sensor.relative_qe[c])) as f32);
        }
        let frame = Capture { frame: row as u64, ..capture(1000.0, time_s as f32, gain as f32) };
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
fn mean_and_variance_with_every_kind_of_non_uniformity() {
    // Pixels of a frame share their rows and columns, so the independent samples are specimens with a frame each.
    const SPECIMENS: u64 = 3000;
    // Two tests at three settings, family-wise alpha 1e-4.
    const Z: f64 = 4.3;
    for (light, gain, time_s) in [(0.0f32, 1.0f32, 0.05f32), (0.1, 3.16, 0.01), (0.6, 1.0, 0.02)] {
        let (white_e, side) = (20_000.0, 24);
        let picture = LinearImage::filled(CHANNELS, side, side, light);
        let (mut means, mut squares) = (Vec::new(), Vec::new());
        let u = uneven(0);
        // E lambda and Var lambda over pixels, then the contributions of the read-out.
        let percent = [u.prnu_pixel_percent, u.prnu_row_percent, u.prnu_column_percent];
        let prnu2: f64 = percent.iter().map(|p| (0.01 * p).powi(2)).sum();
        let (sensor, t) = (SensorModel { cfa: CfaPattern::MONO, ..imx249() }, time_s as f64);
        let light_e = light as f64 * white_e as f64;
        let (share, hot) = (u.hot_pixel_share, u.hot_pixel_e_per_s);
        let rate = light_e + t * (sensor.dark_current_e_per_s + share * hot);
        let rate_variance = light_e * light_e * prnu2 + t * t * (2.0 * share - share * share) * hot * hot;
        let offsets = [u.dsnu_pixel_e, u.dsnu_row_e, u.dsnu_column_e, u.row_noise_e, u.column_noise_e];
        let offset_variance: f64 = offsets.iter().map(|s| s * s).sum();
        let k = sensor.gain_dn_per_e * gain as f64;
        let expected_mean =
            k * (rate + sensor.read_noise_mean_e) + sensor.black_level_dn + sensor.electronics_mean_dn;
        let electrons2 = rate + rate_variance + offset_variance + sensor.read_noise_e.powi(2);
        let expected_variance = k * k * electrons2 + sensor.electronics_noise_dn.powi(2) + 1.0 / 12.0;
        for specimen in 0..SPECIMENS {
            let sensor = SensorModel { nonuniformity: uneven(specimen), ..sensor.clone() };
            let frame = Capture { frame: specimen, ..capture(white_e, time_s, gain) };
            let raw = expose(&picture, &sensor, &frame, &noise(NoiseMode::Exact)).unwrap();
            let (_, mean, _, _) = moments(raw.dn.iter().map(|&v| v as f64));
            means.push(mean);
            let about = raw.dn.iter().map(|&v| (v as f64 - expected_mean).powi(2));
            squares.push(about.sum::<f64>() / raw.dn.len() as f64);
        }
        for (what, samples, expected) in
            [("mean", means, expected_mean), ("variance", squares, expected_variance)]
        {
            let (n, mean, variance, _) = moments(samples.iter().copied());
            let z = (mean - expected) / (variance / n).sqrt();
            assert!(z.abs() < Z, "light {light}: {what} {mean}, expected {expected}, z {z}");
        }
    }
}

#[test]
fn each_part_of_the_fixed_pattern_has_its_spread() {
    // One part at a time; alpha 1e-6 each.
    const Z: f64 = 4.9;
    let (height, width) = (900, 1100);
    let pattern = |of: NonUniformity| {
        let sensor = SensorModel { nonuniformity: NonUniformity { specimen: 4, ..of }, ..imx249() };
        sensor.fixed_pattern(Placement::default(), height, width)
    };
    let spread = |values: Vec<f64>, mean: f64, sigma: f64| {
        let n = values.len() as f64;
        let (_, m, v, _) = moments(values.iter().copied());
        let (z_mean, z_variance) =
            ((m - mean) / (sigma / n.sqrt()), (v / (sigma * sigma) - 1.0) / (2.0 / n).sqrt());
        assert!(z_mean.abs() < Z && z_variance.abs() < Z, "{z_mean} {z_variance}");
    };
    let all = |values: &[f32]| values.iter().map(|&v| v as f64).collect::<Vec<_>>();
    let rows = |v: &[f32]| (0..height).map(|r| v[r * width] as f64).collect::<Vec<_>>();
    let columns = |v: &[f32]| v[..width].iter().map(|&v| v as f64).collect::<Vec<_>>();

    let pixel = pattern(NonUniformity { dsnu_pixel_e: 2.0, prnu_pixel_percent: 1.0, ..Default::default() });
    spread(all(&pixel.offset_e), 0.0, 2.0);
    spread(all(&pixel.response), 1.0, 0.01);
    let row = pattern(NonUniformity { dsnu_row_e: 2.0, prnu_row_percent: 1.0, ..Default::default() });
    spread(rows(&row.offset_e), 0.0, 2.0);
    spread(rows(&row.response), 1.0, 0.01);
    assert!(row.offset_e.chunks(width).all(|line| line.iter().all(|v| *v == line[0])));
    let column =
        pattern(NonUniformity { dsnu_column_e: 2.0, prnu_column_percent: 1.0, ..Default::default() });
    spread(columns(&column.offset_e), 0.0, 2.0);
    spread(columns(&column.response), 1.0, 0.01);
    assert!(column.offset_e.chunks(width).all(|line| *line == column.offset_e[..width]));

    let hot =
        pattern(NonUniformity { hot_pixel_share: 0.01, hot_pixel_e_per_s: 500.0, ..Default::default() });
    let currents: Vec<f64> = hot.dark_e_per_s.iter().filter(|v| **v > 0.0).map(|&v| v as f64).collect();
    let (n, pixels) = (currents.len() as f64, (height * width) as f64);
    assert!(((n - 0.01 * pixels) / (0.01 * 0.99 * pixels).sqrt()).abs() < Z);
    assert!((currents.iter().sum::<f64>() / n / 500.0 - 1.0).abs() * n.sqrt() < Z);
    assert!(hot.offset_e.iter().all(|v| *v == 0.0) && hot.response.iter().all(|v| *v == 1.0));
}

#[test]
fn row_and_column_noise_changes_with_the_frame_and_the_fixed_pattern_does_not() {
    // Without other temporal noise, two frames differ only by row or column noise.
    let quiet = SensorModel {
        dark_current_e_per_s: 0.0,
        read_noise_e: 0.0,
        electronics_noise_dn: 0.0,
        gain_dn_per_e: 10.0,
        nonuniformity: NonUniformity { dsnu_pixel_e: 2.0, row_noise_e: 3.0, ..Default::default() },
        black_level_dn: 2000.0,
        ..imx249()
    };
    let dark = LinearImage::zeros(CHANNELS, 600, 50);
    let frame = |sensor: &SensorModel, frame: u64| {
        let capture = Capture { frame, ..capture(1000.0, 0.01, 1.0) };
        expose(&dark, sensor, &capture, &noise(NoiseMode::Exact)).unwrap().dn
    };
    let differences = |sensor: &SensorModel| {
        let (a, b) = (frame(sensor, 0), frame(sensor, 1));
        a.iter().zip(&b).map(|(a, b)| (a - b) as f64).collect::<Vec<_>>()
    };
    let by_row = differences(&quiet);
    // Rounding to whole numbers of both frames leaves the difference within 1 DN along a row.
    assert!(by_row.chunks(50).all(|line| line.iter().all(|d| (d - line[0]).abs() <= 2.0)));
    let (n, _, variance, _) = moments(by_row.iter().step_by(50).copied());
    let expected = 2.0 * (10.0f64 * 3.0).powi(2) + 1.0 / 6.0;
    assert!(((variance / expected - 1.0) / (2.0 / n).sqrt()).abs() < 4.4, "{variance}");

    let columns = NonUniformity { row_noise_e: 0.0, column_noise_e: 3.0, ..quiet.nonuniformity };
    let by_column = differences(&SensorModel { nonuniformity: columns, ..quiet.clone() });
    assert!(by_column.chunks(50).all(|line| line.iter().zip(&by_column).all(|(a, b)| (a - b).abs() <= 2.0)));
    let still = NonUniformity { row_noise_e: 0.0, ..quiet.nonuniformity };
    assert!(differences(&SensorModel { nonuniformity: still, ..quiet }).iter().all(|d| *d == 0.0));
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
