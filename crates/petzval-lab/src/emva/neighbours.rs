//! Whether the pixels of a mean frame differ independently of their neighbours, once rows and columns are taken away.
//!
//! The split into pixels, rows and columns takes the pixels for independent, and the loss in the high-pass follows from that. Blotches, a pattern of
//! amplifiers or optical cross-talk are not. With the residuals `d` of `n` pixels, the correlations at small distances
//!
//! ```text
//! r(a, b) = sum d(y, x) d(y + a, x + b) / sum d^2,      n sum (r - r_0)^2 / v     chi-squared of as many degrees as distances
//! ```
//!
//! are compared with those of independent pixels after the filter, `r_0`; `v` is the sum of the squares of these over all distances.

use super::goodness::{ALPHA, FitTest, Verdict, chi2_beyond};
use super::high_pass::{HighPass, Plane};
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Distances of the neighbours, rows and columns.
const DISTANCES: [[usize; 2]; 4] = [[0, 1], [1, 0], [0, 2], [2, 0]];

/// Least departure of a correlation that matters: less changes a variance by less than 2 %.
const LEAST: f64 = 0.01;

/// Correlation with the next pixel but one, of either sign, from which pixels repeat like the filters of a mosaic.
const TILED: f64 = 0.5;

/// Correlations of pixels with their neighbours.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Neighbours {
    pixels: f64,
    /// Sums of the products at each distance, over that of the squares, less the expected correlation; times `pixels`.
    excess: [f64; DISTANCES.len()],
    /// Sum of the squared correlations that the filter makes.
    of_filter: f64,
}

impl Neighbours {
    /// The correlations of a filtered frame.
    pub fn of(plane: &Plane, high_pass: HighPass) -> Self {
        let (height, width) = (plane.height, plane.width);
        let mean = |values: &mut dyn Iterator<Item = f64>, count: usize| values.sum::<f64>() / count as f64;
        let rows: Vec<f64> =
            (plane.values.chunks_exact(width)).map(|row| mean(&mut row.iter().copied(), width)).collect();
        let columns: Vec<f64> = (0..width)
            .map(|column| mean(&mut plane.values.iter().skip(column).step_by(width).copied(), height))
            .collect();
        let whole = rows.iter().sum::<f64>() / height as f64;
        // Take pixels far off for the others' limit: a few hot ones would be the whole sum.
        let mut residuals: Vec<f64> = (plane.values.iter().enumerate())
            .map(|(i, v)| v - rows[i / width] - columns[i % width] + whole)
            .collect();
        let limit = FAR_SIGMAS * SIGMA_OVER_MEDIAN * median(residuals.iter().map(|d| d.abs()));
        residuals.iter_mut().for_each(|d| *d = d.clamp(-limit, limit));
        let squares: f64 = residuals.iter().map(|d| d * d).sum();
        if squares <= 0.0 {
            return Self::default();
        }
        let pixels = (height * width) as f64;
        let [own_of_row, own_of_column] = [width, height].map(|line| 1.0 - 1.0 / line as f64);
        let kernel = high_pass.kernel();
        let expected = expected(&kernel);
        let correlation = |[down, right]: [usize; 2]| {
            let pairs = (0..height.saturating_sub(down)).flat_map(|row| {
                let (above, below) =
                    (&residuals[row * width..][..width], &residuals[(row + down) * width..][..width]);
                above.iter().zip(&below[right.min(width)..]).map(|(a, b)| a * b)
            });
            let count = height.saturating_sub(down) * width.saturating_sub(right);
            let found = pairs.sum::<f64>() / count.max(1) as f64 / (squares / pixels);
            // Means of rows and of columns take a share of the variance, and of every covariance along them.
            let of_all = found * own_of_row * own_of_column;
            let taken = if down == 0 {
                (1.0 - own_of_row) * own_of_column
            } else {
                (1.0 - own_of_column) * own_of_row
            };
            pixels * (of_all - expected([down, right]) + taken)
        };
        let of_filter = pixels * high_pass.passed().pixel_correlation;
        Self { pixels, excess: DISTANCES.map(correlation), of_filter }
    }

