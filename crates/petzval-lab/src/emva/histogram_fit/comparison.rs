//! Compares captured histograms with those of the model.

use petzval_base::statistics::maximum;
use schemars::JsonSchema;
use serde::Serialize;

use super::parameter::Numbers;
use super::sample::{Sample, mean_dn};
use crate::emva::captures::Kind;
use petzval_camera::sensor::Colour;

/// Distance between a histogram and a distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct GoodnessOfFit {
    /// `sum (c - e)^2 / e` over bins of at least ten expected samples (or ten captured ones where less than one is
    /// expected), over their number minus one.
    pub reduced_chi2: f64,
    /// Number of these bins minus one.
    pub degrees_of_freedom: usize,
    /// Largest difference of the cumulative distributions (Kolmogorov-Smirnov), 0..1.
    pub kolmogorov_smirnov: f64,
    /// Half the sum of the absolute differences of the probabilities, 0..1.
    pub total_variation: f64,
}

/// A captured histogram with the expected ones before and after the fit.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct HistogramComparison {
    /// Whether light fell on the sensor.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Colour; `None` for dark frames.
    pub colour: Option<Colour>,
    /// First digital number of the three lists.
    pub first_dn: u32,
    /// Captured samples per digital number.
    pub captured: Vec<u64>,
    /// Expected samples with the parameters before the fit.
    pub expected_before: Vec<f64>,
    /// Expected samples with the fitted parameters.
    pub expected_after: Vec<f64>,
    /// Distance before the fit.
    pub before: GoodnessOfFit,
    /// Distance after the fit.
    pub after: GoodnessOfFit,
    /// Reduced chi-square of the core alone after the fit, without tails.
    pub core_reduced_chi2: f64,
    /// Degrees of freedom of the core.
    pub core_degrees_of_freedom: usize,
    /// Samples brighter than the core in excess of the model, as a share of all samples.
    pub tail_share: f64,
    /// Standard error of that share.
    pub tail_share_se: f64,
    /// Mean of the samples in the tail above the mean of the histogram, DN.
    pub tail_mean_dn: f64,
}

/// Standard errors by which a tail must exceed the model.
const TAIL_SIGMAS: f64 = 5.0;
/// Share of the pixels above which a tail gets a warning.
const TAIL_SHARE: f64 = 1e-5;

impl HistogramComparison {
    /// Whether dark frames have a tail of bright pixels that noise does not explain.
    pub fn has_dark_tail(&self) -> bool {
        let is_significant = self.tail_share > TAIL_SIGMAS * self.tail_share_se;
        self.kind == Kind::Dark && is_significant && self.tail_share > TAIL_SHARE
    }

    /// The setting in words.
    pub fn label(&self) -> String {
        let (gain, ms) = (self.linear_gain, 1e3 * self.exposure_s);
        let colour = self.colour.map_or(String::new(), |c| format!(", {c:?}").to_lowercase());
        let kind = if self.kind == Kind::Flat { "flat" } else { "dark" };
        format!("{kind}, gain {gain}, {ms} ms{colour}")
    }
}

/// Compares a captured histogram with the distributions of the parameters before and after the fit.
pub(super) fn compare(
    sample: &Sample<'_>,
    full_well_e: f64,
    max_dn: u32,
    before: &Numbers,
    after: &Numbers,
) -> HistogramComparison {
    let h = sample.histogram;
    let n = h.counts.total() as f64;
    let [p_before, p_after] =
        [before, after].map(|numbers| sample.distribution(full_well_e, max_dn, numbers));
    // Cover the captured samples, and the digital numbers at which the model expects half a sample or more.
    let visible = |p: &f64| n * p >= 0.5;
    let first = (h.counts.first_dn as usize).min(p_after.iter().position(visible).unwrap_or(usize::MAX));
    let last = (h.counts.last_dn() as usize).max(p_after.iter().rposition(visible).unwrap_or(0));
    let captured: Vec<u64> = (first..=last).map(|y| h.counts.at(y as i64)).collect();
    let expected = |p: &[f64]| p[first..=last].iter().map(|p| n * p).collect::<Vec<f64>>();
    let (expected_before, expected_after) = (expected(&p_before), expected(&p_after));

    // Compare the core alone, without tails.
    let (low, high) = (sample.core.0 as usize, sample.core.1 as usize);
    let within: Vec<u64> = (low..=high).map(|y| h.counts.at(y as i64)).collect();
    let n_within = within.iter().sum::<u64>() as f64;
    let share = p_after[low..=high].iter().sum::<f64>().max(1e-300);
    let expected_within: Vec<f64> = p_after[low..=high].iter().map(|p| n_within * p / share).collect();

    // Measure the tail: samples brighter than the core, in excess of the model.
    let beyond = high + 1;
    let in_tail: Vec<(f64, f64)> =
        (beyond..=last.max(beyond)).map(|y| (y as f64, h.counts.at(y as i64) as f64)).collect();
    let (found, mean) = (in_tail.iter().map(|(_, c)| c).sum::<f64>(), mean_dn(&h.counts));
    let explained: f64 = n * p_after.iter().skip(beyond).sum::<f64>();
    let above: f64 = in_tail.iter().map(|(y, c)| (y - mean) * c).sum();
    let core = goodness(&within, &expected_within, n_within);
    HistogramComparison {
        kind: h.kind,
        linear_gain: h.linear_gain,
        exposure_s: h.exposure_s,
        colour: h.colour,
        first_dn: first as u32,
        before: goodness(&captured, &expected_before, n),
        after: goodness(&captured, &expected_after, n),
        core_reduced_chi2: core.reduced_chi2,
        core_degrees_of_freedom: core.degrees_of_freedom,
        captured,
        expected_before,
        expected_after,
        tail_share: (found - explained) / n,
        tail_share_se: (explained + 1.0).sqrt() / n,
        tail_mean_dn: if found > 0.0 { above / found } else { 0.0 },
    }
}

/// Compares counts with expected counts of the same digital numbers; `n` samples in all.
pub fn goodness(captured: &[u64], expected: &[f64], n: f64) -> GoodnessOfFit {
    let mut bins: Vec<(f64, f64)> = Vec::new();
    let (mut c_bin, mut e_bin) = (0.0, 0.0);
    let (mut c_sum, mut e_sum, mut ks, mut variation) = (0.0, 0.0, 0.0_f64, 0.0);
    for (c, e) in captured.iter().map(|c| *c as f64).zip(expected) {
        c_sum += c;
        e_sum += e;
        ks = maximum(ks, (c_sum - e_sum).abs() / n);
        variation += 0.5 * (c - e).abs() / n;
        // Merge neighbouring digital numbers until a bin has ten expected samples, or ten captured ones where the model
        // has none.
        c_bin += c;
        e_bin += e;
        if e_bin >= 10.0 || (c_bin >= 10.0 && e_bin < 1.0) {
            bins.push((c_bin, e_bin));
            (c_bin, e_bin) = (0.0, 0.0);
        }
    }
    // Add the remainder to the last bin: alone it would be divided by a tiny expected count.
    match bins.last_mut() {
        Some((c, e)) => (*c, *e) = (*c + c_bin, *e + e_bin),
        None => bins.push((c_bin, e_bin)),
    }
    let chi2: f64 = bins.iter().map(|(c, e)| (c - e).powi(2) / e.max(1e-3)).sum();
    let degrees_of_freedom = bins.len().saturating_sub(1);
    let reduced_chi2 = chi2 / degrees_of_freedom.max(1) as f64;
    GoodnessOfFit { reduced_chi2, degrees_of_freedom, kolmogorov_smirnov: ks, total_variation: variation }
}
