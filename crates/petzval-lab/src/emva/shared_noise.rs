//! Temporal noise that pixels share with their neighbours, or frames with the frame before: that of frames which were filtered in the camera.
//!
//! Photons, dark current and readout give each pixel of each frame noise of its own. A low-pass, a correction of defects or a reduction of noise
//! over time takes a part of the variance away, and K with it. What it leaves is correlated. With the last frame `y_L` of a flat point, the
//! sum `S` of its `L` frames, and the squares `A` of the steps from frame to frame and `B` of the deviations from the mean,
//!
//! ```text
//! d    = L y_L - S                                          fixed pattern cancels                    [DN]
//! r(h) = sum over pixels of d(p) d(p + h) / sum d^2         h: next pixel of the same colour in the row, in the column, diagonally
//! rho  = 1 - A / (2 B)                                      stacks: von Neumann's ratio
//! ```
//!
//! once the means of rows and of columns are subtracted, whose noise whole lines share. With `N` pixels in a row and `M` in a column the means leave
//! independent noise the share `f = (1 - 1/N)(1 - 1/M)` of its variance, and make it look correlated by
//!
//! ```text
//! -1/(N - 1) in the row,   -1/(M - 1) in the column,   1/((N - 1)(M - 1)) diagonally
//! ```
//!
//! So `r` less these, times `f`, is the correlation. Without a filter all are zero, with standard errors of at most `1/sqrt(pixels)` and of
//! `sqrt((L - 2)/((L^2 - 1) f pixels))`. A filter whose weights sum to one keeps the sum of the covariances over all distances, so
//! the variance without it is
//!
//! ```text
//! (1 + 2 sum over h of r(h)) (1 + rho) / (1 - rho)          times what is found
//! ```

use schemars::JsonSchema;
use serde::Serialize;

use super::line_noise::LineSums;
use super::measured::{Measured, Unresolved};
use petzval_base::statistics::median;

/// Standard errors beyond which a correlation is no chance.
const SHARED_SIGMAS: f64 = 5.0;

/// Least correlation that matters: it changes K by 2 %.
const LEAST: f64 = 0.01;

/// Share of the variance from which on the figures that rest on it are withdrawn.
const FAR_OFF: f64 = 0.1;

/// Least share of a variance that a filter may leave. At a tenth the true variance would be ten times the measured one.
const LEAST_LEFT: f64 = 0.1;

/// Standard deviations at which a pixel counts as one at this limit: a few blinking ones would be the whole sum.
const FAR_SIGMAS: f64 = 5.0;

/// Pixels of a frame that are looked at, about: they give a correlation to a thousandth.
const MOST_PIXELS: usize = 1 << 20;

/// Correlations of the noise of neighbours, of one point or of several.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct NeighbourNoise {
    pixels: f64,
    /// Correlations along rows, along columns and on the diagonals, times `pixels`.
    sums: [f64; 3],
}

/// Sums over the pixels of one colour.
#[derive(Debug, Clone, Copy, Default)]
struct Products {
    squares: f64,
    pixels: f64,
    /// Products of neighbours along rows, along columns and on the diagonals, and their numbers.
    of_pairs: [(f64, f64); 3],
}

/// A point of flat frames, as it is reduced.
pub(super) struct LastFrame<'a> {
    /// The last frame, DN.
    pub last: &'a [u16],
    /// Sum of all frames, DN.
    pub sum_dn: &'a [u32],
    /// Frames.
    pub frames: usize,
    /// Columns.
    pub width: usize,
    /// Index of the colour of each place of the tile, rows of columns.
    pub class_of: &'a [Vec<usize>],
    /// Lines of each colour.
    pub lines: Vec<&'a LineSums>,
    /// Temporal variance of the pixels of each colour, DN^2.
    pub variance_dn2: Vec<f64>,
}

