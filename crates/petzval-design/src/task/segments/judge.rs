//! Scores of the classes that the network of a camera names, over all held-out windows at once.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use petzval_learn::dataset::ClassMap;
use petzval_learn::score::ScoreDescription;
use petzval_learn::score::segmentation::{PixelConfusion, SegmentScore, segment_scores};

use super::PixelReader;
use super::overlay::with_classes;
use super::segmented_frames::{self, SHOWN, SegmentedFrame, ShownFrame, clusters, confusions};
use crate::camera::host_image;
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::run::PictureScore;
use crate::task::{Depth, Findings, HeldOut, Judge, ScoredPicture, Taken, named_scores};

/// Judges the classes of pixels.
pub(super) struct SegmentJudge {
    scores: Arc<[SegmentScore]>,
    classes: usize,
}

impl SegmentJudge {
    /// The scores that an experiment names, in that order.
    pub fn new(cameras: &Cameras) -> Result<Self> {
        let classes = cameras.experiment.classes().counted();
        let named = &cameras.experiment.scoring.scores;
        let scores = named_scores(named, segment_scores(&classes.names()), |score| &score.about.name)?;
        Ok(Self { scores: scores.into(), classes: classes.len() })
    }
}

impl Judge for SegmentJudge {
    fn scores(&self) -> Vec<ScoreDescription> {
        self.scores.iter().map(|score| score.about.clone()).collect()
    }

    fn reasons_for_none(&self) -> BTreeMap<String, String> {
        self.scores.iter().map(|score| (score.about.name.clone(), score.why_none.clone())).collect()
    }

    fn begin(&self, depth: Depth) -> Box<dyn Findings> {
        Box::new(SegmentFindings {
            scores: self.scores.clone(),
            classes: self.classes,
            shown_frames: if depth == Depth::EveryStage { SHOWN } else { 0 },
            frames: Vec::new(),
            shown: Vec::new(),
        })
    }
}

/// What the network of one camera finds.
struct SegmentFindings {
    scores: Arc<[SegmentScore]>,
    classes: usize,
    /// Frames of which pictures are kept.
    shown_frames: usize,
    frames: Vec<SegmentedFrame>,
    shown: Vec<ShownFrame>,
}

impl Findings for SegmentFindings {
    fn add(&mut self, taken: Taken) -> Result<ScoredPicture> {
        let Taken { camera, window, finished, developed, .. } = taken;
        let HeldOut { name, sequence, relative_field, shot } = window;
        let truth = shot.labels.of::<ClassMap>().ok_or(DesignError::OtherTask)?.clone();
        let reader = camera.reader::<PixelReader>().ok_or(DesignError::OtherTask)?;
        // What the network sees need not be the picture: of a camera whose network sees the truth it is the scene.
        let found = reader.read(finished.clone())?;
        let confusion = PixelConfusion::of(&truth.classes, &found.classes, self.classes);
        self.frames.push(SegmentedFrame { name: name.clone(), sequence, confusion });
        let mut scene = camera.scenes(&[shot])?.swap_remove(0);
        scene.data = scene.to_srgb();
        let finished = host_image(finished)?;
        let picture = ScoredPicture {
            score: PictureScore { photo: name, relative_field, scores: BTreeMap::new() },
            developed,
            truth: with_classes(&scene, &truth),
            output: with_classes(&finished, &found),
        };
        if self.shown.len() < self.shown_frames {
            self.shown.push(ShownFrame::new(&finished, truth, found)?);
        }
        Ok(picture)
    }

    fn scores(&self) -> BTreeMap<String, f64> {
        let frames = confusions(&self.frames);
        let value = |score: &SegmentScore| Some((score.about.name.clone(), score.of(&frames, self.classes)?));
        self.scores.iter().filter_map(value).collect()
    }

    fn intervals(&self) -> BTreeMap<String, [f64; 2]> {
        let (frames, clusters) = (confusions(&self.frames), clusters(&self.frames));
        let interval = |score: &SegmentScore| {
            Some((score.about.name.clone(), score.interval(&frames, &clusters, self.classes)?))
        };
        self.scores.iter().filter_map(interval).collect()
    }

    fn draws(&self) -> BTreeMap<String, Vec<Option<f64>>> {
        let (frames, clusters) = (confusions(&self.frames), clusters(&self.frames));
        let draws =
            |score: &SegmentScore| (score.about.name.clone(), score.draws(&frames, &clusters, self.classes));
        self.scores.iter().map(draws).collect()
    }

    fn save(&self, folder: &Path) -> Result<()> {
        segmented_frames::save(folder, &self.frames, &self.shown)
    }
}
