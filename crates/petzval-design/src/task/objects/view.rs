//! What the report of a run shows of detection: precision over recall, figures by group, where objects are lost, and mistakes.

use petzval_files::picture_size;
use petzval_learn::detection::BBox;
use petzval_learn::score::detection::{
    Bootstrap, Group, Interpolation, Picture, Protocol, Ranking, bootstrap,
};
use petzval_learn::score::{ObjectScore, object_scores};
use petzval_report::design_report::{
    CameraDetection, DetectionView, GroupFigure, LostObjects, Mistake, PrecisionCurve, Range, TaskPart,
    detection_part,
};
use rayon::prelude::*;

use super::seen_windows::{self, SeenWindow, Stage};
use crate::cameras::Cameras;
use crate::error::Result;
use crate::run::picture_names::{file_name, whole_png};
use crate::run::{CameraMetrics, Metrics, RunFolder};
use crate::task::TaskReport;

/// Most misses and most false alarms that are shown of a camera.
const MOST_MISTAKES: usize = 8;

/// First letters of the scores that are shown beside each other: all objects, each class, sizes and places.
const SHOWN: &str = "ap50";

/// What the report of a run shows of objects: what its cameras find, and where. Cameras that an earlier version scored are not counted.
pub(super) fn report(cameras: &Cameras, run: &RunFolder, metrics: &Metrics) -> Result<TaskReport> {
    let classes = cameras.experiment.classes();
    let mut all: Vec<Option<Seen>> = Vec::new();
    for row in &metrics.rows {
        let number = cameras.place_of(&row.camera).unwrap_or(all.len());
        let windows = seen_windows::read(run, &row.camera)?;
        all.push(windows.map(|windows| Seen::new(number, row, windows, classes.len())));
    }
    let is_found = |window: &SeenWindow| {
        window.truth.objects.iter().filter(|object| window.lost_at(object).is_none()).count()
    };
    let found = |seen: &Option<Seen>| {
        seen.as_ref().map_or_else(Vec::new, |seen| seen.windows.iter().map(is_found).collect())
    };
    // Boxes are those of the first camera, which the truth is of.
    let first = all.first().and_then(Option::as_ref);
    let focus = |(index, window): (usize, &SeenWindow)| {
        let objects = window.truth.objects.iter();
        let largest = objects.max_by(|a, b| a.bbox.area().total_cmp(&b.bbox.area()))?;
        // A picture that cannot be read is not shown.
        let (side, _) = picture_size(&run.picture(&file_name(index, "truth", None))).ok()?;
        Some(largest.bbox.centre().map(|v| f64::from(v) / f64::from(side)))
    };
    let (found, focus) = (
        all.iter().map(found).collect(),
        first.map_or_else(Vec::new, |seen| seen.windows.iter().enumerate().map(focus).collect()),
    );
    let view = detection_view(cameras, run, &all.into_iter().flatten().collect::<Vec<_>>());
    Ok(TaskReport { part: view.as_ref().map_or_else(TaskPart::default, detection_part), found, focus })
}

/// What the cameras of a run find; none without a camera.
fn detection_view(of: &Cameras, run: &RunFolder, cameras: &[Seen]) -> Option<DetectionView> {
    let all = of.experiment.classes();
    let classes = &all.names()[..];
    let field = of.field();
    // The ceiling is no baseline.
    let baseline = cameras.iter().find(|c| !c.is_ceiling).or(cameras.first())?;
    let design = cameras.iter().rfind(|c| !c.is_ceiling).unwrap_or(baseline);
    let groups: Vec<ObjectScore> =
        object_scores(classes).into_iter().filter(|score| score.about.name.starts_with(SHOWN)).collect();
    let view = |seen: &Seen| {
        let ranking = seen.ranking(classes.len());
        let clusters = seen_windows::clusters(&seen.windows);
        let curve = |i: usize| {
            let curve = ranking.classes[i].curve(0, None)?;
            let points = curve.recall.iter().copied().zip(curve.precision.iter().copied()).collect();
            Some(PrecisionCurve { class: classes[i].to_owned(), points })
        };
        let group = |score: &ObjectScore| {
            let value = score.of(&seen.judged, classes.len(), field)?;
            let range = score.interval(&seen.judged, &clusters, classes.len(), field);
            // All objects are headed `AP50`, a group of them by its name alone.
            let name = score.about.title.trim_start_matches("AP50 ").to_owned();
            Some(GroupFigure { name, value, range })
        };
        CameraDetection {
            camera: seen.camera.to_owned(),
            number: seen.number,
            curves: (0..classes.len()).filter_map(curve).collect(),
            groups: groups.par_iter().filter_map(group).collect(),
            against_baseline: difference(baseline, seen, classes.len()),
            design_against: difference(seen, design, classes.len()),
            ap50_at_stages: Stage::ALL.map(|stage| seen.ap50_at(stage, classes.len())),
            lost: seen.lost(),
            misses: seen.misses(run, classes),
            false_alarms: seen.false_alarms(run, classes),
        }
    };
    Some(DetectionView {
        baseline: baseline.camera.to_owned(),
        design: design.camera.to_owned(),
        windows: baseline.windows.len(),
        cameras: cameras.iter().map(view).collect(),
    })
}

