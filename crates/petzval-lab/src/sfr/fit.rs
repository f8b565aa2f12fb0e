//! The path of an edge: a blurred step between two planes of light, fitted to all pixels at once.
//!
//! ```text
//! v = D(x, y) + (B(x, y) - D(x, y)) Phi(d / s)
//! ```
//!
//! with the distance d from the path, the blur s in pixels, the normal integral Phi, and planes D and B of the dark and the bright side. All
//! pixels count, by Huber's weights, so that an edge is found whose step is less than the noise of a pixel, and dead pixels hardly move it.

use std::f64::consts::{PI, SQRT_2};

use nalgebra::{DMatrix, DVector};
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

use super::path::{Beside, Path};
use super::region::Region;
use super::search::Step;

/// Depth of the sides whose levels a guess has, pixels.
const NEAR_PX: f64 = 8.0;

/// Pixels to either side by which a guess is moved.
const SHIFTS: i32 = 8;

/// Highest degree of a path, and the least number of rows for each degree.
const MOST_DEGREE: usize = 4;
const ROWS_PER_DEGREE: usize = 12;

/// What a higher degree has to gain, as a difference of twice the logarithm of the likelihood: chance does so once in two thousand.
const LEAST_GAIN: f64 = 12.0;

/// Largest sagitta of a path, of its rows: an edge that bends further is a corner.
const MOST_SAGITTA: f64 = 0.1;

/// Most pixels of a fit; of larger regions every n-th row counts.
const MOST_PIXELS: usize = 40_000;

/// Least width of Huber's weights in each round, as a share of the step. It is wide while the path is a guess, so that the pixels of the
/// edge outweigh dead columns. It is never narrower than the deviation of a blur from a normal one.
const LEAST_WIDTHS: [f64; 3] = [0.3, 0.1, 0.02];

/// Steps in a round, and the share of the loss that a step has to gain for another.
const STEPS: usize = 12;
const LEAST_GAIN_OF_STEP: f64 = 1e-7;

/// Standard deviations of the blur beyond which a pixel has the value of its side.
const EVEN_BLURS: f64 = 6.5;

/// Numbers beside the path: the logarithm of s, and three of each plane.
const BESIDE_PATH: usize = 7;

/// A fitted edge.
pub struct Fit {
    pub path: Path,
    /// Standard deviation of the blur, pixels.
    pub blur_px: f64,
    /// Step from dark to bright in the middle of the region.
    pub step: f64,
    /// Standard error of the step.
    pub step_error: f64,
    /// Standard deviation of the pixels about the fit, from their median.
    pub noise: f64,
    /// The numbers of the fit: path, blur, planes.
    numbers: Vec<f64>,
}

/// Fits an edge near a first guess.
pub fn fit_edge(region: &Region, guess: &Step) -> Option<Fit> {
    let (problem, numbers) = Problem::near(region, guess, f64::INFINITY);
    let mut best = problem.solved(numbers)?;
    // A higher degree counts if it explains more than chance would.
    let most = MOST_DEGREE.min(region.height / ROWS_PER_DEGREE);
    let mut tried = best.clone();
    for degree in 2..=most {
        let mut numbers = tried.numbers.clone();
        numbers.insert(degree, 0.0);
        let Some(next) = problem.solved(numbers) else { break };
        let count = problem.pixels.len() as f64;
        let gain = count * (best.loss / next.loss.max(1e-300)).ln();
        let added = (next.numbers.len() - best.numbers.len()) as f64;
        let sagitta = problem.path.with(&next.numbers[..=degree]).sagitta();
        tried = next.clone();
        if gain > LEAST_GAIN * added && sagitta < MOST_SAGITTA * region.height as f64 {
            best = next;
        }
    }
    problem.fit(best.numbers)
}

/// The guess itself, straight: moved across to where the pixels near it differ most, with their medians as levels.
pub fn guessed(region: &Region, guess: &Step) -> Option<Fit> {
    let moved = |by_px: f64| {
        let guess = Step { offset_px: guess.offset_px + by_px, ..*guess };
        let (problem, numbers) = Problem::near(region, &guess, NEAR_PX);
        let step = numbers[numbers.len() - 3] - numbers[numbers.len() - 6];
        (step, problem, numbers)
    };
    let all = (-SHIFTS..=SHIFTS).map(|k| moved(f64::from(k)));
    let (_, problem, numbers) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    problem.fit(numbers)
}

