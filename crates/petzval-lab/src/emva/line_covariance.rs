//! How the temporal noise of rows is correlated from row to row, and that of columns from column to column.
//!
//! A readout circuit may serve several rows, or wander slowly while it reads them, and column converters may take every n-th column. So
//! neighbours may share their noise, and their difference shows too little of it. `e_k(r)` is the mean of row `r` in frame `k` less its
//! mean over the frames and less the mean of frame `k` over the rows of one kind, in which flicker and drift of whole frames cancel. From
//!
//! ```text
//! c(h) = sum over r, k of e_k(r) e_k(r + h) / (pairs (L - 1))        autocovariance, h = 0..lags        [DN^2]
//! ```
//!
//! over all dark frames of a gain follows the covariance `C(h)` of the noise ([`LineModel`]):
//!
//! ```text
//! c(0) = C(0) + P / N - A,   c(h) = C(h) - A                          P noise of single pixels, N pixels in a row
//! A    = 1/M sum over |h| <= H of (1 - |h|/M) C(h)                    variance of the mean of all M rows
//! ```
//!
//! `A` is what the mean of the frame took with it. `H` is the least window of four correlation lengths (after Sokal 1989: H >= 4 tau with
//! tau = 1/2 + sum of C(h)/C(0) up to H). Noise without such a window within the frame cannot be told from a drift of the frame.
//! Lines of a period share a covariance `B` at all multiples of it, of any distance. It is found from
//! `c(h) - (c(h-1) + c(h+1))/2` at these multiples, in which decaying covariances are negative, and is subtracted first.

use super::measured::{Measured, Unresolved};

/// Autocovariance of the temporal noise of lines, of one point or of several.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LineCovariance {
    /// Lines of the frame.
    lines: usize,
    /// Kinds of lines whose means are subtracted: one in the dark.
    kinds: usize,
    /// By lag: sum of the products over pairs of lines and frames, DN^2.
    sums: Vec<f64>,
    /// By lag: number of pairs times degrees of freedom in time.
    weights: Vec<f64>,
    /// Degrees of freedom in time: frames less one, summed over the points.
    degrees: f64,
    /// One over the pixels of a line, mean, times `degrees`.
    shares: f64,
    /// By point: degrees of freedom in time, and by line the sum over the frames of `e^2`, DN^2.
    squares: Vec<(f64, Vec<f64>)>,
}

/// Least lines of a part of a frame.
const LEAST_PART: usize = 8;

/// Least number of lags of one kind that the longest filter reaches.
const FILTERED_LAGS: usize = 20;

