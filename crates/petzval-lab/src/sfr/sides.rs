//! The light of the two sides: their levels, and how they change across the region.
//!
//! Light that falls across a chart multiplies both sides, an additive haze adds to both; each side has a plane of its own here, or a surface
//! of second degree, so that either is divided out. The tails of a blur, which fall as 1 / d on both sides of an edge, are fitted beside the
//! planes, so that they are not taken for light.

use nalgebra::{DMatrix, DVector};

use super::region::Region;

/// Standard deviations of a normal blur beyond which a side is even, and the least distance, pixels.
const FAR_BLURS: f64 = 6.4;
const LEAST_FAR_PX: f64 = 3.0;

/// Least depth of the even part of a side, pixels, and its least number of pixels.
const LEAST_DEPTH_PX: f64 = 3.0;
const LEAST_PIXELS: usize = 40;

/// Share of the profile, at either end, whose mean is the level of that side.
const LEVEL_SHARE: f64 = 0.2;

/// The variance ratio (F) from which a change of the light counts, and the least change over the region, of the step.
const LEAST_RATIO: f64 = 12.0;
const LEAST_CHANGE: f64 = 0.02;

/// Least change over the region, of the step, of light that may be bent.
const LEAST_BENT: f64 = 0.1;

/// Difference of the changes of both sides that is one light, of the greater; the change below which it does not count, of the step; and the
/// level of the dark side below which it has no share, of the bright one.
const LIKE: f64 = 0.5;
const SMALL_CHANGE: f64 = 0.06;
const LEAST_DARK: f64 = 0.05;

/// Terms of a surface beyond its constant: `x, y, x^2, x y, y^2`.
const TERMS: usize = 5;

/// The light of both sides.
#[derive(Clone, Debug)]
pub struct Sides {
    /// Levels of the dark and the bright side at the middle of the edge.
    pub levels: [f64; 2],
    /// How each side changes, in coordinates of the region of -1 to 1 from the middle of the edge.
    changes: [[f64; TERMS]; 2],
    /// Largest change of the bright side over the region, of its level; none if the light is even.
    pub fall: Option<f64>,
    /// The same changes as each band of rows pulls them: their sum of squares is the variance.
    pulls: Vec<[[f64; TERMS]; 2]>,
    middle: [f64; 2],
    half: [f64; 2],
}

/// A pixel: its place in the region, its distance from the edge, value, and band of rows.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub at: [f64; 2],
    pub distance: f64,
    pub value: f64,
    pub band: usize,
}

/// Distance beyond which a side is even, pixels.
pub fn far_px(blur_px: f64) -> f64 {
    (FAR_BLURS * blur_px).max(LEAST_FAR_PX)
}

impl Sides {
    /// The sides of an edge of a given blur, seen up to `half` pixels from it.
    pub fn of(
        region: &Region,
        samples: &[Sample],
        middle: [f64; 2],
        blur_px: f64,
        half: usize,
        bands: usize,
    ) -> Self {
        let even = Self {
            levels: [0.0; 2],
            changes: [[0.0; TERMS]; 2],
            fall: None,
            pulls: Vec::new(),
            middle,
            half: [0.5 * region.width as f64, 0.5 * region.height as f64],
        };
        let far = far_px(blur_px);
        let beyond: Vec<&Sample> = samples.iter().filter(|s| s.distance.abs() > far).collect();
        let count = |sign: f64| beyond.iter().filter(|s| sign * s.distance > 0.0).count();
        let is_known = half as f64 >= far + LEAST_DEPTH_PX && count(1.0).min(count(-1.0)) >= LEAST_PIXELS;
        let found = if is_known { even.changed(&beyond, far, half as f64, bands) } else { None };
        let mut sides = found.unwrap_or(even);
        sides.levels = sides.mean_levels(samples, half as f64);
        let step = (sides.levels[1] - sides.levels[0]).abs();
        let change = sides.largest_change(region);
        if change < LEAST_CHANGE * step {
            sides.changes = [[0.0; TERMS]; 2];
            sides.pulls.clear();
            sides.levels = sides.mean_levels(samples, half as f64);
        } else {
            sides.fall = Some(change / sides.levels[1].abs().max(1e-300));
        }
        sides
    }

