//! Scores of what the detector of a camera finds in all held-out windows at once.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use burn::prelude::*;
use petzval_camera::tape::srgb_encode_op;
use petzval_learn::detection::Truth;
use petzval_learn::score::detection::Picture;
use petzval_learn::score::{Field, ObjectScore, ScoreDescription, object_scores};

use super::Finder;
use super::boxes::{with_detections, with_truth};
use super::seen_windows::{self, SeenWindow, clusters};
use crate::camera::host_image;
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::run::PictureScore;
use crate::task::{Depth, Findings, HeldOut, Judge, ScoredPicture, Taken, named_scores};

/// Judges what a detector finds.
pub(super) struct ObjectJudge {
    scores: Arc<[ObjectScore]>,
    classes: usize,
    field: Field,
}

impl ObjectJudge {
    /// The scores that an experiment names, in that order.
    pub fn new(cameras: &Cameras) -> Result<Self> {
        let classes = cameras.experiment.classes();
        let known = object_scores(&classes.names());
        let named = &cameras.experiment.scoring.scores;
        let scores = named_scores(named, known, |score| &score.about.name)?.into();
        Ok(Self { scores, classes: classes.len(), field: cameras.field() })
    }
}

impl Judge for ObjectJudge {
    fn scores(&self) -> Vec<ScoreDescription> {
        self.scores.iter().map(|score| score.about.clone()).collect()
    }

    fn reasons_for_none(&self) -> BTreeMap<String, String> {
        self.scores.iter().map(|score| (score.about.name.clone(), score.why_none.clone())).collect()
    }

    fn begin(&self, depth: Depth) -> Box<dyn Findings> {
        let Self { scores, classes, field } = self;
        Box::new(ObjectFindings {
            scores: scores.clone(),
            classes: *classes,
            field: *field,
            depth,
            windows: Vec::new(),
        })
    }
}

/// What the detector of one camera finds.
struct ObjectFindings {
    scores: Arc<[ObjectScore]>,
    classes: usize,
    field: Field,
    depth: Depth,
    windows: Vec<SeenWindow>,
}

impl ObjectFindings {
    fn judged(&self) -> Vec<Picture> {
        self.windows.iter().map(|window| window.judged(self.classes)).collect()
    }
}

impl Findings for ObjectFindings {
    fn add(&mut self, taken: Taken) -> Result<ScoredPicture> {
        let Taken { camera, window, frames, finished, developed } = taken;
        let HeldOut { name: photo, sequence, relative_field, shot } = window;
        let truth = shot.labels.of::<Truth>().ok_or(DesignError::OtherTask)?.clone();
        let at = camera.kept(&shot).placement;
        let shots = [shot];
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        let found =
            |picture: Tensor<4>| Ok::<_, DesignError>(finder.detector.detect(picture)?.swap_remove(0));
        let found = match self.depth {
            Depth::EveryStage => [
                found(camera.truths(&shots)?.clamp(0.0, 1.0))?,
                found(encoded_light(frames.irradiance))?,
                found(encoded_light(frames.developed))?,
                found(finished.clone())?,
            ],
            Depth::Finished => [vec![], vec![], vec![], found(finished.clone())?],
        };
        let window = SeenWindow { at: [at.row, at.col], sequence, truth, found };
        let mut scene = camera.scenes(&shots)?.swap_remove(0);
        scene.data = scene.to_srgb();
        let picture = ScoredPicture {
            score: PictureScore { photo, relative_field, scores: BTreeMap::new() },
            developed,
            truth: with_truth(&scene, &window.truth),
            output: with_detections(&host_image(finished)?, &window.truth, window.finished()),
        };
        self.windows.push(window);
        Ok(picture)
    }

    fn scores(&self) -> BTreeMap<String, f64> {
        let windows = self.judged();
        let value = |score: &ObjectScore| {
            Some((score.about.name.clone(), score.of(&windows, self.classes, self.field)?))
        };
        self.scores.iter().filter_map(value).collect()
    }

    fn intervals(&self) -> BTreeMap<String, [f64; 2]> {
        let (windows, clusters) = (self.judged(), clusters(&self.windows));
        let interval = |score: &ObjectScore| {
            let range = score.interval(&windows, &clusters, self.classes, self.field)?;
            Some((score.about.name.clone(), range))
        };
        self.scores.iter().filter_map(interval).collect()
    }

    fn draws(&self) -> BTreeMap<String, Vec<Option<f64>>> {
        let (windows, clusters) = (self.judged(), clusters(&self.windows));
        let draws = |score: &ObjectScore| {
            (score.about.name.clone(), score.draws(&windows, &clusters, self.classes, self.field))
        };
        self.scores.iter().map(draws).collect()
    }

    fn save(&self, folder: &Path) -> Result<()> {
        seen_windows::save(folder, &self.windows)
    }
}

/// Linear light as a display shows it, within the range of a picture.
fn encoded_light(light: Tensor<4>) -> Tensor<4> {
    srgb_encode_op(light).clamp(0.0, 1.0)
}