impl LastFrame<'_> {
    /// The correlations of the noise of neighbours, by colour.
    pub(super) fn neighbours(&self) -> Vec<NeighbourNoise> {
        let (down, right) = (self.class_of.len(), self.class_of[0].len());
        let means: Vec<LineMeans> = (0..self.lines.len()).map(|class| self.line_means(class)).collect();
        let limits: Vec<f64> = self.variance_dn2.iter().map(|variance| self.limit(*variance)).collect();
        let row_of = |row: usize| -> Vec<f64> {
            let span = row * self.width..(row + 1) * self.width;
            let of_pixel = |(column, (last, sum)): (usize, (&u16, &u32))| {
                let class = self.class_of[row % down][column % right];
                let found = (self.frames as i64 * i64::from(*last) - i64::from(*sum)) as f64;
                let own = found - means[class].rows[row] - means[class].columns[column];
                own.clamp(-limits[class], limits[class])
            };
            self.last[span.clone()].iter().zip(&self.sum_dn[span]).enumerate().map(of_pixel).collect()
        };
        let height = self.last.len() / self.width;
        let mut found = vec![Products::default(); self.lines.len()];
        // Of large frames some rows are enough.
        let every = self.last.len().div_ceil(MOST_PIXELS);
        for row in (0..height).filter(|row| (row / down).is_multiple_of(every)) {
            let (above, below) =
                (row_of(row), if row + down < height { row_of(row + down) } else { Vec::new() });
            for (column, own) in above.iter().enumerate() {
                let products = &mut found[self.class_of[row % down][column % right]];
                products.squares += own * own;
                products.pixels += 1.0;
                let mut add = |way: usize, product: Option<f64>| {
                    if let Some(product) = product {
                        products.of_pairs[way].0 += product;
                        products.of_pairs[way].1 += 1.0;
                    }
                };
                let next = above.get(column + right);
                add(0, next.map(|next| own * next));
                add(1, below.get(column).map(|under| own * under));
                add(2, below.get(column + right).map(|under| own * under));
                add(2, next.zip(below.get(column)).map(|(next, under)| next * under));
            }
        }
        found.iter().zip(&self.lines).map(|(products, lines)| products.neighbours(lines)).collect()
    }

    fn limit(&self, variance_dn2: f64) -> f64 {
        let frames = self.frames as f64;
        FAR_SIGMAS * (frames * (frames - 1.0) * variance_dn2.max(0.0)).sqrt()
    }

    /// Means of `d` of the rows of a colour, and means of what is left in its columns, DN.
    fn line_means(&self, class: usize) -> LineMeans {
        let lines = self.lines[class];
        let mean = |sums: &[Vec<u64>], pixels: &[usize], line: usize| {
            let all = sums.iter().map(|frame| frame[line] as f64).sum::<f64>();
            let last = sums.last().map_or(0.0, |frame| frame[line] as f64);
            (self.frames as f64 * last - all) / pixels[line].max(1) as f64
        };
        let (height, width) = (lines.row_pixels.len(), lines.column_pixels.len());
        let rows: Vec<f64> = (0..height).map(|row| mean(&lines.rows, &lines.row_pixels, row)).collect();
        // A column has the means of its rows, those of its place in the tile.
        let (down, right) = (self.class_of.len(), self.class_of[0].len());
        let of_rows: Vec<f64> = (0..right)
            .map(|place| {
                let own = (0..height).filter(|row| self.class_of[row % down][place] == class);
                own.clone().map(|row| rows[row]).sum::<f64>() / own.count().max(1) as f64
            })
            .collect();
        let columns = (0..width)
            .map(|column| mean(&lines.columns, &lines.column_pixels, column) - of_rows[column % right])
            .collect();
        LineMeans { rows, columns }
    }
}

impl LineSums {
    /// Shares of the variance of independent pixels that are left when the mean of each row, and of each column, is subtracted: `1 - 1/N` of lines
    /// of `N` pixels. 0 if each line is a single pixel.
    fn own_shares(&self) -> [f64; 2] {
        [&self.row_pixels, &self.column_pixels].map(|pixels| {
            let used = pixels.iter().filter(|n| **n > 0).count();
            1.0 - used as f64 / pixels.iter().sum::<usize>().max(1) as f64
        })
    }
}

/// What lines share, DN.
struct LineMeans {
    rows: Vec<f64>,
    columns: Vec<f64>,
}

