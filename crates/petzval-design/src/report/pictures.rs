//! The pictures of a run's report: the scores of all, those that are shown, and whole frames.

use std::collections::BTreeMap;

use petzval_learn::score::ScoreDescription;
use petzval_report::design_report::{
    CameraPicture, FrameView, HeldOutScores, PictureView, Report, Role, choice, detail,
};

use crate::error::DesignError;
use crate::experiment::Variant;
use crate::run::picture_names::{file_name, spread_pictures, whole_name};
use crate::run::{CameraMetrics, Metrics, PictureScore, RunFolder};
use crate::task::TaskReport;

/// Most pictures that a page shows: all of three photographs at nine places. Each takes about 0.13 MB.
const MOST_PICTURES: usize = 27;

/// Most pictures of cameras on a page, each finished and as a raw frame: a page of many cameras shows fewer scenes.
const MOST_OF_CAMERAS: usize = 120;

/// Scenes that a page shows however many cameras there are.
const LEAST_PICTURES: usize = 6;

/// The values of the scores, in their order; NaN for one that is missing.
pub(crate) fn in_order(scores: &[ScoreDescription], values: &BTreeMap<String, f64>) -> Vec<f64> {
    scores.iter().map(|score| values.get(&score.name).copied().unwrap_or(f64::NAN)).collect()
}

/// The scores of every held-out picture by every camera, and the objects that are found in it.
pub(crate) fn held_out(metrics: &Metrics, of_task: &TaskReport) -> Vec<HeldOutScores> {
    let Some(first) = metrics.rows.first() else { return Vec::new() };
    let scores = |row: &CameraMetrics, i: usize| {
        row.pictures.get(i).map_or_else(Vec::new, |picture| in_order(&metrics.scores, &picture.scores))
    };
    let of = |(i, picture): (usize, &PictureScore)| HeldOutScores {
        photograph: picture.photo.clone(),
        relative_field: picture.relative_field,
        scores: metrics.rows.iter().map(|row| scores(row, i)).collect(),
        // Counts of cameras that an earlier version scored are not known, and then none is compared.
        found: of_task
            .found
            .iter()
            .map(|found| found.get(i).copied())
            .collect::<Option<_>>()
            .unwrap_or_default(),
    };
    first.pictures.iter().enumerate().map(of).collect()
}

/// Some of the held-out pictures: those that a report chooses by gain and place, then others that are spread evenly.
pub(crate) fn pictures(
    run: &RunFolder,
    metrics: &Metrics,
    of_task: &TaskReport,
    report: &Report,
) -> Result<Vec<PictureView>, DesignError> {
    let read = |file: String| {
        let path = run.picture(&file);
        petzval_base::read_whole(&path).map_err(DesignError::io(&path))
    };
    let Some(first) = metrics.rows.first() else { return Ok(Vec::new()) };
    let truth = |index: usize| file_name(index, "truth", None);
    // A picture that cannot be read fails below, where it is shown.
    let chosen = choice(report, &|index| read(truth(index)).map_or(0.0, |png| detail(&png)));
    let shown = MOST_PICTURES.min(LEAST_PICTURES.max(MOST_OF_CAMERAS / metrics.rows.len()));
    let mut order: Vec<(usize, Option<Role>)> =
        chosen.into_iter().map(|(index, role)| (index, Some(role))).collect();
    for index in spread_pictures(metrics.held_out_images, metrics.held_out_places, shown) {
        let is_shown = order.iter().any(|(other, _)| *other == index);
        if order.len() < shown && !is_shown && index < first.pictures.len() {
            order.push((index, None));
        }
    }
    let mut all = Vec::new();
    for (index, role) in order {
        let picture = &first.pictures[index];
        let mut cameras = Vec::new();
        for m in &metrics.rows {
            let Some(picture) = m.pictures.get(index) else { continue };
            cameras.push(CameraPicture {
                camera: m.camera.clone(),
                developed_png: read(file_name(index, "developed", Some(&m.camera)))?,
                output_png: read(file_name(index, "output", Some(&m.camera)))?,
                scores: in_order(&metrics.scores, &picture.scores),
            });
        }
        let title =
            picture.photo.rsplit_once('.').map_or(picture.photo.as_str(), |(stem, _)| stem).to_owned();
        let focus = of_task.focus.get(index).copied().flatten();
        all.push(PictureView { title, number: index, role, focus, truth_png: read(truth(index))?, cameras });
    }
    Ok(all)
}

/// Whole frames of a photograph, if they were made: the scene and those of the cameras.
pub(crate) fn frames(run: &RunFolder, variants: &[Variant]) -> Result<Vec<FrameView>, DesignError> {
    if !run.picture(&whole_name(None)).is_file() {
        return Ok(Vec::new());
    }
    let mut all = Vec::new();
    for camera in [None].into_iter().chain(variants.iter().map(|variant| Some(variant.name.as_str()))) {
        let path = run.picture(&whole_name(camera));
        if path.is_file() {
            let png = petzval_base::read_whole(&path).map_err(DesignError::io(&path))?;
            all.push(FrameView { name: camera.unwrap_or("the scene").to_owned(), png });
        }
    }
    Ok(all)
}
