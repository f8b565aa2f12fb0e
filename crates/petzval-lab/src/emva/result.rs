//! The result of a characterisation: the numbers of each gain and colour, and of all gains together.

use schemars::JsonSchema;
use serde::Serialize;

use super::captures::SensorFacts;
use super::counts::PointHistogram;
use super::dark::DarkSeries;
use super::figures::{Figure, of_light};
use super::high_pass::HighPass;
use super::histogram_fit::HistogramFit;
use super::hot_pixels::PixelDarkCurrents;
use super::joint::JointFit;
use super::line_noise::LineNoise;
use super::measured::{Measured, Unresolved};
use super::spatial::Spatial;
use super::transfer::PhotonTransfer;
use super::transfer_point::TransferPoint;
use super::warning::Warning;
use petzval_camera::sensor::Colour;

/// Options of the evaluation of a series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Options {
    /// The filter before non-uniformity (of the corrected values).
    pub high_pass: HighPass,
    /// Subtract the variance of the frames' means from the temporal variance (release 4). Without it, Eq. 6 of Tseng et
    /// al. holds.
    pub mean_difference: bool,
    /// Fit the remaining parameters of the model to the histograms.
    pub fit_histograms: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { high_pass: HighPass::R4, mean_difference: true, fit_histograms: false }
    }
}

/// The characterisation of a series of captures.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Characterization {
    /// Facts of the sensor that the list states.
    pub sensor: SensorFacts,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Options of the evaluation.
    pub options: Options,
    /// Warnings about the captures.
    #[schemars(with = "Vec<String>")]
    pub warnings: Vec<Warning>,
    /// Each linear gain, ascending.
    pub gains: Vec<GainResult>,
    /// All gains together.
    pub joint: JointFit,
    /// The fit to the histograms, if it was requested and possible.
    pub histogram_fit: Option<HistogramFit>,
    /// Captured histograms of the points of two frames; too long for the results file.
    #[serde(skip)]
    pub histograms: Vec<PointHistogram>,
}

/// One linear gain.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct GainResult {
    /// Linear gain g.
    pub linear_gain: f64,
    /// Dark series over the pixels that answer light or exposure time.
    pub dark: DarkSeries,
    /// Temporal noise of rows and columns in the dark frames.
    pub line_noise: LineNoise,
    /// Dark currents pixel by pixel, if there are two different dark exposure times.
    pub pixel_dark_currents: Option<PixelDarkCurrents>,
    /// Each colour; mono sensors have the one colour `clear`. Empty if the gain has no flat points.
    pub channels: Vec<ChannelResult>,
}

/// One colour at one gain.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ChannelResult {
    /// Colour.
    pub colour: Colour,
    /// Points with flat and dark frames, light ascending.
    pub points: Vec<TransferPoint>,
    /// Photon transfer by our rules.
    pub transfer: PhotonTransfer,
    /// Photon transfer by the rules of the EMVA 1288 Python library.
    pub library_transfer: PhotonTransfer,
    /// Non-uniformity, if there are stacks.
    pub spatial: Option<Spatial>,
    /// Figures under the names of the library.
    pub figures: Vec<Figure>,
}

impl GainResult {
    /// The colour that saturates, of several the one whose saturation capacity has the least error: pixels of all colours are full at the same charge, and
    /// the most sensitive ones reach it first.
    pub fn saturated_channel(&self) -> Option<&ChannelResult> {
        let error = |c: &&ChannelResult| {
            let capacity = c.figure("u_e_sat")?.best();
            capacity.value().map(|_| capacity.standard_error().unwrap_or(f64::INFINITY))
        };
        let known = self.channels.iter().filter(|c| error(c).is_some());
        known.min_by(|a, b| error(a).unwrap_or(f64::INFINITY).total_cmp(&error(b).unwrap_or(f64::INFINITY)))
    }
}

impl ChannelResult {
    /// A figure by its name.
    pub fn figure(&self, name: &str) -> Option<&Figure> {
        self.figures.iter().find(|f| f.name == name)
    }

    /// A figure that is proportional to the mean signal of all pixels (R, QE, u_e_sat), for the pixels that answer light; `None` if all do.
    /// K, a ratio of the variance and the mean of all pixels, is not off by pixels without either.
    pub fn without_defects(&self, name: &str) -> Option<Measured> {
        let bias = self.spatial.as_ref()?.signal_bias.filter(|bias| bias.is_finite() && *bias > -1.0)?;
        Some(self.figure(name)?.best().scale(1.0 / (1.0 + bias)))
    }

    /// DSNU, e-, and PRNU, %, with the pixels that do not answer light, which the figures leave out; `None` if there are none, or if
    /// a filter in the camera spread them.
    pub fn non_uniformity_with_defects(&self) -> Option<[Measured; 2]> {
        if self.transfer.shared_noise.is_some_and(|shared| shared.is_spatial() && shared.is_far()) {
            return None;
        }
        let spatial = self.spatial.as_ref()?;
        let [flat, dark] = spatial.components_with_defects.as_ref()?;
        let [light, ..] = of_light(flat, dark, spatial.shared);
        let gain = self.figure("K").map_or(Measured::none(Unresolved::FollowsFrom("K")), Figure::best);
        let root = |variance: Measured| variance.if_above_noise().root();
        let percent_per_dn = 100.0 / (spatial.flat.mean_dn - spatial.dark.mean_dn);
        Some([root(dark.total).over(gain), root(light).scale(percent_per_dn)])
    }
}