impl Products {
    fn neighbours(&self, lines: &LineSums) -> NeighbourNoise {
        let variance = self.squares / self.pixels;
        if self.pixels == 0.0 || variance <= 0.0 {
            return NeighbourNoise::default();
        }
        let [own_of_row, own_of_column] = lines.own_shares();
        let free = own_of_row * own_of_column;
        if free <= 0.0 {
            return NeighbourNoise::default();
        }
        // Subtract the correlations that the subtracted means leave in independent noise.
        let [in_row, in_column] = [own_of_row, own_of_column].map(|own| (1.0 - own) / own);
        let by_means = [-in_row, -in_column, in_row * in_column];
        let correlation = |way: usize| {
            let (sum, pairs) = self.of_pairs[way];
            if pairs > 0.0 { free * (sum / pairs / variance - by_means[way]) } else { 0.0 }
        };
        NeighbourNoise { pixels: self.pixels, sums: [0, 1, 2].map(|way| self.pixels * correlation(way)) }
    }
}

impl NeighbourNoise {
    /// All points together.
    pub(super) fn pooled(points: impl IntoIterator<Item = Self>) -> Self {
        points.into_iter().fold(Self::default(), |all, one| Self {
            pixels: all.pixels + one.pixels,
            sums: [0, 1, 2].map(|way| all.sums[way] + one.sums[way]),
        })
    }

    /// The correlations along rows, along columns and on the diagonals.
    fn correlations(&self) -> [Measured; 3] {
        let pixels = self.pixels.max(1.0);
        self.sums.map(|sum| Measured::new(sum / pixels, pixels.sqrt().recip()))
    }
}

/// Largest variance of a pixel, in medians, for few degrees of freedom `n` `FAR_VARIANCE + FAR_VARIANCE_OF_FEW / n`. Chance exceeds it in fewer than
/// one pixel of ten thousand. Telegraph pixels, whose noise is correlated in itself, lie beyond.
const FAR_VARIANCE: f64 = 4.0;
const FAR_VARIANCE_OF_FEW: f64 = 20.0;

/// Steps from frame to frame, of the pixels of one colour whose variance is near that of the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameSteps {
    /// Pixels.
    pixels: usize,
    /// Sum over pixels and frames of the squared steps from frame to frame, DN^2.
    steps_dn2: f64,
    /// Sum over pixels and frames of the squared deviations from the mean of the frames, DN^2.
    squares_dn2: f64,
}

impl FrameSteps {
    /// Adds up pixels of so many frames, each with its sum of squared steps and its temporal variance, DN^2. `None` without noise.
    pub(super) fn of(pixels: impl Iterator<Item = (f64, f64)> + Clone, frames: usize) -> Option<Self> {
        let degrees = frames as f64 - 1.0;
        let limit_dn2 = (FAR_VARIANCE + FAR_VARIANCE_OF_FEW / degrees)
            * median(pixels.clone().map(|(_, variance_dn2)| variance_dn2));
        let mut found = Self { pixels: 0, steps_dn2: 0.0, squares_dn2: 0.0 };
        for (steps_dn2, variance_dn2) in pixels.filter(|(_, variance_dn2)| *variance_dn2 <= limit_dn2) {
            found.pixels += 1;
            found.steps_dn2 += steps_dn2;
            found.squares_dn2 += degrees * variance_dn2;
        }
        (found.squares_dn2 > 0.0).then_some(found)
    }
}

/// Correlation of the noise of a frame with that of the frame before, of a stack of so many pixels, those that are left out of `found` included.
/// Not resolved if the colour has a single row or column, whose means are all of its noise.
pub(super) fn frame_correlation(
    lines: &LineSums,
    frame_sums: &[u64],
    pixels: usize,
    found: FrameSteps,
) -> Measured {
    let steps = |sums: &[f64]| sums.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let squares = |sums: &[f64]| {
        let mean = sums.iter().sum::<f64>() / sums.len() as f64;
        sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>()
    };
    // What rows and columns share; that of the whole frame is in both.
    let shared = |of: &dyn Fn(&[f64]) -> f64| {
        let of_lines = |sums: &[Vec<u64>], pixels: &[usize]| -> f64 {
            let used = pixels.iter().enumerate().filter(|(_, n)| **n > 0);
            let of_line = |(line, n): (usize, &usize)| {
                let over_frames: Vec<f64> = sums.iter().map(|frame| frame[line] as f64).collect();
                of(&over_frames) / *n as f64
            };
            used.map(of_line).sum()
        };
        let whole: Vec<f64> = frame_sums.iter().map(|sum| *sum as f64).collect();
        of_lines(&lines.rows, &lines.row_pixels) + of_lines(&lines.columns, &lines.column_pixels)
            - of(&whole) / pixels as f64
    };
    let kept = found.pixels as f64 / pixels as f64;
    let steps_dn2 = found.steps_dn2 - kept * shared(&steps);
    let squares_dn2 = found.squares_dn2 - kept * shared(&squares);
    let frames = frame_sums.len() as f64;
    let free = lines.own_shares().iter().product::<f64>() * found.pixels as f64;
    if free <= 0.0 || squares_dn2 <= 0.0 {
        return Measured::none(Unresolved::FewLines);
    }
    let error = ((frames - 2.0) / ((frames * frames - 1.0) * free)).sqrt();
    Measured::new(1.0 - steps_dn2 / (2.0 * squares_dn2), error)
}

