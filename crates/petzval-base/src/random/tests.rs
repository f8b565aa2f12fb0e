//! Statistical tests of the random numbers against their distributions.

use super::*;

const WIDTH: usize = 50_000;
const ROWS: usize = 20;

/// A million counts of one rate: 20 rows of 50,000 pixels.
fn counts(rate: f64, seed: u64, frame: u64) -> Vec<f64> {
    let (rates, mut scratch) = (vec![rate; WIDTH], PoissonScratch::default());
    let mut all = vec![0.0; ROWS * WIDTH];
    for (row, counts) in all.chunks_exact_mut(WIDTH).enumerate() {
        poisson_row(&rates, Stream::new(seed, frame, Stage::Shot), place(row, 0), &mut scratch, counts);
    }
    all
}

/// A million pairs of normal numbers.
fn normals(seed: u64, frame: u64, stage: Stage) -> [Vec<f64>; 2] {
    let mut pairs = [vec![0.0; ROWS * WIDTH], vec![0.0; ROWS * WIDTH]];
    let [a, b] = &mut pairs;
    for (row, (a, b)) in a.chunks_exact_mut(WIDTH).zip(b.chunks_exact_mut(WIDTH)).enumerate() {
        Stream::new(seed, frame, stage).normals_row(place(row, 0), a, b);
    }
    pairs
}

/// Correlation of two series over its standard deviation for independent ones.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len()) as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - ma) * (y - mb);
        aa += (x - ma) * (x - ma);
        bb += (y - mb) * (y - mb);
    }
    ab / (aa * bb).sqrt() * n.sqrt()
}

#[test]
fn counts_follow_the_poisson_law_at_every_rate() {
    // Pearson's chi-square over bins of about a twentieth of the spread, each expecting 20 counts or more. Family-wise
    // alpha 1e-4 over 29 rates: one-sided normal quantile at 3.4e-6, after the cube-root transform of Wilson and Hilferty.
    const Z: f64 = 4.5;
    let rates = [
        1e-3, 0.01, 0.05, 0.3, 1.0, 2.0, 3.0, 5.0, 7.0, 9.0, 9.999, 10.0, 10.5, 12.0, 15.0, 16.0, 20.0, 30.0,
        50.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9,
    ];
    for (i, rate) in rates.into_iter().enumerate() {
        let counts = counts(rate, 11, i as u64);
        let spread = rate.sqrt();
        let step = (spread / 20.0).ceil();
        let first = (rate - 7.0 * spread).max(0.0).floor();
        let bins = ((14.0 * spread + 40.0) / step).ceil() as usize;
        let mut seen = vec![0.0; bins];
        for count in &counts {
            assert!(*count >= 0.0 && count.fract() == 0.0, "rate {rate}: {count}");
            // Counts beyond the bins fall into the outermost.
            seen[(((count - first) / step).max(0.0) as usize).min(bins - 1)] += 1.0;
        }
        let law = |k: f64| (k * rate.ln() - rate - libm::lgamma(k + 1.0)).exp();
        let expected = (0..bins).map(|bin| {
            let from = first + bin as f64 * step;
            counts.len() as f64 * (0..step as usize).map(|j| law(from + j as f64)).sum::<f64>()
        });
        // Join bins until each expects 20 counts.
        let (mut square, mut joined, mut open) = (0.0, 0, [0.0; 2]);
        let mut expected_sum = 0.0;
        for (seen, expected) in seen.iter().zip(expected) {
            open = [open[0] + seen, open[1] + expected];
            expected_sum += expected;
            if open[1] >= 20.0 {
                square += (open[0] - open[1]).powi(2) / open[1];
                (joined, open) = (joined + 1, [0.0; 2]);
            }
        }
        assert!(
            (expected_sum / counts.len() as f64 - 1.0).abs() < 1e-4,
            "rate {rate}: bins hold {expected_sum}"
        );
        let freedom = (joined - 1).max(1) as f64;
        let curve = 2.0 / (9.0 * freedom);
        let z = ((square / freedom).cbrt() - (1.0 - curve)) / curve.sqrt();
        assert!(z < Z, "rate {rate}: chi-square {square} of {freedom}, z {z}");

        // Mean and variance, two-sided at the same level.
        let n = counts.len() as f64;
        let mean = counts.iter().sum::<f64>() / n;
        let variance = counts.iter().map(|c| (c - rate).powi(2)).sum::<f64>() / n;
        let z_mean = (mean - rate) / (rate / n).sqrt();
        let z_variance = (variance - rate) / ((2.0 * rate * rate + rate) / n).sqrt();
        assert!(z_mean.abs() < Z + 0.2 && z_variance.abs() < Z + 0.2, "rate {rate}: {z_mean} {z_variance}");
    }
}

#[test]
fn a_row_of_mixed_rates_equals_the_counts_of_single_pixels() {
    // Rates of both methods side by side, zero, and far beyond any full well.
    let rates: Vec<f64> = (0..700)
        .map(|i| match i % 7 {
            0 => 0.0,
            1 => 0.02 * i as f64,
            2 => 9.9 + 0.001 * i as f64,
            3 => 10.0 + i as f64,
            4 => 1e4,
            5 => 1e9 + i as f64,
            _ => 10f64.powi(i % 80),
        })
        .collect();
    let shot = Stream::new(3, 4, Stage::Shot);
    let (mut scratch, mut counts) = (PoissonScratch::default(), vec![0.0; rates.len()]);
    for row in 0..50 {
        let first = place(row, 17);
        poisson_row(&rates, shot, first, &mut scratch, &mut counts);
        for (i, &rate) in rates.iter().enumerate() {
            assert_eq!(counts[i], poisson(rate, shot, place(row, 17 + i)), "row {row}, rate {rate}");
        }
        // A shorter row after a longer one is not affected by leftovers in the scratch memory.
        poisson_row(&rates[..5], shot, first, &mut scratch, &mut counts[..5]);
        assert_eq!(counts[3], poisson(rates[3], shot, place(row, 20)));
        assert_eq!(counts[0], 0.0);
    }
}

