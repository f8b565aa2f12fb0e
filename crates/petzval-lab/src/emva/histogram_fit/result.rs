//! Result of the fit to the histograms.

use petzval_base::statistics::maximum;
use schemars::JsonSchema;
use serde::Serialize;

use super::comparison::HistogramComparison;
use super::parameter::ModelParameters;
use crate::emva::goodness::{ALPHA, FitTest, Verdict, chi2_beyond};
use crate::emva::measured::Measured;

/// Electrons per unit of light in a green (or clear) pixel.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LightLevel {
    /// Linear gain of the points.
    pub linear_gain: f64,
    /// Electrons per photon if photons are known, else per second; electrons of a single point if neither states its light.
    pub electrons: Measured,
}

/// Result of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct HistogramFit {
    /// Parameters before.
    pub start: ModelParameters,
    /// Parameters after.
    pub fitted: ModelParameters,
    /// K with its standard error, DN/e-.
    pub gain_dn_per_e: Measured,
    /// mu_r, e-.
    pub read_noise_mean_e: Measured,
    /// BL + mu_el, DN.
    pub dark_offset_dn: Measured,
    /// sigma_el, DN.
    pub electronics_noise_dn: Measured,
    /// alpha.
    pub red_over_green: Measured,
    /// beta.
    pub blue_over_green: Measured,
    /// `sqrt(sigma_r^2 + DSNU^2)`: the noise of the dark histograms, e-.
    pub dark_noise_e: Measured,
    /// sigma_r, e-: from temporal noise if it is known, else including DSNU.
    pub read_noise_e: Measured,
    /// DSNU, e-: the width of the histograms beyond temporal noise. The error is an upper bound, because both come from
    /// the same frames.
    pub dsnu_e: Measured,
    /// PRNU, including the unevenness of the light, percent.
    pub prnu_percent: Measured,
    /// mu_I, e-/s.
    pub dark_current_e_per_s: Measured,
    /// Light levels.
    pub light: Vec<LightLevel>,
    /// Steps taken.
    pub steps: usize,
    /// Whether the last step was smaller than a thousandth of the standard errors.
    pub converged: bool,
    /// Histograms that were left out: clipped, at the full well, or beyond the range of photon transfer.
    pub left_out: usize,
    /// Whether the model describes the cores of all histograms together.
    pub test: FitTest,
    /// Reasons to doubt the fit.
    #[serde(skip)]
    pub flags: FitFlags,
    /// Every histogram that was fitted.
    pub histograms: Vec<HistogramComparison>,
}

/// Reasons to doubt a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FitFlags {
    /// It did not converge.
    pub is_stopped: bool,
    /// The model does not describe the histograms.
    pub is_poor: bool,
    /// The histograms do not determine all parameters.
    pub is_ambiguous: bool,
}

impl HistogramFit {
    /// Whether the fit converged and describes the histograms: standard errors are valid only if true.
    pub fn is_sound(&self) -> bool {
        !self.flags.is_stopped && !self.flags.is_poor
    }
}

/// Mean reduced chi-square of the cores above which the model does not describe the histograms. Fixed differences between pixels count
/// twice in two frames, which alone gives up to 2.
const POOR_MEAN: f64 = 2.0;
/// Reduced chi-square of the worst core above which the model does not describe the histograms.
const POOR_WORST: f64 = 5.0;
/// Mean reduced chi-square of the cores.
pub fn mean_core_chi2(histograms: &[HistogramComparison]) -> f64 {
    histograms.iter().map(|h| h.core_reduced_chi2).sum::<f64>() / histograms.len().max(1) as f64
}

/// Chi-squared of all cores together. `parameters` were fitted. Fixed differences between pixels count twice in two frames, which raises
/// it. The standard errors are then too small by its root.
pub fn test_of(histograms: &[HistogramComparison], parameters: usize, is_poor: bool) -> FitTest {
    let bins: usize = histograms.iter().map(|h| h.core_degrees_of_freedom).sum();
    let chi2: f64 = histograms.iter().map(|h| h.core_reduced_chi2 * h.core_degrees_of_freedom as f64).sum();
    let degrees_of_freedom = bins.saturating_sub(parameters);
    let p_value = chi2_beyond(chi2, degrees_of_freedom);
    FitTest {
        reduced_chi2: chi2 / degrees_of_freedom.max(1) as f64,
        p_value,
        verdict: match p_value < ALPHA {
            _ if degrees_of_freedom == 0 => Verdict::Untested,
            _ if is_poor => Verdict::Withdrawn,
            true => Verdict::Widened,
            false => Verdict::Holds,
        },
        ..FitTest::untested(bins + histograms.len(), degrees_of_freedom)
    }
}

/// Whether the model describes the cores of the histograms.
pub fn describes(histograms: &[HistogramComparison]) -> bool {
    let worst = histograms.iter().map(|h| h.core_reduced_chi2).fold(0.0, maximum);
    mean_core_chi2(histograms) <= POOR_MEAN && worst <= POOR_WORST
}
