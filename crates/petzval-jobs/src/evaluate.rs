//! `evaluate`: the cameras of a finished run scored again, with exact optics, and cameras as they are made.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_camera::psf::PsfBank;
use petzval_design::block::Block;
use petzval_design::camera::Camera;
use petzval_design::design_loop::{finished_camera, set_sight};
use petzval_design::experiment::{Experiment, PicturesKey, PsfsBy};
use petzval_design::inputs::{
    SetupFor, check_inputs, check_inputs_or_accepted, check_parts_or_accepted, setup_of_run,
};
use petzval_design::made_cameras::{LeftOut, MadeError, TrialPlan, made_cameras, symmetric};
use petzval_design::report::run_report::{camera_lens, read_metrics};
use petzval_design::run::input_list::{InputList, check_pictures_are_there, pictures_of_run};
use petzval_design::run::{CameraMetrics, DigestCheck, Kept, PictureScore, RunFolder, load_blocks};
use petzval_design::scoring::{Scored, Scorer, ranges_of_means};
use petzval_design::setup::Setup;
use petzval_design::task::Purpose;
use petzval_design::trained_pictures::TrainedPictures;
use petzval_files::ToleranceFile;
use petzval_learn::score::range_of_difference;
use petzval_optics::lens::Lens;
use petzval_optics::psf::PsfKind;
use petzval_optics::tolerance::Tolerances;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::design::{pictures_now, report_pictures, scorer};
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::given_psfs;
use crate::lens::tolerance::{read as read_tolerances, warn_of_wide_tolerances};
use crate::missing_scores::warn_of_missing;
use crate::range::check_ranges;
use crate::run_page::warn_of_changed_config;

pub use crate::lens::tolerance::{Compensate, Grade};
pub use petzval_design::run::{MadeMetrics, Metrics};
pub use petzval_learn::score::ScoreDescription;

petzval_base::parameters! {
    /// A finished run.
    pub struct Request {
        /// Its folder.
        run: PathBuf = PathBuf::new();
        /// Where tensors live.
        device: String = crate::usual::device();
        /// Photographs: those of the run where they are now, or others, none of which is kept for training. `scoring.pictures` of the run limits
        /// how many are scored.
        photos: Option<PathBuf> = None;
        /// Labelled pictures: those of the run where they are now, or others, none of which is kept for training. A folder or a file of annotations in
        /// COCO format, or a folder of pictures with label images.
        /// `street.held_out` of the run is the number of windows that are scored.
        data: Option<PathBuf> = None;
        /// Files or folders of the run, by their path below it, that may differ from their digests.
        accept_changed: Vec<String> = Vec::new();
        /// PSFs by rays or by waves, in place of those of the run.
        psf: Option<PsfKind> = None;
        /// PSFs in place of those of each camera's lens: the folder of results of `psf` or `psf-calibrate`, or its `psf.json`. They form the images, and
        /// development and restoration know them; networks and ISPs stay as they were trained. Spots and fields of view are those of the lens.
        psfs: Option<PathBuf> = None;
        /// Also make cameras at random, whose lenses are off by their tolerances, and score them.
        made: Option<Made> = None;
    }
}

petzval_base::parameters! {
    /// Cameras to be made at random from each design of a run.
    pub struct Made {
        /// How many of each design, 1 to 100000.
        trials: usize = 30, "", 1..100_000, Linear, "1 to 100000 cameras of each design";
        /// Most held-out pictures on which each is scored, at least 1.
        pictures: usize = 6, "", 1..1_000_000, Linear, "at least one held-out picture";
    }
    also {
        /// Their tolerances.
        tolerances: LensTolerances = LensTolerances::Grade(Grade::Precision);
        /// Seed of their errors.
        seed: u64 = crate::usual::seed();
        /// What is adjusted on every lens.
        compensate: Compensate = Compensate::Focus;
        /// Whether each camera is calibrated: development knows its lens as it was made, not only the lens as drawn.
        calibrate: bool = false;
        /// What a camera has to reach in the first score; that of the first camera as drawn if none is given, as in all other scores.
        limit: Option<f64> = None;
    }
}

/// Where tolerances come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LensTolerances {
    /// Tolerances of good practice, of this grade.
    Grade(Grade),
    /// A tolerance file, for the lenses of all designs.
    File(PathBuf),
}

