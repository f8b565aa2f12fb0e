//! How good a picture is, in the numbers that results are published in.
//!
//! A new score touches two files: its own, and the list in `standard.rs`. Runs, tables and reports show whatever
//! scores an experiment names in `scoring.scores`.

mod lpips;
mod psnr;
mod ssim;
mod standard;

pub use standard::standard_scores;

use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::quality::QualityError;
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

/// One number that says how good a picture is.
pub trait Score {
    /// Key in `metrics.json` and in `scoring.scores`, with the unit if there is one: `psnr_db`.
    fn name(&self) -> &'static str;

    /// Heading of a column: `PSNR dB`.
    fn title(&self) -> &'static str;

    /// Digits after the decimal point in tables.
    fn decimals(&self) -> usize;

    /// Whether a larger value is a better one.
    fn higher_is_better(&self) -> bool {
        true
    }

    /// The score of one picture.
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

/// How a table shows a score.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Key of the score.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Digits after the decimal point.
    pub decimals: usize,
    /// Whether a larger value is a better one.
    pub higher_is_better: bool,
}

/// The columns of the named scores, in the order of the names. Names that are no scores are left out.
pub fn columns(scores: &[Box<dyn Score>], names: &[String]) -> Vec<Column> {
    let column = |s: &dyn Score| Column {
        name: s.name().to_owned(),
        title: s.title().to_owned(),
        decimals: s.decimals(),
        higher_is_better: s.higher_is_better(),
    };
    let find = |name: &String| scores.iter().find(|s| s.name() == name).map(|s| column(s.as_ref()));
    names.iter().filter_map(find).collect()
}
