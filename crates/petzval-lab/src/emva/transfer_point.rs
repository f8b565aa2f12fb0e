//! One setting of a photon transfer: mean and temporal variance of its flat and its dark frames.

use schemars::JsonSchema;
use serde::Serialize;

use super::clamp::CLIPPED_SHARE;
use super::point::Moments;
use super::rounding::RoundingError;

/// One setting with its flat and its dark frames.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TransferPoint {
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Photons per pixel, if they are known.
    pub photons: Option<f64>,
    /// Mean of the flat frames, DN.
    pub mean_dn: f64,
    /// Its standard error, DN.
    pub mean_se_dn: f64,
    /// Temporal variance of the flat frames, DN^2.
    pub variance_dn2: f64,
    /// Its standard error, DN^2.
    pub variance_se_dn2: f64,
    /// Mean of the dark frames, DN.
    pub dark_mean_dn: f64,
    /// Its standard error, DN.
    pub dark_mean_se_dn: f64,
    /// Temporal variance of the dark frames, DN^2.
    pub dark_variance_dn2: f64,
    /// Its standard error, DN^2.
    pub dark_variance_se_dn2: f64,
    /// Distance of the digital numbers in the dark, DN.
    #[serde(skip)]
    pub dark_step_dn: f64,
    /// Part of the flat variance that whole rows share beyond what the dark frames have, if it is significant: light that flickers while a rolling
    /// shutter reads, DN^2. It is no noise of pixels, and the variance above dark is without it.
    pub row_flicker_dn2: f64,
    /// Variance of the flat samples over pixels and frames, DN^2.
    pub total_variance_dn2: f64,
    /// Share of the flat samples at the digital number where the converter clips.
    pub share_at_max: f64,
}

impl TransferPoint {
    /// Pairs flat and dark moments; `mean_difference` subtracts the variance of the frames' means (release 4), `clip_dn` is
    /// where the converter clips ([`super::samples::clip_dn`]), `dark_step_dn` the distance of the digital numbers in the dark.
    pub fn new(
        exposure_s: f64,
        photons: Option<f64>,
        flat: &Moments,
        dark: &Moments,
        mean_difference: bool,
        clip_dn: u32,
        dark_step_dn: f64,
    ) -> Self {
        let variance =
            |m: &Moments| if mean_difference { m.variance_dn2 } else { m.variance_uncorrected_dn2 };
        let point = Self {
            exposure_s,
            photons,
            mean_dn: flat.mean_dn,
            mean_se_dn: flat.mean_se_dn,
            variance_dn2: variance(flat),
            variance_se_dn2: flat.variance_se_dn2,
            dark_mean_dn: dark.mean_dn,
            dark_mean_se_dn: dark.mean_se_dn,
            dark_variance_dn2: variance(dark),
            dark_variance_se_dn2: dark.variance_se_dn2,
            dark_step_dn,
            row_flicker_dn2: 0.0,
            total_variance_dn2: flat.total_variance_dn2(),
            share_at_max: share_at(flat, clip_dn),
        };
        // Clipped samples have lost their noise, and that of rows with it.
        let row_flicker_dn2 = if point.is_clipped() { 0.0 } else { row_flicker_dn2(flat, dark) };
        Self { row_flicker_dn2, ..point }
    }

    /// Whether samples are clipped: mean and noise of such a point are biased.
    pub fn is_clipped(&self) -> bool {
        self.share_at_max > CLIPPED_SHARE
    }

    /// Whether most of the samples are clipped: the signal ends at the converter.
    pub fn is_full(&self) -> bool {
        self.share_at_max > FULL_SHARE
    }

    /// Signal above dark, DN.
    pub fn signal_dn(&self) -> f64 {
        self.mean_dn - self.dark_mean_dn
    }

    /// Standard error of the signal, DN.
    pub fn signal_se_dn(&self) -> f64 {
        self.mean_se_dn.hypot(self.dark_mean_se_dn)
    }

    /// Errors of the dark frames by rounding.
    pub(super) fn dark_rounding(&self) -> RoundingError {
        RoundingError::of(self.dark_variance_dn2, self.dark_step_dn)
    }

    /// Variance above dark, without the flicker of rows, DN^2.
    pub fn shot_variance_dn2(&self) -> f64 {
        self.variance_dn2 - self.dark_variance_dn2 - self.row_flicker_dn2
    }

    /// Standard error of the variance above dark, DN^2.
    pub fn shot_variance_se_dn2(&self) -> f64 {
        self.variance_se_dn2.hypot(self.dark_variance_se_dn2)
    }
}

/// Standard errors above which rows of flat frames have more noise than those of dark frames, and the least share of the variance above dark.
const FLICKER_SIGMAS: f64 = 5.0;
const LEAST_FLICKER: f64 = 0.005;

/// Temporal variance of the means of rows in flat frames, less that of their pixels and that of dark frames, DN^2; zero if it may be chance.
fn row_flicker_dn2(flat: &Moments, dark: &Moments) -> f64 {
    let of_rows = |moments: &Moments| {
        let rows = moments.line_covariances[0].filtered(&[], 1)?;
        let of_pixels = rows.pixel_share * moments.pixel_dn2();
        Some((rows.variance_dn2 - of_pixels, of_pixels, rows.standard_error_dn2 / rows.variance_dn2))
    };
    let (Some((own, of_pixels, _)), Some((of_dark, _, share))) = (of_rows(flat), of_rows(dark)) else {
        return 0.0;
    };
    // Rows of flat frames may scatter as those of dark frames do, and by what their pixels make.
    let added = own - of_dark;
    let by_pixels = 2.0_f64.sqrt() * share * of_pixels;
    let error = by_pixels.hypot(flat.lines_se_dn2()).hypot(dark.lines_se_dn2());
    // Where light adds no noise, the well is full.
    let of_light = flat.variance_dn2 - dark.variance_dn2;
    let matters = of_light > 0.0 && added > LEAST_FLICKER * of_light;
    if matters && added > FLICKER_SIGMAS * error { added } else { 0.0 }
}

/// Share of the samples at the digital number where they are clipped; zero if the mean is so far below that these are
/// stuck pixels.
fn share_at(flat: &Moments, clip_dn: u32) -> f64 {
    if flat.reaches(clip_dn) {
        flat.histogram.at(clip_dn.into()) as f64 / flat.histogram.total() as f64
    } else {
        0.0
    }
}

/// The rules that select the points of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rules {
    /// Rules of the EMVA 1288 Python library: the brightest point counts as saturated if no peak of the noise is seen.
    Library,
    /// Our rules: saturation is a peak of the noise beyond which it falls by more than chance, or a signal that no
    /// longer grows. Without saturation, all points count that are not clipped and lie on the line of the noise.
    Ours,
}

/// Share of samples at the largest digital number above which a point counts as full.
const FULL_SHARE: f64 = 0.5;

/// Share of the way to saturation that the fits of R and K take (EMVA 1288).
pub(super) const FIT_SHARE: f64 = 0.7;

/// Light of each point: photons if all are known, else exposure times.
pub fn light(points: &[TransferPoint]) -> Vec<f64> {
    let photons: Option<Vec<f64>> = points.iter().map(|p| p.photons).collect();
    photons.unwrap_or_else(|| points.iter().map(|p| p.exposure_s).collect())
}
