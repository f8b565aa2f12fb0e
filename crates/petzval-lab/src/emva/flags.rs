//! Flags: facts that decide whether a point is used, computed once from the captures.
//!
//! Flags decide and warnings report. The selection of points reads the flags, and the
//! [`warnings`](super::warnings) are made from the same flags. A flag that is set holds the numbers that show it.
//!
//! | flag | evidence | a point with it |
//! |---|---|---|
//! | clipped at zero | samples pile up at digital number 0 | is not used for K and the dark series: its mean and noise are biased |
//! | clamped | dark samples pile up at the lower end of their noise | is not used for K and the dark series, as above |
//! | moved | a part of a frame differs from the other frames | is not used for K and the dark series |
//! | flicker | whole frames differ from each other | is used: the differences are subtracted from the noise |
//! | light leak, uneven | parts of the mean frame differ, defect pixels left out | is used |
//! | other filters | pixels of one colour differ by their place in a tile | is used |
//! | no dark, no signal | the dark frames of its exposure time are missing, or equally bright | is not used for K |
//! | saturated | samples are clipped, or the noise has fallen | is left out by the photon transfer |
//! | darker | the point has more light than another and is darker | is used |

use super::block_means::BLOCKS;
use super::captures::{Captures, Kind, Point};
use super::point::{LeftOut, PointStatistics};
use petzval_base::statistics::median;

/// The frames of one point with their moments and flags.
#[derive(Debug)]
pub struct FlaggedPoint<'a> {
    /// The setting and the frames.
    pub point: &'a Point,
    /// Moments of the frames.
    pub found: PointStatistics,
    /// Flags from these frames alone.
    pub flags: FrameFlags,
}

/// Flags of one point from its own frames.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameFlags {
    /// The setting in words.
    pub label: String,
    /// Share of the samples at digital number 0, if the distribution is cut off there.
    pub clipped_at_zero: Option<f64>,
    /// Dark samples are cut off from below at a digital number above 0.
    pub clamped: Option<Clamp>,
    /// The means of the frames differ by more than noise.
    pub flicker: Option<Flicker>,
    /// A part of one frame differs from the other frames by more than noise.
    pub moved: Option<Movement>,
    /// Largest difference of two blocks of dark frames, DN, if it is more than noise.
    pub light_leak_dn: Option<f64>,
    /// Largest difference of two blocks of flat frames, percent of the signal, if it is more than noise and 5 %.
    pub uneven_percent: Option<f64>,
    /// By how much pixels of one colour differ by their place in a tile of 4x4 pixels, percent of the signal, if it is more than noise and 10 %.
    pub other_filters_percent: Option<f64>,
}

/// Where dark samples are cut off from below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clamp {
    /// Digital number.
    pub level_dn: u32,
    /// Share of the samples there.
    pub share: f64,
}

/// Means of frames that differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flicker {
    /// Largest difference of the frames' means, DN.
    pub difference_dn: f64,
    /// Its standard error from noise alone, DN.
    pub standard_error_dn: f64,
}

/// A frame that differs from the others in a part of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Movement {
    /// The frame, counted from 1.
    pub frame: usize,
    /// Largest difference of a block's mean from that of the other frames, DN.
    pub difference_dn: f64,
    /// Its standard error from noise alone, DN.
    pub standard_error_dn: f64,
}

/// Flags of the points of one gain.
#[derive(Debug, Clone, PartialEq)]
pub struct GainFlags {
    /// Flags of each point from its own frames, in the order of the list.
    pub frames: Vec<FrameFlags>,
    /// Usable flat points, light ascending.
    pub flats: Vec<FlatFlags>,
    /// Flat stacks in the order of the list.
    pub stacks: Vec<StackFlags>,
    /// Flat points that are not used because of their own frames.
    pub left_out: LeftOutFlats,
    /// Pixels that the dark series leaves out, and what that changes at its shortest exposure.
    pub dark_defects: LeftOut,
    /// The colour filter array.
    pub cfa: String,
    /// Levels of the shortest dark frames by the place of a pixel in the tile, row by row, DN, if they differ.
    pub tile_levels_dn: Option<Vec<f64>>,
}

/// Flat points of one gain that are not used because of their own frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LeftOutFlats {
    /// Those in which something moved.
    pub moved: usize,
    /// Those that are clipped at zero.
    pub clipped: usize,
}