impl<'a> Problem<'a> {
    /// The pixels of a region, and the numbers of a straight edge where the guess lies, with the levels of so many pixels on both sides.
    fn near(region: &'a Region, guess: &Step, reach_px: f64) -> (Self, Vec<f64>) {
        // The guess in the coordinates of the turned region.
        let [nx, ny] = if region.is_upright { guess.normal } else { [guess.normal[1], guess.normal[0]] };
        let offset =
            if region.is_mirrored { guess.offset_px - nx * region.width as f64 } else { guess.offset_px };
        let nx = if region.is_mirrored { -nx } else { nx };
        let slope = -ny / nx;
        let middle = offset / nx + slope * 0.5 * region.height as f64;
        let path = Path::straight(middle, slope, region.height);
        let every = region.values.len().div_ceil(MOST_PIXELS);
        let pixels: Vec<([f64; 2], f64)> = (0..region.values.len())
            .filter(|i| (i / region.width).is_multiple_of(every) && !region.is_dead[*i])
            .map(|i| (region.middle(i), region.values[i]))
            .collect();
        let levels = levels(&pixels, &path, guess.cell_px + 1.0, reach_px).unwrap_or_default();
        let mut numbers = path.coefficients.clone();
        numbers.extend([guess.cell_px.max(1.0).ln(), levels[0], 0.0, 0.0, levels[1], 0.0, 0.0]);
        (Self { region, pixels, path }, numbers)
    }
}

/// Medians of the pixels on both sides of a path, from a distance on and over so many pixels; none where a side has no pixels.
fn levels(pixels: &[([f64; 2], f64)], path: &Path, from_px: f64, reach_px: f64) -> Option<[f64; 2]> {
    let mut sides = [Vec::new(), Vec::new()];
    for (at, value) in pixels {
        let distance = path.beside(*at).distance;
        if distance.abs() > from_px && distance.abs() < from_px + reach_px {
            sides[usize::from(distance > 0.0)].push(*value);
        }
    }
    sides.iter().all(|side| !side.is_empty()).then(|| sides.map(median))
}

/// Numbers with the mean loss of their residuals.
#[derive(Clone)]
struct State {
    numbers: Vec<f64>,
    /// Sum of Huber's loss.
    loss: f64,
}

struct Problem<'a> {
    region: &'a Region,
    pixels: Vec<([f64; 2], f64)>,
    path: Path,
}

/// The model at a pixel.
struct Modelled {
    value: f64,
    /// None beyond the blur.
    beside: Option<Beside>,
    /// `Phi` and its derivative by d.
    rise: [f64; 2],
    /// `1, x, y` of the planes, and the step there.
    plane: [f64; 3],
    step: f64,
}

