//! The pictures of a run's report: the scores of all, those that are shown, and whole frames.

use std::collections::BTreeMap;

use petzval_base::counted;
use petzval_learn::score::ScoreDescription;
use petzval_report::design_report::{
    CameraPicture, FrameView, HeldOutScores, PictureView, Report, Role, choice, detail,
};

use crate::error::{DesignError, Result};
use crate::experiment::Variant;
use crate::run::picture_names::{file_name, spread_pictures, whole_name, whole_png};
use crate::run::{CameraMetrics, Metrics, PictureScore, RunFolder};
use crate::task::TaskReport;

/// Most pictures that a page shows: all of three photographs at nine places. Each takes about 0.13 MB.
const MOST_PICTURES: usize = 27;

/// Most pictures of cameras on a page, each finished and as a raw frame: a page of many cameras shows fewer scenes.
const MOST_OF_CAMERAS: usize = 120;

/// Most missing files that are named.
const MOST_NAMED: usize = 3;

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

/// Pictures of a report.
#[derive(Default)]
pub(crate) struct Pictures {
    /// Those that are shown.
    pub(crate) shown: Vec<PictureView>,
    /// Files of others, which are missing or damaged.
    missing: Vec<String>,
}

impl Pictures {
    /// What is not shown, in a sentence that names the first files; none where nothing is missing.
    pub(crate) fn left_out(&self) -> Option<String> {
        let named: Vec<String> =
            self.missing.iter().take(MOST_NAMED).map(|file| format!("pictures/{file}")).collect();
        let more = match self.missing.len() - named.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let files = counted(self.missing.len(), "picture");
        (!named.is_empty()).then(|| {
            format!(
                "{files} missing in the folder of the run or damaged, not shown: {}{more}",
                named.join(", ")
            )
        })
    }

    /// The bytes of a picture; the name of a file without them is kept.
    fn read(&mut self, run: &RunFolder, file: String) -> Option<Vec<u8>> {
        let png = whole_png(run, &file);
        if png.is_none() {
            self.missing.push(file);
        }
        png
    }
}

/// Some of the held-out pictures: those that a report chooses by gain and place, then others that are spread evenly. Files that are missing or
/// damaged are left out.
pub(crate) fn pictures(
    run: &RunFolder,
    metrics: &Metrics,
    of_task: &TaskReport,
    report: &Report,
) -> Pictures {
    let mut found = Pictures::default();
    let Some(first) = metrics.rows.first() else { return found };
    let truth = |index: usize| file_name(index, "truth", None);
    let chosen = choice(report, &|index| whole_png(run, &truth(index)).map_or(0.0, |png| detail(&png)));
    let shown = MOST_PICTURES.min(LEAST_PICTURES.max(MOST_OF_CAMERAS / metrics.rows.len()));
    let mut order: Vec<(usize, Option<Role>)> =
        chosen.into_iter().map(|(index, role)| (index, Some(role))).collect();
    for index in spread_pictures(metrics.held_out_images, metrics.held_out_places, shown) {
        let is_shown = order.iter().any(|(other, _)| *other == index);
        if order.len() < shown && !is_shown && index < first.pictures.len() {
            order.push((index, None));
        }
    }
    for (index, role) in order {
        let picture = &first.pictures[index];
        let mut cameras = Vec::new();
        for m in &metrics.rows {
            let Some(picture) = m.pictures.get(index) else { continue };
            let [developed, output] = ["developed", "output"]
                .map(|state| found.read(run, file_name(index, state, Some(&m.camera))));
            let Some((developed_png, output_png)) = developed.zip(output) else { continue };
            let scores = in_order(&metrics.scores, &picture.scores);
            cameras.push(CameraPicture { camera: m.camera.clone(), developed_png, output_png, scores });
        }
        let Some(truth_png) = found.read(run, truth(index)).filter(|_| !cameras.is_empty()) else { continue };
        let title =
            picture.photo.rsplit_once('.').map_or(picture.photo.as_str(), |(stem, _)| stem).to_owned();
        let focus = of_task.focus.get(index).copied().flatten();
        found.shown.push(PictureView { title, number: index, role, focus, truth_png, cameras });
    }
    found
}

/// Whole frames of a photograph, if they were made: the scene and those of the cameras.
pub(crate) fn frames(run: &RunFolder, variants: &[Variant]) -> Result<Vec<FrameView>> {
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