impl LeftOutFlats {
    /// Counts the points of these flags; one that is clipped counts as that.
    pub(super) fn of<'a>(flats: impl Iterator<Item = &'a FrameFlags>) -> Self {
        flats.filter(|flags| !flags.is_usable()).fold(Self::default(), |found, flags| {
            let clipped = usize::from(!flags.is_whole());
            Self { moved: found.moved + 1 - clipped, clipped: found.clipped + clipped }
        })
    }
}

/// A flat point, compared with its dark frames and the other flat points.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatFlags {
    /// The setting in words.
    pub label: String,
    /// Line of the list where the point begins.
    pub line: u32,
    /// Its signal above the dark frames.
    pub signal: Signal,
    /// In at least one colour, samples are clipped or the point is beyond the peak of the noise.
    pub is_saturated: bool,
    /// In at least one colour, the point is darker than the one before, which has less light.
    pub is_darker: bool,
}

/// Signal of a flat point above the dark frames of its gain and exposure time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Signal {
    /// The point is brighter than the dark frames, and is used.
    Above,
    /// The point has no usable dark frames.
    NoDark,
    /// The point is not brighter than the dark frames.
    None {
        /// Its mean minus that of the dark frames, DN.
        signal_dn: f64,
        /// Standard error of the difference, DN.
        standard_error_dn: f64,
    },
}

/// A flat stack.
#[derive(Debug, Clone, PartialEq)]
pub struct StackFlags {
    /// The setting in words.
    pub label: String,
    /// Whether it is evaluated.
    pub stack_use: StackUse,
}

/// Whether a flat stack is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StackUse {
    /// It is evaluated.
    Evaluated,
    /// It has no dark stack of its exposure time.
    NoDarkStack,
    /// Another stack of this gain is evaluated.
    Surplus,
}

impl FrameFlags {
    /// Computes the flags of a point. `block_lines_dn2` is the noise of rows, and of columns, of blocks at this gain
    /// ([`block_lines_dn2`](super::gain_lines::block_lines_dn2)).
    pub fn of(
        captures: &Captures,
        point: &Point,
        found: &PointStatistics,
        block_lines_dn2: [f64; 2],
    ) -> Self {
        let black_dn = captures.black_level_dn(point.linear_gain).unwrap_or(0.0);
        // A drift of light and offset by a thousandth of the signal is harmless.
        let drift_dn = match point.kind {
            Kind::Flat => 1e-3 * (found.all.mean_dn - black_dn).abs(),
            Kind::Dark => 0.05,
        };
        let deviations: Vec<Deviations> =
            found.block_deviations_dn.iter().map(|d| Deviations::of(d, &found.block_pixels)).collect();
        // A clipped frame does not show what moved.
        let is_full = found.all.is_clipped_at_max(((1_u64 << captures.sensor.bits) - 1) as u32);
        let is_mono = captures.sensor.cfa.rows() * captures.sensor.cfa.cols() == 1;
        Self {
            label: point.label(),
            clipped_at_zero: found.all.is_clipped_at_zero().then_some(found.all.share_at_zero),
            clamped: clamp(found).filter(|_| point.kind == Kind::Dark),
            flicker: flicker(found, &deviations, drift_dn),
            moved: movement(found, &deviations, drift_dn, block_lines_dn2).filter(|_| !is_full),
            light_leak_dn: light_leak_dn(found, block_lines_dn2).filter(|_| point.kind == Kind::Dark),
            uneven_percent: uneven_percent(found, black_dn, block_lines_dn2)
                .filter(|_| point.kind == Kind::Flat && is_mono),
            other_filters_percent: other_filters_percent(found, black_dn),
        }
    }

    /// Whether mean and noise of the frames are unbiased.
    pub fn is_usable(&self) -> bool {
        self.is_whole() && self.moved.is_none()
    }

    /// Whether the noise of the frames is not cut off from below.
    pub fn is_whole(&self) -> bool {
        self.clipped_at_zero.is_none() && self.clamped.is_none()
    }
}

impl GainFlags {
    /// Flat points with dark frames and light above them: those of the photon transfer.
    pub fn with_signal(&self) -> impl Iterator<Item = &FlatFlags> {
        self.flats.iter().filter(|flat| flat.signal == Signal::Above)
    }
}

/// Standard errors above which a difference is not noise: 64 blocks of a hundred points exceed it by chance once in ten
/// thousand series.
const NOT_NOISE_SIGMAS: f64 = 6.0;