impl LineCovariance {
    /// Autocovariance of the means of lines. `sums` holds the sum of the pixels by frame and line, `pixels` the number of pixels of each
    /// line. Lines without pixels are left out. Light that flickers changes each of `kinds` of lines, which repeat, in its own way; in the dark
    /// there is one kind. The colour filter array repeats after `tile` lines.
    pub fn of(sums: &[Vec<u64>], pixels: &[usize], kinds: usize, tile: usize) -> Self {
        let (frames, lines) = (sums.len() as f64, pixels.len());
        let counted = |line: &usize| pixels[*line] > 0;
        let mut residuals: Vec<Vec<f64>> = sums
            .iter()
            .map(|frame| frame.iter().zip(pixels).map(|(s, n)| *s as f64 / (*n).max(1) as f64).collect())
            .collect();
        // Subtract the mean over the frames, then from each frame its mean over the lines of one kind.
        for line in 0..lines {
            let mean = residuals.iter().map(|frame| frame[line]).sum::<f64>() / frames;
            let subtract =
                |frame: &mut Vec<f64>| frame[line] = if pixels[line] > 0 { frame[line] - mean } else { 0.0 };
            residuals.iter_mut().for_each(subtract);
        }
        for kind in 0..kinds.min(lines) {
            let of_kind: Vec<usize> = (kind..lines).step_by(kinds).filter(counted).collect();
            for frame in &mut residuals {
                let mean = of_kind.iter().map(|line| frame[*line]).sum::<f64>() / of_kind.len().max(1) as f64;
                of_kind.iter().for_each(|line| frame[*line] -= mean);
            }
        }
        // Sum the products by lag, and count the pairs that have pixels.
        let degrees = frames - 1.0;
        let lags = (lines / 2).max(FILTERED_LAGS * tile).min(lines.saturating_sub(1));
        let product = |lag: usize| {
            let of_frame =
                |frame: &Vec<f64>| frame.iter().zip(&frame[lag..]).map(|(a, b)| a * b).sum::<f64>();
            residuals.iter().map(of_frame).sum()
        };
        let pairs =
            |lag: usize| (0..lines - lag).filter(|i| counted(i) && counted(&(i + lag))).count() as f64;
        let square = |line: usize| residuals.iter().map(|frame| frame[line] * frame[line]).sum();
        let used = (0..lines).filter(counted).count().max(1) as f64;
        let shares = pixels.iter().filter(|n| **n > 0).map(|n| 1.0 / *n as f64).sum::<f64>() / used;
        Self {
            lines,
            kinds,
            squares: vec![(degrees, (0..lines).map(square).collect())],
            sums: (0..=lags).map(product).collect(),
            weights: (0..=lags).map(|lag| pairs(lag) * degrees).collect(),
            degrees,
            shares: shares * degrees,
        }
    }

