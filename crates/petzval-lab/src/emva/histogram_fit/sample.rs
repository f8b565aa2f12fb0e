//! The histograms of the fit: their cores, their light levels, and the parameters that they determine.

use super::parameter::{ModelParameters, Numbers, Parameter};
use crate::emva::captures::Kind;
use crate::emva::counts::{Counts, PointHistogram};
use crate::emva::pmf::{Response, digital_numbers};
use petzval_camera::sensor::Colour;

/// Half width of the core of a histogram in standard deviations.
const CORE_SIGMAS: f64 = 4.0;
/// More electrons than any pixel holds; steps beyond are refused.
const MOST_ELECTRONS: f64 = 1e8;

/// One histogram of the fit.
pub struct Sample<'a> {
    /// The captured histogram.
    pub histogram: &'a PointHistogram,
    /// Its light level, and its light in units of the level; `None` in the dark.
    pub light: Option<(Parameter, f64)>,
    /// First and last digital number of the core.
    pub core: (u32, u32),
}

impl Sample<'_> {
    /// Mean electrons of light.
    pub fn electrons(&self, numbers: &Numbers) -> f64 {
        self.light.map_or(0.0, |(level, unit)| numbers[level] * unit * ratio(numbers, self.histogram.colour))
    }

    /// The parameters on which the distribution of its digital numbers depends.
    pub fn parameters(&self) -> Vec<Parameter> {
        let own_ratio = ratio_of(self.histogram.colour);
        let depends = |p: &Parameter| match p {
            Parameter::RedOverGreen | Parameter::BlueOverGreen => {
                self.light.is_some() && own_ratio == Some(*p)
            }
            Parameter::PrnuSquared => self.light.is_some(),
            _ => true,
        };
        Parameter::shared().filter(depends).chain(self.light.map(|(level, _)| level)).collect()
    }

    /// Probabilities of the digital numbers `0..=max_dn` under the parameters.
    pub fn distribution(&self, full_well_e: f64, max_dn: u32, numbers: &Numbers) -> Vec<f64> {
        let light_e = self.electrons(numbers);
        let response = Response {
            gain_dn_per_e: numbers[Parameter::Gain] * self.histogram.linear_gain,
            read_noise_mean_e: numbers[Parameter::ReadNoiseMean],
            read_noise_e: numbers[Parameter::DarkNoise],
            offset_dn: numbers[Parameter::DarkOffset] + self.histogram.black_shift_dn,
            electronics_noise_dn: numbers[Parameter::ElectronicsNoise],
            pattern_variance_e2: numbers[Parameter::PrnuSquared] * light_e * light_e,
            full_well_e,
            max_dn,
        };
        let dark_e = numbers[Parameter::DarkCurrent] * self.histogram.exposure_s;
        digital_numbers(light_e + dark_e, &response)
    }
}

/// Whether a histogram can be fitted: it lies within the range of photon transfer, and its core is clipped neither by the
/// converter nor by the full well. Only the core counts, because the extremes are random.
pub fn is_usable(h: &PointHistogram, start: &ModelParameters, max_dn: u32) -> bool {
    let (low, high) = core(&h.counts);
    let offset_dn = start.dark_offset_dn + h.black_shift_dn;
    let electrons =
        (f64::from(high) - offset_dn) / (start.gain_dn_per_e * h.linear_gain) - start.read_noise_mean_e;
    let is_clipped_at_zero = low == 0;
    let is_clipped_at_max = high >= max_dn;
    let is_below_full = h.kind == Kind::Dark || electrons < start.full_well_e;
    h.counts.total() > 0 && h.in_range && !is_clipped_at_zero && !is_clipped_at_max && is_below_full
}

/// The samples, the parameters to start from, and the linear gain of each light level. `None` without histograms.
pub fn arrange<'a>(
    start: &ModelParameters,
    histograms: &[&'a PointHistogram],
) -> Option<(Vec<Sample<'a>>, Numbers, Vec<f64>)> {
    let mut numbers = Numbers::of(start);
    // Points of one gain share a light level if their exposure times or photons give the ratio of their light. The
    // colours of a point always share one.
    let mut levels: Vec<((f64, Option<usize>), Parameter)> = Vec::new();
    let mut samples = Vec::new();
    for histogram in histograms {
        let light = (histogram.kind == Kind::Flat).then(|| {
            // The unit of light: photons if all points of the gain state them, else seconds. The two are not comparable.
            let of_gain =
                |h: &&&PointHistogram| h.kind == Kind::Flat && h.linear_gain == histogram.linear_gain;
            let by_photons = histograms.iter().filter(of_gain).all(|h| h.photons.is_some());
            let stated = |h: &PointHistogram| h.photons.filter(|_| by_photons).unwrap_or(h.exposure_s);
            let unit = stated(histogram).max(1e-12);

            // Points whose stated light is the same have levels of their own.
            let is_twin = |h: &&&PointHistogram| {
                of_gain(h) && h.colour == histogram.colour && stated(h) == stated(histogram)
            };
            let is_alone = histograms.iter().filter(is_twin).count() > 1;
            let key = (histogram.linear_gain, is_alone.then_some(histogram.point));

            // A new level starts from the mean of the histogram.
            let known = levels.iter().find(|(k, _)| *k == key).map(|(_, level)| *level);
            let level = known.unwrap_or_else(|| {
                let mean = mean_dn(&histogram.counts);
                let offset_dn = start.dark_offset_dn + histogram.black_shift_dn;
                let e = (mean - offset_dn) / (start.gain_dn_per_e * histogram.linear_gain)
                    - start.read_noise_mean_e
                    - start.dark_current_e_per_s * histogram.exposure_s;
                let ratio = ratio(&numbers, histogram.colour);
                let level = numbers.push_light(e.max(1.0) / (unit * ratio));
                levels.push((key, level));
                level
            });
            (level, unit)
        });
        samples.push(Sample { histogram, light, core: core(&histogram.counts) });
    }
    let gains = levels.iter().map(|((gain, _), _)| *gain).collect();
    (!samples.is_empty()).then_some((samples, numbers, gains))
}

