//! Dark current pixel by pixel: that of ordinary pixels, and the hot pixels above them.
//!
//! From the mean frames of the shortest and of the longest dark exposure of a gain each pixel has a dark current
//!
//! ```text
//! x_p = (mean_p(t_long) - mean_p(t_short)) / (t_long - t_short)        [DN/s]
//! ```
//!
//! in which its fixed offset (DSNU) cancels. The pixels scatter by noise of standard deviation `s`. A share `h` of
//! them, the hot pixels, has an additional dark current, exponentially distributed with mean `theta`
//! ([`NonUniformity`](petzval_camera::sensor::NonUniformity)). An exponential distribution has no memory: the excess
//! over a threshold `T` has the same distribution. So the `n` pixels more than `T = 6 s` above the others determine
//! both numbers, whatever the distribution of the noise below (peaks over a threshold):
//!
//! ```text
//! theta = sum(x_p - T) / m                       m of the n are not full at t_long: maximum likelihood of a censored sample
//! h     = n / N exp(T / theta - s^2 / (2 theta^2))                     N pixels; the exponent accounts for pixels below T
//! ```
//!
//! with the relative standard errors `1/sqrt(m)` and `hypot(1/sqrt(n), (T/theta - s^2/theta^2)/sqrt(m))`: the specimen
//! is one draw of its kind. The dark current of the ordinary pixels is the mean of those within `T`, minus the
//! contribution of hot pixels below `T`.
//!
//! Rounding, and an offset that drifts, move all pixels of a frame together and do not average out over them. Both ends have the error of
//! rounding of a dark point, and the departure of the dark series from its line; where rounding ends in `T`, the hot pixels have it too.
//!
//! A pixel may also be brighter than the others in dark frames of any exposure time. Such a bright pixel has no excess
//! dark current but an excess offset, its mean at no exposure time, `mean_p(t_short) - x_p t_short`.

use schemars::JsonSchema;
use serde::Serialize;

use super::captures::{Kind, Point};
use super::dark::DarkSeries;
use super::flags::FlaggedPoint;
use super::goodness::{ALPHA, FitTest, Verdict, chi2_beyond};
use super::measured::{Measured, RESOLVED_SIGMAS, Unresolved};
use super::point::Stack;
use super::rounding::RoundingError;
use super::samples::greatest_common_divisor;
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Standard deviations from the median beyond which a dark current is not noise: 2e-9 of normally distributed ones
/// exceed it.
const THRESHOLD_SIGMAS: f64 = 6.0;
/// Fewest pixels from which the distribution is estimated: ten give the mean excess to a third.
const FEWEST: usize = 10;
/// Least mean excess of hot pixels, standard deviations: seven times as many lie below the threshold as above, and dark currents of any smooth
/// distribution look like these.
const LEAST_EXCESS_SIGMAS: f64 = 3.0;
/// Largest difference of the cumulative distributions up to which excesses count as exponential, with wider errors: of many hot pixels, the test
/// shows departures of a few percent, which every sensor has.
const LARGEST_DEPARTURE: f64 = 0.1;
/// Share of normal pixels below the median by more than one standard deviation.
const BELOW_ONE_SIGMA: f64 = 0.158_655_253_931_457_05;
/// Variance of the difference of two numbers that are both rounded, steps^2.
const ROUNDING_DN2: f64 = 2.0 / 12.0;

/// Dark frames at one end of a dark series.
struct DarkEnd<'a> {
    /// Exposure time, s.
    exposure_s: f64,
    /// Sum of the frames.
    stack: &'a Stack,
    /// Temporal variance of a frame, DN^2.
    variance_dn2: f64,
    /// Variance of the mean of a frame by the noise of its rows and columns, DN^2.
    lines_dn2: f64,
    /// Distance of its digital numbers, DN.
    step_dn: f64,
}

