//! The limit against dense linear algebra over all pixels, against closed forms, and its gradient against differences.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use petzval_fourier::Complex64;

use super::alias::Mosaic;
use super::*;
use crate::sensor::CfaPattern;

const SCENES: NaturalScenes = NaturalScenes { mean: 0.2, power: 4.29e-3, correlation: 0.9 };
const WHITE_E: f64 = 900.0;
const DARK_E2: f64 = 40.0;

/// Pixels of red, green and blue with some light of the others.
fn mixed(cfa: CfaPattern) -> impl Fn(usize, usize) -> [f64; CHANNELS] {
    use crate::sensor::Colour::{Blue, Green, Red};
    move |row, col| match cfa.colour(row, col) {
        Red => [0.6, 0.1, 0.0],
        Green => [0.1, 0.8, 0.1],
        Blue => [0.0, 0.2, 0.5],
        _ => [0.3, 0.4, 0.3],
    }
}

/// A kernel on a circle of `n` x `n` pixels, row by row.
fn kernel(n: usize, sigma: f64, shift: f64) -> Vec<f64> {
    let folded = |k: usize, shift: f64| {
        let d = (k as f64 - shift + 0.5 * n as f64).rem_euclid(n as f64) - 0.5 * n as f64;
        (-0.5 * (d / sigma).powi(2)).exp()
    };
    let values: Vec<f64> = (0..n * n).map(|i| folded(i / n, shift) * folded(i % n, 0.0)).collect();
    let sum: f64 = values.iter().sum();
    values.into_iter().map(|v| v / sum).collect()
}

fn spectrum(n: usize, kernel: &[f64]) -> Vec<Complex64> {
    let at = |f: usize| {
        let term = |(x, v): (usize, &f64)| {
            let turns = (f / n * (x / n) + f % n * (x % n)) as f64 / n as f64;
            Complex64::cis(-TAU * turns) * *v
        };
        kernel.iter().enumerate().map(term).sum()
    };
    (0..n * n).map(at).collect()
}

/// The covariance of one colour on the circle, by the distance of two pixels.
fn covariance(n: usize) -> Vec<f64> {
    let folded = |k: usize| k.min(n - k) as f64 / n as f64;
    let power = |f: usize| SCENES.spectrum(folded(f / n).hypot(folded(f % n)), 0.5 / n as f64);
    let at = |x: usize| {
        let term = |f: usize| power(f) * (TAU * (f / n * (x / n) + f % n * (x % n)) as f64 / n as f64).cos();
        (0..n * n).map(term).sum::<f64>() / (n * n) as f64
    };
    (0..n * n).map(at).collect()
}

/// The error by one large matrix over the colours of all pixels.
fn dense(n: usize, cfa: CfaPattern, kernels: &[Vec<f64>], illumination: [f64; CHANNELS]) -> [f64; CHANNELS] {
    let (pixels, covariance, response) = (n * n, covariance(n), mixed(cfa));
    let apart = |a: usize, b: usize| (a / n + n - b / n) % n * n + (a % n + n - b % n) % n;
    let scene = DMatrix::from_fn(CHANNELS * pixels, CHANNELS * pixels, |a, b| {
        let colour = if a / pixels == b / pixels { 1.0 } else { SCENES.correlation };
        colour * covariance[apart(a % pixels, b % pixels)]
    });
    let share = |p: usize| {
        let r = response(p / n, p % n);
        (r.map(|v| v / r.iter().sum::<f64>()), WHITE_E * r.iter().sum::<f64>())
    };
    let a = DMatrix::from_fn(pixels, CHANNELS * pixels, |p, x| {
        let c = x / pixels;
        share(p).0[c] * illumination[c] * kernels[c][apart(p, x % pixels)]
    });
    let noise = DMatrix::from_fn(pixels, pixels, |p, q| {
        if p != q {
            return 0.0;
        }
        let (shares, white_e) = share(p);
        let light: f64 = shares.iter().zip(illumination).map(|(s, i)| s * i).sum();
        (SCENES.mean * light * white_e + DARK_E2) / white_e.powi(2)
    });
    let with_scene = &a * &scene;
    let frame = &with_scene * a.transpose() + noise;
    let explained = with_scene.transpose() * frame.cholesky().unwrap().solve(&with_scene);
    [0, 1, 2].map(|c| {
        let of_pixel =
            |p: usize| scene[(c * pixels + p, c * pixels + p)] - explained[(c * pixels + p, c * pixels + p)];
        (0..pixels).map(of_pixel).sum::<f64>() / pixels as f64
    })
}

#[test]
fn the_limit_is_that_of_one_large_matrix_over_all_pixels() {
    let illumination = [0.8, 0.9, 0.7];
    for cfa in [CfaPattern::RGGB, CfaPattern::GBRG, CfaPattern::MONO, "RGB/GBR".parse().unwrap()] {
        let mosaic = Mosaic::new(cfa, mixed(cfa), WHITE_E, DARK_E2);
        let n = mosaic.fitting_side(6);
        let kernels = [kernel(n, 0.8, 0.3), kernel(n, 0.6, 0.0), kernel(n, 1.1, -0.2)];
        let spectra: Vec<_> = kernels.iter().map(|k| spectrum(n, k)).collect();
        let found = mosaic.limit(&SCENES, n, &spectra, illumination, false).mean_square;
        let wanted = dense(n, cfa, &kernels, illumination);
        for c in 0..CHANNELS {
            assert!((found[c] / wanted[c] - 1.0).abs() < 1e-9, "{cfa}: {found:?} {wanted:?}");
        }
    }
}

