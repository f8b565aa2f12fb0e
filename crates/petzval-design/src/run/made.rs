//! The figures of cameras as they are made, `tolerance.json`.

use std::collections::BTreeMap;

use petzval_learn::score::ScoreDescription;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{RunFolder, note_digests, read_json_if_there, write_file};
use crate::error::{DesignError, Result};

/// Random cameras of every design of a run, whose lenses are off by their tolerances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MadeMetrics {
    /// The grade of the tolerances, or their file.
    pub tolerances: String,
    /// Whether the image plane of every lens was set anew.
    pub is_refocused: bool,
    /// Whether development knew the lens of every camera; if not, it took it for the lens as drawn.
    #[serde(default = "known")]
    pub is_calibrated: bool,
    /// How many tolerances were left out, because the lens would lose its symmetry.
    pub left_out: usize,
    /// How many compensators were left out for the same reason.
    #[serde(default)]
    pub compensators_left_out: usize,
    /// Seed of the random lenses.
    pub seed: u64,
    /// Cameras of each design.
    pub trials: usize,
    /// Held-out pictures on which each was scored.
    pub pictures: usize,
    /// The scores; without those of objects of which the pictures hold none.
    pub scores: Vec<ScoreDescription>,
    /// What a camera has to reach in each score.
    pub limits: BTreeMap<String, f64>,
    /// One row a design.
    pub rows: Vec<MadeRow>,
}

/// What cameras were before there was a choice.
fn known() -> bool {
    true
}

/// Random cameras of one design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MadeRow {
    /// Name of the variant.
    pub camera: String,
    /// Each of [`MadeMetrics::scores`].
    pub scores: BTreeMap<String, MadeFigures>,
    /// The scores of each camera; none for one without an image, or whose lens cannot be built.
    pub trials: Vec<Option<BTreeMap<String, f64>>>,
    /// How many lenses cannot be built.
    #[serde(default)]
    pub unbuildable: usize,
}

/// A score of random cameras of one design.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MadeFigures {
    /// That of the camera as drawn, on the same pictures; none if it sees no object of this kind.
    pub drawn: Option<f64>,
    /// Mean over the cameras with an image; none if there are none.
    pub mean: Option<f64>,
    /// What nine in ten cameras reach: the 10th percentile of a score of which more is better; none if more than one in ten has no image.
    pub of_90_percent: Option<f64>,
    /// Share of the cameras that reach the limit, 0..1.
    pub share: f64,
}

impl MadeMetrics {
    /// Those of a run; none if it was not evaluated with tolerances.
    pub fn read(run: &RunFolder) -> Result<Option<Self>> {
        read_json_if_there(&run.tolerance())
    }

    /// Writes them into the folder of their run.
    pub fn write(&self, run: &RunFolder) -> Result<()> {
        write_file(&run.tolerance(), DesignError::json("the figures of made cameras", self)?.as_bytes())?;
        note_digests(run, &[run.tolerance()])
    }
}