/// What a camera finds.
struct Seen<'a> {
    camera: &'a str,
    /// Its place among the cameras of the run.
    number: usize,
    is_ceiling: bool,
    windows: Vec<SeenWindow>,
    judged: Vec<Picture>,
}

impl<'a> Seen<'a> {
    fn new(number: usize, row: &'a CameraMetrics, windows: Vec<SeenWindow>, classes: usize) -> Self {
        let judged = windows.iter().map(|window| window.judged(classes)).collect();
        Self { camera: &row.camera, number, is_ceiling: row.is_ceiling, windows, judged }
    }

    fn ranking(&self, classes: usize) -> Ranking {
        ranking(&self.judged, classes)
    }

    /// The average precision of its detector in the pictures of a stage.
    fn ap50_at(&self, stage: Stage, classes: usize) -> Option<f64> {
        let judged: Vec<Picture> =
            self.windows.iter().map(|window| window.judged_at(stage, classes)).collect();
        ranking(&judged, classes).average_precision(Interpolation::Points101, None)
    }

    fn lost(&self) -> LostObjects {
        let mut lost = LostObjects::default();
        for window in &self.windows {
            lost.objects += window.truth.beside.len();
            lost.beside += window.truth.beside.len();
            for object in &window.truth.objects {
                lost.objects += 1;
                match window.lost_at(object) {
                    None => lost.found += 1,
                    Some(Stage::Scene) => lost.in_scene += 1,
                    Some(Stage::Light) => lost.by_lens += 1,
                    Some(Stage::Raw) => lost.by_sensor += 1,
                    Some(Stage::Finished) => lost.by_isp += 1,
                }
            }
        }
        lost
    }

    /// The largest objects that are not found.
    fn misses(&self, run: &RunFolder, classes: &[&str]) -> Vec<Mistake> {
        let missed = |window: &SeenWindow| -> Vec<Ranked> {
            let missed = window.truth.objects.iter().filter(|o| window.lost_at(o).is_some());
            missed.map(|o| (o.bbox.area(), o.bbox, o.class)).collect()
        };
        self.mistakes(run, missed, |class, _| classes[class].to_owned())
    }

    /// The surest false alarms.
    fn false_alarms(&self, run: &RunFolder, classes: &[&str]) -> Vec<Mistake> {
        let alarms =
            |window: &SeenWindow| window.false_alarms().map(|d| (d.score, d.bbox, d.class)).collect();
        self.mistakes(run, alarms, |class, score| format!("{} {score:.2}", classes[class]))
    }

    /// The mistakes of the highest rank, one of a window, with the pictures in which they are. Those whose picture is missing are left out.
    fn mistakes(
        &self,
        run: &RunFolder,
        of_window: impl Fn(&SeenWindow) -> Vec<Ranked>,
        title: impl Fn(usize, f32) -> String,
    ) -> Vec<Mistake> {
        let first = |(number, window)| {
            let first = of_window(window).into_iter().rev().max_by(|a, b| a.0.total_cmp(&b.0))?;
            Some((number, first))
        };
        let mut firsts: Vec<(usize, Ranked)> = self.windows.iter().enumerate().filter_map(first).collect();
        firsts.sort_by(|(_, a), (_, b)| b.0.total_cmp(&a.0));
        let mistake = |(number, (rank, bbox, class)): (usize, Ranked)| {
            Some(Mistake {
                picture_png: whole_png(run, &file_name(number, "output", Some(self.camera)))?,
                bbox: [bbox.x1, bbox.y1, bbox.x2, bbox.y2],
                title: format!("{}, scene {}", title(class, rank), number + 1),
            })
        };
        firsts.into_iter().filter_map(mistake).take(MOST_MISTAKES).collect()
    }
}

/// The detections of pictures at an overlap of 0.5.
fn ranking(judged: &[Picture], classes: usize) -> Ranking {
    Ranking::new(judged, classes, &Protocol::coco_at(0.5), &Group::all())
}

/// A mistake: what it is ranked by, its box and its class.
type Ranked = (f32, BBox, usize);

/// The AP50 of a camera less that of another one; both see the same draws of the windows, those of one film together. None for a camera and itself.
fn difference(baseline: &Seen, camera: &Seen, classes: usize) -> Option<Range> {
    if baseline.camera == camera.camera || baseline.windows.len() != camera.windows.len() {
        return None;
    }
    let rankings = [baseline, camera].map(|seen| seen.ranking(classes));
    let area =
        |ranking: &Ranking, counts: &[u32]| ranking.average_precision(Interpolation::Points101, Some(counts));
    let how = Bootstrap::of_clusters(seen_windows::clusters(&baseline.windows), 1);
    let found = bootstrap(&how, |counts| Some(area(&rankings[1], counts)? - area(&rankings[0], counts)?))?;
    Some(Range { value: found.value, low: found.low, high: found.high })
}