    /// All points together; `None` without points, or of frames that differ in size.
    pub fn pooled<'a>(points: impl IntoIterator<Item = &'a Self>) -> Option<Self> {
        let mut points = points.into_iter();
        let mut all = points.next()?.clone();
        for point in points {
            if (point.lines, point.kinds) != (all.lines, all.kinds) {
                return None;
            }
            all.sums.iter_mut().zip(&point.sums).for_each(|(a, b)| *a += b);
            all.weights.iter_mut().zip(&point.weights).for_each(|(a, b)| *a += b);
            all.degrees += point.degrees;
            all.shares += point.shares;
            all.squares.extend(point.squares.iter().cloned());
        }
        Some(all)
    }

    /// Standard error of `c(0)` by the scatter of the squares over parts of the frames of at least so many lines, DN^2: whatever lines share
    /// within such a part. Zero with fewer than three parts.
    fn scatter_of_parts(&self, least_lines: usize) -> f64 {
        let count = (self.lines / least_lines.max(LEAST_PART)).max(1);
        let Some(mean) = self.at(0) else { return 0.0 };
        // Each part less what it has on average.
        let part = |(degrees, squares): &(f64, Vec<f64>), i: usize| {
            let of_part = &squares[i * self.lines / count..(i + 1) * self.lines / count];
            of_part.iter().sum::<f64>() - mean * degrees * of_part.len() as f64
        };
        let of_point = |point| (0..count).map(move |i| part(point, i));
        let parts: Vec<f64> = self.squares.iter().flat_map(of_point).collect();
        let n = parts.len() as f64;
        if n < 3.0 {
            return 0.0;
        }
        let squares: f64 = parts.iter().map(|p| p * p).sum();
        (squares * n / (n - 1.0)).sqrt() / self.weights[0]
    }

    /// Degrees of freedom in time of as many points with equal noise: the noisier ones, at long exposures, scatter most and count as few.
    fn alike_degrees(&self) -> f64 {
        let (mut sum, mut squares) = (0.0, 0.0);
        for (degrees, of_lines) in &self.squares {
            let of_point = of_lines.iter().sum::<f64>();
            sum += of_point;
            squares += of_point * of_point / degrees;
        }
        if squares > 0.0 { sum * sum / squares } else { self.degrees }
    }

    /// `c(h)`, DN^2; `None` beyond the largest lag, or where no two lines of this distance have pixels.
    fn at(&self, lag: usize) -> Option<f64> {
        let (sum, weight) = (self.sums.get(lag)?, self.weights.get(lag)?);
        (*weight > 0.0).then(|| sum / weight)
    }

    /// Temporal variance of the means of lines after a filter along them, `delta - kernel`, whose sum is zero: what the noise of the
    /// lines and that of their pixels leave there, DN^2. Lines are `step` apart. Without a kernel it is their variance about the mean of the frame.
    /// `None` if the frame has too few lines.
    pub fn filtered(&self, kernel: &[f64], step: usize) -> Option<Filtered> {
        let mut taps: Vec<f64> = kernel.iter().map(|k| -k).collect();
        if taps.is_empty() {
            taps.push(0.0);
        }
        let middle = taps.len() / 2;
        taps[middle] += 1.0;
        // The covariance after the filter at a lag: that before it, weighted by the autocorrelation of the taps.
        let reach = taps.len() - 1;
        let weight = |shift: usize| taps.iter().zip(&taps[shift..]).map(|(a, b)| a * b).sum::<f64>();
        let weights: Vec<f64> = (0..=reach).map(weight).collect();
        let after = |lag: usize| -> Option<f64> {
            let each = |shift: i64| {
                Some(
                    weights[shift.unsigned_abs() as usize]
                        * self.at(shift.abs_diff(lag as i64) as usize * step)?,
                )
            };
            let reach = reach as i64;
            (-reach..=reach).map(each).sum()
        };
        let variance_dn2 = after(0)?;
        // The lines have the same variance less what the mean of the frame took, where the taps do not cancel it.
        let is_free = if kernel.is_empty() { 1.0 - self.kinds as f64 / self.lines as f64 } else { 1.0 };
        let pixel_share = weights[0] * is_free * self.shares / self.degrees;
        // Sum the squared correlations over all lags, less what chance adds to them.
        let specimens = self.weights[0].max(1.0);
        let others: Vec<f64> = (1..self.sums.len()).map_while(after).map(|c| 2.0 * c * c).collect();
        let chance = 1.0 + 2.0 * others.len() as f64 / specimens;
        let squares = variance_dn2 * variance_dn2;
        let correlation = if squares > 0.0 {
            ((1.0 + others.iter().sum::<f64>() / squares) / chance).max(1.0)
        } else {
            1.0
        };
        let standard_error_dn2 = variance_dn2.abs() * (2.0 * correlation / specimens).sqrt();
        Some(Filtered { variance_dn2, pixel_share, standard_error_dn2, correlation })
    }
}

/// Temporal variance of lines after a filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filtered {
    /// The variance, DN^2.
    pub variance_dn2: f64,
    /// Share of the temporal variance of single pixels in it.
    pub pixel_share: f64,
    /// Its standard error, DN^2.
    pub standard_error_dn2: f64,
    /// Sum of the squared correlations with all lines: the factor by which they raise the variance of a variance.
    pub correlation: f64,
}

/// The covariance of the temporal noise of lines.
#[derive(Debug, Clone, PartialEq)]
pub struct LineModel {
    /// Variance of a line, `C(0)`, DN^2. Chance may make it negative.
    pub variance_dn2: Measured,
    /// `C(h)` of lags from 0, DN^2, without the part of a period; zero beyond.
    covariance_dn2: Vec<f64>,
    /// Whether there is noise of lines beyond doubt.
    is_certain: bool,
    /// Period, lines, and the covariance of the lines at its multiples, DN^2.
    period: Option<(usize, f64)>,
}

/// Correlation lengths within which a covariance counts (Sokal's window).
const WINDOW: f64 = 4.0;

/// Largest share of the lines that a window may have: with more of them, most of the noise is in the mean of the frame.
const WIDEST: f64 = 0.5;

/// Largest share of the variance that the mean of the frame may have taken.
const MOST_TAKEN: f64 = 0.35;