/// Correlations of temporal noise that are neither chance nor small; zero where they are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SharedNoise {
    /// With the next pixel of the same colour in the row.
    pub along_rows: f64,
    /// With the next pixel of the same colour in the column.
    pub along_columns: f64,
    /// With the next pixels of the same colour on the diagonals.
    pub diagonal: f64,
    /// Of a frame with the frame before.
    pub between_frames: f64,
}

impl SharedNoise {
    /// The correlations of the flat points of one colour, and of its stack; `None` if none of them matters.
    pub(super) fn of(neighbours: NeighbourNoise, frames: Option<Measured>) -> Option<Self> {
        let that_matters = |found: Measured| {
            let value = found.value().unwrap_or(0.0);
            if value.abs() > LEAST.max(SHARED_SIGMAS * found.error_or_zero()) { value } else { 0.0 }
        };
        let [along_rows, along_columns, diagonal] = neighbours.correlations().map(that_matters);
        let between_frames = frames.map_or(0.0, that_matters);
        let found = Self { along_rows, along_columns, diagonal, between_frames };
        (found.is_spatial() || between_frames != 0.0).then_some(found)
    }

    /// Whether neighbouring pixels share noise.
    pub fn is_spatial(&self) -> bool {
        [self.along_rows, self.along_columns, self.diagonal].iter().any(|r| *r != 0.0)
    }

    /// Variance that the filter took, over that which it left, at least -0.9. Each neighbour stands for its mirror image.
    pub fn missing_share(&self) -> f64 {
        self.whole_share().max(LEAST_LEFT) - 1.0
    }

    /// Whether the variance is so much too high that the neighbours do not show by how much.
    pub fn is_beyond_measure(&self) -> bool {
        self.whole_share() <= LEAST_LEFT
    }

    /// Variance without the filter over that which is found. The correlations of few neighbours may add up to less than zero, which no variance is.
    fn whole_share(&self) -> f64 {
        let in_space = 1.0 + 2.0 * (self.along_rows + self.along_columns + 2.0 * self.diagonal);
        let in_time = (1.0 + self.between_frames) / (1.0 - self.between_frames);
        in_space * in_time
    }

    /// Whether the figures that rest on the variance are withdrawn; else their errors contain what is missing.
    pub fn is_far(&self) -> bool {
        let missing = self.missing_share();
        missing.is_nan() || missing.abs() > FAR_OFF
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const SIZE: usize = 96;

    /// The correlations of square frames.
    fn found(tile: &[Vec<usize>], of: &dyn Fn(&[f64]) -> Vec<f64>, frames: usize) -> Vec<NeighbourNoise> {
        found_in([SIZE; 2], tile, of, frames)
    }

    /// The correlations of `frames` frames of noise of 10 DN, with rows of their own noise. `of` filters each frame.
    fn found_in(
        [height, width]: [usize; 2],
        tile: &[Vec<usize>],
        of: &dyn Fn(&[f64]) -> Vec<f64>,
        frames: usize,
    ) -> Vec<NeighbourNoise> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let classes = 1 + tile.iter().flatten().max().unwrap();
        let mut lines = vec![LineSums::new(frames, (height, width)); classes];
        let (mut sum_dn, mut last) = (vec![0; height * width], Vec::new());
        for k in 0..frames {
            let mut one = || -> f64 { StandardNormal.sample(&mut rng) };
            let rows: Vec<f64> = (0..height).map(|_| 5.0 * one()).collect();
            let noise: Vec<f64> = (0..height * width).map(|_| 10.0 * one()).collect();
            let dn = |(i, v): (usize, f64)| (500.0 + v + rows[i / width]).round() as u16;
            last = of(&noise).into_iter().enumerate().map(dn).collect();
            for (i, dn) in last.iter().enumerate() {
                let (row, column) = (i / width, i % width);
                let own = &mut lines[tile[row % tile.len()][column % tile[0].len()]];
                own.rows[k][row] += u64::from(*dn);
                own.columns[k][column] += u64::from(*dn);
                own.row_pixels[row] += usize::from(k == 0);
                own.column_pixels[column] += usize::from(k == 0);
                sum_dn[i] += u32::from(*dn);
            }
        }
        let (lines, variance_dn2) = (lines.iter().collect(), vec![125.0; classes]);
        let point =
            LastFrame { last: &last, sum_dn: &sum_dn, frames, width, class_of: tile, lines, variance_dn2 };
        point.neighbours()
    }

