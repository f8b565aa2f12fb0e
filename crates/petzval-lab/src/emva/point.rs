//! The frames of one point reduced to moments per colour, histograms, and for stacks the sum of the frames.
//!
//! Frames are reduced as they are read; two images of sums, not the frames, are in memory. With frames `y_k`, `k = 1..L`,
//!
//! ```text
//! mu    = mean over pixels and frames of y                                              [DN]
//! s2_p  = sum_k (y_k - mean_k y)^2 / (L - 1)                       per pixel            [DN^2]
//! s2    = mean over pixels of s2_p - variance over frames of the frames' means          [DN^2]
//! ```
//!
//! For two frames A and B that is `mean((A - B)^2)/2 - (mu_A - mu_B)^2/2` (EMVA 1288 release 4, Eq. 18); the second
//! term subtracts the flicker of the light. Without it, it is Eq. 6 of Tseng et al. 2021.

use std::hash::{DefaultHasher, Hash, Hasher};

use petzval_base::Cancelled;
use serde::Serialize;

use super::block_means::{BLOCKS, BlockMeans, block_means};
use super::captures::{CaptureError, Captures, FrameFile, Kind, Point};
use super::clamp::{CLIPPED_SHARE, clamp_dn};
use super::counts::Counts;
use super::line_covariance::{LineCovariance, LineModel};
use super::line_noise::{LineNoise, LineSums, double_differences};
use super::measured::Measured;
use super::shared_noise::{FrameSteps, LastFrame, NeighbourNoise, frame_correlation};
use super::tile_range::tile_range_dn;
use petzval_camera::sensor::{CfaPattern, Colour};
use petzval_files::raw_file::{RawFrame, RawInfo};

/// By how much the moments of all pixels change without the defect pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LeftOut {
    /// Pixels that are left out.
    pub pixels: usize,
    /// Change of the mean, DN.
    pub mean_dn: f64,
    /// Change of the temporal variance, DN^2.
    pub variance_dn2: f64,
}

impl LeftOut {
    /// The change of the moments of so many frames without pixels of these sums, DN, and temporal variances, DN^2.
    pub fn of(all: &Moments, frames: usize, pixels: impl Iterator<Item = (u32, f64)>) -> Self {
        let (mut count, mut mean_dn, mut variance_dn2) = (0, 0.0, 0.0);
        for (sum_dn, variance) in pixels {
            count += 1;
            mean_dn += f64::from(sum_dn) / frames as f64 - all.mean_dn;
            variance_dn2 += variance - all.variance_uncorrected_dn2;
        }
        if count == 0 || count >= all.pixels {
            return Self::default();
        }
        let kept = (all.pixels - count) as f64;
        Self { pixels: count, mean_dn: -mean_dn / kept, variance_dn2: -variance_dn2 / kept }
    }
}

/// Moments of the pixels of one colour (or of all) at one point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moments {
    /// Pixels.
    pub pixels: usize,
    /// Mean, DN.
    pub mean_dn: f64,
    /// Standard error of the mean from temporal noise of pixels, and of rows and columns where [`Self::set_lines`] has set it, DN. Flat and
    /// dark frames have the same pixels, so non-uniformity is no error of their difference.
    pub mean_se_dn: f64,
    /// Temporal variance with the variance of the frames' means taken away, DN^2.
    pub variance_dn2: f64,
    /// Temporal variance without that correction, DN^2.
    pub variance_uncorrected_dn2: f64,
    /// Standard error of the variance, from its spread over the pixels and from the noise of few rows and columns, DN^2.
    pub variance_se_dn2: f64,
    /// Variance of the mean by the noise of rows and columns that whole frames have in common, DN^2: it is not in
    /// [`variance_dn2`](Self::variance_dn2), which is free of all that whole frames have in common.
    pub lines_of_frame_dn2: f64,
    /// The parts of the variance that pixels of a row, and of a column, have in common, if neighbours have noise of their own.
    pub line_noise: LineNoise,
    /// How the noise of rows, and that of columns, is correlated.
    #[serde(skip)]
    pub line_covariances: [LineCovariance; 2],
    /// How the noise of neighbours of one colour is correlated; zero of dark frames, and of all colours together.
    #[serde(skip)]
    pub neighbours: NeighbourNoise,
    /// Correlation of the noise of a frame with that of the frame before, of flat stacks.
    #[serde(skip)]
    pub between_frames: Option<Measured>,
    /// Rows, and columns, that have pixels of this kind.
    #[serde(skip)]
    has_pixels: [Vec<bool>; 2],
    /// Variances of the mean and of the variance by the noise of single pixels alone, DN^2 and DN^4.
    #[serde(skip)]
    of_pixels: [f64; 2],
    /// Mean of each frame, DN.
    pub frame_means_dn: Vec<f64>,
    /// Share of the samples at digital number 0.
    pub share_at_zero: f64,
    /// Share of the samples at the largest digital number.
    pub share_at_max: f64,
    /// Histogram of all frames.
    pub histogram: Counts,
}