/// Dark currents of the pixels at one gain.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PixelDarkCurrents {
    /// Exposure time of the shorter dark frames, s.
    pub short_s: f64,
    /// Exposure time of the longer ones, s.
    pub long_s: f64,
    /// Median over the pixels, DN/s.
    pub median_dn_per_s: Measured,
    /// Mean of the ordinary pixels, those that are not hot, DN/s.
    pub ordinary_dn_per_s: Measured,
    /// Standard deviation of the ordinary pixels, noise and all, DN/s.
    pub spread_dn_per_s: f64,
    /// Dark current above which a pixel is an outlier, DN/s.
    pub threshold_dn_per_s: f64,
    /// Number of outliers.
    pub outliers: usize,
    /// Their places in the frame, row by row, ascending.
    #[serde(skip)]
    pub outlier_pixels: Vec<usize>,
    /// Outliers that are full at the longer exposure: only a lower bound of their dark current is known.
    pub full: usize,
    /// Number of bright pixels: ordinary dark current, but an offset above those of the others.
    pub bright: usize,
    /// Median of their offsets above the median of all, DN.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bright_offset_dn: Option<f64>,
    /// Their places in the frame, row by row, ascending.
    #[serde(skip)]
    pub bright_pixels: Vec<usize>,
    /// Share of the pixels that are hot, h.
    pub hot_share: Measured,
    /// Mean dark current of hot pixels above that of the ordinary ones, theta, DN/s.
    pub hot_excess_dn_per_s: Measured,
    /// Whether the excesses over the threshold are exponentially distributed; `None` if there are too few, or some are full.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hot_test: Option<FitTest>,
}

impl PixelDarkCurrents {
    /// Relative standard error of the hot pixels' dark current in all, if there are hot pixels.
    pub(super) fn hot_relative_error(&self) -> Option<f64> {
        let relative = |m: &Measured| Some(m.standard_error()? / m.value()?);
        Some(relative(&self.hot_share)?.hypot(relative(&self.hot_excess_dn_per_s)?))
    }
}

/// The dark points of the shortest and of the longest exposure; of one exposure that of the most frames.
pub(super) fn dark_ends<'a>(points: &[&'a Point]) -> [Option<&'a Point>; 2] {
    let darks = || points.iter().copied().filter(|p| p.kind == Kind::Dark);
    let by_time = |a: &&Point, b: &&Point| a.exposure_s.total_cmp(&b.exposure_s);
    let frames = |p: &Point| p.frames.len();
    [
        darks().min_by(|a, b| by_time(a, b).then(frames(b).cmp(&frames(a)))),
        darks().max_by(|a, b| by_time(a, b).then(frames(a).cmp(&frames(b)))),
    ]
}

