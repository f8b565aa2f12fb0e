//! Merged exposures of scenes that are known.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson};

use super::*;
use crate::sensor::CfaPattern;

const BLACK: f64 = 64.0;
const FULL: f64 = 4095.0;
/// Digital numbers of an electron, and electrons of read noise.
const GAIN: f64 = 0.4;
const READ_E: f64 = 2.5;

const SIZE: (usize, usize) = (64, 256);

/// A 12-bit frame at an exposure of `light`, in electrons of the longest exposure, by row and column.
fn frame(exposure: f64, light: impl Fn(usize, usize) -> f64, seed: u64) -> RawInput {
    let (height, width) = SIZE;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let read = Normal::new(0.0, READ_E).unwrap();
    let mut dn = Vec::new();
    for i in 0..height * width {
        let mean = light(i / width, i % width) * exposure;
        let electrons = if mean > 0.0 { Poisson::new(mean).unwrap().sample(&mut rng) } else { 0.0 };
        let value = BLACK + GAIN * (electrons + read.sample(&mut rng));
        dn.push(value.round().clamp(0.0, FULL) as u32);
    }
    let range = FULL - BLACK;
    // Rounding to digital numbers adds a twelfth of one.
    let dark_dn2 = (GAIN * READ_E).powi(2) + 1.0 / 12.0;
    let noise = NoiseProfile { shot: GAIN / range, read: dark_dn2 / range.powi(2) };
    let about = FrameData {
        black_dn: BLACK,
        white_dn: FULL,
        response: [1.0; 3],
        saturation: 1.0,
        noise,
        gain_ev: 0.0,
        colour_matrix: None,
        companding: None,
        shading: None,
        warp: None,
    };
    RawInput { height, width, dn, bits: 12, cfa: CfaPattern::RGGB, about }
}

const EXPOSURES: [f64; 3] = [1.0, 1.0 / 8.0, 1.0 / 64.0];

fn merged(light: impl Fn(usize, usize) -> f64, options: &MergeOptions) -> RawInput {
    let frames: Vec<RawInput> =
        EXPOSURES.iter().enumerate().map(|(k, e)| frame(*e, &light, 7 + k as u64)).collect();
    merge_exposures(&frames, &EXPOSURES, options).unwrap().frame
}

/// Light of a merged frame in electrons of the longest exposure.
fn electrons(frame: &RawInput) -> Vec<f64> {
    let per_e = GAIN * (frame.about.white_dn - frame.about.black_dn) / (FULL - BLACK);
    frame.dn.iter().map(|dn| (f64::from(*dn) - frame.about.black_dn) / per_e).collect()
}

fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64)
}

/// Variance of the best linear estimate from exposures that do not saturate, electrons of the longest squared.
fn best_variance(light: f64, from: usize) -> f64 {
    let rounding = 1.0 / 12.0 / GAIN.powi(2);
    let of = |e: &f64| (light * e + READ_E.powi(2) + rounding) / e.powi(2);
    1.0 / EXPOSURES[from..].iter().map(|e| 1.0 / of(e)).sum::<f64>()
}

#[test]
fn noise_is_that_of_the_best_linear_estimate() {
    // The longest saturates at 10,000 electrons, the next at 80,000.
    for (light, from) in [(0.0, 0), (30.0, 0), (1000.0, 0), (6000.0, 0), (20_000.0, 1), (300_000.0, 2)] {
        let found = electrons(&merged(|_, _| light, &MergeOptions::default()));
        let (mean, variance) = mean_and_variance(&found);
        let wanted = best_variance(light, from);
        // 16,384 pixels: the variance is known to 1.1 %; the light has steps of a quarter of a digital number.
        assert!((variance / wanted - 1.0).abs() < 0.05, "{light}: {variance} {wanted}");
        let error = (wanted / found.len() as f64).sqrt();
        assert!((mean - light).abs() < 5.0 * error + 2e-4 * light, "{light}: {mean}, {error}");
    }
}

