//! The likelihood of the cores of the histograms, its slope and information matrix, and the step of the fit.

use nalgebra::{DMatrix, DVector};
use petzval_base::Cancelled;
use rayon::prelude::*;

use super::parameter::{Numbers, Parameter};
use super::sample::Sample;

/// Called each time one histogram was compared with the model; its error ends the fit.
pub type Compared<'a> = &'a (dyn Fn() -> Result<(), Cancelled> + Sync);

/// Log likelihood of the cores, its slope and its information.
pub struct Score {
    /// Sum over all samples in the cores.
    pub log_likelihood: f64,
    slope: Vec<f64>,
    information: DMatrix<f64>,
}

impl Score {
    /// Likelihood of all samples at these parameters. Calls `compared` for each sample; its error ends the work.
    pub fn of(
        samples: &[Sample<'_>],
        full_well_e: f64,
        max_dn: u32,
        numbers: &Numbers,
        compared: Compared<'_>,
    ) -> Result<Self, Cancelled> {
        let part = |sample: &Sample<'_>| {
            compared()?;
            Ok(derivatives(sample, full_well_e, max_dn, numbers))
        };
        let parts: Vec<Core> = samples.par_iter().map(part).collect::<Result<_, Cancelled>>()?;
        let n = numbers.count();
        let mut total = Self { log_likelihood: 0.0, slope: vec![0.0; n], information: DMatrix::zeros(n, n) };
        for (sample, Core { log_likelihood, slopes, p }) in samples.iter().zip(&parts) {
            total.log_likelihood += log_likelihood;
            let counts = |k: usize| sample.histogram.counts.at(i64::from(sample.core.0) + k as i64) as f64;
            let all: f64 = (0..p.len()).map(counts).sum();
            for (i, di) in slopes {
                total.slope[i.index()] += di.iter().enumerate().map(|(k, d)| counts(k) * d).sum::<f64>();
                for (j, dj) in slopes {
                    total.information[(i.index(), j.index())] +=
                        all * p.iter().zip(di.iter().zip(dj)).map(|(p, (a, b))| p * a * b).sum::<f64>();
                }
            }
        }
        Ok(total)
    }

    /// Slope of the log likelihood over one parameter.
    pub fn slope(&self, parameter: Parameter) -> f64 {
        self.slope[parameter.index()]
    }

    /// The step of Fisher scoring, with the diagonal raised by the damping: the inverse information times the slope.
    pub fn step(&self, free: &[Parameter], damping: f64) -> Option<DVector<f64>> {
        // Scaled to a unit diagonal, so that the units of the parameters do not matter.
        let raw = self.information_of(free);
        let scale: Vec<f64> = (0..free.len()).map(|i| raw[(i, i)].sqrt()).collect();
        if scale.iter().any(|s| !s.is_finite() || *s == 0.0) {
            return None;
        }
        let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            raw[(i, j)] / (scale[i] * scale[j]) + if i == j { damping } else { 0.0 }
        });
        let slope = DVector::from_fn(free.len(), |i, _| self.slope(free[i]) / scale[i]);
        let step = matrix.cholesky()?.solve(&slope);
        Some(DVector::from_fn(free.len(), |i, _| step[i] / scale[i]))
    }

    /// Inverse of the information matrix. It is scaled to a unit diagonal first, because the parameters' units span
    /// many powers of ten.
    pub fn covariance(&self, free: &[Parameter]) -> Option<DMatrix<f64>> {
        let raw = self.information_of(free);
        let scale: Vec<f64> = (0..free.len()).map(|i| raw[(i, i)].sqrt()).collect();
        let unit = DMatrix::from_fn(free.len(), free.len(), |i, j| raw[(i, j)] / (scale[i] * scale[j]));
        let inverse = unit.cholesky()?.inverse();
        Some(DMatrix::from_fn(free.len(), free.len(), |i, j| inverse[(i, j)] / (scale[i] * scale[j])))
    }

    fn information_of(&self, free: &[Parameter]) -> DMatrix<f64> {
        DMatrix::from_fn(free.len(), free.len(), |i, j| self.information[(free[i].index(), free[j].index())])
    }
}

/// The core of one histogram under the parameters.
struct Core {
    log_likelihood: f64,
    /// Per parameter that it depends on: the derivative of the logarithm of each probability.
    slopes: Vec<(Parameter, Vec<f64>)>,
    /// Probability of each digital number, given that it lies in the core.
    p: Vec<f64>,
}

fn derivatives(sample: &Sample<'_>, full_well_e: f64, max_dn: u32, numbers: &Numbers) -> Core {
    let (low, high) = (sample.core.0 as usize, sample.core.1 as usize);
    let within = |numbers: &Numbers| {
        let p = sample.distribution(full_well_e, max_dn, numbers);
        let total: f64 = p[low..=high].iter().sum::<f64>().max(1e-300);
        p[low..=high].iter().map(|p| (p / total).max(1e-300)).collect::<Vec<f64>>()
    };
    let p = within(numbers);
    let log_likelihood =
        p.iter().enumerate().map(|(k, p)| sample.histogram.counts.at((low + k) as i64) as f64 * p.ln()).sum();

    // Central differences of the logarithm of each probability.
    let light_e = sample.electrons(numbers);
    let slope = |parameter: Parameter| {
        let step = parameter.step(numbers[parameter], light_e);
        let at = |d: f64| {
            let mut moved = numbers.clone();
            moved[parameter] += d;
            within(&moved)
        };
        let (up, down) = (at(step), at(-step));
        let slopes = up.iter().zip(&down).map(|(u, d)| (u.ln() - d.ln()) / (2.0 * step)).collect();
        (parameter, slopes)
    };
    Core { log_likelihood, slopes: sample.parameters().into_iter().map(slope).collect(), p }
}