    /// The sides with planes, or surfaces of second degree, where they explain more than chance.
    fn changed(&self, beyond: &[&Sample], far: f64, half: f64, bands: usize) -> Option<Self> {
        let flat = Surfaces::fitted(self, beyond, 0, far)?;
        let planes = Surfaces::fitted(self, beyond, 2, far)?;
        let mut best = planes.ratio_over(&flat).filter(|ratio| *ratio > LEAST_RATIO).map(|_| planes)?;
        // A surface needs a side that is deeper than what it is continued over, and light that changes by more than the tails of a blur do.
        let linear = best.changes().iter().map(|c| 2.0 * (c[0].abs() + c[1].abs())).fold(0.0, f64::max);
        let step = (flat.numbers[1] - flat.numbers[0]).abs();
        if half > 3.0 * far
            && linear > LEAST_BENT * step
            && let Some(surfaces) = Surfaces::fitted(self, beyond, TERMS, far)
            && surfaces.ratio_over(&best).is_some_and(|ratio| ratio > LEAST_RATIO)
        {
            best = surfaces;
        }
        let pulls = best.pulls(self, beyond, bands, far);
        Some(Self { changes: best.changes(), pulls, ..self.clone() })
    }

    /// How far the two sides change unlike each other, of the step, over the half width of the region; 0 where they change by the same share,
    /// as light does, by the same amount, as haze does, or by little.
    pub fn unlike(&self) -> f64 {
        let slope = |side: usize| [self.changes[side][0], self.changes[side][1]];
        let size = |v: [f64; 2]| v[0].hypot(v[1]);
        let apart = |a: [f64; 2], b: [f64; 2]| size([a[0] - b[0], a[1] - b[1]]);
        let is_like = |a: [f64; 2], b: [f64; 2]| apart(a, b) <= LIKE * size(a).max(size(b));
        let relative = [0, 1].map(|side| slope(side).map(|s| s / self.levels[side]));
        let step = self.levels[1] - self.levels[0];
        // The share of a dark side near zero is not known.
        let is_dark = self.levels[0] < LEAST_DARK * self.levels[1];
        let is_small = size(slope(0)).max(size(slope(1))) < SMALL_CHANGE * step;
        if is_small || is_dark || is_like(slope(0), slope(1)) || is_like(relative[0], relative[1]) {
            return 0.0;
        }
        apart(slope(0), slope(1)) / step
    }

    /// Terms of the surfaces at a place: `x, y, x^2, x y, y^2`.
    fn terms(&self, at: [f64; 2]) -> [f64; TERMS] {
        let [x, y] = [0, 1].map(|k| (at[k] - self.middle[k]) / self.half[k]);
        [x, y, x * x, x * y, y * y]
    }

    /// Values of the dark and the bright side, continued to a place.
    pub fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let terms = self.terms(at);
        [0, 1].map(|side| self.levels[side] + dot(&self.changes[side], &terms))
    }

    /// The share of the step at a place, 0 on the dark side, 1 on the bright one; none where the sides meet.
    pub fn share(&self, at: [f64; 2], value: f64) -> Option<f64> {
        let [dark, bright] = self.at(at);
        let step = bright - dark;
        (step > 0.1 * (self.levels[1] - self.levels[0])).then(|| (value - dark) / step)
    }

    /// By band of rows, how the band pulls the share of the step at a place on the edge's profile.
    pub fn pulls_at(&self, at: [f64; 2], share: f64) -> Vec<f64> {
        let terms = self.terms(at);
        let step = self.levels[1] - self.levels[0];
        let pull = |[dark, bright]: &[[f64; TERMS]; 2]| {
            -(dot(dark, &terms) * (1.0 - share) + dot(bright, &terms) * share) / step
        };
        self.pulls.iter().map(pull).collect()
    }

    /// Means of the outer fifths of the profile, less the change of the light.
    fn mean_levels(&self, samples: &[Sample], half: f64) -> [f64; 2] {
        let outer = (1.0 - 2.0 * LEVEL_SHARE) * half;
        [-1.0, 1.0].map(|sign| {
            let changes = &self.changes[usize::from(sign > 0.0)];
            let is_outer = |s: &&Sample| sign * s.distance > outer && sign * s.distance <= half;
            let (sum, count) = samples.iter().filter(is_outer).fold((0.0, 0.0), |(sum, count), s| {
                (sum + s.value - dot(changes, &self.terms(s.at)), count + 1.0)
            });
            sum / f64::max(count, 1.0)
        })
    }

    /// By band, how the band pulls the mean levels.
    pub fn level_pulls(&self, samples: &[Sample], half: f64, bands: usize) -> [Vec<f64>; 2] {
        let outer = (1.0 - 2.0 * LEVEL_SHARE) * half;
        [-1.0, 1.0].map(|sign| {
            let side = usize::from(sign > 0.0);
            let (mut sums, mut count) = (vec![0.0; bands], 0.0);
            for s in samples.iter().filter(|s| sign * s.distance > outer && sign * s.distance <= half) {
                sums[s.band] += s.value - self.at(s.at)[side];
                count += 1.0;
            }
            sums.iter().map(|sum| sum / f64::max(count, 1.0)).collect()
        })
    }

    /// Largest change of the bright side between two corners of the region.
    fn largest_change(&self, region: &Region) -> f64 {
        let (w, h) = (region.width as f64, region.height as f64);
        let corners = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].map(|at| self.at(at));
        let range = |side: usize| {
            let (low, high) = corners
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c[side]), h.max(c[side])));
            high - low
        };
        range(0).max(range(1))
    }
}

