//! Scores of a class in Python beside the usual ones of pictures. The score of a camera is the mean of those of its pictures.

use std::collections::BTreeMap;
use std::sync::Arc;

use petzval_learn::guest_task::GuestTask;
use petzval_learn::score::{Score, ScoreDescription, standard_scores};

use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::task::pictures::PictureJudge;
use crate::task::{Depth, Findings, Judge, ScoredPicture, Taken};

/// Judges by the scores that the experiment names.
pub(super) struct OwnJudge {
    own: Arc<GuestTask>,
    /// The named scores of the class.
    named: Vec<String>,
    usual: PictureJudge,
    /// All of them, in the order of the experiment.
    all: Vec<ScoreDescription>,
}

impl OwnJudge {
    /// Fails if the experiment names a score that neither the class nor the program computes. A score of the class goes before one of the same name.
    pub fn new(cameras: &Cameras, own: Arc<GuestTask>) -> Result<Self> {
        let mut standard: Vec<Option<Box<dyn Score>>> =
            standard_scores(&cameras.lpips()?).into_iter().map(Some).collect();
        let of_class = own.scores().iter().map(|score| score.name.as_str());
        let names: Vec<&str> = of_class.chain(standard.iter().flatten().map(|score| score.name())).collect();
        let known = names.join(", ");
        let (mut named, mut usual, mut all) = (Vec::new(), Vec::new(), Vec::new());
        for name in &cameras.experiment.scoring.scores {
            if let Some(score) = own.scores().iter().find(|score| score.name == *name) {
                named.push(name.clone());
                all.push(score.clone());
                continue;
            }
            let is_it =
                |score: &&mut Option<Box<dyn Score>>| score.as_ref().is_some_and(|s| s.name() == name);
            let Some(score) = standard.iter_mut().find(is_it).and_then(Option::take) else {
                return Err(DesignError::UnknownScore { name: name.clone(), known });
            };
            all.push(ScoreDescription::of(score.as_ref()));
            usual.push(score);
        }
        Ok(Self { own, named, usual: PictureJudge::of(usual), all })
    }
}

impl Judge for OwnJudge {
    fn scores(&self) -> Vec<ScoreDescription> {
        self.all.clone()
    }

    fn begin(&self, depth: Depth) -> Box<dyn Findings> {
        let (own, named, usual) = (self.own.clone(), self.named.clone(), self.usual.begin(depth));
        Box::new(OwnFindings { own, named, usual, sums: BTreeMap::new(), pictures: 0 })
    }
}

/// The scores of the pictures of one camera.
struct OwnFindings {
    own: Arc<GuestTask>,
    named: Vec<String>,
    usual: Box<dyn Findings>,
    sums: BTreeMap<String, f64>,
    pictures: usize,
}

impl Findings for OwnFindings {
    fn add(&mut self, taken: Taken) -> Result<ScoredPicture> {
        let mut found = BTreeMap::new();
        if !self.named.is_empty() {
            let truth = taken.camera.truths(std::slice::from_ref(&taken.window.shot))?;
            found = self.own.score(taken.finished.clone(), truth)?;
            found.retain(|name, _| self.named.contains(name));
        }
        for (name, score) in &found {
            *self.sums.entry(name.clone()).or_default() += score;
        }
        self.pictures += 1;
        let mut picture = self.usual.add(taken)?;
        picture.score.scores.extend(found);
        Ok(picture)
    }

    fn scores(&self) -> BTreeMap<String, f64> {
        let mean = |(name, sum): (&String, &f64)| (name.clone(), sum / self.pictures as f64);
        let mut scores = self.usual.scores();
        scores.extend(self.sums.iter().map(mean));
        scores
    }
}