/// Repetitions until a window agrees with the covariance that it gives.
const WINDOWS: usize = 8;

/// Standard errors beyond which there is noise of lines at all.
const CERTAIN_SIGMAS: f64 = 3.0;

/// Standard errors beyond which a period is no chance: one of 64 periods exceeds them in ten million series.
const PERIOD_SIGMAS: f64 = 6.0;

/// Longest period that is looked for, lines: converters for 64 columns.
const LONGEST_PERIOD: usize = 64;

impl LineModel {
    /// No noise of lines, or none that is known.
    pub fn none(why: Unresolved) -> Self {
        let variance_dn2 = Measured::none(why);
        Self { variance_dn2, covariance_dn2: Vec::new(), is_certain: false, period: None }
    }

    /// The model of an autocovariance, where single pixels have the temporal variance `pixel_dn2`.
    pub fn of(found: &LineCovariance, pixel_dn2: Measured) -> Self {
        let (lines, degrees) = (found.lines as f64, found.degrees);
        let share = found.shares / degrees;
        let known: Option<Vec<f64>> = (0..found.sums.len()).map(|lag| found.at(lag)).collect();
        let (Some(mut rest), Some(pixel)) = (known, pixel_dn2.value()) else {
            return Self::none(Unresolved::FewLines);
        };
        if rest.len() < 2 || degrees <= 0.0 {
            return Self::none(Unresolved::FewLines);
        }
        let whole = rest[0];
        // Independent lines have this error; more is certain noise of lines, whose correlation can be looked at.
        let kinds = found.kinds as f64;
        let specimens = (lines - kinds).max(1.0) * found.alike_degrees();
        let of_pixels = share * pixel_dn2.error_or_zero();
        let independent_se = whole * (2.0 / specimens).sqrt();
        rest[0] -= share * pixel * (1.0 - kinds / lines);
        if rest[0] < CERTAIN_SIGMAS * independent_se {
            let variance = rest[0] / (1.0 - kinds / lines);
            let variance_dn2 = Measured::new(variance, independent_se.hypot(of_pixels));
            return Self { variance_dn2, covariance_dn2: vec![variance], is_certain: false, period: None };
        }

        // Subtract the part of a period: `n` independent numbers, whose mean is missing in the covariance.
        let period = period(&rest, lines, degrees);
        let mut of_period_se = 0.0;
        if let Some((n, level)) = period {
            let count = n as f64;
            let part =
                |lag: usize| if lag.is_multiple_of(n) { level * (1.0 - 1.0 / count) } else { -level / count };
            rest.iter_mut().enumerate().for_each(|(lag, c)| *c -= part(lag));
            of_period_se = level * (2.0 / ((count - 1.0) * degrees)).sqrt();
        }

        // Find the window of the rest, and add what the mean of the frame took.
        let level = period.map_or(0.0, |(_, level)| level);
        if rest[0] < CERTAIN_SIGMAS * independent_se {
            let variance_dn2 =
                Measured::new(rest[0] + level, independent_se.hypot(of_period_se).hypot(of_pixels));
            return Self { variance_dn2, covariance_dn2: vec![rest[0].max(0.0)], is_certain: true, period };
        }
        let Some(covariance_dn2) = with_mean_of_frame(&rest, found.lines, found.kinds) else {
            // Up to its first zero, the covariance is at least this.
            let positive = rest.iter().take_while(|c| **c > 0.0).count();
            rest.truncate(positive);
            let variance_dn2 = Measured::none(Unresolved::LinesTogether { lines: found.lines });
            return Self { variance_dn2, covariance_dn2: rest, is_certain: true, period };
        };
        let (window, added) = (covariance_dn2.len() - 1, covariance_dn2[0] - rest[0]);
        // The error of the variance of correlated lines, by their covariance or by the scatter of parts of the frames; of the part that was
        // added; of the period and of the pixels.
        let squares = square_sum(&rest, whole - level, specimens);
        let of_parts = if period.is_none() { found.scatter_of_parts(window + 1) } else { 0.0 };
        let of_lines = (2.0 * squares / specimens).sqrt().max(of_parts);
        let in_mean: f64 = weights_in_mean(window + 1, lines).iter().sum();
        let of_mean = added * (2.0 * (2.0 * window as f64 + 1.0) / specimens).sqrt() / (1.0 - in_mean);
        let standard_error = of_lines.hypot(of_mean).hypot(of_period_se).hypot(of_pixels);
        let variance_dn2 = Measured::new(covariance_dn2[0] + level, standard_error);
        Self { variance_dn2, covariance_dn2, is_certain: true, period }
    }