impl Moments {
    /// Temporal variance of single pixels, DN^2: without the noise that rows and columns share, where that is known.
    pub fn pixel_dn2(&self) -> f64 {
        self.line_noise.pixel_dn2.value().unwrap_or(self.variance_dn2).max(0.0)
    }

    /// Sets the standard errors for lines with this noise: rows and columns are few, and correlated ones are fewer still, so that their
    /// mean and their variance scatter more than those of the pixels.
    pub fn set_lines(&mut self, models: &[LineModel; 2]) {
        let frames = self.frame_means_dn.len() as f64;
        let of_lines = models.iter().zip(&self.has_pixels).map(|(model, has)| model.of_mean(has));
        let [of_mean, of_variance] = of_lines.fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
        let [pixels_of_mean, pixels_of_variance] = self.of_pixels;
        self.lines_of_frame_dn2 = of_mean;
        self.mean_se_dn = (pixels_of_mean + of_mean / frames).sqrt();
        self.variance_se_dn2 = (pixels_of_variance + of_variance / (frames - 1.0)).sqrt();
    }

    /// Standard error of the variance by the noise of few rows and columns alone, DN^2.
    pub fn lines_se_dn2(&self) -> f64 {
        (self.variance_se_dn2.powi(2) - self.of_pixels[1]).max(0.0).sqrt()
    }

    /// Variance of all samples, over pixels and frames, DN^2.
    pub fn total_variance_dn2(&self) -> f64 {
        let first = f64::from(self.histogram.first_dn);
        let samples = self.histogram.counts.iter().enumerate();
        let squares = samples.map(|(i, c)| *c as f64 * (first + i as f64 - self.mean_dn).powi(2));
        squares.sum::<f64>() / self.histogram.total() as f64
    }

    /// Whether the distribution of the samples is cut off at digital number 0: samples are at 0, and the bulk of them is so near that
    /// they are not dead pixels.
    pub fn is_clipped_at_zero(&self) -> bool {
        let [low, median, _] = self.bulk_dn();
        self.share_at_zero > CLIPPED_SHARE && (low == 0.0 || median < BULK_SIGMAS * (median - low))
    }

    /// Digital number above 0 at which the distribution of dark samples is cut off from below, if it is.
    pub fn clamp_dn(&self) -> Option<u32> {
        let [_, median, high] = self.bulk_dn();
        clamp_dn(&self.histogram, [median, high]).filter(|dn| *dn > 0)
    }

    /// Whether the distribution of the samples is cut off at a digital number, the largest of the converter: samples are there, and the bulk
    /// of them is so near that they are not stuck pixels.
    pub fn is_clipped_at_max(&self, largest_dn: u32) -> bool {
        self.share_at_max > CLIPPED_SHARE && self.reaches(largest_dn)
    }

    /// Whether the bulk of the samples comes near a digital number: their median lies within eight standard deviations below it. Samples
    /// further off are those of stuck pixels.
    pub fn reaches(&self, dn: u32) -> bool {
        let [_, median, high] = self.bulk_dn();
        let dn = f64::from(dn);
        high >= dn || median + BULK_SIGMAS * (high - median).max(RESOLVED_DN) >= dn
    }