/// The figures of the response, computed anew.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The figures; on other pictures than those of the run with their 95 % ranges.
    pub metrics: Metrics,
    /// The other pictures; none if the held-out ones of the run were scored.
    #[serde(default, serialize_with = "petzval_base::lossy_path::serialize")]
    pub other_pictures: Option<PathBuf>,
    /// How many of the other pictures the run was trained on, by the content of their files: scores on them say little about others.
    #[serde(default)]
    pub trained_on: usize,
    /// On other pictures: scores of the last camera that is no ceiling less those of each other one.
    #[serde(default)]
    pub differences: Vec<Difference>,
    /// Largest absolute difference between a score or a spot radius and that of the run; none on other pictures.
    pub largest_difference_from_run: Option<f64>,
    /// Camera, figure and unit of that difference; none if every figure is the same.
    #[serde(default)]
    pub largest_difference_of: Option<String>,
    /// Figures of cameras as they are made, if `made` was requested.
    pub made: Option<MadeMetrics>,
}

/// How much better one camera scores than another on the same pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Difference {
    /// The camera from whose scores the other's are taken.
    pub camera: String,
    /// The other.
    pub against: String,
    /// Mean differences by score.
    pub scores: BTreeMap<String, f64>,
    /// Their 95 % ranges, low and high, by the same draws of photographs or films for both; none for less than two.
    pub ranges: BTreeMap<String, [f64; 2]>,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    seed: Some(|request, seed| {
        if let Some(made) = &mut request.made {
            made.seed = seed;
        }
    }),
    ..AsUnit::PLAIN
};

/// Scores the cameras: lenses by exact tracing, pictures on the held-out photographs. The run folder stays as it is, unless cameras are made
/// from the designs: then `tolerance.json` is written, and the report with its figures.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    if let Some(made) = &request.made {
        check_ranges(made)?;
    }
    let folder = RunFolder::open(&request.run)?;
    let kept = read_metrics(&folder)?;
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    let check = DigestCheck::of_request(&folder, &request.accept_changed, &warn)?;
    // The figures are computed again: what differs is shown.
    for change in check.changes("")? {
        context.warning(WarningKind::ChangedFile, format!("{}: {change}", request.run.display()));
    }
    check.check_cameras(kept.rows.iter().map(|row| row.camera.as_str()))?;
    let designs = request.made.as_ref().map(|made| made.designs(&kept, &folder, context)).transpose()?;
    warn_of_changed_config(&folder, context)?;
    let mut experiment = context.assets.experiment_of_run(&folder)?;
    let key = context.assets.facts_of(&experiment)?.pictures;
    let place = pictures_now(key, request.photos.as_deref(), request.data.as_deref())?;
    let given = request.psfs.as_deref().map(given_psfs::bank).transpose()?;
    check_given(request, &experiment)?;
    let kept = if given.is_some() { without_ceilings(kept, context) } else { kept };
    if let Some(kind) = request.psf.map(PsfsBy::from) {
        // `tolerance.json` stands beside the scores of the run, and is compared with them.
        if request.made.is_some() && kind != experiment.psf.kind {
            let name = if kind == PsfsBy::Geometric { "geometric" } else { "diffraction" };
            let hint = "made cameras are scored with the PSFs of the run; leave one of the two out";
            return Err(JobError::setting("psf", name, "not together with made cameras", hint));
        }
        // The networks are those of the run, and so are the weights from which they started.
        experiment.network.pin_weights(experiment.psf.kind.traced());
        experiment.psf.kind = kind;
    }
    let (setup, others) = setup(experiment, (&folder, &check), (place, given.as_ref()), request, context)?;
    let scorer = scorer(setup)?;
    let setup = scorer.setup();
    if scorer.scores() != kept.scores {
        return Err(JobError::input(
            format!("{}: the run has other scores than its config.toml names", request.run.display()),
            "put scoring.scores back as it was",
        ));
    }
    let mut rows: Vec<CameraMetrics> = Vec::new();
    let mut draws: Vec<Draws> = Vec::new();
    for row in &kept.rows {
        context.note(format!("scoring {}", row.camera));
        let camera = camera_of(setup, &folder, &row.camera)?;
        let tick = |done, of| context.progress(done as u64, of as u64, &row.camera);
        let Scored { metrics: found, findings, .. } = scorer.score_watched(&row.camera, &camera, &tick)?;
        let mut intervals = found.intervals.clone();
        if others.is_some() {
            intervals.extend(ranges_of_means(&found.pictures));
            draws.push(findings.draws());
        }
        rows.push(CameraMetrics {
            is_ceiling: row.is_ceiling,
            isp_steps: row.isp_steps,
            network_steps: row.network_steps,
            intervals,
            ..found
        });
    }
    if let Some(Others { trained_on }) = others {
        let [held_out_images, held_out_places] = setup.held_out_pictures()?;
        let differences = differences(&rows, &draws, &kept.scores);
        return Ok(Response {
            metrics: explained(Metrics { rows, held_out_images, held_out_places, ..kept }, &scorer, context),
            other_pictures: place.map(Path::to_path_buf),
            trained_on,
            differences,
            largest_difference_from_run: None,
            largest_difference_of: None,
            made: None,
        });
    }
    let (largest, of) = largest_difference(&rows, &kept);
    let metrics = explained(Metrics { rows, ..kept }, &scorer, context);
    let plan = request.made.as_ref().zip(designs.as_deref());
    let made =
        plan.map(|(made, designs)| make(made, designs, &metrics, &scorer, &folder, context)).transpose()?;
    Ok(Response {
        metrics,
        other_pictures: None,
        trained_on: 0,
        differences: Vec::new(),
        largest_difference_from_run: Some(largest),
        largest_difference_of: of,
        made,
    })
}