/// Differences of one frame from the others of its point, DN, split into four parts: whole frame, rows of blocks, columns of blocks, and
/// single blocks.
pub struct Deviations {
    /// Difference of the whole frame.
    pub whole_dn: f64,
    /// Difference of each row of blocks, after that of the whole frame is subtracted.
    pub rows_dn: Vec<f64>,
    /// Difference of each column of blocks, after that of the whole frame is subtracted.
    pub columns_dn: Vec<f64>,
    /// Difference of each block that remains; `None` for a block without pixels.
    pub blocks_dn: Vec<Option<f64>>,
}

impl Deviations {
    /// Splits the deviations of the blocks by medians, so that an object that moves through a few blocks does not count as a change
    /// of the whole frame.
    pub fn of(deviations_dn: &[f64], pixels: &[usize]) -> Self {
        let mut blocks_dn: Vec<Option<f64>> =
            deviations_dn.iter().zip(pixels).map(|(d, n)| (*n > 0).then_some(*d)).collect();
        let mut subtract_median = |places: &dyn Fn(usize) -> bool| {
            let of_places = || (0..BLOCKS * BLOCKS).filter(|i| places(*i));
            let known: Vec<f64> = of_places().filter_map(|i| blocks_dn[i]).collect();
            let middle = if known.is_empty() { 0.0 } else { median(known) };
            of_places().for_each(|i| blocks_dn[i] = blocks_dn[i].map(|d| d - middle));
            middle
        };
        let whole_dn = subtract_median(&|_| true);
        let rows_dn = (0..BLOCKS).map(|row| subtract_median(&|i| i / BLOCKS == row)).collect();
        let columns_dn = (0..BLOCKS).map(|column| subtract_median(&|i| i % BLOCKS == column)).collect();
        Self { whole_dn, rows_dn, columns_dn, blocks_dn }
    }
}

/// The number at which all samples are cut off from below.
fn clamp(found: &PointStatistics) -> Option<Clamp> {
    let (level_dn, histogram) = (found.all.clamp_dn()?, &found.all.histogram);
    let share = histogram.at(level_dn.into()) as f64 / histogram.total() as f64;
    Some(Clamp { level_dn, share })
}

/// Finds frames of one setting whose means differ by more than noise and a small drift.
fn flicker(found: &PointStatistics, deviations: &[Deviations], drift_dn: f64) -> Option<Flicker> {
    let frames = found.frames as f64;
    let whole = || deviations.iter().map(|d| d.whole_dn);
    let range = whole().fold(f64::MIN, f64::max) - whole().fold(f64::MAX, f64::min);
    let difference_dn = range * (frames - 1.0) / frames;
    let of_pixels = found.all.variance_dn2.max(0.0) / found.all.pixels as f64;
    let of_lines = found.all.lines_of_frame_dn2;
    // Two frames are compared. The variance of a median is pi/2 times that of the mean.
    let standard_error_dn = (std::f64::consts::PI * (of_pixels + of_lines)).sqrt();
    (difference_dn > NOT_NOISE_SIGMAS * standard_error_dn + drift_dn)
        .then_some(Flicker { difference_dn, standard_error_dn })
}