/// The parameter that is the signal of a colour over that of green; `None` for green and clear pixels.
fn ratio_of(colour: Option<Colour>) -> Option<Parameter> {
    match colour {
        Some(Colour::Red) => Some(Parameter::RedOverGreen),
        Some(Colour::Blue) => Some(Parameter::BlueOverGreen),
        _ => None,
    }
}

/// Signal of a colour over that of green.
fn ratio(numbers: &Numbers, colour: Option<Colour>) -> f64 {
    ratio_of(colour).map_or(1.0, |p| numbers[p])
}

/// Mean of a histogram, DN.
pub fn mean_dn(counts: &Counts) -> f64 {
    let sum: f64 = counts.counts.iter().enumerate().map(|(i, c)| i as f64 * *c as f64).sum();
    f64::from(counts.first_dn) + sum / counts.total().max(1) as f64
}

/// Median +- a number of standard deviations; the standard deviation is half the distance of the 16 % and 84 % quantiles.
fn core(counts: &Counts) -> (u32, u32) {
    let total = counts.total() as f64;
    let quantile = |share: f64| {
        let mut below = 0.0;
        for (i, c) in counts.counts.iter().enumerate() {
            // Spread the samples of a bin evenly over it.
            if below + *c as f64 >= share * total {
                return f64::from(counts.first_dn) + i as f64 - 0.5
                    + (share * total - below) / (*c as f64).max(1.0);
            }
            below += *c as f64;
        }
        f64::from(counts.last_dn())
    };
    let (median, sigma) = (quantile(0.5), 0.5 * (quantile(0.8413) - quantile(0.1587)));
    let reach = CORE_SIGMAS * sigma.max(0.5);
    // Do not cut the limits to the captured range: the extremes are random, and the noise would come out too small.
    ((median - reach).floor().max(0.0) as u32, (median + reach).ceil() as u32)
}

/// Parameters that the histograms determine; the others are held.
pub fn free_parameters(samples: &[Sample<'_>], numbers: &Numbers) -> Vec<Parameter> {
    let several = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.dedup();
        values.len() > 1
    };
    let has = |colour| samples.iter().any(|s| s.histogram.colour == Some(colour));
    let has_light = samples.iter().any(|s| s.light.is_some());
    let several_gains = several(samples.iter().map(|s| s.histogram.linear_gain).collect());
    let dark = samples.iter().filter(|s| s.light.is_none());
    let several_times = several(dark.map(|s| s.histogram.exposure_s).collect());
    let lights: Vec<f64> =
        samples.iter().filter(|s| s.light.is_some()).map(|s| s.electrons(numbers)).collect();
    let brightest = lights.iter().copied().fold(0.0, f64::max);

    let is_free = |p: &Parameter| match p {
        Parameter::Gain => has_light,
        Parameter::ReadNoiseMean | Parameter::DarkNoise => several_gains,
        Parameter::DarkOffset | Parameter::ElectronicsNoise | Parameter::Light(_) => true,
        Parameter::RedOverGreen => has(Colour::Green) && has(Colour::Red),
        Parameter::BlueOverGreen => has(Colour::Green) && has(Colour::Blue),
        Parameter::DarkCurrent => several_times && numbers[*p] > 0.0,
        // PRNU needs light levels that differ by a factor of two.
        Parameter::PrnuSquared => lights.iter().any(|light| 2.0 * light < brightest),
    };
    numbers.parameters().filter(is_free).collect()
}

/// Whether every parameter is within its bounds, and no histogram has more light than pixels hold.
pub fn is_plausible(samples: &[Sample<'_>], numbers: &Numbers) -> bool {
    numbers.parameters().all(|p| p.allows(numbers[p]))
        && samples.iter().all(|s| s.electrons(numbers) < MOST_ELECTRONS)
}
