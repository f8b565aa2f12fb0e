//! Adam on a plain vector, for the few dozen coordinates of a lens.

use serde::{Deserialize, Serialize};

/// Decay of the first and second moments, and the floor of the denominator (Kingma and Ba 2015).
const BETA: [f64; 2] = [0.9, 0.99];
const EPSILON: f64 = 1e-12;

/// Moments of the gradient so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    first: Vec<f64>,
    second: Vec<f64>,
    steps: i32,
}

impl Adam {
    /// Whether these are moments of so many coordinates, or none yet.
    pub fn fits(&self, coordinates: usize) -> bool {
        let fits = |moments: &[f64]| moments.is_empty() || moments.len() == coordinates;
        self.steps >= 0 && fits(&self.first) && fits(&self.second)
    }

    /// `x -= rate m / (sqrt(v) + eps)` with bias-corrected moments m of the gradient and v of its square.
    pub fn step(&mut self, x: &mut [f64], gradient: &[f64], rate: f64) {
        self.first.resize(x.len(), 0.0);
        self.second.resize(x.len(), 0.0);
        self.steps += 1;
        let correction = BETA.map(|b| 1.0 - b.powi(self.steps));
        for i in 0..x.len() {
            self.first[i] = BETA[0] * self.first[i] + (1.0 - BETA[0]) * gradient[i];
            self.second[i] = BETA[1] * self.second[i] + (1.0 - BETA[1]) * gradient[i] * gradient[i];
            let mean = self.first[i] / correction[0];
            let spread = (self.second[i] / correction[1]).sqrt();
            x[i] -= rate * mean / (spread + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::cosine_rate;

    #[test]
    fn a_badly_scaled_quadratic_is_minimised() {
        let (mut x, mut adam) = (vec![3.0, -2.0], Adam::default());
        for step in 0..400 {
            let gradient = vec![2.0 * x[0], 2e6 * (x[1] - 1.0)];
            adam.step(&mut x, &gradient, cosine_rate(0.1, 0.001, step, 400));
        }
        assert!(x[0].abs() < 1e-2 && (x[1] - 1.0).abs() < 1e-2, "{x:?}");
    }
}
