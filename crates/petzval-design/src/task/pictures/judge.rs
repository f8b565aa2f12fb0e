//! Scores of single pictures. The score of a camera is their mean.

use std::collections::BTreeMap;
use std::sync::Arc;

use petzval_learn::score::{Score, ScoreDescription, ScoredPair};

use crate::camera::host_image;
use crate::error::Result;
use crate::experiment::Experiment;
use crate::run::PictureScore;
use crate::task::{Depth, Findings, HeldOut, Judge, ScoredPicture, Taken, named_scores};

/// Judges each finished picture by itself.
pub struct PictureJudge {
    scores: Arc<[Box<dyn Score>]>,
}

impl PictureJudge {
    /// The scores of `known` that the experiment names, in that order.
    pub fn new(experiment: &Experiment, known: Vec<Box<dyn Score>>) -> Result<Self> {
        Ok(Self::of(named_scores(&experiment.scoring.scores, known, |score| score.name())?))
    }

    /// These scores.
    pub fn of(scores: Vec<Box<dyn Score>>) -> Self {
        Self { scores: scores.into() }
    }
}

impl Judge for PictureJudge {
    fn scores(&self) -> Vec<ScoreDescription> {
        self.scores.iter().map(|score| ScoreDescription::of(score.as_ref())).collect()
    }

    fn begin(&self, _: Depth) -> Box<dyn Findings> {
        Box::new(PictureFindings { scores: self.scores.clone(), found: Vec::new() })
    }
}

/// The scores of the pictures of one camera.
struct PictureFindings {
    scores: Arc<[Box<dyn Score>]>,
    found: Vec<BTreeMap<String, f64>>,
}

impl Findings for PictureFindings {
    fn add(&mut self, taken: Taken) -> Result<ScoredPicture> {
        let HeldOut { name: photo, relative_field, shot, .. } = taken.window;
        let truth_tensor = taken.camera.truths(&[shot])?;
        let pair = ScoredPair {
            truth: host_image(truth_tensor.clone())?,
            finished: host_image(taken.finished.clone())?,
            finished_tensor: taken.finished,
            truth_tensor,
        };
        let mut scores = BTreeMap::new();
        for score in self.scores.iter() {
            scores.insert(score.name().to_owned(), score.of(&pair)?);
        }
        self.found.push(scores.clone());
        Ok(ScoredPicture {
            score: PictureScore { photo, relative_field, scores },
            developed: taken.developed,
            truth: pair.truth,
            output: pair.finished,
        })
    }

    fn scores(&self) -> BTreeMap<String, f64> {
        let mean = |name: &str| {
            let sum: f64 = self.found.iter().map(|scores| scores[name]).sum();
            sum / self.found.len() as f64
        };
        self.scores.iter().map(|score| (score.name().to_owned(), mean(score.name()))).collect()
    }
}