fn dot(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A constant and some terms on either side, and the tail of the blur on both.
struct Surfaces {
    terms: usize,
    numbers: DVector<f64>,
    inverse: DMatrix<f64>,
    squares: f64,
    count: usize,
}

impl Surfaces {
    fn row(sides: &Sides, sample: &Sample, terms: usize, far: f64) -> Vec<f64> {
        let each = 1 + terms;
        let mut row = vec![0.0; 2 * each + 1];
        let first = if sample.distance > 0.0 { each } else { 0 };
        row[first] = 1.0;
        row[first + 1..first + each].copy_from_slice(&sides.terms(sample.at)[..terms]);
        row[2 * each] = -far / sample.distance;
        row
    }

    fn fitted(sides: &Sides, beyond: &[&Sample], terms: usize, far: f64) -> Option<Self> {
        let count = 2 * (1 + terms) + 1;
        let (mut g, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for sample in beyond {
            let row = DVector::from_vec(Self::row(sides, sample, terms, far));
            right.axpy(sample.value, &row, 1.0);
            g.syger(1.0, &row, &row, 1.0);
        }
        g.fill_upper_triangle_with_lower_triangle();
        let floor = 1e-12 * g.diagonal().max();
        (0..count).for_each(|i| g[(i, i)] += floor);
        let inverse = g.cholesky()?.inverse();
        let numbers = &inverse * right;
        let residual = |sample: &&Sample| {
            let row = Self::row(sides, sample, terms, far);
            sample.value - row.iter().zip(numbers.iter()).map(|(a, b)| a * b).sum::<f64>()
        };
        let squares = beyond.iter().map(|sample| residual(sample).powi(2)).sum();
        Some(Self { terms, numbers, inverse, squares, count: beyond.len() })
    }

    /// The variance that these surfaces explain beyond others, over what they leave, for each of their numbers.
    fn ratio_over(&self, fewer: &Self) -> Option<f64> {
        let added = (self.numbers.len() - fewer.numbers.len()) as f64;
        let left = self.squares / self.count.checked_sub(self.numbers.len())?.max(1) as f64;
        Some((fewer.squares - self.squares) / added / left.max(1e-300))
    }

    fn spread(&self, numbers: &[f64]) -> [[f64; TERMS]; 2] {
        [0, 1].map(|side| {
            let mut of = [0.0; TERMS];
            let first = side * (1 + self.terms) + 1;
            of[..self.terms].copy_from_slice(&numbers[first..first + self.terms]);
            of
        })
    }

    fn changes(&self) -> [[f64; TERMS]; 2] {
        self.spread(self.numbers.as_slice())
    }

    /// `G^-1 sum_(i in band) r_i x_i` for every band.
    fn pulls(&self, sides: &Sides, beyond: &[&Sample], bands: usize, far: f64) -> Vec<[[f64; TERMS]; 2]> {
        let mut sums = vec![DVector::zeros(self.numbers.len()); bands];
        for sample in beyond {
            let row = DVector::from_vec(Self::row(sides, sample, self.terms, far));
            let residual = sample.value - row.dot(&self.numbers);
            sums[sample.band].axpy(residual, &row, 1.0);
        }
        sums.iter().map(|sum| self.spread((&self.inverse * sum).as_slice())).collect()
    }
}
