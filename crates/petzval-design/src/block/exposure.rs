//! The exposure as a block: time and gain of the sensor, within ranges that the experiment states.
//!
//! The scene gives its light at a rate: a camera that is exposed for twice as long collects twice the electrons, and as much more of them as dark
//! current. What limits the time from above is the range that is stated, because nothing moves in a photograph; and saturation, which the
//! frames have. Gain lifts the signal above the steps of the converter and saturates it earlier.

use std::collections::BTreeMap;

use petzval_base::parameter::{Parameter, Scale};
use petzval_base::random::{Stage, Stream};
use petzval_camera::sensor::Exposure;
use serde::{Deserialize, Serialize};

use super::{Batch, Block, BlockState, Descent, as_json, losses_of, parsed, read_places};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, ExposureSetting, StepMethod, StepRule};

const PLACES: &str = "places.json";
const PROGRESS: &str = "progress.json";
const OTHER_SETTINGS: &str = "other settings of the exposure move; has the experiment been changed?";

/// Half the distance of the two points of a difference, as a share of a range. The frames of both have the same random numbers, so the
/// difference is not one of noise.
const HALF_STEP: f64 = 0.02;

impl ExposureSetting {
    /// Its value in an exposure.
    fn read(self, exposure: &Exposure) -> f64 {
        f64::from(match self {
            Self::Time => exposure.time_s,
            Self::Gain => exposure.linear_gain,
        })
    }

    /// What it is, with a range.
    fn about(self, [min, max]: [f64; 2]) -> Parameter {
        let (name, unit) = match self {
            Self::Time => ("exposure.time_s", "s"),
            Self::Gain => ("exposure.linear_gain", ""),
        };
        let (scale, default, sentence, hint) = (Scale::Log, Vec::new(), String::new(), "");
        Parameter { name, unit, min, max, scale, default, sentence, hint }
    }
}

/// Time and gain on their way. Without any that moves, the exposure is the stated one.
pub struct ExposureBlock {
    stated: Exposure,
    varied: Vec<(ExposureSetting, Parameter)>,
    /// Where the varied ones lie in their ranges, by equal ratios, 0..1.
    places: Vec<f64>,
    progress: Progress,
}

/// How far a stage has come, beside the places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    #[serde(flatten)]
    way: Descent,
    /// The places that the last random step drew, which are forgotten when the stage ends.
    #[serde(default)]
    drawn: Option<Vec<f64>>,
}

impl Progress {
    fn from(places: &[f64]) -> Self {
        Self { way: Descent::from(places), drawn: None }
    }
}

impl ExposureBlock {
    /// An exposure of which some settings may move, each within a range that holds its stated value.
    pub fn new(stated: Exposure, varied: impl IntoIterator<Item = (ExposureSetting, [f64; 2])>) -> Self {
        let varied: Vec<_> =
            varied.into_iter().map(|(setting, range)| (setting, setting.about(range))).collect();
        let place = |(setting, about): &(ExposureSetting, Parameter)| about.unit_of(setting.read(&stated));
        let places: Vec<f64> = varied.iter().map(place).collect();
        let progress = Progress::from(&places);
        Self { stated, varied, places, progress }
    }

    /// The exposure behind the lens for which it is stated.
    pub fn exposure(&self) -> Exposure {
        self.at(&self.places)
    }

    /// The exposure in work: as it stands, or as the last random step of the stage drew it.
    pub fn exposure_in_work(&self) -> Exposure {
        self.at(self.progress.drawn.as_ref().unwrap_or(&self.places))
    }

    /// Draws places evenly around those at the start of the stage, as far as a share of the way to the ends of their ranges. They follow from
    /// the seed and the number of the batch alone.
    fn draw(&mut self, batch: &Batch, reach: f64) {
        let number = batch.number();
        let stream = Stream::new(batch.noise.seed, number, Stage::Exposure);
        let place = |(k, place): (usize, &f64)| place + reach * (stream.uniforms(k as u32, 0)[0] - place);
        self.progress.drawn = Some(self.places.iter().enumerate().map(place).collect());
    }

    /// The exposure where the varied settings lie at some places. White has as many more electrons as it is exposed for longer.
    fn at(&self, places: &[f64]) -> Exposure {
        let mut exposure = self.stated;
        for ((setting, about), place) in self.varied.iter().zip(places) {
            let value = about.value_at(*place) as f32;
            match setting {
                ExposureSetting::Time => exposure.time_s = value,
                ExposureSetting::Gain => exposure.linear_gain = value,
            }
        }
        exposure.white_e = self.stated.white_e * (exposure.time_s / self.stated.time_s);
        exposure
    }

    /// The settings that may move: each with its stated value, and its value now.
    pub fn changes(&self) -> impl Iterator<Item = (&Parameter, f64, f64)> {
        let now = self.exposure();
        self.varied
            .iter()
            .map(move |(setting, about)| (about, setting.read(&self.stated), setting.read(&now)))
    }

    /// Losses at the present settings, and the derivatives of the batch's loss by the places, from central differences.
    fn gradient(&self, batch: &Batch) -> Result<(BTreeMap<String, f64>, Vec<f64>)> {
        let losses = |places: &[f64]| {
            let camera = batch.camera.exposed_as(&self.at(places));
            losses_of(batch, &camera, batch.shots)
        };
        let slope = |k: usize| {
            let [low, high] = [-HALF_STEP, HALF_STEP].map(|off| (self.places[k] + off).clamp(0.0, 1.0));
            let total = |place: f64| {
                let mut places = self.places.clone();
                places[k] = place;
                Ok::<_, DesignError>(losses(&places)?["total"])
            };
            Ok((total(high)? - total(low)?) / (high - low))
        };
        let slopes = (0..self.places.len()).map(slope).collect::<Result<_>>()?;
        Ok((losses(&self.places)?, slopes))
    }
}

impl Block for ExposureBlock {
    fn name(&self) -> BlockName {
        BlockName::Exposure
    }

    fn free_numbers(&self) -> usize {
        self.places.len()
    }

    fn begin_stage(&mut self, _: bool) {
        self.progress = Progress::from(&self.places);
    }

    fn step(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        if rule.method == StepMethod::Random {
            self.draw(batch, rule.rate);
            return Ok(BTreeMap::new());
        }
        let (losses, gradient) = self.gradient(batch)?;
        self.progress.way.step_within_ranges(&mut self.places, &gradient, rule);
        Ok(losses)
    }

    fn is_finite(&self) -> bool {
        self.places.iter().all(|p| p.is_finite())
    }

    fn save_numbers(&self) -> Result<BlockState> {
        as_json(PLACES, "the exposure", &self.places)
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        self.places = read_places(state, PLACES, self.places.len(), OTHER_SETTINGS)?;
        Ok(())
    }

    fn save_progress(&self) -> Result<BlockState> {
        as_json(PROGRESS, "the moments of the exposure", &self.progress)
    }

    fn load_progress(&mut self, state: &BlockState) -> Result<(), String> {
        let progress: Progress = parsed(state, PROGRESS)?;
        let count = self.places.len();
        if !progress.way.fits(count) || progress.drawn.as_ref().is_some_and(|places| places.len() != count) {
            return Err(format!("{PROGRESS}: {OTHER_SETTINGS}"));
        }
        self.progress = progress;
        Ok(())
    }
}
