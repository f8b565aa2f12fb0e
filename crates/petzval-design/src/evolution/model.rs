//! A quadratic model of the function near the mean, and the point that it proposes.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Points that a model is fitted to, over its coefficients.
const POINTS_PER_COEFFICIENT: f64 = 2.0;

/// Least number of points over coefficients.
const LEAST_POINTS_PER_COEFFICIENT: f64 = 1.2;

/// Weight of the best point over that of the worst.
const WEIGHT_RATIO: f64 = 20.0;

/// How far beyond the points of the model its proposal may lie, in each coordinate.
const REACH: f64 = 1.5;

/// Most coordinates for which products of two are part of the model: its cost grows with their sixth power.
const MOST_COORDINATES_OF_PRODUCTS: usize = 16;

/// The step, in white coordinates, to the point where a quadratic function through known points is stationary: a weighted
/// least-squares fit of constant, slopes, squares and, if there are enough points, products. Axes that curve down are taken as if they
/// curved up, so that the step goes downhill.
///
/// `known` are white coordinates from the mean of the search, with finite values, the best first. None while there are too few.
pub(super) fn proposal(known: &[(Vec<f64>, f64)]) -> Option<Vec<f64>> {
    let n = known.first()?.0.len();
    let of_products = 1 + n + n * (n + 1) / 2;
    let enough =
        |coefficients: usize| known.len() as f64 >= LEAST_POINTS_PER_COEFFICIENT * coefficients as f64;
    let has_products = n <= MOST_COORDINATES_OF_PRODUCTS && enough(of_products);
    let coefficients = if has_products { of_products } else { 1 + 2 * n };
    if !enough(coefficients) {
        return None;
    }
    let used = &known[..known.len().min((POINTS_PER_COEFFICIENT * coefficients as f64) as usize)];

    // Coordinates between -1 and 1, and values whose median is 1 above the best.
    let reach: Vec<f64> =
        (0..n).map(|i| used.iter().map(|(z, _)| z[i].abs()).fold(1e-12, f64::max)).collect();
    let (best, median) = (used[0].1, used[used.len() / 2].1);
    if median <= best {
        return None;
    }
    let pairs: Vec<(usize, usize)> =
        (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).filter(|(i, j)| has_products || i == j).collect();
    let weight = |k: usize| {
        let share = k as f64 / (used.len() - 1).max(1) as f64;
        (WEIGHT_RATIO + (1.0 - WEIGHT_RATIO) * share).sqrt()
    };
    let rows: Vec<Vec<f64>> = used
        .iter()
        .map(|(z, _)| {
            let z: Vec<f64> = z.iter().zip(&reach).map(|(z, reach)| z / reach).collect();
            let products = pairs.iter().map(|(i, j)| z[*i] * z[*j]);
            [1.0].into_iter().chain(z.iter().copied()).chain(products).collect()
        })
        .collect();
    let matrix = DMatrix::from_fn(used.len(), coefficients, |k, c| weight(k) * rows[k][c]);
    let values = DVector::from_fn(used.len(), |k, _| weight(k) * (used[k].1 - best) / (median - best));
    let fit = matrix.svd(true, true).solve(&values, 1e-10).ok()?;

    let slope = fit.rows(1, n).into_owned();
    let mut curvature = DMatrix::<f64>::zeros(n, n);
    for ((i, j), c) in pairs.iter().zip(fit.iter().skip(1 + n)) {
        curvature[(*i, *j)] += c;
        curvature[(*j, *i)] += c;
    }
    let axes = SymmetricEigen::new(curvature);
    let strongest = axes.eigenvalues.iter().fold(0.0_f64, |a, b: &f64| a.max(b.abs()));
    let along = axes.eigenvectors.transpose() * slope;
    let step = DVector::from_fn(n, |i, _| {
        -along[i] / axes.eigenvalues[i].abs().max(1e-6 * strongest + f64::MIN_POSITIVE)
    });
    let step = axes.eigenvectors * step;
    let step: Vec<f64> = (0..n).map(|i| step[i].clamp(-REACH, REACH) * reach[i]).collect();
    step.iter().all(|v| v.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a spiral, the best first.
    fn known(f: impl Fn(&[f64]) -> f64, n: usize, count: usize) -> Vec<(Vec<f64>, f64)> {
        let point = |k: usize| -> Vec<f64> {
            (0..n).map(|i| ((k * (2 * i + 3) + i) as f64 * 0.7).sin() * 2.0).collect()
        };
        let mut all: Vec<(Vec<f64>, f64)> = (0..count)
            .map(point)
            .map(|z| {
                let v = f(&z);
                (z, v)
            })
            .collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        all
    }

    #[test]
    fn the_minimum_of_a_quadratic_is_proposed() {
        let f = |z: &[f64]| {
            3.0 + (z[0] - 0.5).powi(2) + 40.0 * (z[1] + z[0] - 0.2).powi(2) + 7.0 * (z[2] + 1.0).powi(2)
        };
        let step = proposal(&known(f, 3, 24)).unwrap();
        for (got, want) in step.iter().zip([0.5, -0.3, -1.0]) {
            assert!((got - want).abs() < 1e-8, "{step:?}");
        }
        // Without products while points are few.
        let round =
            |z: &[f64]| z.iter().zip([0.4, -0.6, 0.1, 0.9]).map(|(z, t)| (z - t).powi(2)).sum::<f64>();
        let step = proposal(&known(round, 4, 12)).unwrap();
        assert!((step[3] - 0.9).abs() < 1e-8, "{step:?}");
    }

    #[test]
    fn steps_go_downhill_and_no_further_than_the_points_reach() {
        let step = proposal(&known(|z| -z[0] * z[0] - 0.5 * z[0] + z[1], 2, 30)).unwrap();
        assert!(step[0] > 0.0 && step[1] < 0.0 && step.iter().all(|v| v.abs() <= 3.0), "{step:?}");
        assert!(proposal(&known(|z| z[0], 3, 8)).is_none());
        assert!(proposal(&known(|_| 1.0, 3, 30)).is_none());
        assert!(proposal(&[]).is_none());
    }
}
