//! Request and response of an optimisation.

use std::path::PathBuf;
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::figures::Figures;
use super::goal::Goal;
use crate::error::JobError;

/// Iterations of a descent, if nobody says how many.
pub(super) const ITERATIONS: usize = 200;

/// Rounds of a search, if nobody says how many.
pub(super) const ROUNDS: u64 = 10;

/// An optimisation that begins, or one that is continued, and how far it goes in this call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Where it starts.
    pub start: Start,
    /// Iterations of a descent: 200 if none are given. One that is continued goes on to those that it began with, or takes as many more as
    /// are given here.
    #[serde(default)]
    pub iterations: Option<usize>,
    /// Rounds of a search, 1 at least: 10 if none are given; the same rounds give the same lenses on any machine. One that is continued goes
    /// on to those that it began with, or takes as many more as are given here.
    #[serde(default)]
    pub rounds: Option<u64>,
    /// Stops a search after the round in which so many seconds have passed, if that is before its last round.
    pub seconds: Option<f64>,
    /// Whether to search again, for as many rounds, with each of some further requirements, to see what each costs.
    #[serde(default)]
    pub trade: bool,
}

/// Where an optimisation starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// At a lens.
    New {
        /// Lens file, or a built-in name. Its variables move; a lens that names none gets its curvatures and gaps.
        lens: String,
        /// Folder for the lenses and the history; it must not hold an optimisation.
        out: PathBuf,
        /// What the lens has to be.
        #[serde(default)]
        goal: Box<Goal>,
        /// Whether to search the whole of the bounds, not only downhill from the lens.
        #[serde(default)]
        global: bool,
        /// Seed of the search.
        #[serde(default = "crate::usual::seed")]
        seed: u64,
    },
    /// Where the optimisation in a folder ended, with its goal.
    Resume {
        /// The folder.
        folder: PathBuf,
        /// Forget every step after this one first.
        rewind: Option<usize>,
    },
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// The lenses.
    pub found: Found,
    /// Field angles of [`Figures::rms_spot_um`], degrees.
    pub fields_deg: Vec<f64>,
}

/// The lens at the start and the best one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The lens at the start; `None` if its rays do not reach the image.
    pub start: Option<Figures>,
    /// The best lens.
    pub best: Figures,
    /// Variables of the best lens that stand on a bound.
    #[serde(default)]
    pub at_bounds: Vec<String>,
    /// Steps of the history.
    pub steps: usize,
    /// What further requirements cost; empty unless the request has `trade`.
    pub trades: Vec<Trade>,
    /// File of the best lens.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub lens: PathBuf,
    /// The page that shows the lens before and after.
    #[serde(default)]
    pub page: PathBuf,
}

/// The best lens of a search with a further requirement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// The requirement, in words.
    pub requirement: String,
    /// Mean over the fields of the RMS spot radius, um.
    pub mean_rms_um: f64,
    /// How many limits are violated.
    pub violations: usize,
}

impl Request {
    pub(super) fn check(&self) -> Result<(), JobError> {
        if self.rounds == Some(0) {
            return Err(JobError::setting("rounds", 0, "out of range", "1 or more; 10 is usual"));
        }
        match self.seconds.filter(|s| !(*s > 0.0 && *s < 1e7)) {
            Some(s) => Err(JobError::setting("seconds", s, "out of range", "a week is 604800")),
            None => Ok(()),
        }
    }

    pub(super) fn is_out_of_time(&self, began: Instant) -> bool {
        self.seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds)
    }
}