    /// Adds those of other pixels.
    pub fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.excess.iter_mut().zip(&other.excess).for_each(|(a, b)| *a += b);
        self.of_filter += other.of_filter;
    }

    /// Departures of the correlations from those of independent pixels.
    fn departures(&self) -> [f64; DISTANCES.len()] {
        self.excess.map(|excess| excess / self.pixels.max(1.0))
    }

    /// Whether the pixels repeat in rows and columns as in a tile of colour filters, 2x2 or, with two alike in a row, 4x4.
    pub fn is_tiled(&self) -> bool {
        let [right, down, second_right, second_down] = self.departures();
        let is_two = right.max(down) < 0.0 && second_right.min(second_down) > TILED;
        let is_four = second_right.max(second_down) < -TILED;
        is_two || is_four
    }

    /// The test. A departure that no figure shows is none.
    pub fn test(&self) -> FitTest {
        let departures = self.departures();
        let of_filter = self.of_filter / self.pixels.max(1.0);
        let squares: f64 = departures.iter().map(|d| d * d).sum();
        let chi2 = if of_filter > 0.0 { self.pixels * squares / of_filter } else { 0.0 };
        let degrees_of_freedom = DISTANCES.len();
        let p_value = chi2_beyond(chi2, degrees_of_freedom);
        let matters = departures.iter().any(|d| d.abs() > LEAST);
        FitTest {
            reduced_chi2: chi2 / degrees_of_freedom as f64,
            p_value,
            verdict: match p_value < ALPHA && matters {
                _ if self.pixels == 0.0 => Verdict::Untested,
                true => Verdict::Widened,
                false => Verdict::Holds,
            },
            ..FitTest::untested(self.pixels as usize, degrees_of_freedom)
        }
    }

    /// Factor on the error of the variance of the pixels: fewer of them are independent. Each distance stands for its mirror image, and the first
    /// two for the diagonal ones.
    pub fn scatter(&self) -> f64 {
        let squares: f64 = self.departures().iter().map(|d| 2.0 * d * d).sum();
        let [right, down, ..] = self.departures();
        (1.0 + squares + 4.0 * (right * down).powi(2)).sqrt()
    }

    /// Share of the variance of the pixels that the filter takes beyond that of independent ones: twice the low-pass at the neighbours, weighed by
    /// their correlations.
    pub fn lost_share(&self, high_pass: HighPass) -> f64 {
        let kernel = high_pass.kernel();
        let Some(middle) = kernel.len().checked_sub(1).map(|last| last / 2) else { return 0.0 };
        let tap = |shift: usize| kernel.get(middle + shift).copied().unwrap_or(0.0);
        let low_pass = |[down, right]: [usize; 2]| tap(down) * tap(right);
        DISTANCES.iter().zip(self.departures()).map(|(at, d)| 2.0 * d * low_pass(*at)).sum::<f64>().abs()
    }
}

/// Correlation that a filter `delta - l x l` makes among independent pixels, by distance.
fn expected(kernel: &[f64]) -> impl Fn([usize; 2]) -> f64 + '_ {
    let middle = kernel.len() / 2;
    let once = move |shift: usize| kernel.get(middle + shift).copied().unwrap_or(0.0);
    let twice =
        move |shift: usize| kernel.iter().zip(kernel.iter().skip(shift)).map(|(a, b)| a * b).sum::<f64>();
    move |[down, right]| {
        if kernel.is_empty() {
            return 0.0;
        }
        let at = |down: usize, right: usize| {
            let delta = if down == 0 && right == 0 { 1.0 } else { 0.0 };
            delta - 2.0 * once(down) * once(right) + twice(down) * twice(right)
        };
        at(down, right) / at(0, 0)
    }
}

/// Standard deviations beyond which a pixel counts as one at this limit.
const FAR_SIGMAS: f64 = 5.0;

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const SIZE: usize = 120;

    fn noise(seed: u64) -> Plane {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let values = (0..SIZE * SIZE).map(|_| StandardNormal.sample(&mut rng)).collect();
        Plane { height: SIZE, width: SIZE, values }
    }

    /// The subtracted means make independent pixels of few lines look correlated.
    #[test]
    fn independent_pixels_of_few_lines_have_no_correlation() {
        for (height, width) in [(8, 1000), (1000, 8)] {
            let mut all = Neighbours::default();
            for seed in 0..40 {
                let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                let values = (0..height * width).map(|_| StandardNormal.sample(&mut rng)).collect();
                all.add(&Neighbours::of(&Plane { height, width, values }, HighPass::None));
            }
            // 320,000 pixels give each to 0.0018.
            assert!(all.departures().iter().all(|r| r.abs() < 0.008), "{height}: {:?}", all.departures());
        }
    }

    #[test]
    fn independent_pixels_pass_with_any_filter_and_blotches_do_not() {
        for filter in [HighPass::None, HighPass::R31, HighPass::R4] {
            let mut p_values = Vec::new();
            for seed in 0..60 {
                let test = Neighbours::of(&filter.apply(&noise(seed)).unwrap(), filter).test();
                assert_eq!(test.verdict, Verdict::Holds, "{filter:?}: {test:?}");
                p_values.push(test.p_value);
            }
            // Uniform by Kolmogorov and Smirnov at 1e-4.
            p_values.sort_by(f64::total_cmp);
            let off = p_values
                .iter()
                .enumerate()
                .map(|(i, p)| (p - (i as f64 + 0.5) / 60.0).abs())
                .fold(0.0, f64::max);
            assert!(off < 2.23 / 60.0_f64.sqrt(), "{filter:?}: {off}");
            // Each pixel has a third of its right neighbour.
            let mut alike = noise(7);
            for i in 0..alike.values.len() - 1 {
                alike.values[i] += alike.values[i + 1] / 3.0;
            }
            let found = Neighbours::of(&filter.apply(&alike).unwrap(), filter);
            assert_eq!(found.test().verdict, Verdict::Widened, "{filter:?}");
            assert!(!found.is_tiled(), "{filter:?}");
            // Tiles of filters, one pixel or two by two of a colour, beside as much noise as they differ by.
            for side in [1, 2] {
                let mut tiled = noise(8);
                for (i, value) in tiled.values.iter_mut().enumerate() {
                    let (row, col) = (i / SIZE / side % 2, i % SIZE / side % 2);
                    *value += [[-4.0, 1.0], [1.0, -2.0]][row][col];
                }
                let found = Neighbours::of(&filter.apply(&tiled).unwrap(), filter);
                assert!(found.is_tiled(), "{filter:?} {side}: {:?}", found.departures());
            }
            assert!(
                (found.departures()[0] - 0.3).abs() < 0.03 && found.scatter() > 1.08,
                "{:?}",
                found.departures()
            );
        }
    }
}