    fn at(&self, lag: usize) -> f64 {
        let of_period = self.period.filter(|(n, _)| lag.is_multiple_of(*n)).map_or(0.0, |(_, level)| level);
        self.covariance_dn2.get(lag).copied().unwrap_or(0.0) + of_period
    }

    /// Two variances due to the noise of lines: that of the mean over the lines of one frame, DN^2, and that of their mean variance times
    /// the degrees of freedom in time, DN^4. `has_pixels` marks the lines with pixels of the colour. Zero if noise of lines is in doubt:
    /// chance must not widen errors.
    pub fn of_mean(&self, has_pixels: &[bool]) -> [f64; 2] {
        let count = has_pixels.iter().filter(|has| **has).count() as f64;
        if !self.is_certain || count == 0.0 {
            return [0.0; 2];
        }
        let lags = match self.period {
            Some(_) => has_pixels.len(),
            None => self.covariance_dn2.len().min(has_pixels.len()),
        };
        let [mut mean, mut variance] = [0.0; 2];
        for lag in 0..lags {
            let covariance = self.at(lag);
            if covariance == 0.0 {
                continue;
            }
            let pairs = has_pixels.iter().zip(&has_pixels[lag..]).filter(|(a, b)| **a && **b).count() as f64;
            let both_ways = if lag == 0 { pairs } else { 2.0 * pairs };
            mean += both_ways * covariance;
            variance += both_ways * covariance * covariance;
        }
        [(mean / (count * count)).max(0.0), 2.0 * variance / (count * count)]
    }
}

