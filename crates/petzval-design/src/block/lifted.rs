//! Levenberg and Marquardt's method for a lens on its way through noisy batches: averaged gradients and the curvature of the loss as lifted to the
//! rays, in the free coordinates.
//!
//! The lifted loss is a paraboloid over the landing points of the rays that just touches zero, see
//! [`lifted_normal_equations`](petzval_optics::merit::lifted_normal_equations). Its minimum is no loss at all, which no batch allows: a step goes
//! a share of the way there. Its curvature is what counts. It knows which numbers of the lens move the rays alike, where Adam sees each alone.

use nalgebra::{DMatrix, DVector};
use petzval_optics::design_space::{DesignSpaceError, SmoothSpace};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::{Seen, lifted_normal_equations};
use serde::{Deserialize, Serialize};

/// Decay of the averages of gradients, and of the slower ones of curvatures.
const DECAY: [f64; 2] = [0.9, 0.95];

/// Damping, as a share of each coordinate's own curvature: directions that hardly move the rays are not followed far.
const DAMPING: f64 = 1e-2;

/// Longest step of a coordinate, rad of the bounding sine.
const LONGEST: f64 = 0.1;

/// A lens of a design space, and by what a loss sees it.
#[derive(Clone, Copy)]
pub struct Lift<'a> {
    /// The space.
    pub space: &'a SmoothSpace,
    /// Free coordinates.
    pub x: &'a [f64],
    /// Errors of the numbers, see [`SmoothSpace::lens_off`]; empty for the lens as drawn.
    pub errors: &'a [f64],
    /// The lens at `x` with these errors.
    pub lens: &'a Lens,
    /// Rays and light.
    pub seen: Seen<'a>,
    /// The squares of violations of the requirements, mm^2, with their derivatives.
    pub violations: &'a [(f64, LensGradient)],
    /// Weight of the violations in the loss, 1/mm^2.
    pub constraint_weight: f64,
}

impl Lift<'_> {
    /// The curvature by the free coordinates of a loss > 0 with this gradient and of the weighted violations: half of its second derivative as
    /// Gauss and Newton approximate it. `None` where the rays say nothing, because most of a field are lost.
    pub fn curvature(
        &self,
        loss: f64,
        by_loss: &LensGradient,
    ) -> Result<Option<DMatrix<f64>>, DesignSpaceError> {
        let numbers = self.space.space().numbers();
        let Some(mut gram) = lifted_normal_equations(self.seen, self.lens, numbers, loss, by_loss) else {
            return Ok(None);
        };
        // Each violation v of a requirement is a residual of its own, sqrt(weight) v, with dv = d(v^2) / (2 v).
        for (square, by_square) in self.violations {
            let by = |i: usize| numbers.get(i).map_or(0.0, |n| by_square[*n] / (2.0 * square.sqrt()));
            let by = DVector::from_fn(gram.nrows(), |i, _| by(i));
            gram.ger(self.constraint_weight, &by, &by, 1.0);
        }
        let slopes = free_slopes(self.space, self.x, self.errors, self.lens)?;
        let inner = gram.view((0, 0), (numbers.len() + 1, numbers.len() + 1));
        Ok(Some(slopes.transpose() * inner * slopes))
    }
}

/// Derivatives of the numbers of the space, and last of the logarithm of the stop radius, by the free coordinates, `[number][coordinate]`: of
/// `lens`, which is the lens at `x` with these errors.
pub fn free_slopes(
    space: &SmoothSpace,
    x: &[f64],
    errors: &[f64],
    lens: &Lens,
) -> Result<DMatrix<f64>, DesignSpaceError> {
    let mut slopes = space.space().map(&space.space().coordinates(lens))?.slopes;
    // Each coordinate of the space follows a free one of its own.
    let stretch = space.pull_back_coordinates_off(x, errors, &vec![1.0; x.len()]);
    slopes.column_iter_mut().zip(stretch).for_each(|(mut column, stretch)| column *= stretch);
    Ok(slopes)
}

/// Averages so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lifted {
    gradient: Vec<f64>,
    /// Row by row.
    curvature: Vec<f64>,
    steps: i32,
}