    /// Mean of the samples within six standard deviations of their median, DN: hot and stuck pixels do not count.
    pub(super) fn bulk_mean_dn(&self) -> f64 {
        let [low, median, _] = self.bulk_dn();
        // Whole numbers may show up to one less than the standard deviation.
        let reach = TRIM_SIGMAS * (median - low + 1.0);
        let first = f64::from(self.histogram.first_dn);
        let samples = self.histogram.counts.iter().enumerate().map(|(i, c)| (first + i as f64, *c as f64));
        let within = samples.filter(|(dn, _)| (dn - median).abs() <= reach);
        let (count, sum) = within.fold((0.0, 0.0), |(n, sum), (dn, c)| (n + c, sum + c * dn));
        sum / count
    }

    /// The digital numbers one standard deviation of a normal distribution below its median, at it, and one above. A dead column or
    /// stuck pixels, which widen the variance without end, hardly move them.
    fn bulk_dn(&self) -> [f64; 3] {
        [0.158_655, 0.5, 0.841_345].map(|share| f64::from(self.histogram.quantile_dn(share)))
    }
}

/// Standard deviations from the median within which samples belong to the distribution.
const BULK_SIGMAS: f64 = 8.0;

/// Standard deviations from the median within which samples count in the mean of the bulk.
const TRIM_SIGMAS: f64 = 6.0;

/// Least standard deviation that whole digital numbers resolve, DN: that of their rounding.
const RESOLVED_DN: f64 = 0.29;

/// The sum of the frames of a stack, pixel by pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Stack {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Frames.
    pub frames: usize,
    /// Sum over the frames, DN.
    pub sum_dn: Vec<u32>,
    /// Temporal variance of each pixel, DN^2.
    pub variance_dn2: Vec<f64>,
}

/// A point reduced to statistics.
#[derive(Debug, Clone, PartialEq)]
pub struct PointStatistics {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Number of frames.
    pub frames: usize,
    /// All pixels.
    pub all: Moments,
    /// The pixels of each colour that the sensor has.
    pub colours: Vec<(Colour, Moments)>,
    /// Means of 8x8 blocks of the mean frame without its defect pixels.
    pub block_means: BlockMeans,
    /// Largest difference of two places of a tile of 4x4 pixels that have one colour, DN. Zero for dark frames.
    pub tile_range_dn: f64,
    /// By frame, mean of each of 8x8 blocks less that of the other frames, DN.
    pub block_deviations_dn: Vec<Vec<f64>>,
    /// Pixels of each block.
    pub block_pixels: Vec<usize>,
    /// By frame, a fingerprint of its digital numbers; `None` of a frame without noise, as one that is saturated. Frames of one
    /// fingerprint are copies.
    pub fingerprints: Vec<Option<u64>>,
    /// The summed frames, of stacks and of points with `keep_sum` (see [`reduce`]).
    pub stack: Option<Stack>,
    /// By how much the moments of all pixels change without the defect pixels of the gain.
    pub(super) left_out: LeftOut,
}

impl PointStatistics {
    /// Sets the standard errors of all moments for this noise of rows and of columns.
    pub fn set_lines(&mut self, models: &[LineModel; 2]) {
        self.all.set_lines(models);
        self.colours.iter_mut().for_each(|(_, moments)| moments.set_lines(models));
    }

    /// Leaves these pixels out, ascending, of a point whose sum is kept.
    pub(super) fn leave_out(&mut self, defects: &[usize]) {
        if let Some(stack) = &self.stack {
            let pixels = defects.iter().map(|i| (stack.sum_dn[*i], stack.variance_dn2[*i]));
            self.left_out = LeftOut::of(&self.all, self.frames, pixels);
        }
    }

    /// Moments of one colour.
    pub fn colour(&self, colour: Colour) -> Option<&Moments> {
        self.colours.iter().find(|(c, _)| *c == colour).map(|(_, m)| m)
    }
}

/// Sums of one class of pixels while frames come in.
#[derive(Clone)]
struct Class {
    pixels: usize,
    frame_sums: Vec<u64>,
    table: Vec<u64>,
    variance: f64,
    variance_squared: f64,
    /// Squared steps from frame to frame, of flat stacks.
    steps: Option<FrameSteps>,
    neighbours: NeighbourNoise,
    lines: LineSums,
}