#[test]
fn the_profile_says_how_noisy_the_merged_frame_is() {
    for light in [0.0, 200.0, 5000.0] {
        let frame = merged(|_, _| light, &MergeOptions::default());
        let white_e = (FULL - BLACK) / GAIN;
        let (_, variance) = mean_and_variance(&electrons(&frame));
        let noise = frame.about.noise;
        let said = (noise.shot * light / white_e + noise.read) * white_e.powi(2);
        assert!((variance / said - 1.0).abs() < 0.06, "{light}: {variance} {said}");
    }
}

#[test]
fn the_change_of_exposure_leaves_no_seam() {
    // Light grows from 5,000 electrons to 160,000 over the columns, past the saturation of two exposures.
    let light = |col: usize| 5000.0 * 32f64.powf(col as f64 / 255.0);
    let mut sums = vec![0.0; SIZE.1];
    const RUNS: u64 = 12;
    for run in 0..RUNS {
        let frames: Vec<RawInput> = EXPOSURES
            .iter()
            .enumerate()
            .map(|(k, e)| frame(*e, |_, col| light(col), 100 + 10 * run + k as u64))
            .collect();
        let found = electrons(&merge_exposures(&frames, &EXPOSURES, &MergeOptions::default()).unwrap().frame);
        (0..found.len()).for_each(|i| sums[i % SIZE.1] += found[i]);
    }
    let count = (RUNS as usize * SIZE.0) as f64;
    for (col, sum) in sums.iter().enumerate() {
        let apart = sum / count / light(col) - 1.0;
        // 768 pixels of at most 3 % noise.
        assert!(apart.abs() < 0.005, "column {col}: {apart}");
    }
}

#[test]
fn the_brightest_light_is_kept_up_to_the_end_of_the_shortest_exposure() {
    let frame = merged(|_, col| if col < 128 { 500_000.0 } else { 5e6 }, &MergeOptions::default());
    assert!(frame.bits <= 24 && frame.bits >= 18, "{}", frame.bits);
    frame.validate().unwrap();
    let found = electrons(&frame);
    let (bright, _) = mean_and_variance(&found[10 * SIZE.1..][..128]);
    assert!((bright / 500_000.0 - 1.0).abs() < 0.01, "{bright}");
    // Everything saturates: the light is that of the end of the shortest exposure, as the frame says.
    let end = 64.0 * (FULL - BLACK) / GAIN;
    assert!(found[10 * SIZE.1 + 128..][..128].iter().all(|v| (v / end - 1.0).abs() < 1e-3));
    assert!((frame.about.saturation / 64.0 - 1.0).abs() < 1e-6);
}

#[test]
fn what_moved_is_shown_once() {
    // A square of 2,000 electrons on 300 moves by half its side between the exposures.
    let square = |from: usize, bright: f64| {
        move |row: usize, col: usize| {
            if (16..48).contains(&row) && (from..from + 64).contains(&col) { bright } else { 300.0 }
        }
    };
    let of = |bright: f64, options: &MergeOptions| {
        let frames = [frame(1.0, square(64, bright), 1), frame(1.0 / 2.0, square(96, bright), 2)];
        electrons(&merge_exposures(&frames, &[1.0, 0.5], options).unwrap().frame)
    };
    let mean = |found: &[f64], cols: std::ops::Range<usize>| {
        let values: Vec<f64> =
            (20..44).flat_map(|row| found[row * SIZE.1..][cols.clone()].to_vec()).collect();
        mean_and_variance(&values).0
    };
    let off = MergeOptions { motion_sigmas: None };
    // The place that it left, and that to which it came: mixed without the check, those of the longer exposure with it.
    let (ghost, whole) = (of(2000.0, &off), of(2000.0, &MergeOptions::default()));
    assert!(
        (500.0..1900.0).contains(&mean(&ghost, 66..94)) && (400.0..1800.0).contains(&mean(&ghost, 130..158))
    );
    assert!((mean(&whole, 66..94) / 2000.0 - 1.0).abs() < 0.02, "{}", mean(&whole, 66..94));
    assert!((mean(&whole, 130..158) / 300.0 - 1.0).abs() < 0.05, "{}", mean(&whole, 130..158));
    // One that saturates the longer exposure is where the shorter one saw it, at both places.
    let bright = of(15_000.0, &MergeOptions::default());
    assert!((mean(&bright, 66..94) / 300.0 - 1.0).abs() < 0.05, "{}", mean(&bright, 66..94));
    assert!((mean(&bright, 130..158) / 15_000.0 - 1.0).abs() < 0.02, "{}", mean(&bright, 130..158));
    // A resting scene is not touched by the check, except for rare noise.
    let rest = |options| merged(|_, col| 40.0 * col as f64, options).dn;
    let changed = rest(&off).iter().zip(rest(&MergeOptions::default())).filter(|(a, b)| **a != *b).count();
    assert!(changed < SIZE.0 * SIZE.1 / 500, "{changed}");
}