/// Dark currents of the pixels from the two ends of a dark series, if their exposure times differ and neither is cut off from below. Light that
/// leaks in, or a glow, is brighter than noise in places, and has no hot pixels.
/// `max_dn` is the largest digital number of the converter; `bulk` the dark series of the bulk of the pixels.
pub(super) fn of_dark_ends(
    ends: [Option<&FlaggedPoint<'_>>; 2],
    max_dn: f64,
    bulk: &DarkSeries,
) -> Option<PixelDarkCurrents> {
    let [short, long] = ends.map(|end| dark_end(end, bulk.step_dn()));
    let (short, long) = (short?, long?);
    let leaks = ends.iter().flatten().any(|end| end.flags.light_leak_dn.is_some());
    (long.exposure_s > short.exposure_s).then(|| {
        let drift_se = bulk.departure_of_ends(long.exposure_s - short.exposure_s);
        let found = pixel_dark_currents(&short, &long, max_dn, drift_se);
        if leaks && found.hot_share.value().is_some() {
            let none = Measured::none(Unresolved::LightLeak);
            PixelDarkCurrents { hot_share: none, hot_excess_dn_per_s: none, hot_test: None, ..found }
        } else {
            found
        }
    })
}

/// One end of a dark series, if its frames are not cut off from below.
fn dark_end<'a>(end: Option<&'a FlaggedPoint<'_>>, step_dn: f64) -> Option<DarkEnd<'a>> {
    let FlaggedPoint { point, found, flags } = end?;
    flags.is_whole().then_some(DarkEnd {
        exposure_s: point.exposure_s,
        stack: found.stack.as_ref()?,
        variance_dn2: found.all.variance_dn2,
        lines_dn2: found.all.lines_of_frame_dn2,
        step_dn,
    })
}

/// Dark currents of the pixels from the two ends of a dark series. `max_dn` is the largest digital number of the converter, `drift_se` the standard
/// error of a slope between both ends by what is no noise, DN/s.
fn pixel_dark_currents(
    short: &DarkEnd<'_>,
    long: &DarkEnd<'_>,
    max_dn: f64,
    drift_se: f64,
) -> PixelDarkCurrents {
    let (short_frames, long_frames) = (short.stack.frames as i64, long.stack.frames as i64);
    let common = i64::from(greatest_common_divisor(short.stack.frames as u32, long.stack.frames as u32));
    let (of_long, of_short) = (short_frames / common, long_frames / common);
    // Difference of the mean frames in units of 1 / (short_frames of_short) DN, so that the numbers stay whole.
    let differences: Vec<i64> = (long.stack.sum_dn.iter().zip(&short.stack.sum_dn))
        .map(|(l, s)| of_long * i64::from(*l) - of_short * i64::from(*s))
        .collect();
    let time_s = long.exposure_s - short.exposure_s;
    let per_unit = 1.0 / ((short_frames * of_short) as f64 * time_s);
    let pixels = differences.len() as f64;

    // Estimate median and standard deviation by quantiles, which hot pixels hardly shift. Pixels above the threshold
    // are outliers.
    let mut sorted = differences.clone();
    let median = quantile(&mut sorted, 0.5) * per_unit;
    let below = quantile(&mut sorted, BELOW_ONE_SIGMA) * per_unit;
    let spread = (median - below).max(short.step_dn * ROUNDING_DN2.sqrt() / time_s);
    let threshold = median + THRESHOLD_SIGMAS * spread;

    // Average the ordinary pixels, those within the threshold.
    let currents = || differences.iter().map(|d| *d as f64 * per_unit);
    let within = |x: &f64| (x - median).abs() <= threshold - median;
    let (core, core_sum) = currents().filter(within).fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
    let core_mean = core_sum / core;
    // Noise that rows and columns share moves all pixels of a frame together.
    let lines_of = |end: &DarkEnd<'_>| end.lines_dn2 / end.stack.frames as f64;
    let lines_se = (lines_of(short) + lines_of(long)).sqrt() / time_s;
    // So do rounding and the drift of the offset.
    let rounding_of = |end: &DarkEnd<'_>| RoundingError::of(end.variance_dn2, end.step_dn).mean_dn;
    let rounding_se = rounding_of(short).hypot(rounding_of(long)) / time_s;
    let shared_se = lines_se.hypot(drift_se);
    let core_se = (spread / f64::sqrt(core)).hypot(shared_se).hypot(rounding_se);

    // Collect the outliers: dark current, and digital number at the longer exposure.
    let long_dn = |sum: u32| f64::from(sum) / long_frames as f64;
    let beyond = currents().zip(&long.stack.sum_dn).enumerate().filter(|(_, (x, _))| *x > threshold);
    let (outlier_pixels, outliers): (Vec<usize>, Vec<(f64, f64)>) =
        beyond.map(|(pixel, (x, sum))| (pixel, (x, long_dn(*sum)))).unzip();
    // Outliers that pile up at the top are full at the longer exposure: only a lower bound of their dark current is known.
    let n = outliers.len() as f64;
    let excess = |x: f64| x - core_mean;
    let frame_noise_dn = (short.variance_dn2.max(0.0) / long_frames as f64).sqrt();
    let mean_excess_dn = outliers.iter().map(|(x, _)| excess(*x)).sum::<f64>() / n * time_s;
    let end_dn = full_from(&outliers, frame_noise_dn, mean_excess_dn).min(max_dn);
    let full = outliers.iter().filter(|(_, dn)| *dn >= end_dn).count();
    let known = (outliers.len() - full) as f64;
    let (bright_pixels, bright_offset_dn) = bright_pixels([short, long], &outlier_pixels, end_dn);

    // Estimate the mean excess of the hot pixels by maximum likelihood.
    let above = threshold - core_mean;
    let theta = outliers.iter().map(|(x, _)| x - threshold).sum::<f64>() / known;
    // The standard error of a median is sqrt(pi/2) times that of the mean for normally distributed numbers.
    // Means of few frames lie on steps of their own, which move a median further than a mean: 1.9 times for two frames of 0.4 DN noise.
    let of_few = 1.0 + 2.0 / short_frames.min(long_frames) as f64;
    let of_noise = (0.5 * std::f64::consts::PI / pixels).sqrt() * spread;
    let median_se = of_noise.hypot(shared_se).hypot(of_few * rounding_se);
    let found = PixelDarkCurrents {
        short_s: short.exposure_s,
        long_s: long.exposure_s,
        median_dn_per_s: Measured::new(median, median_se),
        ordinary_dn_per_s: Measured::new(core_mean, core_se),
        spread_dn_per_s: spread,
        threshold_dn_per_s: threshold,
        outliers: outliers.len(),
        outlier_pixels,
        full,
        bright: bright_pixels.len(),
        bright_offset_dn,
        bright_pixels,
        hot_share: Measured::none(Unresolved::NoHotPixels { outliers: outliers.len() }),
        hot_excess_dn_per_s: Measured::none(Unresolved::NoHotPixels { outliers: outliers.len() }),
        hot_test: None,
    };
    // Six standard deviations out, the tail of normal noise falls by 1/e within a sixth of its standard deviation. Other tails are longer, and a
    // share that is mostly a guess below the threshold is none.
    if outliers.len() - full < FEWEST || theta <= LEAST_EXCESS_SIGMAS * spread {
        return found;
    }
    // Estimate the share of hot pixels: the outliers, and those below the threshold.
    let ratio = spread / theta;
    let share = n / pixels * (above / theta - 0.5 * ratio * ratio).exp();
    // Rounding moves the ordinary pixels against the threshold, and so the excess over it.
    let of_steps = rounding_se / theta;
    let share_error = n.sqrt().recip().hypot((above / theta - ratio * ratio) / known.sqrt()).hypot(of_steps);
    // The share must be resolved, and the median must be that of ordinary pixels.
    if share_error * RESOLVED_SIGMAS >= 1.0 || share >= 0.5 {
        return found;
    }
    // Subtract the hot pixels below the threshold from the mean of the ordinary pixels.
    let below_share = (-above / theta).exp();
    let hidden = share * (theta - (theta + above) * below_share) / (1.0 - share * below_share);
    // If the excesses are far from exponentially distributed, the outliers are not hot pixels of this model, and what lies below the threshold is
    // a guess.
    let excesses: Vec<f64> = outliers.iter().map(|(x, _)| x - threshold).collect();
    let hot_test = (full == 0).then(|| exponential_test(&excesses, per_unit));
    let (mut of_share, mut of_hidden, mut of_excess) =
        (share * share_error, hidden * share_error, (theta / known.sqrt()).hypot(rounding_se));
    if hot_test.is_some_and(|test| test.verdict == Verdict::Withdrawn) {
        let none = Measured::none(Unresolved::NotExponential { outliers: found.outliers });
        let error = core_se.hypot(of_hidden).hypot(hidden);
        return PixelDarkCurrents {
            ordinary_dn_per_s: Measured::new(core_mean - hidden, error),
            hot_share: none,
            hot_excess_dn_per_s: none,
            hot_test,
            ..found
        };
    }
    // If they are nearly so, the error contains all that lies below the threshold, and the mean has the error of its own scatter.
    if hot_test.is_some_and(|test| test.verdict == Verdict::Widened) {
        let scatter = excesses.iter().map(|x| (x - theta).powi(2)).sum::<f64>() / n;
        of_share = of_share.hypot(share - n / pixels);
        of_hidden = of_hidden.hypot(hidden);
        of_excess = of_excess.max((scatter / n).sqrt().hypot(rounding_se));
    }
    PixelDarkCurrents {
        ordinary_dn_per_s: Measured::new(core_mean - hidden, core_se.hypot(of_hidden)),
        hot_share: Measured::new(share, of_share),
        hot_excess_dn_per_s: Measured::new(theta, of_excess),
        hot_test,
        ..found
    }
}

/// Bright pixels, and the median of their offsets above the median of all pixels, DN. The offset of a pixel is its mean at no exposure time, from
/// the two ends of the dark series; bright is what lies more than six standard deviations above the median. Hot pixels and those
/// that reach `end_dn` are none of them.
fn bright_pixels(
    [short, long]: [&DarkEnd<'_>; 2],
    hot_pixels: &[usize],
    end_dn: f64,
) -> (Vec<usize>, Option<f64>) {
    // Extrapolate each pixel to no exposure time.
    let mean = |end: &DarkEnd<'_>, i: usize| f64::from(end.stack.sum_dn[i]) / end.stack.frames as f64;
    let share = short.exposure_s / (long.exposure_s - short.exposure_s);
    let offsets: Vec<f64> = (0..short.stack.sum_dn.len())
        .map(|i| mean(short, i) + share * (mean(short, i) - mean(long, i)))
        .collect();
    // Rounding leaves at least its own variance in each of the two means.
    let middle = median(offsets.iter().copied());
    let scatter = SIGMA_OVER_MEDIAN * median(offsets.iter().map(|o| (o - middle).abs()));
    // Means of few frames lie on steps, and so does the median of their deviations; the standard deviation of what it keeps does not.
    let kept = || offsets.iter().map(|o| o - middle).filter(|o| o.abs() <= THRESHOLD_SIGMAS * scatter);
    let scatter = scatter.max((kept().map(|o| o * o).sum::<f64>() / kept().count().max(1) as f64).sqrt());
    let rounding = short.step_dn * (0.5 * ROUNDING_DN2).sqrt() * (1.0 + share).hypot(share);
    let limit = middle + THRESHOLD_SIGMAS * scatter.max(rounding);
    let is_bright =
        |i: &usize| offsets[*i] > limit && mean(long, *i) < end_dn && hot_pixels.binary_search(i).is_err();
    let found: Vec<usize> = (0..offsets.len()).filter(is_bright).collect();
    let offset = (!found.is_empty()).then(|| median(found.iter().map(|i| offsets[*i] - middle)));
    (found, offset)
}

/// Test of exponential distribution (Moran 1951). The statistic is `2 n (ln(mean) - mean(ln))` over `1 + (n + 1)/(6 n)` for n values; it is
/// nearly chi-squared with `n - 1` degrees of freedom. It is small if the values are too even, and large if they are too uneven; each side
/// has half of the level. Values that fail widen the errors; if their cumulative distribution is off by more than [`LARGEST_DEPARTURE`] as well,
/// the figures are withdrawn. Values are rounded to multiples of `step`; the logarithm of each is averaged over its rounding interval.
fn exponential_test(values: &[f64], step: f64) -> FitTest {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    // The mean logarithm from a to b: that of x is the slope of x ln x - x.
    let logarithm = |v: &f64| {
        let (a, b) = ((v - 0.5 * step).max(0.0), v + 0.5 * step);
        let of = |x: f64| if x > 0.0 { x * x.ln() - x } else { 0.0 };
        (of(b) - of(a)) / (b - a)
    };
    let of_logarithms = values.iter().map(logarithm).sum::<f64>() / n;
    let chi2 = 2.0 * n * (mean.ln() - of_logarithms) / (1.0 + (n + 1.0) / (6.0 * n));
    let degrees_of_freedom = values.len() - 1;
    let above = chi2_beyond(chi2, degrees_of_freedom);
    let p_value = 2.0 * above.min(1.0 - above);
    // Compare the cumulative distributions.
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let difference = |(i, v): (usize, &f64)| ((i as f64 + 0.5) / n - (1.0 - (-v / mean).exp())).abs();
    let departure = sorted.iter().enumerate().map(difference).fold(0.0, f64::max);
    let verdict = if p_value >= ALPHA {
        Verdict::Holds
    } else if departure > LARGEST_DEPARTURE {
        Verdict::Withdrawn
    } else {
        Verdict::Widened
    };
    FitTest {
        reduced_chi2: chi2 / degrees_of_freedom as f64,
        p_value,
        verdict,
        ..FitTest::untested(values.len(), degrees_of_freedom)
    }
}

/// Number of outliers within noise of the largest from which they count as full. The largest of exponentially
/// distributed numbers lie apart by about their mean: four of them within a tenth of it are one sample in a thousand.
const PILE: usize = 4;

/// Digital number from which pixels are full: the top at which the outliers `(dark current, digital number)` pile up.
fn full_from(outliers: &[(f64, f64)], frame_noise_dn: f64, mean_excess_dn: f64) -> f64 {
    let top = outliers.iter().map(|(_, dn)| *dn).fold(f64::NEG_INFINITY, f64::max);
    let from = top - THRESHOLD_SIGMAS * frame_noise_dn;
    let piled = outliers.iter().filter(|(_, dn)| *dn >= from).count();
    if piled >= PILE && top - from <= 0.1 * mean_excess_dn { from } else { f64::INFINITY }
}

/// The value below which a share `q` of whole numbers lies, each spread evenly over the unit around it. Sorts in part.
fn quantile(values: &mut [i64], q: f64) -> f64 {
    let wanted = q * values.len() as f64;
    let (_, value, _) = values.select_nth_unstable((wanted as usize).min(values.len() - 1));
    let value = *value;
    let below = values.iter().filter(|v| **v < value).count() as f64;
    let at = values.iter().filter(|v| **v == value).count() as f64;
    value as f64 - 0.5 + (wanted - below) / at
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, Exp, Normal};

    use super::*;

    /// Sums of `frames` dark frames of 1 ms and of 1 s: noise of 2 DN, 30 DN/s, hot pixels, a plateau where pixels are full.
    fn ends(seed: u64, pixels: usize, frames: usize, share: f64, excess: f64, end_dn: f64) -> [Stack; 2] {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let (noise, exponential) = (Normal::new(0.0, 2.0).unwrap(), Exp::new(1.0 / excess).unwrap());
        let mut stacks = [vec![0u32; pixels], vec![0u32; pixels]];
        for i in 0..pixels {
            let offset_dn = 100.0 + 5.0 * noise.sample(&mut rng);
            let hot = if rng.random::<f64>() < share { exponential.sample(&mut rng) } else { 0.0 };
            for (stack, time_s) in stacks.iter_mut().zip([0.001, 1.0]) {
                for _ in 0..frames {
                    let dn = (offset_dn + (30.0 + hot) * time_s).min(end_dn) + noise.sample(&mut rng);
                    stack[i] += dn.round().clamp(0.0, 4095.0) as u32;
                }
            }
        }
        stacks.map(|sum_dn| Stack { height: 1, width: pixels, frames, sum_dn, variance_dn2: Vec::new() })
    }

    fn found(stacks: &[Stack; 2]) -> PixelDarkCurrents {
        let end = |stack, exposure_s| DarkEnd {
            exposure_s,
            stack,
            variance_dn2: 4.1,
            lines_dn2: 0.0,
            step_dn: 1.0,
        };
        pixel_dark_currents(&end(&stacks[0], 0.001), &end(&stacks[1], 1.0), 4095.0, 0.0)
    }

    #[test]
    fn errors_match_the_scatter_over_specimens_with_and_without_full_pixels() {
        const SPECIMENS: u64 = 60;
        for (share, excess, end_dn) in [(0.01, 300.0, 1e6), (0.02, 1500.0, 2000.0), (0.02, 25.0, 1e6)] {
            let mut pulls = [const { Vec::new() }; 4];
            for seed in 0..SPECIMENS {
                let f = found(&ends(seed, 20_000, 2, share, excess, end_dn));
                let measured = [f.hot_share, f.hot_excess_dn_per_s, f.ordinary_dn_per_s, f.median_dn_per_s];
                // The median of all pixels is that of the ordinary ones, moved by half the share of the hot.
                let median = 30.0 + f.spread_dn_per_s * (0.5 * std::f64::consts::PI).sqrt() * share;
                for (list, (m, truth)) in
                    pulls.iter_mut().zip(measured.iter().zip([share, excess, 30.0, median]))
                {
                    list.push((m.value().unwrap() - truth) / m.standard_error().unwrap());
                }
            }
            // Means of 60 pulls within 4 / sqrt(60), their scatter within 4 / sqrt(120) of one: eight numbers at 6e-5 each.
            for (name, list) in ["share", "excess", "ordinary", "median"].iter().zip(&pulls) {
                let n = SPECIMENS as f64;
                let mean = list.iter().sum::<f64>() / n;
                let scatter = (list.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
                assert!(mean.abs() < 4.0 / n.sqrt(), "{share} {excess} {name}: mean pull {mean}");
                assert!((scatter - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{share} {excess} {name}: {scatter}");
            }
        }
    }

    #[test]
    fn rounding_is_in_the_errors_whatever_the_phase_of_the_level() {
        const PHASES: u32 = 4;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(0.0, 0.2).unwrap();
        let mut frame = |dn: f64| (dn + noise.sample(&mut rng)).round() as u32;
        let mut squares = [0.0; 2];
        for phase in 0..PHASES * PHASES {
            let place = |k: u32| (f64::from(k) + 0.5) / f64::from(PHASES);
            let levels = [100.0 + place(phase / PHASES), 110.0 + place(phase % PHASES)];
            let (mut stacks, mut variances) = (Vec::new(), Vec::new());
            for dn in levels {
                let pairs: Vec<[u32; 2]> = (0..2000).map(|_| [frame(dn), frame(dn)]).collect();
                let variance = |[a, b]: &[u32; 2]| 0.5 * f64::from(a.abs_diff(*b)).powi(2);
                variances.push(pairs.iter().map(variance).sum::<f64>() / 2000.0);
                let sum_dn = pairs.iter().map(|[a, b]| a + b).collect();
                stacks.push(Stack { height: 1, width: 2000, frames: 2, sum_dn, variance_dn2: Vec::new() });
            }
            let end = |i: usize, exposure_s| DarkEnd {
                exposure_s,
                stack: &stacks[i],
                variance_dn2: variances[i],
                lines_dn2: 0.0,
                step_dn: 1.0,
            };
            let f = pixel_dark_currents(&end(0, 0.0), &end(1, 1.0), 4095.0, 0.0);
            for (square, figure) in squares.iter_mut().zip([f.ordinary_dn_per_s, f.median_dn_per_s]) {
                let off = figure.value().unwrap() - (levels[1] - levels[0]);
                *square += (off / figure.standard_error().unwrap()).powi(2);
            }
            // An offset that drifts is in both as well.
            let drifts = pixel_dark_currents(&end(0, 0.0), &end(1, 1.0), 4095.0, 30.0);
            for figure in [drifts.ordinary_dn_per_s, drifts.median_dn_per_s] {
                assert!(figure.standard_error().unwrap() > 30.0, "{figure:?}");
            }
        }
        let scatter = squares.map(|sum| (sum / f64::from(PHASES * PHASES)).sqrt());
        assert!(scatter.iter().all(|pull| *pull < 1.25), "{scatter:?}");
    }

    #[test]
    fn excesses_that_are_not_exponential_are_no_hot_pixels() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        let mut draw =
            |of: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..400).map(|_| of(rng.random::<f64>())).collect() };
        let exponential = exponential_test(&draw(&|u| -30.0 * (1.0 - u).ln()), 0.01);
        assert!(exponential.verdict == Verdict::Holds && exponential.p_value > ALPHA, "{exponential:?}");
        // Even numbers about a mean, and a few far above many.
        for of in [(&|u: f64| 20.0 + 20.0 * u) as &dyn Fn(f64) -> f64, &|u| 30.0 * (1.0 - u).powf(-1.5)] {
            let found = exponential_test(&draw(of), 0.01);
            assert_eq!(found.verdict, Verdict::Withdrawn, "{found:?}");
        }
        // Many that are nearly exponential: the test sees it, and the errors grow.
        let many: Vec<f64> =
            (0..40_000).map(|i| 30.0 * (-(1.0 - (f64::from(i) + 0.5) / 40_000.0).ln()).powf(1.1)).collect();
        assert_eq!(exponential_test(&many, 0.01).verdict, Verdict::Widened);
        // Few excesses far above many.
        let mut stacks = ends(4, 50_000, 2, 0.0, 1.0, 1e6);
        for i in 0..400 {
            stacks[1].sum_dn[100 * i] += 2 * (14.0 * ((i as f64 + 0.5) / 400.0).powf(-0.75)) as u32;
        }
        let uneven = found(&stacks);
        assert_eq!(uneven.full, 0, "{uneven:?}");
        for figure in [uneven.hot_share, uneven.hot_excess_dn_per_s] {
            assert!(matches!(figure.reason(), Some(Unresolved::NotExponential { .. })), "{figure:?}");
        }
        let (ordinary, error) =
            (uneven.ordinary_dn_per_s.value().unwrap(), uneven.ordinary_dn_per_s.standard_error().unwrap());
        assert!((ordinary - 30.0).abs() < 4.0 * error, "{ordinary} +- {error}");
    }

    #[test]
    fn a_lognormal_dark_current_has_outliers_and_no_hot_pixels() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        let normal: Normal<f64> = Normal::new(0.0, 0.5).unwrap();
        let mut stacks = ends(4, 50_000, 2, 0.0, 1.0, 1e6);
        for sum_dn in &mut stacks[1].sum_dn {
            *sum_dn += 2 * (100.0 * normal.sample(&mut rng).exp()).round() as u32;
        }
        let lognormal = found(&stacks);
        assert!(lognormal.outliers > 100, "{lognormal:?}");
        for figure in [lognormal.hot_share, lognormal.hot_excess_dn_per_s] {
            assert!(matches!(figure.reason(), Some(Unresolved::NoHotPixels { .. })), "{figure:?}");
        }
    }

    #[test]
    fn an_offset_of_any_exposure_time_is_bright_and_not_hot() {
        // Thirty pixels 200 DN above the others at both times, beside 1 % of hot pixels.
        let mut stacks = ends(2, 50_000, 3, 0.01, 300.0, 1e6);
        let before = found(&stacks);
        assert_eq!((before.bright, before.bright_offset_dn), (0, None));
        let ordinary = (0..50_000).filter(|i| before.outlier_pixels.binary_search(i).is_err());
        let places: Vec<usize> = ordinary.step_by(1000).take(30).collect();
        for stack in &mut stacks {
            places.iter().for_each(|i| stack.sum_dn[*i] += 3 * 200);
        }
        let after = found(&stacks);
        assert_eq!((after.bright, &after.bright_pixels), (30, &places));
        // The median of thirty offsets that scatter by ten is known to two.
        let offset = after.bright_offset_dn.unwrap();
        assert!((offset - 200.0).abs() < 8.0, "{offset}");
        assert_eq!(after.outlier_pixels, before.outlier_pixels);
        // A pixel that is full whatever the time is no offset of the others' kind.
        places.iter().for_each(|i| stacks[1].sum_dn[*i] = 3 * 4095);
        places.iter().for_each(|i| stacks[0].sum_dn[*i] = 3 * 4095);
        assert_eq!(found(&stacks).bright, 0);
    }

    #[test]
    fn noise_alone_has_no_hot_pixels() {
        let f = found(&ends(1, 200_000, 3, 0.0, 1.0, 1e6));
        assert_eq!((f.outliers, f.full, f.outlier_pixels.len(), f.bright), (0, 0, 0, 0));
        assert!(f.hot_share.reason().is_some() && f.hot_excess_dn_per_s.reason().is_some());
        let (value, se) =
            (f.ordinary_dn_per_s.value().unwrap(), f.ordinary_dn_per_s.standard_error().unwrap());
        assert!(((value - 30.0) / se).abs() < 4.0, "{value} +- {se}");
    }

    #[test]
    fn stacks_of_different_lengths_and_constant_frames_have_a_dark_current() {
        let stack = |frames: usize, dn: u32| Stack {
            height: 10,
            width: 10,
            frames,
            sum_dn: vec![frames as u32 * dn; 100],
            variance_dn2: Vec::new(),
        };
        let (short, long) = (stack(4, 100), stack(6, 110));
        let end = |stack, exposure_s| DarkEnd {
            exposure_s,
            stack,
            variance_dn2: 0.0,
            lines_dn2: 0.0,
            step_dn: 1.0,
        };
        let f = pixel_dark_currents(&end(&short, 1.0), &end(&long, 3.0), 4095.0, 0.0);
        assert_eq!(f.ordinary_dn_per_s.value(), Some(5.0));
        assert!((f.median_dn_per_s.value().unwrap() - 5.0).abs() < 1e-12 && f.outliers == 0);
    }
}