/// Finds the part of a frame that differs most from the other frames, beyond noise and the drift of the whole frame.
///
/// A part is a block, compared with its row and its column of blocks, or a whole row or column of blocks. Rows and columns must differ by
/// more than the noise of neighbouring rows, and by more than rows of blocks differ at the other points of this gain.
fn movement(
    found: &PointStatistics,
    deviations: &[Deviations],
    drift_dn: f64,
    block_lines_dn2: [f64; 2],
) -> Option<Movement> {
    let (frames, blocks) = (found.frames as f64, BLOCKS as f64);
    let of_others = frames / (frames - 1.0);
    let [row_dn2, column_dn2] = found.all.line_noise.certain_dn2();
    let pixel_dn2 = found.all.pixel_dn2();
    let beyond_noise = |frame: usize, difference_dn: f64, variance_dn2: f64| {
        let standard_error_dn = (of_others * variance_dn2).sqrt();
        let found = Movement { frame, difference_dn: difference_dn.abs(), standard_error_dn };
        (found.difference_dn > NOT_NOISE_SIGMAS * found.standard_error_dn + drift_dn).then_some(found)
    };
    // A row of blocks has the noise of its rows of pixels; it is the median of its blocks.
    let of_line = |line_dn2: f64, lines: usize, of_all_points_dn2: f64| {
        let pixels = found.all.pixels as f64 / blocks;
        let median = std::f64::consts::FRAC_PI_2;
        median * pixel_dn2 / pixels + (median * line_dn2 * blocks / lines as f64).max(of_all_points_dn2)
    };
    let of_rows = of_line(row_dn2, found.height, block_lines_dn2[0]);
    let of_columns = of_line(column_dn2, found.width, block_lines_dn2[1]);
    let of_frame = |(k, deviations): (usize, &Deviations)| {
        let block = |(d, n): (&Option<f64>, &usize)| beyond_noise(k + 1, (*d)?, pixel_dn2 / *n as f64);
        let line = |variance_dn2: f64| move |d: &f64| beyond_noise(k + 1, *d, variance_dn2);
        let of_blocks = deviations.blocks_dn.iter().zip(&found.block_pixels).filter_map(block);
        let of_rows = deviations.rows_dn.iter().filter_map(line(of_rows));
        let of_columns = deviations.columns_dn.iter().filter_map(line(of_columns));
        of_blocks.chain(of_rows).chain(of_columns).max_by(|a, b| a.difference_dn.total_cmp(&b.difference_dn))
    };
    let found = deviations.iter().enumerate().filter_map(of_frame);
    found.max_by(|a, b| a.difference_dn.total_cmp(&b.difference_dn).then(b.frame.cmp(&a.frame)))
}

/// Largest difference between two blocks of the mean frame, and the largest standard error of a block from the spread of its pixels and
/// the noise of rows and columns, DN.
fn block_difference(found: &PointStatistics, block_lines_dn2: [f64; 2]) -> (f64, f64) {
    let means = || found.block_means.means_dn.iter().copied();
    let difference_dn = means().fold(f64::NEG_INFINITY, f64::max) - means().fold(f64::INFINITY, f64::min);
    let lines = [found.height, found.width].map(|lines| (found.frames * lines) as f64 / BLOCKS as f64);
    let of_all_points = block_lines_dn2.iter().sum::<f64>() / found.frames as f64;
    let of_lines = found.all.line_noise.of_mean_dn2(lines).max(of_all_points);
    let variance_dn2 = found.block_means.variance_dn2 + of_lines;
    (difference_dn, variance_dn2.sqrt())
}

/// Largest difference between blocks of dark frames, DN, if it exceeds noise and 1 DN.
fn light_leak_dn(found: &PointStatistics, block_lines_dn2: [f64; 2]) -> Option<f64> {
    let (difference_dn, standard_error_dn) = block_difference(found, block_lines_dn2);
    (difference_dn > 1.0 + 2.0 * NOT_NOISE_SIGMAS * standard_error_dn).then_some(difference_dn)
}

/// Largest difference between blocks of a flat field, percent of the signal, if it exceeds noise and 5 %.
fn uneven_percent(found: &PointStatistics, black_dn: f64, block_lines_dn2: [f64; 2]) -> Option<f64> {
    let (difference_dn, standard_error_dn) = block_difference(found, block_lines_dn2);
    let percent = 100.0 * difference_dn / (found.all.mean_dn - black_dn).abs().max(1.0);
    (percent > 5.0 && difference_dn > 2.0 * NOT_NOISE_SIGMAS * standard_error_dn).then_some(percent)
}

/// Least difference of pixels by their place in a tile that is that of colour filters, percent of the signal. The two greens differ by a few.
const OTHER_FILTERS_PERCENT: f64 = 10.0;

/// Pixels that are looked at in a frame, or all of a smaller one.
const LEAST_LOOKED_AT: usize = 65_536;

/// Difference of pixels of one colour by their place in a tile, percent of the signal, if it exceeds noise, rounding and 10 %.
fn other_filters_percent(found: &PointStatistics, black_dn: f64) -> Option<f64> {
    let percent = 100.0 * found.tile_range_dn / (found.all.mean_dn - black_dn).abs().max(1.0);
    // A place has a sixteenth of the pixels that are looked at.
    let pixels = found.all.pixels.min(LEAST_LOOKED_AT) as f64 / 16.0 * found.frames as f64;
    let standard_error_dn = (found.all.pixel_dn2() / pixels).sqrt();
    let is_seen = found.tile_range_dn > 1.0 + 2.0 * NOT_NOISE_SIGMAS * standard_error_dn;
    (percent > OTHER_FILTERS_PERCENT && is_seen).then_some(percent)
}
