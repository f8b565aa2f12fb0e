//! Gradients with respect to gain and exposure, through sensor and development.

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
    let text = include_str!("../../../../data/sensors/imx249-fitted.toml");
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

fn off() -> Noise {
    Noise { mode: NoiseMode::Off, seed: 0 }
}

/// A scalar of the developed pictures: the sum of their squares with random weights.
fn loss(light: Tensor<4>, stops: Tensor<2>, sensor: &SensorModel, noise: &Noise) -> Tensor<1> {
    let captures = captures();
    let raw = expose_with_stops_op(light, stops.clone(), sensor, &captures, noise, 0.0).unwrap();
    let picture = develop_with_stops_op(raw, stops, sensor, &captures).unwrap();
    let weight = tensor(uniform(5, 2 * CHANNELS * HEIGHT * WIDTH), [2, CHANNELS, HEIGHT, WIDTH]);
    (picture.square() * weight).sum()
}

#[test]
fn zero_stops_give_the_capture_and_other_stops_its_changed_exposure() {
    let (sensor, captures) = (sensor(), captures());
    let light = tensor(uniform(1, 2 * CHANNELS * HEIGHT * WIDTH), [2, CHANNELS, HEIGHT, WIDTH]);
    let zero = || tensor(vec![0.0; 4], [2, 2]);
    for mode in [NoiseMode::Exact, NoiseMode::Dequantised, NoiseMode::Off] {
        let noise = Noise { mode, seed: 3 };
        let plain = expose_op(light.clone(), &sensor, &captures, &noise).unwrap();
        let unchanged = expose_with_stops_op(light.clone(), zero(), &sensor, &captures, &noise, 0.0).unwrap();
        assert_eq!(values(unchanged), values(plain.clone()));
        let developed = develop_with_stops_op(plain.clone(), zero(), &sensor, &captures).unwrap();
        assert_eq!(values(developed), values(develop_op(plain, &sensor, &captures).unwrap()));
    }
    // Other stops equal a capture with the changed exposure.
    let up = expose_with_stops_op(
        light.clone(),
        tensor(vec![1.0, -0.5, 0.0, 2.0], [2, 2]),
        &sensor,
        &captures,
        &off(),
        0.0,
    );
    let changed: Vec<Capture> = captures
        .iter()
        .zip([(1.0, -0.5), (0.0, 2.0)])
        .map(|(c, (gain, exposure))| Capture { exposure: c.exposure.with_stops(gain, exposure), ..*c })
        .collect();
    assert_eq!(values(up.unwrap()), values(expose_op(light, &sensor, &changed, &off()).unwrap()));
}