#[test]
fn wrong_exposures_contradict_what_is_lit_and_moving_objects_a_part_of_it() {
    let motion = |frames: &[RawInput], exposures: &[f64]| {
        merge_exposures(frames, exposures, &MergeOptions::default()).unwrap().motion
    };
    // Four fifths of the frame are dark, as at night. The brightest light saturates the longer exposure.
    let light = |_: usize, col: usize| 400.0 * col.saturating_sub(204) as f64;
    let frames = [frame(1.0, light, 1), frame(0.125, light, 2)];
    let right = motion(&frames, &[1.0, 0.125]);
    assert!(right.lit < right.blocks / 4 && right.moved < right.lit / 20, "{right:?}");
    assert!(!right.is_doubtful(), "{right:?}");
    for wrong in [[1.0, 1.0], [0.125, 1.0], [1.0, 0.5]] {
        let found = motion(&frames, &wrong);
        assert!(10 * found.moved > 9 * found.lit && found.is_doubtful(), "{wrong:?} {found:?}");
    }
    // A bar that moves.
    let bar = |from: usize| {
        move |_: usize, col: usize| if (from..from + 16).contains(&col) { 2000.0 } else { 300.0 }
    };
    let found = motion(&[frame(1.0, bar(64), 3), frame(0.5, bar(96), 4)], &[1.0, 0.5]);
    // The light changes in 32 of the 256 columns.
    assert!((0.1..0.15).contains(&(found.moved as f64 / found.blocks as f64)), "{found:?}");
    assert!(!found.is_doubtful(), "{found:?}");
    // Without the check nothing is counted.
    let off = MergeOptions { motion_sigmas: None };
    assert_eq!(merge_exposures(&frames, &[1.0, 1.0], &off).unwrap().motion, Motion::default());
}

#[test]
fn frames_that_do_not_belong_together_are_refused() {
    let one = frame(1.0, |_, _| 100.0, 1);
    let other = RawInput { cfa: CfaPattern::GRBG, ..one.clone() };
    let run = |frames: &[RawInput], exposures: &[f64]| {
        merge_exposures(frames, exposures, &MergeOptions::default()).unwrap_err().to_string()
    };
    assert!(run(std::slice::from_ref(&one), &[1.0]).contains("2 to 8"));
    assert!(run(&[one.clone(), other], &[1.0, 0.5]).contains("same size and array"));
    assert!(run(&[one.clone(), one.clone()], &[1.0, -0.5]).contains("positive"));
    assert!(run(&[one.clone(), one.clone()], &[1.0]).contains("one for each frame"));
    assert!(run(&[one.clone(), one], &[1.0, 1.0 / 8192.0]).contains("24 bits"));
}

#[test]
fn companded_exposures_are_merged_as_linear_ones() {
    let light = |_: usize, col: usize| 30.0 * col as f64;
    let linear: Vec<RawInput> = [1.0, 0.25].iter().map(|e| frame(*e, light, 3)).collect();
    let knots =
        super::super::Companding { companded_dn: vec![0, 1024, 4095], linear_dn: vec![0, 1024, 16383] };
    let mut companded = linear.clone();
    for frame in &mut companded {
        frame.about.companding = Some(knots.clone());
        frame.dn.iter_mut().for_each(|dn| *dn = knots.compress(*dn));
    }
    let of = |frames: &[RawInput]| {
        electrons(&merge_exposures(frames, &[1.0, 0.25], &MergeOptions::default()).unwrap().frame)
    };
    let (a, b) = (of(&linear), of(&companded));
    let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // A step of the companded numbers is five linear ones.
    assert!(apart < 6.0 / GAIN, "{apart}");
}
