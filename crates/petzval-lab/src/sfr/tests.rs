//! Edges whose response is known.

use std::f64::consts::PI;

use petzval_camera::render::Placement;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;

const SIDE: usize = 80;

/// The light, 0.2 left and 0.8 right, of an edge blurred by a Gaussian of `sigma` pixels, as square pixels collect it.
fn edge(angle_deg: f64, sigma: f64) -> Vec<f32> {
    let angle = angle_deg.to_radians();
    let (sin, cos) = angle.sin_cos();
    // The integral of the normal distribution's integral: u P(u) + p(u).
    let integral = |distance: f64| {
        let u = distance / sigma;
        let below = 0.5 * libm::erfc(-u / 2f64.sqrt());
        sigma * (u * below + (-0.5 * u * u).exp() / (2.0 * PI).sqrt())
    };
    const POINTS: usize = 32;
    let light = |row: usize, col: usize| {
        // Exact along the row, points along the column.
        let along = |k: usize| {
            let y = row as f64 + (k as f64 + 0.5) / POINTS as f64 - 0.5 * SIDE as f64;
            let [left, right] = [0.0, 1.0].map(|x| {
                let x = col as f64 + x - 0.5 * SIDE as f64 - 0.3;
                integral(x * cos - y * sin)
            });
            (right - left) / cos
        };
        0.2 + 0.6 * (0..POINTS).map(along).sum::<f64>() / POINTS as f64
    };
    (0..SIDE * SIDE).map(|i| light(i / SIDE, i % SIDE) as f32).collect()
}

/// The response of Gaussian blur and of a square pixel, across an inclined edge.
fn known(frequency: f64, angle_deg: f64, sigma: f64) -> f64 {
    let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let pixel = sinc(frequency * cos) * sinc(frequency * sin);
    (-2.0 * (PI * sigma * frequency).powi(2)).exp() * pixel
}

fn window(row: usize, col: usize, height: usize, width: usize) -> Window {
    Window { placement: Placement { row, col }, height, width }
}

fn measured(values: &[f32]) -> Result<EdgeResponse, SfrError> {
    slanted_edge(&Plane { values, width: SIDE }, &window(4, 8, SIDE - 8, SIDE - 16))
}

#[test]
fn the_response_is_that_of_blur_and_pixel() {
    for (angle_deg, sigma) in [(5.0, 0.3), (5.0, 0.7), (-7.3, 0.7), (3.1, 1.4), (12.0, 0.5), (5.0, 2.5)] {
        let of = measured(&edge(angle_deg, sigma)).unwrap();
        assert!((of.angle_deg - angle_deg).abs() < 0.02, "{angle_deg}: {}", of.angle_deg);
        for k in 1..=60 {
            let frequency = 0.01 * f64::from(k);
            let (found, wanted) = (of.sfr.at(frequency), known(frequency, angle_deg, sigma));
            assert!((found - wanted).abs() < 0.01, "{angle_deg} {sigma} {frequency}: {found} {wanted}");
        }
        let wanted = (0..1000).map(|k| 1e-3 * f64::from(k)).find(|f| known(*f, angle_deg, sigma) < 0.5);
        let (found, wanted) = (of.sfr.mtf50().unwrap(), wanted.unwrap());
        assert!((found / wanted - 1.0).abs() < 0.01, "{angle_deg} {sigma}: {found} {wanted}");
        assert!((of.levels[0] - 0.2).abs() < 1e-3 && (of.levels[1] - 0.8).abs() < 1e-3, "{:?}", of.levels);
        assert!(of.overshoot < 0.002 && of.undershoot < 0.002 && of.roughness_px < 0.02);
    }
}

#[test]
fn the_edge_may_stand_or_lie_and_be_bright_on_either_side() {
    let upright = edge(5.0, 0.7);
    let wanted = measured(&upright).unwrap();
    let turned: Vec<f32> = (0..SIDE * SIDE).map(|i| upright[i % SIDE * SIDE + i / SIDE]).collect();
    let inverse: Vec<f32> = upright.iter().map(|v| 1.0 - v).collect();
    let lying = slanted_edge(&Plane { values: &turned, width: SIDE }, &window(8, 4, SIDE - 16, SIDE - 8));
    for found in [lying.unwrap(), measured(&inverse).unwrap()] {
        for (a, b) in found.sfr.modulation.iter().zip(&wanted.sfr.modulation).take(60) {
            assert!((a - b).abs() < 0.004, "{a} {b}");
        }
        assert!((found.angle_deg.abs() - 5.0).abs() < 0.02);
    }
}

#[test]
fn noise_changes_mtf50_little() {
    let clean = edge(5.0, 0.7);
    let wanted = measured(&clean).unwrap().sfr.mtf50().unwrap();
    let noise = Normal::new(0.0_f32, 0.02).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut mean = 0.0;
    for _ in 0..10 {
        let noisy: Vec<f32> = clean.iter().map(|v| v + noise.sample(&mut rng)).collect();
        let found = measured(&noisy).unwrap().sfr.mtf50().unwrap();
        assert!((found / wanted - 1.0).abs() < 0.15, "{found} {wanted}");
        mean += found / 10.0;
    }
    assert!((mean / wanted - 1.0).abs() < 0.05, "{mean} {wanted}");
}

#[test]
fn sharpening_shows_as_overshoot_and_as_a_response_above_one() {
    let soft = edge(5.0, 1.0);
    // `v + (v - mean of the neighbours)`, whose response along the row is 2 - cos(2 pi f).
    let at = |i: usize, by: i64| soft[(i as i64 + by).clamp(0, (SIDE * SIDE) as i64 - 1) as usize];
    let sharp: Vec<f32> = (0..SIDE * SIDE).map(|i| 2.0 * at(i, 0) - 0.5 * (at(i, -1) + at(i, 1))).collect();
    let found = measured(&sharp).unwrap();
    // The profile P - P'' / 2 of the normal integral P reaches 1.028.
    for found in [found.overshoot, found.undershoot] {
        assert!((found - 0.028).abs() < 0.006, "{found}");
    }
    for frequency in [0.1, 0.2, 0.3, 0.4] {
        let cos = 5f64.to_radians().cos();
        let wanted = known(frequency, 5.0, 1.0) * (2.0 - (2.0 * PI * frequency * cos).cos());
        assert!((found.sfr.at(frequency) - wanted).abs() < 0.015, "{frequency}");
    }
}

#[test]
fn what_is_no_slanted_edge_is_refused() {
    let flat = vec![0.5; SIDE * SIDE];
    assert_eq!(measured(&flat), Err(SfrError::NoEdge));
    assert!(matches!(measured(&edge(0.2, 0.7)), Err(SfrError::Angle { .. })));
    let steep = edge(5.0, 0.7);
    let of = |window| slanted_edge(&Plane { values: &steep, width: SIDE }, &window);
    assert_eq!(of(window(10, 10, SIDE, 20)), Err(SfrError::Outside));
    assert!(matches!(of(window(10, 30, 10, 20)), Err(SfrError::Small { .. })));
    assert!(matches!(of(window(10, 35, 60, 16)), Err(SfrError::Small { .. })));
}