    /// A low-pass along rows whose neighbours are `step` pixels apart.
    fn low_pass(step: usize) -> impl Fn(&[f64]) -> Vec<f64> {
        move |noise| {
            let at = |i: usize| noise.get(i).copied().unwrap_or(0.0);
            (0..noise.len())
                .map(|i| 0.8 * at(i) + 0.1 * at(i + step) + 0.1 * at(i.wrapping_sub(step)))
                .collect()
        }
    }

    #[test]
    fn independent_pixels_share_nothing_and_filtered_ones_do() {
        let mono = vec![vec![0]];
        let bayer = vec![vec![0, 1], vec![1, 2]];
        for frames in [2, 5] {
            for (tile, step) in [(&mono, 1), (&bayer, 2)] {
                let white = found(tile, &|noise| noise.to_vec(), frames);
                for one in white {
                    assert_eq!(SharedNoise::of(one, None), None, "{frames} {one:?}");
                }
                // 2 0.8 0.1 / (0.64 + 2 0.01), along rows alone.
                for one in found(tile, &low_pass(step), frames) {
                    let shared = SharedNoise::of(one, None).unwrap_or_else(|| panic!("{one:?}"));
                    assert!((shared.along_rows - 0.2424).abs() < 0.06, "{shared:?}");
                    assert_eq!((shared.along_columns, shared.diagonal), (0.0, 0.0), "{shared:?}");
                    assert!(shared.is_far(), "{shared:?}");
                }
            }
        }
    }

    /// The subtracted means make independent pixels of few lines look correlated.
    #[test]
    fn independent_pixels_of_few_lines_share_nothing() {
        let mono = vec![vec![0]];
        let bayer = vec![vec![0, 1], vec![1, 2]];
        for few in (2..=6).chain([8, 12]) {
            for (tile, step) in [(&mono, 1), (&bayer, 2)] {
                for size in [[few * step, 3000], [3000, few * step]] {
                    for one in found_in(size, tile, &|noise| noise.to_vec(), 3) {
                        for found in one.correlations() {
                            let (value, error) = (found.value().unwrap(), found.error_or_zero());
                            assert!(value.abs() < 4.5 * error, "{size:?} {one:?}");
                        }
                        assert_eq!(SharedNoise::of(one, None), None, "{size:?} {one:?}");
                    }
                }
            }
        }
    }

    /// The means of single rows and columns are all of their noise.
    #[test]
    fn single_lines_show_no_correlation() {
        for size in [[1, 400], [400, 1]] {
            for one in found_in(size, &[vec![0]], &|noise| noise.to_vec(), 3) {
                assert_eq!(one, NeighbourNoise::default(), "{size:?}");
            }
            let lines = LineSums {
                row_pixels: vec![size[1]; size[0]],
                column_pixels: vec![size[0]; size[1]],
                ..LineSums::new(3, (size[0], size[1]))
            };
            let steps = FrameSteps { pixels: 400, steps_dn2: 1600.0, squares_dn2: 800.0 };
            let found = frame_correlation(&lines, &[0; 3], 400, steps);
            assert_eq!(found, Measured::none(Unresolved::FewLines), "{size:?}");
        }
    }

