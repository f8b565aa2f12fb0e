use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::quality::psnr;

/// A picture of smooth waves and hard, coloured edges.
fn scene(height: usize, width: usize) -> LinearImage {
    let mut image = LinearImage::zeros(CHANNELS, height, width);
    for c in 0..CHANNELS {
        for r in 0..height {
            for k in 0..width {
                let (x, y) = (k as f32, r as f32);
                let wave = (0.35 * x + 0.2 * y).sin() * (0.11 * y - 0.07 * x).cos();
                let edge = if (x - 40.0).hypot(y - 30.0) < 18.0 { [0.3, 0.1, -0.1][c] } else { 0.0 };
                image.set(c, r, k, 0.45 + 0.2 * wave + edge);
            }
        }
    }
    image
}

fn mosaic(image: &LinearImage, cfa: CfaPattern, placement: Placement) -> Vec<f32> {
    let pixel = |i: usize| {
        let (r, c) = (i / image.width, i % image.width);
        let plane = cfa.colour(placement.row + r, placement.col + c).plane().unwrap();
        image.get(plane, r, c)
    };
    (0..image.height * image.width).map(pixel).collect()
}

#[test]
fn malvar_and_menon_match_colour_demosaicing() {
    let text = include_str!("../../../tests/fixtures/demosaic_directional.json");
    let fixture: serde_json::Value = serde_json::from_str(text).unwrap();
    let number = |v: &serde_json::Value| v.as_f64().unwrap() as f32;
    let (height, width) = (12, 14);
    // The library has other rules at the border: Malvar reaches two pixels, the choice of directions four.
    for (method, key, border) in [(Demosaic::Malvar, "malvar2004", 2), (Demosaic::Menon, "menon2007", 4)] {
        for (name, cfa) in [("RGGB", CfaPattern::RGGB), ("GBRG", CfaPattern::GBRG)] {
            let (given, expected) = (&fixture[name]["mosaic"], &fixture[name][key]);
            let values: Vec<f32> =
                (0..height * width).map(|i| number(&given[i / width][i % width])).collect();
            let rgb = method.apply(&values, height, width, cfa, Placement::default()).unwrap();
            for r in border..height - border {
                for c in border..width - border {
                    for channel in 0..CHANNELS {
                        let apart = rgb.get(channel, r, c) - number(&expected[r][c][channel]);
                        assert!(apart.abs() < 1e-6, "{key} {name} ({channel}, {r}, {c}): {apart}");
                    }
                }
            }
        }
    }
}

#[test]
fn every_method_keeps_what_was_measured_and_flat_pictures() {
    let image = scene(61, 83);
    for method in Demosaic::ALL {
        for placement in [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(row, col)| Placement { row, col }) {
            let values = mosaic(&image, CfaPattern::RGGB, placement);
            let rgb = method.apply(&values, 61, 83, CfaPattern::RGGB, placement).unwrap();
            let again = mosaic(&rgb, CfaPattern::RGGB, placement);
            // Menon's refinement moves green at red and blue, never a measured value.
            assert!(values.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-6), "{}", method.name());
            // A flat picture stays flat, up to its border.
            let flat = method.apply(&[0.25; 61 * 83], 61, 83, CfaPattern::RGGB, placement).unwrap();
            assert!(flat.data.iter().all(|v| (v - 0.25).abs() < 1e-5), "{}", method.name());
        }
    }
}

/// On a picture with structure and edges the methods that compare neighbours are better than fixed filters, and these than the mean.
#[test]
fn the_methods_rank_as_published() {
    let image = scene(256, 300);
    let of = |method: Demosaic| {
        let values = mosaic(&image, CfaPattern::GRBG, Placement::default());
        let rgb = method.apply(&values, 256, 300, CfaPattern::GRBG, Placement::default()).unwrap();
        psnr(&image.data, &rgb.data).unwrap()
    };
    let [bilinear, malvar, rcd, menon] = Demosaic::ALL.map(of);
    assert!(bilinear + 1.5 < malvar && malvar < rcd && malvar < menon);
}

#[test]
fn strips_join_without_seams_and_small_or_wrong_mosaics_do_no_harm() {
    let image = scene(300, 64);
    let at = Placement::default();
    let values = mosaic(&image, CfaPattern::RGGB, at);
    for method in Demosaic::ALL {
        let whole = method.apply(&values, 300, 64, CfaPattern::RGGB, at).unwrap();
        // Rows 100..200 alone, with as many rows around them as a method can look.
        let (from, to) = (100 - 24, 200 + 24);
        let cut = method.apply(&values[from * 64..to * 64], to - from, 64, CfaPattern::RGGB, at).unwrap();
        assert_eq!(whole.crop(100, 0, 100, 64), cut.crop(24, 0, 100, 64), "{}", method.name());
        let tiny = method.apply(&[0.1, 0.2, 0.3, 0.4], 2, 2, CfaPattern::RGGB, at).unwrap();
        assert!(tiny.data.iter().all(|v| v.is_finite()));
        for odd in [0.0, -0.01, 1e9] {
            let values = vec![odd; 40 * 40];
            let rgb = method.apply(&values, 40, 40, CfaPattern::RGGB, at).unwrap();
            assert!(rgb.data.iter().all(|v| v.is_finite()), "{} of {odd}", method.name());
        }
        assert!(method.apply(&values[1..], 300, 64, CfaPattern::RGGB, at).is_err());
    }
    assert!(Demosaic::Menon.apply(&[0.0; 64], 8, 8, CfaPattern::MONO, at).is_err());
}

/// At fixed directions every method with a gradient is linear, and the directions are those of the mosaic itself:
/// `<A x, y> = <x, A^T y>` holds exactly.
#[test]
fn the_adjoint_is_the_transpose() {
    let (height, width) = (150, 37);
    let mut generator = ChaCha8Rng::seed_from_u64(5);
    let mut random = |n: usize| -> Vec<f32> { (0..n).map(|_| generator.random()).collect() };
    for method in Demosaic::ALL.into_iter().filter(|m| m.is_differentiable()) {
        for placement in [(0, 0), (1, 0), (0, 1)].map(|(row, col)| Placement { row, col }) {
            let x = random(height * width);
            let y = random(CHANNELS * height * width).iter().map(|v| v - 0.5).collect();
            let y = LinearImage::from_data(CHANNELS, height, width, y).unwrap();
            let image = method.apply(&x, height, width, CfaPattern::GRBG, placement).unwrap();
            let bar = method.adjoint(&x, &y, CfaPattern::GRBG, placement).unwrap();
            let dot = |a: &[f32], b: &[f32]| -> (f64, f64) {
                let products = a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b));
                products.fold((0.0, 0.0), |(sum, square), v| (sum + v, square + v * v))
            };
            let ((forward, square), (backward, _)) = (dot(&image.data, &y.data), dot(&x, &bar));
            // Rounding adds up like a random walk over the products.
            assert!(
                (forward - backward).abs() < 1e-5 * square.sqrt(),
                "{}: {forward} {backward}",
                method.name()
            );
        }
    }
    let (x, y) = (random(height * width), LinearImage::zeros(CHANNELS, height, width));
    assert!(Demosaic::Rcd.adjoint(&x, &y, CfaPattern::GRBG, Placement::default()).is_err());
    assert!(Demosaic::Menon.adjoint(&x[1..], &y, CfaPattern::GRBG, Placement::default()).is_err());
}