impl Class {
    /// The moments of frames whose colour filter array repeats after `tile` rows and columns, and whose rows and columns are of so many `kinds`.
    fn moments(&self, frames: usize, tile: [usize; 2], kinds: [usize; 2]) -> Moments {
        let (n, l) = (self.pixels as f64, frames as f64);
        let frame_means_dn: Vec<f64> = self.frame_sums.iter().map(|s| *s as f64 / n).collect();
        let mean_dn = self.frame_sums.iter().sum::<u64>() as f64 / (n * l);
        let spread = frame_means_dn.iter().map(|m| (m - mean_dn).powi(2)).sum::<f64>() / (l - 1.0);
        let mean_variance = self.variance / n;
        let samples = n * l;
        let of_pixels_dn2 = (self.variance_squared / n - mean_variance * mean_variance).max(0.0) / n;
        let lines = &self.lines;
        let has = |pixels: &[usize]| pixels.iter().map(|n| *n > 0).collect();
        let between_frames =
            self.steps.map(|steps| frame_correlation(lines, &self.frame_sums, self.pixels, steps));
        Moments {
            pixels: self.pixels,
            mean_dn,
            mean_se_dn: (mean_variance / samples).sqrt(),
            variance_dn2: mean_variance - spread,
            variance_uncorrected_dn2: mean_variance,
            variance_se_dn2: of_pixels_dn2.sqrt(),
            lines_of_frame_dn2: 0.0,
            line_noise: lines.noise(tile),
            line_covariances: [
                LineCovariance::of(&lines.rows, &lines.row_pixels, kinds[0], tile[0]),
                LineCovariance::of(&lines.columns, &lines.column_pixels, kinds[1], tile[1]),
            ],
            neighbours: self.neighbours,
            between_frames,
            has_pixels: [has(&lines.row_pixels), has(&lines.column_pixels)],
            of_pixels: [mean_variance / samples, of_pixels_dn2],
            frame_means_dn,
            share_at_zero: self.table[0] as f64 / samples,
            share_at_max: self.table[self.table.len() - 1] as f64 / samples,
            histogram: Counts::of(&self.table),
        }
    }
}