    #[test]
    fn a_missing_share_is_that_of_the_filter() {
        let of = |along: f64, diagonal: f64, between_frames: f64| SharedNoise {
            along_rows: along,
            along_columns: along,
            diagonal,
            between_frames,
        };
        // Centre 0.8, four neighbours 0.05: the variance is 0.65. The pixels two apart are not looked at.
        let low_pass = of(0.08 / 0.65, 0.005 / 0.65, 0.0);
        assert!((low_pass.missing_share() - 0.523).abs() < 1e-3, "{}", low_pass.missing_share());
        // 0.7 of the new frame and 0.3 of the one before leave 0.7 / 1.3 of the variance.
        let over_time = of(0.0, 0.0, 0.3);
        assert!((over_time.missing_share() - (1.3 / 0.7 - 1.0)).abs() < 1e-12);
        assert!(low_pass.is_far() && over_time.is_far() && !of(0.02, 0.0, 0.0).is_far());
        assert!(!low_pass.is_beyond_measure());
        // Neighbours whose correlations add up to nothing or less leave no variance to divide by.
        for sharp in [of(-0.25, 0.0, 0.0), of(-0.4, 0.0, 0.0)] {
            assert!((sharp.missing_share() + 0.9).abs() < 1e-12, "{}", sharp.missing_share());
            assert!(sharp.is_far() && sharp.is_beyond_measure());
        }
    }

    #[test]
    fn frames_that_contain_the_one_before_are_correlated() {
        const FRAMES: usize = 16;
        for (share, expected) in [(0.0, 0.0), (0.3, 0.3)] {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
            let mut lines = LineSums::new(FRAMES, (SIZE, SIZE));
            lines.row_pixels = vec![SIZE; SIZE];
            lines.column_pixels = vec![SIZE; SIZE];
            let mut state = vec![0.0; SIZE * SIZE];
            let (mut frames, mut frame_sums): (Vec<Vec<f64>>, Vec<u64>) = (Vec::new(), Vec::new());
            for k in 0..FRAMES {
                let mut one = || -> f64 { StandardNormal.sample(&mut rng) };
                // Light that wanders moves whole frames.
                let light = 500.0 + 3.0 * k as f64;
                // Few pixels jump once, by far more than the noise.
                let jumps = |i: usize| match i % 1000 {
                    7 if k >= FRAMES / 2 => 200.0f64,
                    507 if k >= FRAMES / 2 => -200.0,
                    _ => 0.0,
                };
                state.iter_mut().for_each(|v| *v = (1.0 - share) * 20.0 * one() + share * *v);
                let value = |(i, v): (usize, &f64)| (light + v + jumps(i)).round() as u64;
                let dn: Vec<u64> = state.iter().enumerate().map(value).collect();
                for (i, dn) in dn.iter().enumerate() {
                    lines.rows[k][i / SIZE] += dn;
                    lines.columns[k][i % SIZE] += dn;
                }
                frame_sums.push(dn.iter().sum());
                frames.push(dn.iter().map(|dn| *dn as f64).collect());
            }
            let of_pixel = |i: usize| {
                let mean = frames.iter().map(|frame| frame[i]).sum::<f64>() / FRAMES as f64;
                let squares = frames.iter().map(|frame| (frame[i] - mean).powi(2)).sum::<f64>();
                let steps = frames.windows(2).map(|pair| (pair[1][i] - pair[0][i]).powi(2)).sum::<f64>();
                (steps, squares / (FRAMES - 1) as f64)
            };
            let steps = FrameSteps::of((0..SIZE * SIZE).map(of_pixel), FRAMES).unwrap();
            let found = frame_correlation(&lines, &frame_sums, SIZE * SIZE, steps);
            let error = found.standard_error().unwrap();
            assert!((error - 0.0024).abs() < 1e-4, "{found:?}");
            // The mean of 16 frames takes a share of the correlation.
            let (value, allowed) = (found.value().unwrap(), 4.0 * error + 0.2 * expected);
            assert!((value - expected).abs() < allowed, "{share}: {found:?}");
            let shared = SharedNoise::of(NeighbourNoise::default(), Some(found));
            assert_eq!(shared.is_some_and(|shared| shared.is_far()), share > 0.0, "{share}: {shared:?}");
        }
    }
}
