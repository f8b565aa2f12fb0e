//! A second, weaker step parallel to the edge: a ghost, a reflection, or a faint second edge.
//!
//! Light that changes, a haze and the tail of a blur are smooth beyond the blur; a copy of the edge is as sharp as the edge. At distances `d0`
//! along either side, the pixels within `W` of it are fitted by least squares with
//!
//! ```text
//! v = a + b z + c z^2 + e z^3 + f u + g Phi((d - d0) / s)        z = (d - d0) / W,   W = max(4 s + 3, 6) pixels
//! ```
//!
//! with the blur `s` of the edge, the place `u` along the edge and the normal integral Phi. There is a ghost where `g` exceeds [`LEAST_GHOST`] of the step and
//! [`GHOST_SIGMAS`] of its standard errors, both that by the residuals of the pixels and that by the scatter over bands of rows. The error of few
//! bands is uncertain: `g` over it must exceed the quantile of Student's distribution at two-sided `p = 1e-7`. Fewer than
//! [`LEAST_BANDS`] give no verdict.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{SMatrix, SVector};

use super::place::Sample;

/// Least step of a ghost, of the step of the edge.
const LEAST_GHOST: f64 = 0.02;

/// Standard errors beyond which a step is no chance, over all distances of a thousand edges.
const GHOST_SIGMAS: f64 = 7.0;

/// Rows of a band: noise of neighbouring pixels may be correlated. Least number of bands whose scatter is an error, and largest.
const ROWS_OF_BAND: f64 = 3.0;
const LEAST_BANDS: usize = 12;
const MOST_BANDS: usize = 48;

/// Standard errors that a normal deviate exceeds on either side with a probability of 1e-7.
const NORMAL_SIGMAS: f64 = 5.327;

/// Least distance to which a fit reaches to either side, pixels; and what it reaches in blurs beyond [`BEYOND_PX`].
const LEAST_REACH_PX: f64 = 6.0;
const REACH_BLURS: f64 = 4.0;
const BEYOND_PX: f64 = 3.0;

/// Most pixels of a fit; of more, every n-th counts.
const MOST_PIXELS: usize = 20_000;

/// Numbers of a fit; the last is the step.
const NUMBERS: usize = 6;

/// A weaker step beside the edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ghost {
    /// Distance from the edge, pixels; negative on the dark side.
    pub distance_px: f64,
    /// Its step, of that of the edge; negative if the light falls there.
    pub share: f64,
}

/// The edge whose ghosts are searched.
#[derive(Clone, Copy, Debug)]
pub struct Beside {
    /// Standard deviation of the blur, pixels.
    pub blur_px: f64,
    /// Where the sides begin to be even, and where the profile ends, pixels.
    pub far_px: f64,
    pub half_px: f64,
    /// The step of the edge, in the unit of the pixels.
    pub step: f64,
    /// Rows.
    pub height: f64,
}

/// Standard errors that the scatter of so many bands must give a ghost: the quantile of Student's distribution (Wallace 1959), and at least
/// [`GHOST_SIGMAS`].
fn ghost_sigmas(bands: usize) -> f64 {
    let degrees = bands as f64 - 1.0;
    let normal = NORMAL_SIGMAS * (8.0 * degrees + 3.0) / (8.0 * degrees + 1.0);
    (degrees * (normal * normal / degrees).exp_m1()).sqrt().max(GHOST_SIGMAS)
}

impl Beside {
    /// The most certain ghost on either side, if there is one.
    pub fn ghost(&self, samples: &[Sample]) -> Option<Ghost> {
        let bands = ((self.height / ROWS_OF_BAND) as usize).min(MOST_BANDS);
        if bands < LEAST_BANDS {
            return None;
        }
        let mut samples = samples.to_vec();
        samples.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let reach = (REACH_BLURS * self.blur_px + BEYOND_PX).max(LEAST_REACH_PX);
        let by = self.blur_px.max(1.0);
        let (first, last) = (self.far_px + reach, self.half_px - reach);
        let count = if last < first { 0 } else { ((last - first) / by) as usize + 1 };
        let places = (0..count).flat_map(|k| [-1.0, 1.0].map(|sign| sign * (first + by * k as f64)));
        let found = places.filter_map(|at| self.step_at(&samples, at, reach, bands));
        found.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(ghost, _)| ghost)
    }

    /// The step at a distance and its standard errors from zero, if it is a ghost. `samples` ascend by their distances.
    fn step_at(&self, samples: &[Sample], at: f64, reach: f64, bands: usize) -> Option<(Ghost, f64)> {
        let [from, to] = [at - reach, at + reach].map(|end| samples.partition_point(|s| s.distance < end));
        let near = || samples[from..to].iter().step_by((to - from).div_ceil(MOST_PIXELS).max(1));
        let row = |s: &Sample| {
            let z = (s.distance - at) / reach;
            let u = 2.0 * s.at[1] / self.height - 1.0;
            let step = 0.5 * libm::erfc((at - s.distance) / self.blur_px * FRAC_1_SQRT_2);
            SVector::<f64, NUMBERS>::from([1.0, z, z * z, z * z * z, u, step])
        };
        // Fit the pixels, and gather by band how the residuals pull the step.
        let (mut normal, mut right) =
            (SMatrix::<f64, NUMBERS, NUMBERS>::zeros(), SVector::<f64, NUMBERS>::zeros());
        for s in near() {
            let row = row(s);
            normal += row * row.transpose();
            right += row * s.value;
        }
        let inverse = normal.cholesky()?.inverse();
        let numbers = inverse * right;
        let of_step = inverse.row(NUMBERS - 1).transpose();
        let (mut pulls, mut squares, mut pixels) = (vec![0.0; bands], 0.0, 0.0);
        let band_of = |s: &Sample| ((s.at[1] / self.height * bands as f64) as usize).min(bands - 1);
        for s in near() {
            let row = row(s);
            let residual = s.value - row.dot(&numbers);
            pulls[band_of(s)] += of_step.dot(&row) * residual;
            squares += residual * residual;
            pixels += 1.0;
        }
        // Bands that the slanted strip does not reach have no pull.
        let reached = pulls.iter().filter(|pull| **pull != 0.0).count();
        if reached < LEAST_BANDS {
            return None;
        }
        let (step, count) = (numbers[NUMBERS - 1], reached as f64);
        let by_bands = (pulls.iter().map(|p| p * p).sum::<f64>() * count / (count - 1.0)).sqrt();
        let by_pixels = (squares / f64::max(pixels - NUMBERS as f64, 1.0) * of_step[NUMBERS - 1]).sqrt();
        // The larger error counts.
        let sigmas = step.abs() / by_bands.max(by_pixels).max(1e-300);
        let share = step / self.step;
        let is_ghost = share.abs() > LEAST_GHOST && sigmas > ghost_sigmas(reached);
        is_ghost.then_some((Ghost { distance_px: at, share }, sigmas))
    }
}