/// Figures with the reasons for scores of which a camera has no value, and a warning that names them.
fn explained(metrics: Metrics, scorer: &Scorer, context: &Context) -> Metrics {
    let metrics = scorer.with_reasons(metrics);
    warn_of_missing(&metrics, context);
    metrics
}

/// The figures of a run without those of its ceilings, whose PSFs are those of a perfect lens.
fn without_ceilings(mut kept: Metrics, context: &Context) -> Metrics {
    for row in kept.rows.iter().filter(|row| row.is_ceiling) {
        context.note(format!("{} is left out: a ceiling has perfect PSFs", row.camera));
    }
    kept.rows.retain(|row| !row.is_ceiling);
    kept
}

/// Refuses what would trace lenses beside PSFs of a file.
fn check_given(request: &Request, experiment: &Experiment) -> Result<()> {
    if let (Some(path), Some(_)) = (&request.psfs, request.psf) {
        let hint = "leave one of psfs and psf out";
        return Err(JobError::setting("psfs", path.display(), "not together with rays or waves", hint));
    }
    if request.made.is_none() {
        return Ok(());
    }
    let hint = "made cameras have the PSFs of their lenses, which are traced; leave one of the two out";
    if let Some(path) = &request.psfs {
        return Err(JobError::setting("psfs", path.display(), "not together with made cameras", hint));
    }
    if experiment.psf.kind == PsfsBy::File {
        return Err(JobError::input("the cameras of this run have the PSFs of a file", hint));
    }
    Ok(())
}

/// Other pictures than those of a run.
struct Others {
    /// How many of them the run was trained on.
    trained_on: usize,
}