impl Problem<'_> {
    fn degree(numbers: &[f64]) -> usize {
        numbers.len() - BESIDE_PATH - 1
    }

    fn modelled(&self, numbers: &[f64], path: &Path, at: [f64; 2]) -> Modelled {
        let rest = &numbers[path.degree() + 1..];
        let blur = rest[0].exp();
        let side = path.side_beyond(at, EVEN_BLURS * blur);
        let (beside, rise) = if let Some(side) = side {
            (None, [0.5 + 0.5 * side, 0.0])
        } else {
            let beside = path.beside(at);
            let z = beside.distance / blur;
            let density = (-0.5 * z * z).exp() / ((2.0 * PI).sqrt() * blur);
            (Some(beside), [0.5 * libm::erfc(-z / SQRT_2), density])
        };
        let half = [0.5 * self.region.width as f64, 0.5 * self.region.height as f64];
        let plane = [1.0, at[0] / half[0] - 1.0, at[1] / half[1] - 1.0];
        let of = |side: &[f64]| (0..3).map(|k| side[k] * plane[k]).sum::<f64>();
        let (dark, bright) = (of(&rest[1..4]), of(&rest[4..7]));
        let step = bright - dark;
        Modelled { value: dark + step * rise[0], beside, rise, plane, step }
    }

    fn residuals(&self, numbers: &[f64]) -> Vec<f64> {
        let path = self.path.with(&numbers[..=Self::degree(numbers)]);
        self.pixels.iter().map(|(at, v)| v - self.modelled(numbers, &path, *at).value).collect()
    }

    /// Levenberg-Marquardt with Huber's weights, whose width follows the residuals.
    fn solved(&self, mut numbers: Vec<f64>) -> Option<State> {
        let mut width = f64::INFINITY;
        for least in LEAST_WIDTHS {
            width = self.huber_width(&numbers, least).min(width);
            let mut damping = 1e-3;
            let mut loss = self.loss(&numbers, width);
            for _ in 0..STEPS {
                let (curvature, slope) = self.normal(&numbers, width);
                let mut is_better = false;
                while damping < 1e6 {
                    let next = self.moved(&numbers, &curvature, &slope, damping)?;
                    let next_loss = self.loss(&next, width);
                    if next_loss <= loss {
                        is_better = next_loss < loss * (1.0 - LEAST_GAIN_OF_STEP);
                        (numbers, loss) = (next, next_loss);
                        damping = (damping * 0.1).max(1e-9);
                        break;
                    }
                    damping *= 10.0;
                }
                if !is_better {
                    break;
                }
            }
        }
        let loss = self.loss(&numbers, width);
        Some(State { numbers, loss })
    }

    /// Three standard deviations of the ordinary pixels, and never less than a share of the step.
    fn huber_width(&self, numbers: &[f64], least: f64) -> f64 {
        let rest = &numbers[Self::degree(numbers) + 1..];
        let noise = SIGMA_OVER_MEDIAN * median(self.residuals(numbers).into_iter().map(f64::abs));
        (3.0 * noise).max(least * (rest[4] - rest[1]).abs()).max(1e-12)
    }

    fn loss(&self, numbers: &[f64], width: f64) -> f64 {
        let huber = |r: f64| match r.abs() {
            small if small < width => r * r,
            large => 2.0 * width * large - width * width,
        };
        self.residuals(numbers).into_iter().map(huber).sum()
    }

    /// `J^T W J` and `J^T W r`.
    fn normal(&self, numbers: &[f64], width: f64) -> (DMatrix<f64>, DVector<f64>) {
        let (count, degree) = (numbers.len(), Self::degree(numbers));
        let path = self.path.with(&numbers[..=degree]);
        let (mut curvature, mut slope) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let mut row = vec![0.0; count];
        for (at, value) in &self.pixels {
            let m = self.modelled(numbers, &path, *at);
            let residual = value - m.value;
            let weight = (width / residual.abs().max(1e-300)).min(1.0);
            // Beyond the blur only the plane of one side counts.
            let Some(beside) = m.beside else {
                let first = degree + if m.rise[0] > 0.0 { 5 } else { 2 };
                for i in 0..3 {
                    let weighted = weight * m.plane[i];
                    slope[first + i] += weighted * residual;
                    for j in 0..=i {
                        curvature[(first + i, first + j)] += weighted * m.plane[j];
                    }
                }
                continue;
            };
            let by_distance = m.step * m.rise[1];
            let mut power = -by_distance * beside.cosine;
            for j in row.iter_mut().take(degree + 1) {
                *j = power;
                power *= beside.u;
            }
            row[degree + 1] = -by_distance * beside.distance;
            for k in 0..3 {
                row[degree + 2 + k] = (1.0 - m.rise[0]) * m.plane[k];
                row[degree + 5 + k] = m.rise[0] * m.plane[k];
            }
            for i in 0..count {
                let weighted = weight * row[i];
                slope[i] += weighted * residual;
                for j in 0..=i {
                    curvature[(i, j)] += weighted * row[j];
                }
            }
        }
        curvature.fill_upper_triangle_with_lower_triangle();
        (curvature, slope)
    }

    fn moved(
        &self,
        numbers: &[f64],
        curvature: &DMatrix<f64>,
        slope: &DVector<f64>,
        damping: f64,
    ) -> Option<Vec<f64>> {
        let step = solve(curvature, slope, damping)?;
        let blur = Self::degree(numbers) + 1;
        let mut next: Vec<f64> = numbers.iter().zip(step.iter()).map(|(n, s)| n + s).collect();
        // A blur between a tenth of a pixel and the region, and at most doubled or halved at once.
        let near = (numbers[blur] - 0.7, numbers[blur] + 0.7);
        next[blur] =
            next[blur].clamp(near.0, near.1).clamp(0.1_f64.ln(), (0.5 * self.region.width as f64).ln());
        next.iter().all(|n| n.is_finite()).then_some(next)
    }

    fn fit(&self, numbers: Vec<f64>) -> Option<Fit> {
        let degree = Self::degree(&numbers);
        let path = self.path.with(&numbers[..=degree]);
        let width = self.huber_width(&numbers, LEAST_WIDTHS[2]);
        let noise = SIGMA_OVER_MEDIAN * median(self.residuals(&numbers).into_iter().map(f64::abs));
        let middle = [path.at(0.5 * self.region.height as f64), 0.5 * self.region.height as f64];
        let modelled = self.modelled(&numbers, &path, middle);
        // The variance of the step from the curvature: (J^T W J)^-1 noise^2.
        let mut along = DVector::zeros(numbers.len());
        for k in 0..3 {
            along[degree + 2 + k] = -modelled.plane[k];
            along[degree + 5 + k] = modelled.plane[k];
        }
        let (curvature, _) = self.normal(&numbers, width);
        let variance = solve(&curvature, &along, 1e-9)?.dot(&along) * noise * noise;
        let blur_px = numbers[degree + 1].exp();
        Some(Fit { path, blur_px, step: modelled.step, step_error: variance.max(0.0).sqrt(), noise, numbers })
    }
}

/// Solves with a damped diagonal.
fn solve(curvature: &DMatrix<f64>, slope: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let mut damped = curvature.clone();
    let largest = curvature.diagonal().max().max(1e-300);
    for i in 0..damped.nrows() {
        damped[(i, i)] += damping * damped[(i, i)] + 1e-12 * largest;
    }
    Some(damped.cholesky()?.solve(slope))
}

impl Fit {
    /// Whether the step exceeds so many of its standard errors.
    pub fn has_step(&self, sigmas: f64) -> bool {
        self.step > sigmas * self.step_error
    }

    /// The light of the fit at a pixel, for a first look at outliers.
    pub fn value(&self, region: &Region, at: [f64; 2]) -> f64 {
        let problem = Problem { region, pixels: Vec::new(), path: self.path.clone() };
        problem.modelled(&self.numbers, &self.path, at).value
    }
}
