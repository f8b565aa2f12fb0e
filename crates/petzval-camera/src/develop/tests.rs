use super::*;
use crate::sensor::{Noise, NoiseMode, expose};

fn sensor() -> SensorModel {
    SensorModel::from_toml(include_str!("../../../../data/sensors/imx249-fitted.toml")).unwrap()
}

fn capture(row: usize, col: usize) -> Capture {
    let exposure = Exposure { white_e: 15000.0, time_s: 0.01, linear_gain: 1.5 };
    Capture { exposure, placement: Placement { row, col }, frame: 0 }
}

fn uniform(seed: u64, n: usize) -> Vec<f32> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random::<f32>()).collect()
}

#[test]
fn bilinear_demosaic_matches_colour_demosaicing() {
    // colour_demosaicing 0.2.7, demosaicing_CFA_Bayer_bilinear; its borders follow another rule, so one pixel is left out.
    let text = include_str!("../../tests/fixtures/demosaic_bilinear.json");
    let fixture: serde_json::Value = serde_json::from_str(text).unwrap();
    for (name, cfa) in [("RGGB", CfaPattern::RGGB), ("GBRG", CfaPattern::GBRG)] {
        let (mosaic, expected) = (&fixture[name]["mosaic"], &fixture[name]["bilinear"]);
        let number = |v: &serde_json::Value| v.as_f64().unwrap() as f32;
        let (height, width) = (12, 14);
        let values: Vec<f32> = (0..height * width).map(|i| number(&mosaic[i / width][i % width])).collect();
        let rgb = demosaic_bilinear(&values, height, width, cfa, Placement::default()).unwrap();
        for r in 1..height - 1 {
            for c in 1..width - 1 {
                for channel in 0..CHANNELS {
                    let difference = rgb.get(channel, r, c) - number(&expected[r][c][channel]);
                    assert!(difference.abs() < 1e-6, "{name} ({channel}, {r}, {c}): {difference}");
                }
            }
        }
    }
}

#[test]
fn a_gray_scene_comes_back_at_any_phase_of_the_mosaic() {
    let light = LinearImage::filled(CHANNELS, 7, 9, 0.37);
    for (row, col) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let noise = Noise { mode: NoiseMode::Off, seed: 0 };
        let raw = expose(&light, &sensor(), &capture(row, col), &noise).unwrap();
        let rgb = develop(&raw, &sensor()).unwrap();
        assert!(rgb.data.iter().all(|v| (v - 0.37).abs() < 1e-6));
    }
}

#[test]
fn noisy_development_is_unbiased() {
    let light = LinearImage::filled(CHANNELS, 400, 400, 0.02);
    let raw = expose(&light, &sensor(), &capture(3, 5), &Noise { mode: NoiseMode::Exact, seed: 4 }).unwrap();
    let rgb = develop(&raw, &sensor()).unwrap();
    for c in 0..CHANNELS {
        let n = rgb.plane(c).len() as f64;
        let mean = rgb.plane(c).iter().map(|&v| v as f64).sum::<f64>() / n;
        // At least 40000 independent pixels of standard deviation below 0.0015.
        assert!((mean - 0.02).abs() < 4.0 * 0.0015 / 200.0, "{mean}");
    }
}

#[test]
fn the_adjoint_is_the_transpose() {
    let (sensor, (height, width)) = (sensor(), (9, 12));
    for (row, col) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let capture = capture(row, col);
        let linear = |dn: Vec<f32>| develop(&Raw { height, width, dn, capture }, &sensor).unwrap();
        let (a, b) = (uniform(1, height * width), uniform(2, height * width));
        // The offset cancels in a difference.
        let sum: Vec<f32> = a.iter().zip(&b).map(|(x, y)| 1000.0 + 100.0 * (x - y)).collect();
        let (high, low) = (linear(sum.clone()), linear(vec![1000.0; height * width]));
        let y =
            LinearImage::from_data(CHANNELS, height, width, uniform(3, CHANNELS * height * width)).unwrap();
        let forward: f64 =
            (0..y.data.len()).map(|i| y.data[i] as f64 * (high.data[i] as f64 - low.data[i] as f64)).sum();
        let back = develop_adjoint(&y, &sensor, &capture).unwrap();
        let backward: f64 = back.iter().zip(&sum).map(|(g, s)| *g as f64 * (*s as f64 - 1000.0)).sum();
        let size: f64 = back.iter().zip(&sum).map(|(g, s)| (*g as f64 * (*s as f64 - 1000.0)).abs()).sum();
        assert!((forward - backward).abs() < 1e-5 * size, "{forward} {backward}");
    }
}

#[test]
fn the_same_bits_on_one_thread_and_on_two() {
    let (sensor, capture) = (sensor(), capture(1, 0));
    let raw =
        Raw { height: 40, width: 50, dn: uniform(5, 2000).iter().map(|v| v * 4000.0).collect(), capture };
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let rgb = develop(&raw, &sensor).unwrap();
            (develop_adjoint(&rgb, &sensor, &capture).unwrap(), rgb)
        })
    };
    assert!(run(1) == run(2));
}

#[test]
fn shading_correction_divides_down_to_the_floor() {
    let image = LinearImage::from_data(1, 1, 3, vec![0.5, 0.5, 0.5]).unwrap();
    let map = LinearImage::from_data(1, 1, 3, vec![1.0, 0.5, 0.01]).unwrap();
    assert_eq!(correct_shading(&image, &map, 0.25).unwrap().data, vec![0.5, 1.0, 2.0]);
    assert!(correct_shading(&image, &LinearImage::zeros(1, 3, 1), 0.25).is_err());
    assert!(matches!(correct_shading(&image, &map, 0.0), Err(SensorError::ShadingFloor { .. })));
}

#[test]
fn too_small_a_frame_is_an_error() {
    let raw = Raw { height: 1, width: 5, dn: vec![0.0; 5], capture: capture(0, 0) };
    assert!(matches!(develop(&raw, &sensor()), Err(SensorError::Shape { what: "mosaic", .. })));
}