impl Lifted {
    /// Averages over this many steps, of the gradient and, row by row, of the curvature.
    pub fn of(gradient: Vec<f64>, curvature: Vec<f64>, steps: i32) -> Self {
        Self { gradient, curvature, steps }
    }

    /// The averages of gradient and curvature, see [`Lifted::of`].
    pub fn averages(&self) -> [&[f64]; 2] {
        [&self.gradient, &self.curvature]
    }

    /// Whether these are averages over so many coordinates, or none yet.
    pub fn fits(&self, coordinates: usize) -> bool {
        let fits = |values: &[f64], count: usize| values.is_empty() || values.len() == count;
        self.steps >= 0
            && fits(&self.gradient, coordinates)
            && fits(&self.curvature, coordinates * coordinates)
    }

    /// Takes up the gradient and the curvature of a batch, and steps a share `rate` of the way to the minimum of the averages.
    pub fn step(&mut self, x: &mut [f64], gradient: &[f64], curvature: &DMatrix<f64>, rate: f64) {
        let count = x.len();
        self.gradient.resize(count, 0.0);
        self.curvature.resize(count * count, 0.0);
        self.steps += 1;
        let average = |kept: &mut [f64], new: &mut dyn Iterator<Item = f64>, decay: f64| {
            kept.iter_mut().zip(new).for_each(|(kept, new)| *kept = decay * *kept + (1.0 - decay) * new);
        };
        average(&mut self.gradient, &mut gradient.iter().copied(), DECAY[0]);
        let rows = (0..count).flat_map(|r| (0..count).map(move |c| (r, c)));
        average(&mut self.curvature, &mut rows.map(|at| curvature[at]), DECAY[1]);
        let correction = DECAY.map(|decay| 1.0 - decay.powi(self.steps));

        let mean = DVector::from_iterator(count, self.gradient.iter().map(|g| g / correction[0]));
        let mut damped = DMatrix::from_row_slice(count, count, &self.curvature) / correction[1];
        let least = 1e-9 * damped.diagonal().max();
        for i in 0..count {
            damped[(i, i)] += DAMPING * damped[(i, i)] + least;
        }
        let Some(factors) = damped.cholesky() else { return };
        let step = factors.solve(&mean) * -rate;
        let longest = step.amax();
        let shortened = if longest > LONGEST { LONGEST / longest } else { 1.0 };
        x.iter_mut().zip(step.iter()).for_each(|(x, step)| *x += shortened * step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two coordinates that move the rays nearly alike: a narrow valley, 200 times as steep across as along.
    #[test]
    fn a_narrow_valley_is_followed_in_a_few_steps() {
        let curvature = DMatrix::from_row_slice(2, 2, &[1.0, 0.99, 0.99, 1.0]);
        let (mut x, mut lifted) = (vec![0.5, -0.4], Lifted::default());
        for _ in 0..60 {
            let gradient = &curvature * DVector::from_row_slice(&x);
            lifted.step(&mut x, gradient.as_slice(), &curvature, 0.3);
        }
        let loss = |x: &[f64]| (&curvature * DVector::from_row_slice(x)).dot(&DVector::from_row_slice(x));
        assert!(loss(&x) < 1e-3 * loss(&[0.5, -0.4]), "{x:?}");
        assert!(lifted.fits(2) && !lifted.fits(3));
    }

    #[test]
    fn averages_are_carried_on() {
        let curvature = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.5, 1.0]);
        let (mut whole, mut x) = (Lifted::default(), vec![0.1, 0.2]);
        whole.step(&mut x, &[0.3, -0.2], &curvature, 0.5);
        let [gradient, products] = whole.averages().map(<[f64]>::to_vec);
        let mut parted = Lifted::of(gradient, products, 1);
        let mut y = x.clone();
        whole.step(&mut x, &[0.1, 0.4], &curvature, 0.5);
        parted.step(&mut y, &[0.1, 0.4], &curvature, 0.5);
        assert_eq!(x, y);
        assert_eq!(whole, parted);
    }

    #[test]
    fn no_step_is_longer_than_the_longest() {
        let mut x = vec![0.0, 0.0];
        Lifted::default().step(&mut x, &[1e6, -1.0], &DMatrix::identity(2, 2), 1.0);
        assert!((x[0] + LONGEST).abs() < 1e-12 && x[1].abs() < LONGEST);
    }
}