#[test]
fn normal_numbers_are_normal() {
    let [a, b] = normals(5, 6, Stage::Read);
    for (name, values) in [("cosine", &a), ("sine", &b)] {
        // Kolmogorov and Smirnov: P(sqrt(n) D > 2.82) = 2 exp(-2 2.82^2) = 2.5e-7; six tests here, family-wise alpha 1e-4
        // with room.
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len() as f64;
        let law = |z: f64| 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
        let distance = sorted.iter().enumerate().fold(0.0f64, |worst, (i, &z)| {
            worst.max((law(z) - i as f64 / n).abs()).max((law(z) - (i + 1) as f64 / n).abs())
        });
        assert!(n.sqrt() * distance < 2.82, "{name}: {distance}");

        // Moments 1 to 6 of the normal law, each with its exact standard error; alpha 1e-6 each.
        let double_factorial = |k: i32| (1..=k).rev().step_by(2).map(f64::from).product::<f64>();
        for k in 1..=6 {
            let moment = values.iter().map(|z| z.powi(k)).sum::<f64>() / n;
            let exact = if k % 2 == 0 { double_factorial(k - 1) } else { 0.0 };
            let error = ((double_factorial(2 * k - 1) - exact * exact) / n).sqrt();
            assert!(((moment - exact) / error).abs() < 4.9, "{name}, moment {k}: {moment}");
        }
        // The tails: how many lie beyond 4 and 4.5 standard deviations.
        for limit in [4.0, 4.5] {
            let seen = values.iter().filter(|z| z.abs() > limit).count() as f64;
            let expected = n * libm::erfc(limit / std::f64::consts::SQRT_2);
            assert!((seen - expected).abs() < 4.9 * expected.sqrt() + 1.0, "{name}: {seen} beyond {limit}");
        }
    }
}

#[test]
fn neighbours_frames_stages_and_seeds_are_independent() {
    // 32 correlations, family-wise alpha 1e-4: two-sided normal quantile at 3e-6.
    const Z: f64 = 4.67;
    let square = |v: &[f64]| v.iter().map(|z| z * z).collect::<Vec<_>>();
    let [a, b] = normals(5, 6, Stage::Read);
    let pixels = counts(50.0, 5, 6);
    let mut pairs: Vec<(&str, Vec<f64>, Vec<f64>)> = vec![
        ("two of a pixel", a.clone(), b.clone()),
        ("neighbours in a row", a.clone(), a[1..].to_vec()),
        ("neighbours in a column", a.clone(), a[WIDTH..].to_vec()),
        ("frames", a.clone(), normals(5, 7, Stage::Read)[0].clone()),
        ("seeds", a.clone(), normals(4, 6, Stage::Read)[0].clone()),
        ("stages", a.clone(), normals(5, 6, Stage::FixedPixel)[0].clone()),
        ("counts and read noise", pixels.clone(), a.clone()),
        ("counts and read noise, second", pixels.clone(), b),
        ("counts of neighbours in a row", pixels.clone(), pixels[1..].to_vec()),
        ("counts of neighbours in a column", pixels.clone(), pixels[WIDTH..].to_vec()),
        ("counts of frames", pixels.clone(), counts(50.0, 5, 7)),
        ("counts of far frames", pixels.clone(), counts(50.0, 5, 6 + (1 << 32))),
        ("counts of seeds", pixels.clone(), counts(50.0, 4, 6)),
        ("counts of far seeds", pixels.clone(), counts(50.0, 5 + (1 << 32), 6)),
        ("counts, small rates", counts(2.0, 5, 6), counts(2.0, 5, 7)),
        ("counts of both methods", counts(2.0, 5, 6), counts(50.0, 5, 7)),
    ];
    for (_, a, b) in &mut pairs {
        let n = a.len().min(b.len());
        a.truncate(n);
        b.truncate(n);
    }
    for (name, a, b) in pairs {
        let z = correlation(&a, &b);
        assert!(z.abs() < Z, "{name}: {z}");
        let centred = |v: &[f64]| {
            let mean = v.iter().sum::<f64>() / v.len() as f64;
            v.iter().map(|x| x - mean).collect::<Vec<_>>()
        };
        let z = correlation(&square(&centred(&a)), &square(&centred(&b)));
        assert!(z.abs() < Z, "{name}, squares: {z}");
    }
}

#[test]
fn rare_exponentials_have_the_given_share_and_mean_one() {
    let hot = Stream::new(1, 0, Stage::Hot);
    let values: Vec<f64> = (0..1_000_000).map(|i| hot.rare_exponential(i, 0.02)).collect();
    let hits: Vec<f64> = values.into_iter().filter(|v| *v > 0.0).collect();
    let n = hits.len() as f64;
    // Alpha 1e-5 each.
    assert!(((n - 2e4) / (2e4f64 * 0.98).sqrt()).abs() < 4.42, "{n}");
    let mean = hits.iter().sum::<f64>() / n;
    let above = hits.iter().filter(|v| **v > std::f64::consts::LN_2).count() as f64 / n;
    assert!((mean - 1.0).abs() * n.sqrt() < 4.42 && (above - 0.5).abs() * 2.0 * n.sqrt() < 4.42);
}
