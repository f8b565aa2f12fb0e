//! Tests of a frame: limits, colours, derivatives, and wrong calls.

use super::*;

#[test]
fn full_well_and_converter_saturate_and_block_the_gradient() {
    let bright = LinearImage::filled(CHANNELS, 4, 4, 1.0);
    let at = |sensor: &SensorModel, mode| {
        expose_with_tape(&bright, sensor, &capture(60000.0, 0.01, 1.0), &noise(mode)).unwrap()
    };
    let (raw, slopes) = at(&imx249(), NoiseMode::StraightThrough);
    assert!(raw.dn.iter().all(|&v| v == 4095.0));
    assert!(slopes.iter().all(|&v| v == 0.0));

    // With less gain the full well limits first.
    let sensor = SensorModel { gain_dn_per_e: 0.05, ..imx249() };
    let (raw, slopes) = at(&sensor, NoiseMode::Off);
    let expected = 0.05 * (33723.0 + 3.25) + 119.0 + 1.15;
    assert!(raw.dn.iter().all(|&v| (v as f64 - expected).abs() < 1e-3));
    assert!(slopes.iter().all(|&v| v == 0.0));
}

#[test]
fn each_pixel_measures_the_colour_of_its_place_on_the_sensor() {
    let bayer = imx249();
    let mixed = SensorModel { cfa: "WR/GB".parse().unwrap(), clear_response: [0.9, 0.5, 0.0], ..imx249() };
    for (sensor, row, col) in [(&bayer, 0, 0), (&bayer, 0, 1), (&bayer, 1, 0), (&bayer, 1, 1), (&mixed, 1, 0)]
    {
        for channel in 0..CHANNELS {
            let mut light = LinearImage::zeros(CHANNELS, 4, 6);
            light.plane_mut(channel).fill(0.5);
            let capture = Capture { placement: Placement { row, col }, ..capture(1000.0, 0.01, 1.0) };
            let raw = expose(&light, sensor, &capture, &noise(NoiseMode::Off)).unwrap();
            for r in 0..4 {
                for c in 0..6 {
                    let response = sensor.response(sensor.cfa.colour(row + r, col + c))[channel];
                    let electrons = 500.0 * response + 25.0 * 0.01 + 3.25;
                    let expected = 0.14 * electrons + 119.0 + 1.15;
                    assert!((raw.dn[r * 6 + c] as f64 - expected).abs() < 1e-3);
                }
            }
        }
    }
}

#[test]
fn slopes_match_finite_differences() {
    // Without noise the frame is piecewise linear in light, so differences are exact.
    for sensor in [
        imx249(),
        SensorModel {
            electronics: Electronics::AfterAdc,
            nonuniformity: uneven(2),
            cfa: CfaPattern::MONO,
            ..imx249()
        },
    ] {
        let light = |value: f32| LinearImage::filled(CHANNELS, 6, 6, value);
        let frame = capture(5000.0, 0.05, 2.0);
        let dn = |v: f32| expose(&light(v), &sensor, &frame, &noise(NoiseMode::Off)).unwrap().dn;
        let (_, slopes) = expose_with_tape(&light(0.4), &sensor, &frame, &noise(NoiseMode::Off)).unwrap();
        let h = 1.0 / 64.0;
        let (high, low) = (dn(0.4 + h), dn(0.4 - h));
        for i in 0..36 {
            let response: f64 = sensor.response(sensor.cfa.colour(i / 6, i % 6)).iter().sum();
            let slope = slopes[i] * response as f32;
            let difference = (high[i] - low[i]) / (2.0 * h);
            assert!((difference / slope - 1.0).abs() < 2e-4, "pixel {i}: {difference} {slope}");
        }
    }

    // The dequantised factor is noisy but has mean one.
    let (sensor, frame) = (imx249(), capture(5000.0, 0.01, 2.0));
    let many = LinearImage::filled(CHANNELS, 400, 400, 0.4);
    let run = |mode| expose_with_tape(&many, &sensor, &frame, &noise(mode)).unwrap().1;
    let (noisy, plain) = (run(NoiseMode::Dequantised), run(NoiseMode::Off)[1]);
    let green = (0..400 * 400).filter(|i| (i / 400 + i % 400) % 2 == 1).map(|i| noisy[i] as f64);
    let (n, mean, variance, _) = moments(green);
    assert!(((mean - plain as f64) / (variance / n).sqrt()).abs() < 4.0);
}

#[test]
fn exact_counts_have_no_derivative_with_respect_to_light() {
    let light = LinearImage::filled(CHANNELS, 4, 4, 0.3);
    let frame = capture(5000.0, 0.01, 1.0);
    let (_, slopes) = expose_with_tape(&light, &imx249(), &frame, &noise(NoiseMode::Exact)).unwrap();
    assert!(slopes.iter().all(|&v| v == 0.0));
}

#[test]
fn a_gain_between_the_steps_is_an_error_that_names_the_nearest() {
    let sensor = SensorModel { gain_steps: vec![1.0, 1.77, 3.16, 31.62], ..imx249() };
    let light = LinearImage::zeros(CHANNELS, 4, 4);
    let at = |gain| expose(&light, &sensor, &capture(1000.0, 0.01, gain), &noise(NoiseMode::Exact));
    for gain in [1.0, 1.77, 3.16, 31.62] {
        assert!(at(gain).is_ok());
    }
    for (gain, step) in [(0.2, 1.0), (1.4, 1.77), (2.0, 1.77), (8.0, 3.16), (1e3, 31.62)] {
        assert_eq!(at(gain).unwrap_err(), SensorError::GainStep { value: gain, nearest: step });
    }
    assert_eq!(imx249().nearest_gain(2.2), 2.2);
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