#[test]
fn without_filters_and_noise_of_colours_the_limit_is_that_of_wiener() {
    // Every pixel sees one gray: the error is the integral of S N / (S K^2 + N).
    let scenes = NaturalScenes { correlation: 1.0, ..SCENES };
    let cfa = CfaPattern::MONO;
    let mosaic = Mosaic::new(cfa, |_, _| [1.0 / 3.0; 3], WHITE_E, DARK_E2);
    let n = 32;
    let k = spectrum(n, &kernel(n, 1.0, 0.0));
    let found = mosaic.limit(&scenes, n, &[k.clone(), k.clone(), k.clone()], [1.0; 3], false).mean_square;
    let noise = (scenes.mean * WHITE_E + DARK_E2) / WHITE_E.powi(2);
    let folded = |k: usize| k.min(n - k) as f64 / n as f64;
    let of_frequency = |f: usize| {
        let s = scenes.spectrum(folded(f / n).hypot(folded(f % n)), 0.5 / n as f64);
        s * noise / (s * k[f].norm_sqr() + noise)
    };
    let wanted = (0..n * n).map(of_frequency).sum::<f64>() / (n * n) as f64;
    assert!(found.iter().all(|v| (v / wanted - 1.0).abs() < 1e-9), "{found:?} {wanted}");
}

/// Gauss curves that grow over the field, darker and moved at its end.
fn bank(sigma_um: f64) -> PsfBank {
    let grid = 48;
    let mut values = Vec::new();
    for (field, growth) in [1.0, 1.3, 2.0].into_iter().enumerate() {
        for colour in 0..CHANNELS {
            let sigma = sigma_um * growth * [1.1, 1.0, 1.2][colour];
            let cell = |i: usize, shift: f64| (-0.5 * ((i as f64 - 23.5 - shift) / sigma).powi(2)).exp();
            let psf: Vec<f64> =
                (0..grid * grid).map(|i| cell(i / grid, field as f64) * cell(i % grid, 0.0)).collect();
            let sum: f64 = psf.iter().sum();
            values.extend(psf.iter().map(|v| (v / sum) as f32));
        }
    }
    let illumination = vec![1.0, 1.0, 1.0, 0.9, 0.91, 0.92, 0.6, 0.62, 0.64];
    PsfBank { field_radius_mm: vec![0.0, 4.0, 6.7], grid, pitch_um: 1.0, values, illumination }
}

fn limit(white_e: f32) -> LinearLimit {
    let sensor =
        toml::from_str(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml")).unwrap();
    let exposure = Exposure { white_e, time_s: 0.005, linear_gain: 1.0 };
    LinearLimit::new(&sensor, &exposure, NaturalScenes::default())
}

fn rms(limit: &LinearLimit, bank: &PsfBank) -> f64 {
    (limit.mean_square(bank).unwrap().iter().sum::<f64>() / CHANNELS as f64).sqrt()
}

#[test]
fn more_light_and_less_blur_leave_less_error() {
    let found =
        [(2.0, 16e3), (5.0, 16e3), (2.0, 100.0)].map(|(sigma, light)| rms(&limit(light), &bank(sigma)));
    assert!(found[0] < 0.8 * found[1] && found[0] < 0.8 * found[2], "{found:?}");
    // A bank in single precision, and an error between those of the noise of a pixel and of no picture at all.
    assert!(found.iter().all(|v| *v > 0.004 && *v < 0.1), "{found:?}");
}

#[test]
fn the_gradient_is_that_of_differences() {
    let (limit, bank) = (limit(2000.0), bank(3.0));
    let found = limit.gradient(&bank).unwrap();
    let plain = limit.mean_square(&bank).unwrap();
    assert_eq!(found.mean_square, plain);
    let value = |bank: &PsfBank| limit.mean_square(bank).unwrap().iter().sum::<f64>() / CHANNELS as f64;
    // By the values of one PSF after the other, along a direction.
    let cells = bank.grid * bank.grid;
    for psf in 0..9 {
        let direction = |i: usize| ((i * 7919) % 101) as f32 / 101.0 - 0.5;
        let moved = |step: f32| {
            let mut moved = bank.clone();
            let values = &mut moved.values[psf * cells..][..cells];
            values.iter_mut().enumerate().for_each(|(i, v)| *v += step * direction(i));
            value(&moved)
        };
        let wanted = (moved(2e-5) - moved(-2e-5)) / 4e-5;
        let along = found.by_values[psf * cells..][..cells].iter().enumerate();
        let along: f64 = along.map(|(i, by)| f64::from(by * direction(i))).sum();
        assert!((along / wanted - 1.0).abs() < 2e-3, "{psf}: {along} {wanted}");
    }
    for i in 0..bank.illumination.len() {
        let moved = |step: f32| {
            let mut moved = bank.clone();
            moved.illumination[i] += step;
            value(&moved)
        };
        let wanted = (moved(0.01) - moved(-0.01)) / 0.02;
        let by = f64::from(found.by_illumination[i]);
        assert!((by / wanted - 1.0).abs() < 2e-3, "{i}: {by} {wanted}");
    }
    for field in 1..3 {
        let moved = |step: f64| {
            let mut moved = bank.clone();
            moved.field_radius_mm[field] += step;
            value(&moved)
        };
        let wanted = (moved(1e-4) - moved(-1e-4)) / 2e-4;
        let by = found.by_radius[field];
        assert!((by / wanted - 1.0).abs() < 5e-3, "{field}: {by} {wanted}");
    }
}