#[test]
fn gradients_of_light_and_stops_match_finite_differences() {
    let sensor = sensor();
    let light_values: Vec<f32> =
        uniform(1, 2 * CHANNELS * HEIGHT * WIDTH).iter().map(|v| 0.1 + 0.6 * v).collect();
    let stops_values = vec![0.25f32, -0.5, -0.75, 0.3];
    let light = || tensor(light_values.clone(), [2, CHANNELS, HEIGHT, WIDTH]);
    let run = |stops: Vec<f32>| values(loss(light(), tensor(stops, [2, 2]), &sensor, &off()))[0];
    let tracked = light().require_grad();
    let stops = tensor(stops_values.clone(), [2, 2]).require_grad();
    let gradients = loss(tracked.clone(), stops.clone(), &sensor, &off()).backward();
    let by_stops = values(stops.grad(&gradients).unwrap());
    // Through both operations the exposure cancels except in hot pixels and offsets. Compare each operation alone too, where
    // the gradients are large.
    let raw_only = |stops: Vec<f32>| {
        let stops = tensor(stops, [2, 2]);
        values(
            expose_with_stops_op(light(), stops, &sensor, &captures(), &off(), 0.0).unwrap().square().sum(),
        )[0]
    };
    let stops_raw = tensor(stops_values.clone(), [2, 2]).require_grad();
    let raw = expose_with_stops_op(light(), stops_raw.clone(), &sensor, &captures(), &off(), 0.0).unwrap();
    let by_stops_raw = values(stops_raw.grad(&raw.square().sum().backward()).unwrap());
    let develop_only = |stops: Vec<f32>| {
        let raw =
            tensor(values(expose_op(light(), &sensor, &captures(), &off()).unwrap()), [2, 1, HEIGHT, WIDTH]);
        develop_with_stops_op(raw, tensor(stops, [2, 2]), &sensor, &captures()).unwrap().square().sum()
    };
    let stops_developed = tensor(stops_values.clone(), [2, 2]).require_grad();
    let developed = values(loss(light(), stops, &sensor, &off()))[0];
    let raw =
        tensor(values(expose_op(light(), &sensor, &captures(), &off()).unwrap()), [2, 1, HEIGHT, WIDTH]);
    let picture = develop_with_stops_op(raw, stops_developed.clone(), &sensor, &captures()).unwrap();
    let by_stops_developed = values(stops_developed.grad(&picture.square().sum().backward()).unwrap());
    let h = 1.0 / 32.0;
    for i in 0..4 {
        let moved = |step: f32| {
            let mut v = stops_values.clone();
            v[i] += step;
            v
        };
        let difference = |f: &dyn Fn(Vec<f32>) -> f32| (f(moved(h)) - f(moved(-h))) / (2.0 * h);
        // Second-order error (h ln 2)^2 / 6 of powers of two, and round-off of sums.
        let d = difference(&raw_only);
        assert!((d / by_stops_raw[i] - 1.0).abs() < 2e-3, "raw, {i}: {d} {}", by_stops_raw[i]);
        let d = difference(&|s| values(develop_only(s))[0]);
        assert!(
            (d / by_stops_developed[i] - 1.0).abs() < 2e-3,
            "develop, {i}: {d} {}",
            by_stops_developed[i]
        );
        let d = difference(&run);
        assert!((d - by_stops[i]).abs() < 1e-3 * developed, "both, {i}: {d} {}", by_stops[i]);
    }
    let by_light = values(tracked.grad(&gradients).unwrap());
    for index in [5, 200, 600, 800] {
        let moved = |step: f32| {
            let mut v = light_values.clone();
            v[index] += step;
            let light = tensor(v, [2, CHANNELS, HEIGHT, WIDTH]);
            values(loss(light, tensor(stops_values.clone(), [2, 2]), &sensor, &off()))[0]
        };
        let d = (moved(0.1) - moved(-0.1)) / 0.2;
        assert!((d - by_light[index]).abs() < 5e-3 * by_light[index].abs() + 1e-3, "{d} {}", by_light[index]);
    }
}

#[test]
fn tangent_and_adjoint_agree() {
    // <y, J x> = <J^T y, x> for the sensor: J x from the slopes, J^T y from the tape.
    let sensor = sensor();
    let n = 2 * CHANNELS * HEIGHT * WIDTH;
    let light = tensor(uniform(1, n), [2, CHANNELS, HEIGHT, WIDTH]).require_grad();
    let stops = tensor(vec![0.0; 4], [2, 2]).require_grad();
    let noise = Noise { mode: NoiseMode::Dequantised, seed: 4 };
    let raw = expose_with_stops_op(light.clone(), stops.clone(), &sensor, &captures(), &noise, 0.1).unwrap();
    let y = uniform(2, 2 * HEIGHT * WIDTH);
    let gradients = (raw * tensor(y.clone(), [2, 1, HEIGHT, WIDTH])).sum().backward();
    let (by_light, by_stops) =
        (values(light.grad(&gradients).unwrap()), values(stops.grad(&gradients).unwrap()));
    let (x_light, x_stops) = (uniform(3, n), uniform(4, 4));
    let (mut forward, mut size) = (0.0, 0.0);
    for (b, capture) in captures().iter().enumerate() {
        let frame = picture(&values(light.clone()), b, CHANNELS, HEIGHT, WIDTH);
        let (_, slopes) = crate::sensor::expose_with_tape(&frame, &sensor, capture, &noise, 0.1).unwrap();
        for i in 0..HEIGHT * WIDTH {
            let colour =
                sensor.cfa.colour(capture.placement.row + i / WIDTH, capture.placement.col + i % WIDTH);
            let response = sensor.response(colour);
            let d_light: f64 = (0..CHANNELS)
                .map(|c| response[c] * x_light[(b * CHANNELS + c) * HEIGHT * WIDTH + i] as f64)
                .sum();
            let tangent = slopes.light[i] as f64 * d_light
                + slopes.log2_gain[i] as f64 * x_stops[2 * b] as f64
                + slopes.log2_exposure[i] as f64 * x_stops[2 * b + 1] as f64;
            forward += y[b * HEIGHT * WIDTH + i] as f64 * tangent;
            size += (y[b * HEIGHT * WIDTH + i] as f64 * tangent).abs();
        }
    }
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| *a as f64 * *b as f64).sum::<f64>();
    let backward = dot(&by_light, &x_light) + dot(&by_stops, &x_stops);
    assert!((forward - backward).abs() < 1e-5 * size, "{forward} {backward}");
}

