//! How the light changes across a region, fitted to the pixels beyond the blur of an edge.
//!
//! ```text
//! v = g(x, y) L_s + h a + T(d)        g = 1 + gamma . (x, y, ...),   T(d) = p d / half + q far / d + r_s (far / d)^4
//! ```
//!
//! L is the level of either side s, h the haze along the edge, and T the tail of the blur at the distance d. Far from the edge the tail is
//! the same on both sides but for its sign. Near the edge it is not, if the lens has coma.
//!
//! The rise p of a tail comes with its falls q and r, since a blur ends. Where the pixels have a rise and no falls, it is a haze that
//! grows across the edge, and belongs to the light.

use nalgebra::{DMatrix, DVector};

use super::place::{Place, Sample, TERMS, WAYS};

/// Numbers of the tail.
const TAIL: usize = 4;

/// Most numbers of a fit: two levels, the light, the haze, and the tail.
const MOST: usize = 2 + WAYS + TAIL;

/// The variance ratio (F) from which a change of the light counts.
const LEAST_RATIO: f64 = 12.0;

/// The same from which a rise without a fall counts as a haze across the edge: noise of neighbours may be correlated.
const LEAST_VEIL_RATIO: f64 = 30.0;

/// Least length of a profile whose light may be bent, in distances at which its sides begin; and the least change over the region, of the step.
const DEPTH: f64 = 3.0;
const LEAST_BENT: f64 = 0.1;

/// Prior standard deviation of the rise of the tail of a blur over half a profile, as a share of the step.
const TAIL_RISE: f64 = 0.02;

/// Steps of Gauss-Newton: the light is nearly linear in its numbers.
const STEPS: usize = 3;

/// `gamma`, and the haze along and across the edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct Light {
    numbers: [f64; WAYS],
}

/// How each band of rows pulls the numbers of the light.
pub type Pulls = Vec<[f64; WAYS]>;

impl Light {
    /// The light and the haze where the terms are these.
    pub fn at(&self, terms: &[f64; WAYS]) -> [f64; 2] {
        let change: f64 = (0..TERMS).map(|k| self.numbers[k] * terms[k]).sum();
        [1.0 + change, (TERMS..WAYS).map(|k| self.numbers[k] * terms[k]).sum()]
    }

    /// Whether a haze grows across the edge.
    pub fn has_veil(&self) -> bool {
        self.numbers[WAYS - 1] != 0.0
    }

    /// The light that explains the pixels beyond the blur better than chance, and how each band of rows pulls it; none if it is even.
    /// `far` is where they begin, `half` the length of the profile, pixels.
    pub fn found(
        place: &Place,
        beyond: &[Sample],
        far: f64,
        half: f64,
        bands: usize,
    ) -> Option<(Self, Pulls)> {
        let problem = Problem { place, beyond, far, half };
        let even = Model { terms: 0, has_haze: false, tail: Tail::Whole };
        let free = problem.solved(Model { terms: 2, has_haze: true, ..even }, 0.0)?;
        let ridge = free.variance() / (TAIL_RISE * free.step()).powi(2).max(1e-300);
        let mut best = problem.solved(even, ridge)?;
        let better = |best: Fitted, model: Model| -> Option<Fitted> {
            let next = problem.solved(model, ridge)?;
            Some(if next.ratio_over(&best) > LEAST_RATIO { next } else { best })
        };
        // A rise without a fall is a haze across the edge.
        let straight = problem.solved(Model { terms: 2, has_haze: true, tail: Tail::Veil }, 0.0)?;
        let is_straight = free.ratio_over(&straight) < LEAST_RATIO;
        // Light that bends explains a rise as well.
        let rises = || {
            let bent = problem.solved(Model { terms: TERMS, has_haze: true, tail: Tail::None }, 0.0)?;
            let bent_and_veil = problem.solved(Model { tail: Tail::Veil, ..bent.model }, 0.0)?;
            Some(bent_and_veil.ratio_over(&bent) > LEAST_VEIL_RATIO)
        };
        if is_straight && rises()? {
            best = problem.solved(Model { tail: Tail::None, ..even }, 0.0)?;
            best = better(best, Model { tail: Tail::Veil, ..even })?;
            for (terms, has_haze) in [(2, false), (2, true)] {
                best = better(best, Model { terms, has_haze, tail: Tail::Veil })?;
            }
            let light = Self { numbers: best.spread(best.numbers.as_slice()) };
            return (best.model.tail == Tail::Veil).then(|| (light, problem.pulls(&best, bands)));
        }
        best = better(best, Model { terms: 2, ..even })?;
        let with_haze = Model { has_haze: true, ..best.model };
        best = better(best, with_haze)?;
        // Bent light needs sides that are deeper than what it is continued over, and a change that no tail has.
        if half > DEPTH * far && best.linear_change() > LEAST_BENT * best.step() {
            for terms in [5, TERMS] {
                let bent = Model { terms, ..best.model };
                best = better(best, bent)?;
            }
        }
        let light = Self { numbers: best.spread(best.numbers.as_slice()) };
        (best.model != even).then(|| (light, problem.pulls(&best, bands)))
    }
}

/// Which numbers are fitted beside the levels and the tail.
#[derive(Clone, Copy, PartialEq)]
struct Model {
    /// Terms of the light.
    terms: usize,
    has_haze: bool,
    tail: Tail,
}

/// What is fitted of the tail of the blur.
#[derive(Clone, Copy, PartialEq)]
enum Tail {
    /// A rise, and its falls.
    Whole,
    /// None, and a haze across the edge.
    Veil,
    None,
}

impl Model {
    /// The place of the tail's first number, or of the haze across the edge.
    fn tail_at(self) -> usize {
        2 + self.terms + usize::from(self.has_haze)
    }