/// Reads the frames of a point one after the other and calls `read` after each. All must have `size`, rows and columns. The
/// sum of the frames is kept for stacks, and for other points with `keep_sum`. `defects` are the places of pixels whose share in the moments is noted.
pub fn reduce(
    captures: &Captures,
    point: &Point,
    size: (usize, usize),
    keep_sum: bool,
    defects: &[usize],
    read: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<PointStatistics, CaptureError> {
    let (height, width) = size;
    let (bits, cfa, pixels) = (captures.sensor.bits, &captures.sensor.cfa, height * width);
    let frames = point.frames.len();
    let colours = cfa.colours();
    let class_of = classes(cfa, &colours);
    let empty = Class {
        pixels: 0,
        frame_sums: vec![0; frames],
        table: vec![0; 1 << bits],
        variance: 0.0,
        variance_squared: 0.0,
        steps: None,
        neighbours: NeighbourNoise::default(),
        lines: LineSums::new(frames, size),
    };
    let tile = [cfa.rows(), cfa.cols()];
    // Light that flickers changes the rows of each colour in their own way.
    let kinds = if point.kind == Kind::Dark { [1, 1] } else { tile };
    let mut class = vec![empty; colours.len()];
    let (mut sum, mut squares) = (vec![0u32; pixels], vec![0u64; pixels]);
    let mut block_sums = vec![[0u64; BLOCKS * BLOCKS]; frames];
    let mut fingerprints = Vec::with_capacity(frames);
    let mut block_totals = [0u64; BLOCKS * BLOCKS];
    let block_of = |row: usize, col: usize| row * BLOCKS / height * BLOCKS + col * BLOCKS / width;
    let is_flat_stack = point.kind == Kind::Flat && point.is_stack();
    let mut before: Vec<u16> = Vec::new();
    // Sum over the frames of the squared steps of each pixel, DN^2.
    let mut steps = vec![0.0f32; if is_flat_stack { pixels } else { 0 }];

    // Read frame by frame: sums per pixel, per colour, per block, and the histogram of each colour.
    for (k, file) in point.frames.iter().enumerate() {
        let frame = load(captures, point, file, size)?;
        fingerprints.push(fingerprint(&frame.dn, width, tile));
        for row in 0..height {
            let span = row * width..(row + 1) * width;
            let kinds = &class_of[row % cfa.rows()];
            for (col, dn) in frame.dn[span.clone()].iter().enumerate() {
                let c = &mut class[kinds[col % cfa.cols()]];
                c.frame_sums[k] += u64::from(*dn);
                c.table[usize::from(*dn)] += 1;
                c.lines.rows[k][row] += u64::from(*dn);
                c.lines.columns[k][col] += u64::from(*dn);
                let block = block_of(row, col);
                block_totals[block] += u64::from(*dn);
                block_sums[k][block] += u64::from(*dn);
            }
            for ((s, q), dn) in
                sum[span.clone()].iter_mut().zip(&mut squares[span.clone()]).zip(&frame.dn[span.clone()])
            {
                *s += u32::from(*dn);
                *q += u64::from(*dn) * u64::from(*dn);
            }
            for (col, d) in double_differences(&frame.dn, width, row, tile) {
                class[kinds[col % cfa.cols()]].lines.doubles[row].squares += (d * d) as f64;
            }
            if is_flat_stack && k > 0 {
                let of_row = before[span.clone()].iter().zip(&frame.dn[span.clone()]);
                for (step, (before, dn)) in steps[span].iter_mut().zip(of_row) {
                    *step += f32::from(before.abs_diff(*dn)).powi(2);
                }
            }
        }
        before = frame.dn;
        read()?;
    }

    // The variance of each pixel over the frames, exact from sums of whole numbers.
    let l = frames as u64;
    let scale = 1.0 / (l * (l - 1)) as f64;
    let mut block_pixels = vec![0usize; BLOCKS * BLOCKS];
    let keep_sum = keep_sum || point.is_stack();
    let mut variance_dn2 = vec![0.0f64; if keep_sum { pixels } else { 0 }];
    let variance_of = |i: usize| (l * squares[i] - u64::from(sum[i]).pow(2)) as f64 * scale;
    for row in 0..height {
        let kinds = &class_of[row % cfa.rows()];
        for col in 0..width {
            let i = row * width + col;
            let variance = variance_of(i);
            let c = &mut class[kinds[col % cfa.cols()]];
            c.pixels += 1;
            c.lines.row_pixels[row] += 1;
            c.lines.column_pixels[col] += 1;
            c.variance += variance;
            c.variance_squared += variance * variance;
            block_pixels[block_of(row, col)] += 1;
            if let Some(v) = variance_dn2.get_mut(i) {
                *v = variance;
            }
        }
        for (col, d) in double_differences(&sum, width, row, tile) {
            let doubles = &mut class[kinds[col % cfa.cols()]].lines.doubles[row];
            doubles.count += 1;
            doubles.squares_of_sum += (d as f64).powi(2);
        }
    }
    // The steps from frame to frame, of the pixels of each colour.
    if is_flat_stack {
        for (index, c) in class.iter_mut().enumerate() {
            let is_own = |i: &usize| class_of[i / width % cfa.rows()][i % width % cfa.cols()] == index;
            let of_pixel = |i: usize| (f64::from(steps[i]), variance_of(i));
            c.steps = FrameSteps::of((0..pixels).filter(is_own).map(of_pixel), frames);
        }
    }
    // The noise that neighbours share, of flat frames: their light makes most of it.
    if point.kind == Kind::Flat {
        let point = LastFrame {
            last: &before,
            sum_dn: &sum,
            frames,
            width,
            class_of: &class_of,
            lines: class.iter().map(|c| &c.lines).collect(),
            variance_dn2: class.iter().map(|c| c.variance / c.pixels.max(1) as f64).collect(),
        };
        let found = point.neighbours();
        class.iter_mut().zip(found).for_each(|(c, found)| c.neighbours = found);
    }
    // All pixels together are the sum of the colours.
    let mut all = Class { steps: None, neighbours: NeighbourNoise::default(), ..class[0].clone() };
    for c in &class[1..] {
        all.pixels += c.pixels;
        all.variance += c.variance;
        all.variance_squared += c.variance_squared;
        all.frame_sums.iter_mut().zip(&c.frame_sums).for_each(|(a, b)| *a += b);
        all.lines.add(&c.lines);
        all.table.iter_mut().zip(&c.table).for_each(|(a, b)| *a += b);
    }
    let mean_of = |sum: u64, pixels: usize| sum as f64 / pixels.max(1) as f64;
    let blocks = || block_pixels.iter().enumerate();
    let all = all.moments(frames, tile, kinds);
    let left_out = LeftOut::of(&all, frames, defects.iter().map(|i| (sum[*i], variance_of(*i))));
    Ok(PointStatistics {
        height,
        width,
        frames,
        all,
        colours: colours
            .iter()
            .zip(&class)
            .filter(|(_, c)| c.pixels > 0)
            .map(|(colour, c)| (*colour, c.moments(frames, tile, kinds)))
            .collect(),
        block_means: block_means(&sum, frames, [height, width]),
        tile_range_dn: match point.kind {
            Kind::Flat => tile_range_dn(&sum, frames, [height, width], cfa),
            Kind::Dark => 0.0,
        },
        block_deviations_dn: block_sums
            .iter()
            .map(|own| {
                let others = |b: usize, n: usize| mean_of(block_totals[b] - own[b], n * (frames - 1));
                blocks().map(|(b, n)| mean_of(own[b], *n) - others(b, *n)).collect()
            })
            .collect(),
        block_pixels,
        fingerprints,
        stack: keep_sum.then_some(Stack { height, width, frames, sum_dn: sum, variance_dn2 }),
        left_out,
    })
}

/// Number of pixels of a frame that are not equal by chance.
const LEAST_FINGERPRINT: usize = 64;

/// Share of the pixels above which those that differ from their neighbours show noise: stuck pixels are fewer.
const NOISY_SHARE: f64 = 0.01;

/// Number of pixels, few steps off their neighbours, from which on they show noise in a frame of any size: so many are never equal by chance.
const LEAST_FLIPS: usize = 500;

/// Most digital numbers by which little noise moves a pixel: one step, also of 12 bits that are left-aligned in 16. Stuck pixels are further off.
const MOST_FLIP_DN: u16 = 16;

/// Share of the rows, and of the columns, above which noise has such pixels: rows of metadata, dead lines and the corners of both are fewer.
const NOISY_LINES: f64 = 0.1;

/// A hash of the digital numbers of a frame in which noise is to be expected. Other frames have none, because separate exposures of them are equal:
/// saturated pixels have no noise, and stuck pixels, dead lines and metadata are the same in every frame.
fn fingerprint(dn: &[u16], width: usize, tile: [usize; 2]) -> Option<u64> {
    // A few pixels may be equal by chance.
    if dn.len() < LEAST_FINGERPRINT {
        return None;
    }
    let differ = |a: u16, b: u16| a != b;
    let flip = |a: u16, b: u16| (1..=MOST_FLIP_DN).contains(&a.abs_diff(b));
    let has_noise = scattered(dn, width, tile, differ) as f64 > NOISY_SHARE * dn.len() as f64
        || scattered(dn, width, tile, flip) >= LEAST_FLIPS;
    has_noise.then(|| {
        let mut hasher = DefaultHasher::new();
        dn.hash(&mut hasher);
        hasher.finish()
    })
}

/// Number of pixels that `differ` both from the next one to the left and from the next one above of the same place in the `tile` of the colour filter
/// array; 0 if they are in few rows or columns.
fn scattered(dn: &[u16], width: usize, tile: [usize; 2], differ: impl Fn(u16, u16) -> bool) -> usize {
    let ([down, right], height) = (tile, dn.len() / width);
    let (mut pixels, mut rows, mut has_some) = (0, 0, vec![false; width]);
    for row in down..height {
        let (own, above) = (&dn[row * width..][..width], &dn[(row - down) * width..][..width]);
        let before = pixels;
        for col in right..width {
            if differ(own[col], own[col - right]) && differ(own[col], above[col]) {
                pixels += 1;
                has_some[col] = true;
            }
        }
        rows += usize::from(pixels > before);
    }
    let columns = has_some.iter().filter(|has_some| **has_some).count();
    let is_spread = |count: usize, of: usize| count as f64 > NOISY_LINES * of as f64;
    if is_spread(rows, height) && is_spread(columns, width) { pixels } else { 0 }
}

/// Index of each colour of the tile, rows of columns.
fn classes(cfa: &CfaPattern, colours: &[Colour]) -> Vec<Vec<usize>> {
    let index = |row, col| colours.iter().position(|c| *c == cfa.colour(row, col)).unwrap_or(0);
    (0..cfa.rows()).map(|row| (0..cfa.cols()).map(|col| index(row, col)).collect()).collect()
}

/// Reads a frame and checks its size, its digital numbers, and its settings.
fn load(
    captures: &Captures,
    point: &Point,
    file: &FrameFile,
    (height, width): (usize, usize),
) -> Result<RawFrame, CaptureError> {
    let (path, bits) = (&file.path, captures.sensor.bits);
    let frame = file.load()?;
    if (frame.height, frame.width) != (height, width) {
        return Err(CaptureError::Size {
            path: path.to_owned(),
            height: frame.height,
            width: frame.width,
            expected_height: height,
            expected_width: width,
        });
    }
    no_contradiction(captures, point, file, &frame.info)?;
    let max = ((1u32 << bits) - 1) as u16;
    if let Some(i) = frame.dn.iter().position(|dn| *dn > max) {
        let (value, row, col) = (frame.dn[i], i / width, i % width);
        return Err(CaptureError::Value { path: path.to_owned(), value, row, col, bits, max });
    }
    Ok(frame)
}

/// Settings that cameras round, exposure time, gain and pitch, agree within this share.
const SAME_SETTING: f64 = 0.01;
/// Black levels agree within this, DN.
const SAME_BLACK_DN: f64 = 0.5;
/// Temperatures agree within this, degrees Celsius: sensors warm up by as much during a series.
const SAME_TEMPERATURE_C: f64 = 10.0;

/// Checks that the frame's own settings (from its sidecar or its file) agree with the list. If they differ, either may be wrong.
fn no_contradiction(
    captures: &Captures,
    point: &Point,
    file: &FrameFile,
    info: &RawInfo,
) -> Result<(), CaptureError> {
    let (sensor, list) = (&captures.sensor, captures.list.display());
    let near = |a: f64, b: f64| (a - b).abs() <= SAME_SETTING * a.abs().max(b.abs());
    let numbers = |key, frame: Option<f64>, listed: Option<f64>, same: &dyn Fn(f64, f64) -> bool| {
        let (frame, listed) = (frame?, listed?);
        (!same(frame, listed)).then(|| (key, frame.to_string(), listed.to_string()))
    };
    let black = |a: f64, b: f64| (a - b).abs() <= SAME_BLACK_DN;
    let warm = |a: f64, b: f64| (a - b).abs() <= SAME_TEMPERATURE_C;
    let exact = |a: f64, b: f64| a == b;
    let (of_frame, of_list) = (info.bits.map(f64::from), Some(f64::from(sensor.bits)));
    let of_sensor = numbers("bits", of_frame, of_list, &exact)
        .or_else(|| {
            let cfa = info.cfa.filter(|cfa| *cfa != sensor.cfa)?;
            Some(("cfa", cfa.to_string(), sensor.cfa.to_string()))
        })
        .or_else(|| {
            let listed = sensor.black_level_dn.filter(|_| point.black_level_dn.is_none());
            numbers("black_level_dn", info.black_level_dn, listed, &black)
        })
        .or_else(|| numbers("pixel_um", info.pixel_um, sensor.pixel_um, &near))
        .or_else(|| {
            let (key, frame, listed) =
                numbers("temperature_c", info.temperature_c, sensor.temperature_c, &warm)?;
            Some((key, frame, format!("{listed} (they may differ by {SAME_TEMPERATURE_C} °C)")))
        });
    let of_point = numbers("linear_gain", info.linear_gain, Some(point.linear_gain), &near)
        .or_else(|| numbers("exposure_s", info.exposure_s, Some(point.exposure_s), &near))
        .or_else(|| numbers("black_level_dn", info.black_level_dn, point.black_level_dn, &black));
    let (found, place) = match (of_sensor, of_point) {
        (Some(found), _) => (found, format!("{list}, [sensor],")),
        (None, Some(found)) => (found, format!("{list}, line {},", point.line)),
        (None, None) => return Ok(()),
    };
    let ((key, frame, list), path) = (found, file.path.clone());
    Err(CaptureError::Contradiction { path, key, frame, list, place })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    const WIDTH: usize = 60;
    const HEIGHT: usize = 50;

    fn frame(of: impl FnMut(usize) -> u16) -> Vec<u16> {
        (0..WIDTH * HEIGHT).map(of).collect()
    }

    #[test]
    fn frames_without_noise_have_no_fingerprint() {
        let none = |dn: &[u16], tile| assert_eq!(fingerprint(dn, WIDTH, tile), None);
        // A saturated sensor with a stuck pixel, a dead column and a dead row, and two rows of metadata.
        none(&frame(|i| if i == 777 { 64 } else { 4031 }), [1, 1]);
        let dead = |i: usize| i % WIDTH == 20 || i / WIDTH == 30;
        none(
            &frame(|i| {
                if i == 777 {
                    2000
                } else if dead(i) {
                    64
                } else {
                    4031
                }
            }),
            [1, 1],
        );
        none(&frame(|i| if i < 2 * WIDTH { (i * 37 % 251) as u16 } else { 4031 }), [1, 1]);
        // Colours that end at numbers of their own.
        let ends = [3900, 4031, 4031, 3950];
        none(&frame(|i| ends[i / WIDTH % 2 * 2 + i % 2]), [2, 2]);
    }

    #[test]
    fn scattered_flips_show_noise_in_a_large_frame_and_stuck_pixels_do_not() {
        let side = 300;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        // One pixel of 140: 640 of the frame, less than a hundredth, in most of the rows and columns.
        let is_rare: Vec<bool> = (0..side * side).map(|_| rng.random::<f64>() < 1.0 / 140.0).collect();
        let of = |usual: u16, rare: u16| -> Vec<u16> {
            is_rare.iter().map(|is_rare| if *is_rare { rare } else { usual }).collect()
        };
        // Dark frames of little noise, also left-aligned.
        for (usual, rare) in [(64, 65), (1024, 1040)] {
            let print = fingerprint(&of(usual, rare), side, [1, 1]);
            assert!(print.is_some(), "{usual} {rare}");
            let mut other = of(usual, rare);
            other[0] += 1;
            assert_ne!(print, fingerprint(&other, side, [1, 1]));
        }
        // A saturated sensor with as many stuck pixels, a dead column and a dead row.
        for stuck in [64, 2000, 4095] {
            let mut saturated = of(4031, stuck);
            for i in 0..side {
                saturated[i * side + 20] = 64;
                saturated[30 * side + i] = 64;
            }
            assert_eq!(fingerprint(&saturated, side, [1, 1]), None, "{stuck}");
        }
    }

    #[test]
    fn copies_of_noise_have_one_fingerprint_even_where_half_is_saturated() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut noisy = || 1000 + (4.0 * rng.random::<f64>()) as u16;
        let whole = frame(|_| noisy());
        let half = frame(|i| if i % WIDTH < WIDTH / 2 { 4095 } else { noisy() });
        // Dark frames of a tenth of a digital number: two numbers, one of them rare.
        let dark = frame(|_| if noisy() == 1000 && noisy() == 1000 { 65 } else { 64 });
        for dn in [&whole, &half, &dark] {
            let print = fingerprint(dn, WIDTH, [1, 1]);
            assert!(print.is_some() && print == fingerprint(&dn.clone(), WIDTH, [1, 1]));
            let mut other = dn.clone();
            other[WIDTH * HEIGHT - 1] += 1;
            assert_ne!(print, fingerprint(&other, WIDTH, [1, 1]));
        }
    }
}