#[test]
fn the_dequantised_gradient_matches_differences_of_the_mean_score() {
    // Mean over many pixels of tanh((dn - 200) / 100): its gradient, against differences of independent frames.
    let side = 700;
    let sensor = SensorModel { nonuniformity: NonUniformity::default(), ..sensor() };
    let exposure = Exposure { white_e: 3000.0, time_s: 0.05, linear_gain: 1.0 };
    let score = |dn: f32| ((dn as f64 - 200.0) / 100.0).tanh();
    let light = LinearImage::filled(CHANNELS, side, side, 0.15);
    let capture = |frame| Capture { exposure, placement: Placement::default(), frame };
    let noise = Noise { mode: NoiseMode::Dequantised, seed: 9 };
    for which in 0..2 {
        let stops = tensor(vec![0.0; 2], [1, 2]).require_grad();
        let batch = tensor(light.data.clone(), [1, CHANNELS, side, side]);
        let raw = expose_with_stops_op(batch, stops.clone(), &sensor, &[capture(0)], &noise, 0.0).unwrap();
        let gradients = ((raw - 200.0) / 100.0).tanh().mean().backward();
        let gradient = values(stops.grad(&gradients).unwrap())[which] as f64;
        let (mut ends, mut variance) = ([0.0; 2], 0.0);
        let h = 0.125f32;
        for (i, step) in [h, -h].into_iter().enumerate() {
            let exposure =
                if which == 0 { exposure.with_stops(step, 0.0) } else { exposure.with_stops(0.0, step) };
            let capture = Capture { exposure, ..capture(1 + i as u64) };
            let dn = expose(&light, &sensor, &capture, &noise).unwrap().dn;
            let n = dn.len() as f64;
            let mean = dn.iter().map(|&v| score(v)).sum::<f64>() / n;
            variance += dn.iter().map(|&v| (score(v) - mean).powi(2)).sum::<f64>() / (n * n);
            ends[i] = mean;
        }
        let difference = (ends[0] - ends[1]) / (2.0 * h as f64);
        // Four standard errors of the differences and of the gradient's own mean, and the third-order term.
        let error = 4.0 * 2f64.sqrt() * variance.sqrt() / (2.0 * h as f64) + 0.01 * gradient.abs();
        assert!((gradient - difference).abs() < error, "{which}: {gradient} {difference} +- {error}");
        assert!(gradient > 0.1);
    }
}

/// Floor of the error of a picture in stops, the mean square of `log2(picture + floor) - log2(scene + floor)`.
const FLOOR: f32 = 0.004;

