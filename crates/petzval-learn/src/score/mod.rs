//! How good a picture is, how well objects are [detected](detection) in it, and how well the classes of its pixels are [found](segmentation),
//! in the numbers that results are published in.
//!
//! A new score touches two files: its own, and the list in `standard.rs`. Runs, tables and reports show whatever
//! scores an experiment names in `scoring.scores`.

pub mod detection;
mod lpips;
mod objects;
mod psnr;
pub mod segmentation;
mod ssim;
mod standard;

pub use objects::{
    Field, ObjectScore, confusion, draws_of, judged, object_scores, range_of, range_of_difference,
};
pub use standard::{STANDARD_SCORES, leading_score, standard_scores};

use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::quality::QualityError;
use petzval_camera::tape::on_device;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::loss::LossError;

/// A finished picture beside its truth: both sRGB-encoded, 0..1.
pub struct ScoredPair {
    /// The finished picture on the device, `[1, 3, height, width]`.
    pub finished_tensor: Tensor<4>,
    /// The truth on the device, of the same shape.
    pub truth_tensor: Tensor<4>,
    /// The finished picture on the host.
    pub finished: LinearImage,
    /// The truth on the host.
    pub truth: LinearImage,
}

impl ScoredPair {
    /// A pair of sRGB-encoded pictures of one size, three planes each.
    pub fn new(finished: LinearImage, truth: LinearImage, device: &Device) -> Self {
        let [finished_tensor, truth_tensor] = [&finished, &truth].map(|picture| on_device(picture, device));
        Self { finished_tensor, truth_tensor, finished, truth }
    }
}

/// One number that says how good a picture is.
pub trait Score: Send + Sync {
    /// Key in `metrics.json` and in `scoring.scores`, with the unit if there is one: `psnr_db`.
    fn name(&self) -> &'static str;

    /// Heading of a column: `PSNR`.
    fn title(&self) -> &'static str;

    /// Unit; empty for a plain number.
    fn unit(&self) -> &'static str {
        ""
    }

    /// How it is computed, in one sentence, for the reader of a report.
    fn definition(&self) -> &'static str;

    /// Digits after the decimal point in tables.
    fn decimals(&self) -> usize;

    /// Whether a larger value is a better one.
    fn higher_is_better(&self) -> bool {
        true
    }

    /// The score of one picture, a finite number. Fails where a picture holds what is none.
    fn of(&self, pair: &ScoredPair) -> Result<f64, ScoreError>;
}

/// A score that could not be computed.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// By a network.
    #[error(transparent)]
    Loss(#[from] LossError),
    /// By a formula over pixels.
    #[error(transparent)]
    Quality(#[from] QualityError),
}

/// What a reader must know of a score.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ScoreDescription {
    /// Its key.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Unit; empty for a plain number.
    pub unit: String,
    /// How it is computed.
    pub definition: String,
    /// Digits after the decimal point in tables.
    pub decimals: usize,
    /// Whether a larger value is a better one.
    pub higher_is_better: bool,
}

impl ScoreDescription {
    /// The description of a score from 0 to 1 of which more is better.
    fn of_share(name: String, title: String, definition: String) -> Self {
        Self { name, title, unit: String::new(), definition, decimals: 4, higher_is_better: true }
    }

    /// The description of a score of which nothing but its name is known.
    pub fn of_name(name: &str) -> Self {
        Self::of_share(name.to_owned(), name.replace('_', " "), String::new())
    }

    /// The description of a score.
    pub fn of(score: &dyn Score) -> Self {
        Self {
            name: score.name().to_owned(),
            title: score.title().to_owned(),
            unit: score.unit().to_owned(),
            definition: score.definition().to_owned(),
            decimals: score.decimals(),
            higher_is_better: score.higher_is_better(),
        }
    }

    /// Title and unit: `PSNR dB`.
    pub fn heading(&self) -> String {
        format!("{} {}", self.title, self.unit).trim_end().to_owned()
    }
}