/// Period of the lines and its covariance, if there is one beyond doubt. `rest` is the autocovariance of the noise of lines.
fn period(rest: &[f64], lines: f64, degrees: f64) -> Option<(usize, f64)> {
    let lags = rest.len() - 1;
    let squares = square_sum(rest, rest[0], lines * degrees);
    let level_of = |n: usize| {
        let at: Vec<usize> = (1..).map(|i| i * n).take_while(|lag| *lag < lags).collect();
        let peak = |lag: &usize| rest[*lag] - 0.5 * (rest[lag - 1] + rest[lag + 1]);
        let count = at.len() as f64;
        // The lag 0 is a neighbour of the first multiple only for a period of one line.
        let level = at.iter().map(peak).sum::<f64>() / count;
        let standard_error = (1.5 * squares / (lines * degrees) / count).sqrt();
        (n, level, standard_error, at.len())
    };
    let longest = LONGEST_PERIOD.min(lags / 4);
    let found: Vec<_> = (2..=longest).map(level_of).filter(|(_, _, _, count)| *count >= 2).collect();
    let certain =
        |(_, level, se, _): &&(usize, f64, f64, usize)| *level > PERIOD_SIGMAS * se && *level > 0.1 * rest[0];
    let most = found.iter().filter(certain).map(|(_, level, ..)| *level).fold(0.0, f64::max);
    let (n, level, ..) = found.iter().filter(certain).find(|(_, level, ..)| *level > 0.7 * most)?;
    // Lines between the multiples are alike; those of a wave are not.
    let mean_of = |residue: usize| {
        let all: Vec<f64> = (1..=lags).filter(|lag| lag % n == residue).map(|lag| rest[lag]).collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    let between: Vec<f64> = (1..*n).map(mean_of).collect();
    let middle = between.iter().sum::<f64>() / between.len() as f64;
    // They differ by chance: `n` numbers a frame have few products.
    let chance = 3.5 / (degrees * *n as f64).sqrt();
    let limit = level * chance.clamp(0.25, 0.6);
    between.iter().all(|c| (c - middle).abs() < limit).then_some((*n, *level))
}

/// The least lag of [`WINDOW`] correlation lengths; `None` if the lines are too few for one.
fn window(covariance: &[f64], lines: usize) -> Option<usize> {
    let mut length = 0.5;
    let widest = ((WIDEST * lines as f64) as usize).min(covariance.len() - 1);
    (1..=widest).find(|lag| {
        length += covariance[*lag] / covariance[0];
        *lag as f64 >= WINDOW * length
    })
}

/// The covariance up to its window, with what the mean of the frame took. The window must hold for the covariance that it gives. `None`
/// if it does not end within the frame, or if the mean took too much.
fn with_mean_of_frame(rest: &[f64], lines: usize, kinds: usize) -> Option<Vec<f64>> {
    let mut last = window(rest, lines)?;
    let mut covariance = with_mean(&rest[..=last], lines, kinds);
    for _ in 0..WINDOWS {
        let added = covariance[0] - rest[0];
        let whole: Vec<f64> =
            covariance.iter().copied().chain(rest[last + 1..].iter().map(|c| c + added)).collect();
        let next = window(&whole, lines)?;
        if next <= last {
            break;
        }
        last = next;
        covariance = with_mean(&rest[..=last], lines, kinds);
    }
    (covariance[0] - rest[0] < MOST_TAKEN * covariance[0]).then_some(covariance)
}

/// Weights of the covariances at so many lags from 0 in the variance of the mean of all lines.
fn weights_in_mean(lags: usize, lines: f64) -> Vec<f64> {
    let weight = |lag: usize| (if lag == 0 { 1.0 } else { 2.0 }) * (1.0 - lag as f64 / lines) / lines;
    (0..lags).map(weight).collect()
}

/// The covariance of lines, from the covariance of lines after the mean of their kind is subtracted. Every `kinds`-th line is of the same
/// kind. Subtracting means removes covariance that depends on the result itself, so the correction is iterated until it agrees with its
/// result.
fn with_mean(rest: &[f64], lines: usize, kinds: usize) -> Vec<f64> {
    let weights = weights_in_mean(rest.len(), lines as f64);
    let count = kinds as f64;
    let mut covariance = rest.to_vec();
    for _ in 0..60 {
        let each = || covariance.iter().zip(&weights).map(|(c, w)| c * w);
        let of_all: f64 = each().sum();
        let of_kind = count * each().step_by(kinds).sum::<f64>();
        let between = if kinds > 1 { (count * of_all - of_kind) / (count - 1.0) } else { of_kind };
        let mean = |lag: usize| if lag.is_multiple_of(kinds) { of_kind } else { between };
        covariance = rest.iter().enumerate().map(|(lag, c)| c + mean(lag)).collect();
    }
    covariance
}

/// Sum of the squared covariances over all lags of both signs, less what chance adds: each of them has the variance `sum / specimens`.
fn square_sum(rest: &[f64], at_zero: f64, specimens: f64) -> f64 {
    let lines = 2.0 * (rest.len() as f64 - 1.0).max(1.0);
    let (mut squares, mut chance) = (at_zero * at_zero, 1.0);
    for (lag, c) in rest.iter().enumerate().skip(1) {
        let pairs = 1.0 - lag as f64 / lines.max(lag as f64 + 1.0);
        squares += 2.0 * c * c;
        chance += 2.0 / (specimens * pairs);
    }
    (squares / chance).max(at_zero * at_zero)
}
