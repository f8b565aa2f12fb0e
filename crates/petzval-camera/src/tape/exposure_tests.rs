//! Gradients with respect to light, through sensor and development.

use burn::prelude::*;

use super::tests::{tensor, uniform, values};
use super::*;
use crate::image::CHANNELS;
use crate::render::Placement;
use crate::sensor::{Capture, Exposure, Noise, NoiseMode, NonUniformity, SensorModel, expose};

const HEIGHT: usize = 12;
const WIDTH: usize = 14;

fn sensor() -> SensorModel {
    let nonuniformity = NonUniformity {
        specimen: 2,
        dsnu_pixel_e: 2.0,
        prnu_pixel_percent: 1.0,
        hot_pixel_share: 0.02,
        hot_pixel_e_per_s: 200.0,
        ..Default::default()
    };
    let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
    SensorModel { nonuniformity, dark_current_e_per_s: 400.0, ..toml::from_str::<SensorModel>(text).unwrap() }
}

fn captures() -> Vec<Capture> {
    let exposure = |gain| Exposure { white_e: 9000.0, time_s: 0.05, linear_gain: gain };
    let at = |row, col| Placement { row, col };
    vec![
        Capture { exposure: exposure(1.0), placement: at(3, 4), frame: 0 },
        Capture { exposure: exposure(1.6), placement: at(90, 201), frame: 1 },
    ]
}

#[test]
fn a_frame_has_the_same_bits_with_a_tape_and_without() {
    let (sensor, captures) = (sensor(), captures());
    let light = || tensor(uniform(1, 2 * CHANNELS * HEIGHT * WIDTH), [2, CHANNELS, HEIGHT, WIDTH]);
    for mode in [NoiseMode::Exact, NoiseMode::Dequantised, NoiseMode::Off] {
        let noise = Noise { mode, seed: 3 };
        let plain = values(expose_op(light(), &sensor, &captures, &noise).unwrap());
        let tracked = values(expose_op(light().require_grad(), &sensor, &captures, &noise).unwrap());
        assert_eq!(plain, tracked, "{mode:?}");
        for (i, capture) in captures.iter().enumerate() {
            let frame = picture(&values(light()), i, CHANNELS, HEIGHT, WIDTH);
            let raw = expose(&frame, &sensor, capture, &noise).unwrap();
            assert_eq!(raw.dn, plain[i * HEIGHT * WIDTH..][..HEIGHT * WIDTH], "{mode:?}");
        }
    }
}

#[test]
fn gradients_of_light_match_finite_differences() {
    let (sensor, captures) = (sensor(), captures());
    let off = Noise { mode: NoiseMode::Off, seed: 0 };
    let shape = [2, CHANNELS, HEIGHT, WIDTH];
    let light: Vec<f32> = uniform(1, 2 * CHANNELS * HEIGHT * WIDTH).iter().map(|v| 0.1 + 0.6 * v).collect();
    // A scalar of the developed pictures: the sum of their squares with random weights.
    let loss = |light: Tensor<4>| {
        let raw = expose_op(light, &sensor, &captures, &off).unwrap();
        let picture = develop_op(raw, &sensor, &captures).unwrap();
        (picture.square() * tensor(uniform(5, 2 * CHANNELS * HEIGHT * WIDTH), shape)).sum()
    };
    let tracked = tensor(light.clone(), shape).require_grad();
    let gradients = loss(tracked.clone()).backward();
    let by_light = values(tracked.grad(&gradients).unwrap());
    for index in [5, 200, 600, 800] {
        let moved = |step: f32| {
            let mut v = light.clone();
            v[index] += step;
            values(loss(tensor(v, shape)))[0]
        };
        let d = (moved(0.1) - moved(-0.1)) / 0.2;
        assert!((d - by_light[index]).abs() < 5e-3 * by_light[index].abs() + 1e-3, "{d} {}", by_light[index]);
    }
}

#[test]
fn tangent_and_adjoint_agree() {
    // <y, J x> = <J^T y, x> for the sensor: J x from the derivatives of the pixels, J^T y from the tape.
    let (sensor, n) = (sensor(), 2 * CHANNELS * HEIGHT * WIDTH);
    let light = tensor(uniform(1, n), [2, CHANNELS, HEIGHT, WIDTH]).require_grad();
    let noise = Noise { mode: NoiseMode::Dequantised, seed: 4 };
    let raw = expose_op(light.clone(), &sensor, &captures(), &noise).unwrap();
    let y = uniform(2, 2 * HEIGHT * WIDTH);
    let gradients = (raw * tensor(y.clone(), [2, 1, HEIGHT, WIDTH])).sum().backward();
    let (by_light, x) = (values(light.grad(&gradients).unwrap()), uniform(3, n));
    let (mut forward, mut size) = (0.0, 0.0);
    for (b, capture) in captures().iter().enumerate() {
        let frame = picture(&values(light.clone()), b, CHANNELS, HEIGHT, WIDTH);
        let (_, slopes) = crate::sensor::expose_with_tape(&frame, &sensor, capture, &noise).unwrap();
        for i in 0..HEIGHT * WIDTH {
            let colour =
                sensor.cfa.colour(capture.placement.row + i / WIDTH, capture.placement.col + i % WIDTH);
            let response = sensor.response(colour);
            let d_light: f64 =
                (0..CHANNELS).map(|c| response[c] * x[(b * CHANNELS + c) * HEIGHT * WIDTH + i] as f64).sum();
            let product = y[b * HEIGHT * WIDTH + i] as f64 * slopes[i] as f64 * d_light;
            forward += product;
            size += product.abs();
        }
    }
    let backward: f64 = by_light.iter().zip(&x).map(|(a, b)| *a as f64 * *b as f64).sum();
    assert!((forward - backward).abs() < 1e-5 * size, "{forward} {backward}");
}

#[test]
fn an_exposure_that_the_sensor_does_not_have_is_an_error() {
    let light = || tensor(uniform(1, 2 * CHANNELS * HEIGHT * WIDTH), [2, CHANNELS, HEIGHT, WIDTH]);
    let off = Noise { mode: NoiseMode::Off, seed: 0 };
    assert!(expose_op(light(), &sensor(), &captures()[..1], &off).is_err(), "a capture for each picture");
    let stepped = SensorModel { gain_steps: vec![1.0, 1.77], ..sensor() };
    assert!(expose_op(light(), &stepped, &captures(), &off).is_err(), "a gain of 1.6");
}
