//! Setting compensators: a few adjustments that are made on every lens, such as its focus.
//!
//! Broyden, Fletcher, Goldfarb and Shanno's method. It starts with the Hessian of the nominal lens, which is nearly that of any lens made
//! from it. With one compensator it is the secant method on the derivative. One step is exact where the cost is a parabola, as the mean
//! square spot is in the image distance.

use nalgebra::{DMatrix, DVector};

/// Steps allowed.
const MOST_STEPS: usize = 40;

/// Halvings of a step that makes things worse.
const MOST_HALVINGS: usize = 24;

/// A step that promises less than this share of the cost is not taken.
const LEAST_GAIN: f64 = 1e-10;

/// A cost with its derivatives by the compensators.
#[derive(Clone, Debug)]
pub(super) struct Cost<T> {
    pub value: f64,
    pub by: Vec<f64>,
    /// What else was found there.
    pub note: T,
}

/// A least cost.
#[derive(Clone, Debug)]
pub(super) struct Least<T> {
    pub at: Vec<f64>,
    pub cost: Cost<T>,
}

/// Step to the least of the quadratic model; where it has none, down the slope.
fn step(hessian: &DMatrix<f64>, by: &[f64]) -> DVector<f64> {
    let slope = DVector::from_column_slice(by);
    match hessian.clone().cholesky() {
        Some(factor) => -factor.solve(&slope),
        None => -DVector::from_fn(slope.len(), |i, _| {
            let bend = hessian[(i, i)].abs();
            if bend > 0.0 { slope[i] / bend } else { 0.0 }
        }),
    }
}

/// The Hessian that also explains how the slope changed along a step.
fn updated(hessian: &DMatrix<f64>, moved: &DVector<f64>, change: &DVector<f64>) -> DMatrix<f64> {
    let along = moved.dot(change);
    let image = hessian * moved;
    let before = moved.dot(&image);
    // Only a slope that grows along the step keeps it positive.
    if !(along > 1e-12 * moved.norm() * change.norm() && before > 0.0) {
        return hessian.clone();
    }
    hessian + change * change.transpose() / along - &image * image.transpose() / before
}

/// The least cost near `start`; `None` if there is no cost at the start.
///
/// `limits`, one per compensator, are kept: a step is cut at them, and what pushes against one is left out.
pub(super) fn least<T>(
    cost: &mut dyn FnMut(&[f64]) -> Option<Cost<T>>,
    start: &[f64],
    hessian: &DMatrix<f64>,
    limits: &[Option<f64>],
) -> Option<Least<T>> {
    let within = |at: f64, limit: &Option<f64>| limit.map_or(at, |limit| at.clamp(-limit, limit));
    let start: Vec<f64> = start.iter().zip(limits).map(|(at, limit)| within(*at, limit)).collect();
    let mut best = Least { cost: cost(&start)?, at: start };
    let mut hessian = hessian.clone();
    for _ in 0..MOST_STEPS {
        // A compensator at its limit stays if the descent direction points outward.
        let held = |i: usize| {
            limits[i].is_some_and(|limit| best.at[i].abs() >= limit && best.cost.by[i] * best.at[i] < 0.0)
        };
        let free: Vec<usize> = (0..best.at.len()).filter(|i| !held(*i)).collect();
        let part = DMatrix::from_fn(free.len(), free.len(), |r, c| hessian[(free[r], free[c])]);
        let slope: Vec<f64> = free.iter().map(|i| best.cost.by[*i]).collect();
        let wanted = step(&part, &slope);
        let promise = -0.5 * wanted.iter().zip(&slope).map(|(s, g)| s * g).sum::<f64>();
        let worth = promise > LEAST_GAIN * best.cost.value.abs();
        if free.is_empty() || !worth {
            break;
        }
        let mut share = 1.0;
        let mut found = None;
        for _ in 0..MOST_HALVINGS {
            let mut at = best.at.clone();
            for (i, s) in free.iter().zip(wanted.iter()) {
                at[*i] = within(at[*i] + share * s, &limits[*i]);
            }
            match cost(&at) {
                Some(next) if next.value <= best.cost.value => {
                    found = Some(Least { at, cost: next });
                    break;
                }
                _ => share *= 0.5,
            }
            // Rounding hides what is left.
            if share * promise < 1e-15 * best.cost.value.abs() {
                break;
            }
        }
        let Some(next) = found else { break };
        let difference = |a: &[f64], b: &[f64]| DVector::from_fn(a.len(), |i, _| a[i] - b[i]);
        let moved = difference(&next.at, &best.at);
        hessian = updated(&hessian, &moved, &difference(&next.cost.by, &best.cost.by));
        best = next;
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bowl(at: &[f64]) -> Option<Cost<()>> {
        // Rosenbrock's valley, its least 1 at (1, 1).
        let (x, y) = (at[0], at[1]);
        let value = 1.0 + (1.0 - x).powi(2) + 10.0 * (y - x * x).powi(2);
        let by = vec![-2.0 * (1.0 - x) - 40.0 * x * (y - x * x), 20.0 * (y - x * x)];
        Some(Cost { value, by, note: () })
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let start = DMatrix::from_diagonal_element(2, 2, 10.0);
        let least = least(&mut |at| bowl(at), &[-0.5, 0.8], &start, &[None, None]).unwrap();
        assert!((least.at[0] - 1.0).abs() < 1e-4 && (least.at[1] - 1.0).abs() < 1e-4, "{:?}", least.at);
    }

    #[test]
    fn limits_hold() {
        let start = DMatrix::from_diagonal_element(2, 2, 10.0);
        let limits = [Some(0.5), None];
        let least = least(&mut |at| bowl(at), &[0.0, 0.0], &start, &limits).unwrap();
        assert!((least.at[0] - 0.5).abs() < 1e-12 && (least.at[1] - 0.25).abs() < 1e-4, "{:?}", least.at);
    }

    #[test]
    fn a_parabola_takes_two_evaluations_more_than_its_start() {
        let mut evaluations = 0;
        let mut parabola = |at: &[f64]| {
            evaluations += 1;
            let x = at[0] - 3.0;
            Some(Cost { value: 2.0 + 0.7 * x * x, by: vec![1.4 * x], note: () })
        };
        let wrong = DMatrix::from_element(1, 1, 1.0);
        let least = least(&mut parabola, &[0.0], &wrong, &[None]).unwrap();
        assert!((least.at[0] - 3.0).abs() < 1e-6 && (least.cost.value - 2.0).abs() < 1e-9);
        assert!(evaluations <= 4, "{evaluations}");
    }
}