#[test]
fn exposure_descends_to_the_optimum_of_a_scan() {
    // A scene of eleven stops. A short exposure buries its shadows in noise and a long one clips its highlights, so an
    // optimum lies between. Gradient descent with fresh noisy frames must find the optimum of a scan with exact counts.
    let side = 96;
    let sensor = SensorModel { nonuniformity: NonUniformity::default(), ..sensor() };
    let scene: Vec<f32> =
        (0..CHANNELS * side * side).map(|i| (-8.0 + 11.0 * (i % side) as f32 / side as f32).exp2()).collect();
    let exposure = Exposure { white_e: 3000.0, time_s: 0.005, linear_gain: 1.0 };
    let log_scene: Vec<f32> = scene.iter().map(|v| (v + FLOOR).log2()).collect();
    let error = |stops: Tensor<2>, frame: u64, mode: NoiseMode| {
        let captures = [Capture { exposure, placement: Placement::default(), frame }];
        let light = tensor(scene.clone(), [1, CHANNELS, side, side]);
        let raw =
            expose_with_stops_op(light, stops.clone(), &sensor, &captures, &Noise { mode, seed: 2 }, 0.0);
        let picture = develop_with_stops_op(raw.unwrap(), stops, &sensor, &captures).unwrap();
        let wanted = tensor(log_scene.clone(), [1, CHANNELS, side, side]);
        let seen = (picture.clamp_min(0.0) + FLOOR).log() / std::f32::consts::LN_2;
        (seen - wanted).square().mean()
    };

    // The scan: eight frames at each quarter stop, and the vertex of a parabola through the three lowest.
    let steps: Vec<f32> = (0..25).map(|i| -3.0 + 0.25 * i as f32).collect();
    let scan: Vec<f32> = steps
        .iter()
        .map(|&s| {
            let at = |f: u64| values(error(tensor(vec![0.0, s], [1, 2]), 1000 + f, NoiseMode::Exact))[0];
            (0..8).map(at).sum::<f32>() / 8.0
        })
        .collect();
    let best = (1..24).min_by(|&a, &b| scan[a].total_cmp(&scan[b])).unwrap();
    let [low, mid, high] = [scan[best - 1], scan[best], scan[best + 1]];
    let optimum = steps[best] + 0.125 * (low - high) / (low - 2.0 * mid + high);
    assert!((2..23).contains(&best), "the optimum lies inside the scan: {optimum}");

    for start in [-2.5f32, 2.5] {
        // Adam, its rate falling, and the mean of the last third.
        let (mut stops, mut m, mut v, mut last) = (start, 0.0f32, 0.0f32, Vec::new());
        for step in 1..=150 {
            let leaf = tensor(vec![0.0, stops], [1, 2]).require_grad();
            let gradients = error(leaf.clone(), step as u64, NoiseMode::Dequantised).backward();
            let g = values(leaf.grad(&gradients).unwrap())[1];
            (m, v) = (0.9 * m + 0.1 * g, 0.99 * v + 0.01 * g * g);
            let rate = 0.15 / (1.0 + step as f32 / 50.0);
            stops -= rate * m / (1.0 - 0.9f32.powi(step)) / ((v / (1.0 - 0.99f32.powi(step))).sqrt() + 1e-8);
            if step > 100 {
                last.push(stops);
            }
        }
        let found = last.iter().sum::<f32>() / last.len() as f32;
        assert!((found - optimum).abs() < 0.2, "from {start}: {found}, scan {optimum}");
    }
}

#[test]
fn wrong_shapes_of_stops_are_errors_and_extreme_stops_give_nan() {
    let (sensor, captures) = (sensor(), captures());
    let light = || tensor(uniform(1, 2 * CHANNELS * HEIGHT * WIDTH), [2, CHANNELS, HEIGHT, WIDTH]);
    let three = tensor(vec![0.0; 6], [2, 3]);
    assert!(expose_with_stops_op(light(), three.clone(), &sensor, &captures, &off(), 0.0).is_err());
    assert!(
        expose_with_stops_op(light(), tensor(vec![0.0; 4], [2, 2]), &sensor, &captures, &off(), -1.0)
            .is_err()
    );
    let raw = expose_op(light(), &sensor, &captures, &off()).unwrap();
    assert!(develop_with_stops_op(raw, three, &sensor, &captures).is_err());

    let stops = tensor(vec![f32::NAN, 0.0, 0.0, 500.0], [2, 2]).require_grad();
    let raw = expose_with_stops_op(light(), stops.clone(), &sensor, &captures, &off(), 0.0).unwrap();
    let picture = develop_with_stops_op(raw, stops.clone(), &sensor, &captures).unwrap();
    let gradients = picture.clone().sum().backward();
    assert!(values(picture).iter().all(|v| v.is_nan()));
    assert!(values(stops.grad(&gradients).unwrap()).iter().all(|v| v.is_nan()));

    // Gain steps restrict a capture, but not the continuous search.
    let stepped = SensorModel { gain_steps: vec![1.0, 1.77], ..sensor };
    assert!(expose_op(light(), &stepped, &captures, &off()).is_err());
    let zero = tensor(vec![0.0; 4], [2, 2]);
    assert!(expose_with_stops_op(light(), zero, &stepped, &captures, &off(), 0.0).is_ok());
}
