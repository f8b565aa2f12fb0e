//! The sensitivity table: the effect of each tolerance alone, and the estimated merit of a lens with all of them.
//!
//! Let q be the cost: the squared merit if small is better, the negative merit if large is better. The perturbations are independent and
//! symmetric. `a_i` is the first derivative of q by perturbation i, `b_i` half of the second, and `H_ij` the mixed second derivative. Then
//!
//! ```text
//! mean(q)     = q_0 + sum b_i m2_i
//! variance(q) = sum a_i^2 m2_i + sum b_i^2 (m4_i - m2_i^2) + sum_(i<j) H_ij^2 m2_i m2_j
//! ```
//!
//! with m2 and m4 the mean square and fourth power of each perturbation. Here `a_i` and `b_i` come from lenses that are made at
//! plus and minus the tolerance, and `H_ij` from the differences of their gradients.

use petzval_base::Cancelled;
use rayon::prelude::*;

use super::{Failure, Made, Study};
use crate::merit::Better;

/// One row of the table.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    /// Index of the perturbation.
    pub perturbation: usize,
    /// Derivative of the merit per unit of the quantity, compensators following.
    pub derivative: f64,
    /// The merit with the quantity at plus its tolerance, compensators set; `None` if that lens brings no image or cannot be built.
    pub at_plus: Option<f64>,
    /// The same at minus its tolerance.
    pub at_minus: Option<f64>,
    /// Where the compensators stand then.
    pub compensators: [Vec<f64>; 2],
    /// Why the lens at plus, and that at minus the tolerance has no merit; `None` where it has one.
    pub failures: [Option<Failure>; 2],
}

impl Sensitivity {
    /// How much worse the merit is at the worse end of the tolerance; infinite if a lens has none.
    pub fn worst_loss(&self, better: Better, nominal: f64) -> f64 {
        let loss = |value: Option<f64>| value.map_or(f64::INFINITY, |v| better.loss(v, nominal));
        loss(self.at_plus).max(loss(self.at_minus))
    }
}

/// The merit of built lenses, estimated from the sensitivities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The nominal merit, worse by the root of the sum of squares of the changes at the tolerances (each the quadratic mean of
    /// both ends): the customary worst-case budget.
    pub root_sum_square: f64,
    /// Standard deviation of the merit to first order, `sqrt(sum (g_i sigma_i)^2)`: right for small perturbations of a merit with
    /// slopes.
    pub linear_spread: f64,
    /// Mean of the merit to second order.
    pub mean: f64,
    /// Its standard deviation to second order; without mixed terms where the merit has no gradient.
    pub standard_deviation: f64,
}

/// The table.
#[derive(Clone, Debug)]
pub struct Sensitivities {
    /// The nominal merit.
    pub nominal: f64,
    /// Rows, in the order of the perturbations.
    pub rows: Vec<Sensitivity>,
    /// All of them together; `None` if a lens at a tolerance brings no image or cannot be built.
    pub estimate: Option<Estimate>,
}

/// Makes a lens at plus and one at minus every tolerance. `progress` is called after each tolerance; its error ends the work.
pub fn sensitivities(
    study: &Study,
    progress: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<Sensitivities, Cancelled> {
    let perturbations = &study.tolerances().perturbations;
    let derivatives = study.nominal_derivatives();
    let ends: Vec<[Result<End, Failure>; 2]> = (0..perturbations.len())
        .into_par_iter()
        .map(|i| {
            let end = |sign: f64| -> Result<End, Failure> {
                let mut off = vec![0.0; perturbations.len()];
                off[i] = sign * perturbations[i].tolerance;
                let made = study.build(&off)?;
                Ok(End { derivatives: study.derivatives(&off, &made), made })
            };
            let both = [end(1.0), end(-1.0)];
            progress()?;
            Ok(both)
        })
        .collect::<Result<_, Cancelled>>()?;
    let row = |(i, [plus, minus]): (usize, &[Result<End, Failure>; 2])| Sensitivity {
        perturbation: i,
        derivative: derivatives[i],
        at_plus: plus.as_ref().ok().map(|e| e.made.value),
        at_minus: minus.as_ref().ok().map(|e| e.made.value),
        compensators: [plus, minus]
            .map(|e| e.as_ref().map_or_else(|_| Vec::new(), |e| e.made.compensators.clone())),
        failures: [plus, minus].map(|e| e.as_ref().err().cloned()),
    };
    Ok(Sensitivities {
        nominal: study.nominal().value,
        rows: ends.iter().enumerate().map(row).collect(),
        estimate: estimate(study, &derivatives, &ends),
    })
}

/// A lens at the end of a tolerance, and the derivatives of its merit by every perturbation.
struct End {
    made: Made,
    derivatives: Vec<Option<f64>>,
}

fn estimate(study: &Study, derivatives: &[f64], ends: &[[Result<End, Failure>; 2]]) -> Option<Estimate> {
    let (better, nominal) = (study.better(), study.nominal().value);
    let perturbations = &study.tolerances().perturbations;
    let at = better.cost(nominal);
    let (mut mean, mut variance, mut linear, mut squares) = (at, 0.0, 0.0, 0.0);
    // Derivatives of the cost at both ends, over the tolerance: the rows of the Hessian.
    let mut rows: Vec<Vec<Option<f64>>> = Vec::with_capacity(ends.len());
    for ((p, by), ends) in perturbations.iter().zip(derivatives).zip(ends) {
        let [Ok(plus), Ok(minus)] = ends else { return None };
        let (tolerance, m2) = (p.tolerance, p.sigma().powi(2));
        let m4 = p.distribution.fourth_moment() * tolerance.powi(4);
        let (up, down) = (better.cost(plus.made.value), better.cost(minus.made.value));
        let a = (up - down) / (2.0 * tolerance);
        let b = (up + down - 2.0 * at) / (2.0 * tolerance * tolerance);
        mean += b * m2;
        variance += a * a * m2 + b * b * (m4 - m2 * m2);
        linear += by * by * m2;
        let losses = [plus, minus].map(|end| better.loss(end.made.value, nominal));
        squares += 0.5 * losses.iter().map(|l| l * l).sum::<f64>();
        let slope = |end: &End, k: usize| end.derivatives[k].map(|by| by * better.slope(end.made.value));
        let bend = |k: usize| Some((slope(plus, k)? - slope(minus, k)?) / (2.0 * tolerance));
        rows.push((0..perturbations.len()).map(bend).collect());
    }
    for i in 0..rows.len() {
        for j in 0..i {
            if let (Some(a), Some(b)) = (rows[i][j], rows[j][i]) {
                let mixed = 0.5 * (a + b);
                variance += (mixed * perturbations[i].sigma() * perturbations[j].sigma()).powi(2);
            }
        }
    }
    // From the cost to the merit; of a root the mean is a little less than the root of the mean.
    let (mean, standard_deviation) = match better {
        Better::Higher => (-mean, variance.sqrt()),
        Better::Lower if mean > 0.0 => {
            (mean.sqrt() * (1.0 - variance / (8.0 * mean * mean)), 0.5 * (variance / mean).sqrt())
        }
        Better::Lower => (nominal, linear.sqrt()),
    };
    let worse = match better {
        Better::Lower => squares.sqrt(),
        Better::Higher => -squares.sqrt(),
    };
    let root_sum_square = nominal + worse;
    Some(Estimate { root_sum_square, linear_spread: linear.sqrt(), mean, standard_deviation })
}