    fn count(self) -> usize {
        self.tail_at()
            + match self.tail {
                Tail::Whole => TAIL,
                Tail::Veil => 1,
                Tail::None => 0,
            }
    }
}

struct Problem<'a> {
    place: &'a Place,
    beyond: &'a [Sample],
    far: f64,
    half: f64,
}

/// Numbers in the order: levels, light, haze, tail.
struct Fitted {
    model: Model,
    numbers: DVector<f64>,
    inverse: DMatrix<f64>,
    /// Sum of the squares of the residuals and of the prior.
    squares: f64,
    pixels: usize,
}

impl Problem<'_> {
    /// Derivatives of a pixel's value by the numbers, and its residual.
    fn row(&self, model: Model, numbers: &DVector<f64>, sample: &Sample) -> ([f64; MOST], f64) {
        let terms = self.place.terms(sample.at);
        let side = usize::from(sample.distance > 0.0);
        let light = 1.0 + (0..model.terms).map(|k| numbers[2 + k] * terms[k]).sum::<f64>();
        let mut row = [0.0; MOST];
        row[side] = light;
        for k in 0..model.terms {
            row[2 + k] = numbers[side] * terms[k];
        }
        let mut value = numbers[side] * light;
        if model.has_haze {
            row[2 + model.terms] = terms[TERMS];
        }
        let at = model.tail_at();
        match model.tail {
            Tail::Whole => {
                let near = self.far / sample.distance;
                row[at] = sample.distance / self.half;
                row[at + 1] = near;
                row[at + 2 + side] = near.powi(4);
            }
            Tail::Veil => row[at] = terms[TERMS + 1],
            Tail::None => {}
        }
        value += (2 + model.terms..model.count()).map(|k| numbers[k] * row[k]).sum::<f64>();
        (row, sample.value - value)
    }

    /// Least squares with a ridge on the tail's rise.
    fn solved(&self, model: Model, ridge: f64) -> Option<Fitted> {
        let count = model.count();
        let mut numbers = DVector::zeros(count);
        for side in 0..2 {
            let own = self.beyond.iter().filter(|s| usize::from(s.distance > 0.0) == side);
            let (sum, count) = own.fold((0.0, 0.0), |(sum, count), s| (sum + s.value, count + 1.0));
            numbers[side] = sum / f64::max(count, 1.0);
        }
        let steps = if model.terms > 0 { STEPS } else { 1 };
        for step in 0..=steps {
            let mut g = [[0.0; MOST]; MOST];
            let (mut right, mut squares) = ([0.0; MOST], 0.0);
            for sample in self.beyond {
                let (row, residual) = self.row(model, &numbers, sample);
                squares += residual * residual;
                for i in 0..count {
                    right[i] += row[i] * residual;
                    for j in 0..=i {
                        g[i][j] += row[i] * row[j];
                    }
                }
            }
            if model.tail == Tail::Whole {
                let rise = model.tail_at();
                squares += ridge * numbers[rise].powi(2);
                right[rise] -= ridge * numbers[rise];
                g[rise][rise] += ridge;
            }
            let largest = (0..count).map(|i| g[i][i]).fold(0.0, f64::max);
            let g = DMatrix::from_fn(count, count, |i, j| {
                let floor = if i == j { 1e-12 * largest } else { 0.0 };
                g[i.max(j)][i.min(j)] + floor
            });
            let factor = g.cholesky()?;
            if step == steps {
                let inverse = factor.inverse();
                return Some(Fitted { model, numbers, inverse, squares, pixels: self.beyond.len() });
            }
            numbers += factor.solve(&DVector::from_column_slice(&right[..count]));
        }
        None
    }

    /// `G^-1 sum_(i in band) r_i x_i` for every band.
    fn pulls(&self, fitted: &Fitted, bands: usize) -> Pulls {
        let count = fitted.model.count();
        let mut sums = vec![DVector::zeros(count); bands];
        for sample in self.beyond {
            let (row, residual) = self.row(fitted.model, &fitted.numbers, sample);
            for i in 0..count {
                sums[sample.band][i] += residual * row[i];
            }
        }
        sums.iter().map(|sum| fitted.spread((&fitted.inverse * sum).as_slice())).collect()
    }
}

impl Fitted {
    fn step(&self) -> f64 {
        (self.numbers[1] - self.numbers[0]).abs()
    }

    /// Variance of the residuals.
    fn variance(&self) -> f64 {
        self.squares / self.pixels.saturating_sub(self.numbers.len()).max(1) as f64
    }

    /// The variance that this fit explains beyond another, over what it leaves, for each of its further numbers.
    fn ratio_over(&self, fewer: &Self) -> f64 {
        let added = self.numbers.len() as f64 - fewer.numbers.len() as f64;
        (fewer.squares - self.squares) / added.max(1.0) / self.variance().max(1e-300)
    }

    /// Change of the bright side over the region by the linear terms; none without them.
    fn linear_change(&self) -> f64 {
        let slope: f64 = (0..self.model.terms.min(2)).map(|k| self.numbers[2 + k].abs()).sum();
        2.0 * self.numbers[1].abs() * slope
    }

    /// Numbers of the light in their places.
    fn spread(&self, numbers: &[f64]) -> [f64; WAYS] {
        let mut of = [0.0; WAYS];
        let terms = self.model.terms;
        of[..terms].copy_from_slice(&numbers[2..2 + terms]);
        if self.model.has_haze {
            of[TERMS] = numbers[2 + terms];
        }
        if self.model.tail == Tail::Veil {
            of[TERMS + 1] = numbers[self.model.tail_at()];
        }
        of
    }
}
