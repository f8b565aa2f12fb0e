//! Request and response of an optimisation.

use std::path::PathBuf;
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::figures::Figures;
use super::goal::Goal;
use crate::error::Result;
use crate::input::LensInput;
use crate::range::check_ranges;

/// Iterations of a descent, if nobody says how many.
pub(super) const ITERATIONS: usize = 200;

/// Rounds of a search, if nobody says how many.
pub(super) const ROUNDS: u64 = 10;

petzval_base::parameters! {
    /// An optimisation that begins, or one that is continued, and how far it goes in this call.
    pub struct Request {
        /// Iterations of a descent: 200 if none are given. One that is continued goes on to those that it began with, or takes as many more as
        /// are given here.
        iterations: Option<usize> = None, "", 0..1_000_000_000, Linear, "200 are usual";
        /// Rounds of a search, 1 at least: 10 if none are given; the same rounds give the same lenses on any machine. One that is continued goes
        /// on to those that it began with, or takes as many more as are given here.
        rounds: Option<u64> = None, "", 1..1_000_000_000, Linear, "1 or more; 10 is usual";
        /// Stops a search after the round in which so many seconds have passed, if that is before its last round.
        seconds: Option<f64> = None, "s", 1e-6..1e7, Log, "a week is 604800";
    }
    also {
        /// Where it starts.
        start: Start = Start::default();
        /// Whether to search again, for as many rounds, with each of some further requirements, to see what each costs.
        trade: bool = false;
    }
}

/// Where an optimisation starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// At a lens.
    New {
        /// Lens: a built-in name, the path of a file, or the lens itself. Its variables move; a lens that names none gets its curvatures and gaps.
        lens: LensInput,
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

impl Default for Start {
    fn default() -> Self {
        Self::New {
            lens: LensInput::default(),
            out: PathBuf::new(),
            goal: Box::default(),
            global: false,
            seed: crate::usual::seed(),
        }
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The lenses.
    pub found: Found,
    /// Field angles of [`Figures::rms_spot_um`], degrees.
    pub fields_deg: Vec<f64>,
}

/// The lens at the start and the best one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    #[serde(default, serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: PathBuf,
}

/// The best lens of a search with a further requirement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Trade {
    /// The requirement, in words.
    pub requirement: String,
    /// Mean over the fields of the RMS spot radius, um.
    pub mean_rms_um: f64,
    /// How many limits are violated.
    pub violations: usize,
}

impl Request {
    pub(super) fn check(&self) -> Result<()> {
        check_ranges(self)
    }

    pub(super) fn is_out_of_time(&self, began: Instant) -> bool {
        self.seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds)
    }
}
