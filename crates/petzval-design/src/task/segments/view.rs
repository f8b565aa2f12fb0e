//! What the report of a run shows of a segmentation: the IoU of each class by each camera, what is taken for what, and windows as pictures.

use petzval_learn::score::detection::{Bootstrap, bootstrap};
use petzval_learn::score::segmentation::{PixelConfusion, SegmentScore, segment_scores};
use petzval_report::design_report::{
    CameraSegments, Range, SegmentFigure, SegmentationView, ShownSegments, TaskPart, segmentation_section,
};
use rayon::prelude::*;

use super::segmented_frames::{self, SegmentedFrame, SegmentedFrames, ShownFrame, clusters, confusions};
use crate::cameras::Cameras;
use crate::error::Result;
use crate::run::{Metrics, RunFolder};
use crate::task::TaskReport;

/// The section of a run; none where no camera has what it shows.
pub(super) fn report(cameras: &Cameras, run: &RunFolder, metrics: &Metrics) -> Result<TaskReport> {
    let classes = cameras.experiment.classes().counted();
    let scores = segment_scores(&classes.names());
    let mut all = Vec::new();
    for row in &metrics.rows {
        let number = cameras.place_of(&row.camera).unwrap_or(all.len());
        if let Some(SegmentedFrames { all: frames, shown }) =
            segmented_frames::read(run, &row.camera, classes.len())?
        {
            all.push(Segmented { camera: &row.camera, number, is_ceiling: row.is_ceiling, frames, shown });
        }
    }
    // The ceiling is no baseline.
    let Some(baseline) = all.iter().find(|camera| !camera.is_ceiling).or(all.first()) else {
        return Ok(TaskReport::default());
    };
    let view = SegmentationView {
        classes: classes.names().into_iter().map(str::to_owned).collect(),
        baseline: baseline.camera.to_owned(),
        windows: baseline.frames.len(),
        cameras: all.par_iter().map(|camera| camera.view(&scores, baseline)).collect(),
    };
    let part = TaskPart { sections: vec![segmentation_section(&view)], ..TaskPart::default() };
    Ok(TaskReport { part, ..TaskReport::default() })
}

/// What a camera finds.
struct Segmented<'a> {
    camera: &'a str,
    number: usize,
    is_ceiling: bool,
    frames: Vec<SegmentedFrame>,
    shown: Vec<ShownFrame>,
}

impl Segmented<'_> {
    /// Its figures; `scores` are those of [`segment_scores`]: the mean, the accuracy, and one for each class.
    fn view(&self, scores: &[SegmentScore], baseline: &Self) -> CameraSegments {
        let (frames, clusters) = (confusions(&self.frames), clusters(&self.frames));
        let classes = scores.len() - 2;
        let figure = |score: &SegmentScore| {
            let value = score.of(&frames, classes)?;
            Some(SegmentFigure { value, range: score.interval(&frames, &clusters, classes) })
        };
        let all = PixelConfusion::sum(classes, frames.iter().map(|frame| (frame, 1)));
        let pixels = |truth: usize| (0..classes).map(|found| all.count(truth, found)).collect();
        CameraSegments {
            camera: self.camera.to_owned(),
            number: self.number,
            mean_iou: figure(&scores[0]),
            accuracy: figure(&scores[1]),
            classes: scores[2..].iter().map(figure).collect(),
            against_baseline: self.difference(&scores[0], baseline, classes),
            confusion: (0..classes).map(pixels).collect(),
            shown: self
                .frames
                .iter()
                .zip(&self.shown)
                .map(|(frame, shown)| shown_segments(frame, shown))
                .collect(),
        }
    }

    /// Its score less that of the baseline; both see the same draws of the windows, those of one film together. None for a camera and itself.
    fn difference(&self, score: &SegmentScore, baseline: &Self, classes: usize) -> Option<Range> {
        if baseline.camera == self.camera || baseline.frames.len() != self.frames.len() {
            return None;
        }
        let both = [baseline, self].map(|camera| confusions(&camera.frames));
        let present = both
            .each_ref()
            .map(|frames| PixelConfusion::sum(classes, frames.iter().map(|f| (f, 1))).present());
        let how = Bootstrap::of_clusters(clusters(&baseline.frames), 1);
        let found = bootstrap(&how, |counts| {
            let [theirs, own] = [0, 1].map(|k| score.of_drawn(&both[k], counts, classes, &present[k]));
            Some(own? - theirs?)
        })?;
        Some(Range { value: found.value, low: found.low, high: found.high })
    }
}

fn shown_segments(frame: &SegmentedFrame, shown: &ShownFrame) -> ShownSegments {
    ShownSegments {
        title: frame.name.clone(),
        photo_png: shown.photo_png.clone(),
        height: shown.truth.height,
        width: shown.truth.width,
        truth: shown.truth.classes.clone(),
        found: shown.found.classes.clone(),
    }
}