/// What cameras of a run are scored with, and what is known of its pictures if they are others than those of the run.
fn setup(
    mut experiment: Experiment,
    (folder, check): (&RunFolder, &DigestCheck<'_>),
    (place, given): (Option<&Path>, Option<&Arc<PsfBank>>),
    request: &Request,
    context: &Context,
) -> Result<(Setup, Option<Others>)> {
    let device = || context.device(&request.device);
    let training = SetupFor::Windows(Purpose::Training, given);
    let Some(place) = place else {
        check_pictures_are_there(folder, &experiment, context.assets.facts_of(&experiment)?.pictures)?;
        let setup = setup_of_run(folder, experiment, &context.assets, device()?, training)?;
        check_inputs_or_accepted(&setup, folder, check)?;
        return Ok((setup, None));
    };
    let key = context.assets.facts_of(&experiment)?.pictures;
    let trained = TrainedPictures::of_run(folder, &experiment, key, &context.assets)?;
    pictures_of_run(folder, &mut experiment, key, Some(place))?;
    // Pictures of the run that were moved are known by their content: first under their names, then photographs under any names.
    let silent = context.assets.clone().reporting_warnings(Arc::new(|_: &str| ()));
    let listed = InputList::read(folder)?.and_then(|list| list.pictures);
    let by_content = listed.as_ref().filter(|listed| key == PicturesKey::Photos && listed.are_read());
    let by_content = by_content.map(|listed| SetupFor::Windows(Purpose::TrainingOf(listed), given));
    for training in [Some(training), by_content].into_iter().flatten() {
        if let Ok(setup) = setup_of_run(folder, experiment.clone(), &silent, device()?, training)
            && check_inputs(&setup, folder).is_ok()
        {
            let place = place.display();
            context.note(format!("{place} holds the pictures of the run: its held-out ones are scored"));
            return Ok((setup, None));
        }
    }
    if request.made.is_some() {
        let key = if request.data.is_some() { "data" } else { "photos" };
        let hint = "made cameras are scored on the held-out pictures of the run; leave one of the two out";
        return Err(JobError::setting(
            key,
            place.display(),
            "holds other pictures than those of the run",
            hint,
        ));
    }
    let scores = SetupFor::Windows(Purpose::Scores, given);
    let setup = setup_of_run(folder, experiment, &context.assets, device()?, scores)?;
    check_parts_or_accepted(&setup, folder, check)?;
    let [trained_on, count] = trained.count_in(&setup)?;
    let place = place.display();
    if trained_on > 0 {
        context.warning(
            WarningKind::DataSet,
            format!(
                "the run has been trained on {trained_on} of the {count} pictures of {place}: scores on them say little about others; \
                 take them out, or leave the option away to score what the run held out"
            ),
        );
    } else {
        context.note(format!("{place} holds other pictures than those of the run, and they are scored"));
    }
    report_pictures(&setup, context);
    Ok((setup, Some(Others { trained_on })))
}

/// Scores of a camera in draws of windows, by name.
type Draws = BTreeMap<String, Vec<Option<f64>>>;

/// The last camera that is no ceiling against each other one, with the draws of every camera.
fn differences(rows: &[CameraMetrics], draws: &[Draws], scores: &[ScoreDescription]) -> Vec<Difference> {
    let all: Vec<_> = rows.iter().zip(draws).filter(|(row, _)| !row.is_ceiling).collect();
    let Some((&(design, ours), others)) = all.split_last() else { return Vec::new() };
    let difference = |&(other, theirs): &(&CameraMetrics, &Draws)| {
        let pairs = design.pictures.iter().zip(&other.pictures);
        let of_picture = |(a, b): (&PictureScore, &PictureScore)| {
            let by = |(name, value): (&String, &f64)| Some((name.clone(), value - b.scores.get(name)?));
            PictureScore { scores: a.scores.iter().filter_map(by).collect(), ..a.clone() }
        };
        let mean = |score: &ScoreDescription| {
            let value = |row: &CameraMetrics| row.scores.get(&score.name).copied();
            Some((score.name.clone(), value(design)? - value(other)?))
        };
        let drawn = |(name, ours): (&String, &Vec<Option<f64>>)| {
            Some((name.clone(), range_of_difference(ours, theirs.get(name)?)?))
        };
        let mut ranges = ranges_of_means(&pairs.map(of_picture).collect::<Vec<_>>());
        ranges.extend(ours.iter().filter_map(drawn));
        Difference {
            camera: design.camera.clone(),
            against: other.camera.clone(),
            scores: scores.iter().filter_map(mean).collect(),
            ranges,
        }
    };
    others.iter().map(difference).collect()
}

/// The largest absolute difference between a figure and that of the run, and which it is. A figure that is no number differs most.
fn largest_difference(rows: &[CameraMetrics], kept: &Metrics) -> (f64, Option<String>) {
    let of_row = |(a, b): (&CameraMetrics, &CameraMetrics)| {
        let score = |score: &ScoreDescription| {
            let value = |row: &CameraMetrics| row.scores.get(&score.name).copied();
            let off = match (value(a), value(b)) {
                (None, None) => 0.0,
                (a, b) => (a.unwrap_or(f64::NAN) - b.unwrap_or(f64::NAN)).abs(),
            };
            (off, format!("{} {}", a.camera, score.heading()))
        };
        let spot = ((a.rms_spot_um - b.rms_spot_um).abs(), format!("{} RMS spot um", a.camera));
        kept.scores.iter().map(score).chain([spot]).collect::<Vec<_>>()
    };
    let order = |off: f64| if off.is_nan() { f64::INFINITY } else { off };
    let all = rows.iter().zip(&kept.rows).flat_map(of_row);
    let largest = all.max_by(|(a, _), (b, _)| order(*a).total_cmp(&order(*b)));
    largest.map_or((0.0, None), |(off, of)| (off, (off != 0.0).then_some(of)))
}

/// A camera of a run as it was finished.
pub(crate) fn camera_of(setup: &Setup, folder: &RunFolder, name: &str) -> Result<Camera> {
    let (mut exposure, mut isp, mut network) = (setup.exposure(), setup.isp()?, setup.network()?);
    let blocks: [&mut dyn Block; 3] = [&mut exposure, &mut isp, &mut network];
    load_blocks(&folder.camera(name), blocks, Kept::Numbers)?;
    let lens = camera_lens(folder, name)?.lens;
    let variant = setup.variants.iter().find(|variant| variant.name == name).ok_or_else(|| {
        let message = format!("{}: its experiment has no variant `{name}`", folder.root().display());
        JobError::input(message, "put the experiment of the run back as it was")
    })?;
    set_sight(&mut network, folder, variant, &lens)?;
    Ok(finished_camera(setup, variant, lens, &exposure, &isp, &network)?)
}

/// A camera of a run whose lens can be made, and what its lens can be off by.
struct DesignToMake {
    camera: String,
    tolerances: Tolerances,
    /// What is left out, because a lens that is off by it has no symmetry.
    left_out: LeftOut,
}

/// Makes cameras from every design, and writes their figures into the run's folder and its report.
fn make(
    made: &Made,
    designs: &[DesignToMake],
    metrics: &Metrics,
    scorer: &Scorer,
    folder: &RunFolder,
    context: &Context,
) -> Result<MadeMetrics> {
    let setup = scorer.setup();
    let total = (designs.len() * made.trials) as u64;
    let Made { trials, seed, pictures, calibrate, .. } = *made;
    let plan = TrialPlan { trials, seed, pictures, is_calibrated: calibrate };
    let (mut limits, mut rows, mut done) = (BTreeMap::new(), Vec::new(), 0);
    let mut scores = metrics.scores.clone();
    for DesignToMake { camera: name, tolerances, .. } in designs {
        let camera = camera_of(setup, folder, name)?;
        let mut tick = || {
            done += 1;
            context.progress(done, total, name);
        };
        let found =
            made_cameras(scorer, &camera, tolerances, &plan, &mut tick).map_err(|error| match error {
                MadeError::Tolerance(error) => {
                    JobError::input(format!("{name}: {error}"), "correct the tolerance file")
                }
                MadeError::Design(error) => error.into(),
            })?;
        if limits.is_empty() {
            limits = found.drawn.clone();
            let first = scores.first().zip(made.limit);
            limits.extend(first.map(|(score, limit)| (score.name.clone(), limit)));
            let (with_limit, without) =
                scores.into_iter().partition::<Vec<_>, _>(|score| limits.contains_key(&score.name));
            scores = with_limit;
            if !without.is_empty() {
                let names: Vec<_> = without.iter().map(|score| score.name.as_str()).collect();
                context.warning(WarningKind::LeftOut, format!(
                    "the {} pictures hold no object for {}, which is left out; more pictures (--pictures) may have some",
                    made.pictures,
                    names.join(", ")
                ));
            }
        }
        if found.unbuildable > 0 {
            context.warning(
                WarningKind::LensFile,
                format!(
                    "{name}: {} of {trials} lenses cannot be built, and count as failed",
                    found.unbuildable
                ),
            );
        }
        rows.push(found.row(name, &scores, &limits));
    }
    let left_out = designs.last().map_or_else(LeftOut::default, |design| design.left_out);
    if let Some(text) = left_out.in_words() {
        context.warning(WarningKind::LeftOut, text);
    }
    let found = MadeMetrics {
        tolerances: made.tolerances.to_string(),
        is_refocused: made.compensate == Compensate::Focus,
        is_calibrated: calibrate,
        left_out: left_out.tolerances,
        compensators_left_out: left_out.compensators,
        seed: made.seed,
        trials: made.trials,
        pictures: made.pictures.min(metrics.held_out_images * metrics.held_out_places),
        scores,
        limits,
        rows,
    };
    found.write(folder)?;
    crate::run_page::write(setup, folder, context)?;
    Ok(found)
}

impl Made {
    /// The designs whose lenses can be made; a lens without aberrations cannot.
    fn designs(&self, metrics: &Metrics, folder: &RunFolder, context: &Context) -> Result<Vec<DesignToMake>> {
        let mut designs = Vec::new();
        for row in metrics.rows.iter().filter(|row| !row.is_ceiling) {
            let lens = camera_lens(folder, &row.camera)?.lens;
            let file = self.of_lens(&lens)?;
            let (tolerances, left_out) =
                symmetric(file.tolerances(&lens, self.compensate == Compensate::Focus));
            warn_of_wide_tolerances(&row.camera, &lens, (self.path(), &file), &tolerances, context);
            if tolerances.perturbations.is_empty() {
                let message = "nothing is off: there is no tolerance with which the lens keeps its symmetry";
                let hint = "name a grade, or radii, thicknesses or glasses in the file";
                return Err(JobError::input(message, hint));
            }
            designs.push(DesignToMake { camera: row.camera.clone(), tolerances, left_out });
        }
        Ok(designs)
    }

    fn of_lens(&self, lens: &Lens) -> Result<ToleranceFile> {
        match &self.tolerances {
            LensTolerances::Grade(grade) => {
                Ok(ToleranceFile { grade: Some((*grade).into()), ..ToleranceFile::default() })
            }
            LensTolerances::File(path) => read_tolerances(path, lens),
        }
    }

    /// The tolerance file; `None` of a grade.
    fn path(&self) -> Option<&Path> {
        match &self.tolerances {
            LensTolerances::Grade(_) => None,
            LensTolerances::File(path) => Some(path),
        }
    }
}

impl fmt::Display for LensTolerances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grade(Grade::Commercial) => f.write_str("commercial grade"),
            Self::Grade(Grade::Precision) => f.write_str("precision grade"),
            Self::Grade(Grade::High) => f.write_str("high grade"),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_compared_draw_by_draw() {
        let row = |camera: &str, ap50: f64, is_ceiling: bool| {
            serde_json::json!({
                "camera": camera, "ap50": ap50, "is_ceiling": is_ceiling, "rms_spot_um": 7.25, "efl_mm": 25.0,
                "f_number": 2.8, "fov_deg": 40.0, "corner_distortion_percent": -1.5, "psf_captured": 1.0,
                "white_e": 16000.0, "network_steps": 3, "rms_spot_by_field_um": [], "pictures": []
            })
        };
        let metrics: Metrics = serde_json::from_value(serde_json::json!({
            "rows": [row("nominal", 0.4, false), row("end-to-end", 0.55, false), row("perfect", 0.9, true)],
            "seeds": [1], "held_out_images": 3, "held_out_places": 1,
            "scores": [{"name": "ap50", "title": "AP50", "unit": "", "definition": "", "decimals": 4, "higher_is_better": true}]
        }))
        .unwrap();
        let draws: Vec<Draws> = [
            vec![Some(0.4), Some(0.5), Some(0.3)],
            // A draw without a class is none of the difference either.
            vec![Some(0.5), Some(0.7), None],
            vec![Some(0.9); 3],
        ]
        .map(|scores| BTreeMap::from([("ap50".to_owned(), scores)]))
        .into();
        let found = differences(&metrics.rows, &draws, &metrics.scores);
        assert_eq!(found.len(), 1);
        assert_eq!([&found[0].camera, &found[0].against], ["end-to-end", "nominal"]);
        // Between 0.1 and 0.2, with a fortieth of the draws beyond either end.
        let [low, high] = found[0].ranges["ap50"];
        assert!((found[0].scores["ap50"] - 0.15).abs() < 1e-12);
        assert!((low - 0.1025).abs() < 1e-12 && (high - 0.1975).abs() < 1e-12, "{low} {high}");
    }
}
