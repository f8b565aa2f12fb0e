//! What the watcher of the job hears of a run: steps with the time left, files, cameras, and what is odd about them.

use std::path::Path;
use std::time::Instant;

use petzval_design::design_loop::Observer;
use petzval_design::error::DesignError;
use petzval_design::experiment::PsfConfig;
use petzval_design::pace::{Pace, UnitsLeft};
use petzval_design::run::{CameraMetrics, Event as StepEvent};
use petzval_design::scalar_log::ScalarLog;
use petzval_learn::score::ScoreDescription;

use crate::context::Context;
use crate::event::{CameraScore, Event, WarningKind};

/// Reports a run's steps and finished cameras to the watcher of the job.
pub(super) struct Watch<'a> {
    context: &'a Context,
    scores: Vec<ScoreDescription>,
    /// The errors that PSFs may have.
    psf: PsfConfig,
    total: u64,
    /// Name, light in the corner and field of view of the first camera that is finished, in % and degrees.
    first: Option<(String, f64, f64)>,
    /// The steps that were taken before.
    events: Vec<StepEvent>,
    /// What is left, and how long it takes.
    pace: Pace,
    /// When the latest step ended.
    latest: Instant,
    /// When the score at work began.
    scoring_since: Instant,
    /// Curves for other programs, as long as they can be written.
    curves: Option<ScalarLog>,
}

/// Light in the corner, % of that on the axis, that a camera may lose against the first one before a word is said. The fourth power of the cosine and the
/// aberrations of the pupil change it by less.
const DARKER_PERCENT: f64 = 5.0;

/// Fields of view that differ by less, as a share, are the same.
const SAME_FIELD: f64 = 0.02;

impl<'a> Watch<'a> {
    /// `scores`: those of the experiment. `events`: the steps that were taken before.
    pub(super) fn new(
        context: &'a Context,
        scores: Vec<ScoreDescription>,
        psf: PsfConfig,
        events: Vec<StepEvent>,
        curves: Option<ScalarLog>,
    ) -> Self {
        let (pace, latest) = (Pace::default(), Instant::now());
        Self {
            context,
            scores,
            psf,
            total: 0,
            first: None,
            events,
            pace,
            latest,
            scoring_since: latest,
            curves,
        }
    }

    /// What to say of a camera with less light in its corner than the first one, of the same field of view.
    fn darker(&mut self, m: &CameraMetrics) -> Option<String> {
        let percent = m.corner_light_percent.filter(|_| !m.is_ceiling)?;
        let (first, was, fov_deg) = self.first.get_or_insert((m.camera.clone(), percent, m.fov_deg));
        let sees_the_same = (m.fov_deg / *fov_deg - 1.0).abs() < SAME_FIELD;
        (sees_the_same && percent < *was - DARKER_PERCENT).then(|| {
            format!(
                "{}: the corner of the sensor has {percent:.0} % of the light on the axis, and {was:.0} % behind {first}: part of a smaller spot may be less \
                 light",
                m.camera
            )
        })
    }

    /// Adds to the curves. What cannot be written ends them, and not the run.
    fn add(&mut self, to: impl FnOnce(&mut ScalarLog) -> Result<(), DesignError>) {
        if let Some(Err(error)) = self.curves.as_mut().map(to) {
            self.curves = None;
            let text = format!(
                "{error}; no more curves are written, and those of the whole run are when it goes on"
            );
            self.context.warning(WarningKind::Other, text);
        }
    }
}

impl Observer for Watch<'_> {
    fn start(&mut self, done: u64, total: u64) {
        self.total = total;
        self.context.progress(done, total, "");
        if done > 0 {
            self.context.note(format!("going on from step {done} of {total}"));
        }
    }

    fn plan(&mut self, left: Vec<UnitsLeft>) {
        self.pace = Pace::new(left, &std::mem::take(&mut self.events));
        self.latest = Instant::now();
    }

    fn step(&mut self, event: &StepEvent) {
        // With what the loop does between two steps.
        let seconds = self.latest.elapsed().as_secs_f64();
        self.latest = Instant::now();
        self.pace.note(event, seconds);
        self.context.event(&Event::Step {
            camera: event.camera.clone(),
            block: event.block.clone(),
            step: event.step,
            total: self.total,
            losses: event.losses.clone(),
            time_left: self.pace.time_left(),
        });
        self.add(|curves| curves.event(event));
    }

    fn file(&mut self, path: &Path, what: &str) {
        self.context.event(&Event::File { path: path.to_path_buf(), what: what.to_owned() });
        if what == "lens" {
            self.add(ScalarLog::lens);
        }
    }

    fn note(&mut self, text: &str) {
        self.context.note(text);
    }

    fn scoring(&mut self, camera: &str, done: usize, of: usize) {
        if done == 0 {
            self.scoring_since = Instant::now();
        }
        self.pace.note_scoring(camera, self.scoring_since.elapsed().as_secs_f64(), done, of);
        self.context.event(&Event::Scoring {
            camera: camera.to_owned(),
            done: done as u64,
            total: of as u64,
            time_left: self.pace.time_left(),
        });
    }

    fn camera(&mut self, m: &CameraMetrics) {
        let value = |score: &ScoreDescription| Some(CameraScore::new(score, *m.scores.get(&score.name)?));
        self.context.event(&Event::Camera {
            camera: m.camera.clone(),
            scores: self.scores.iter().filter_map(value).collect(),
            rms_spot_um: m.rms_spot_um,
        });
        if let Some(darker) = self.darker(m) {
            self.context.warning(WarningKind::LostLight, darker);
        }
        if let Some(lost) = self.psf.lost_light(m.psf_captured, None) {
            self.context.warning(
                WarningKind::LostLight,
                format!("{}: {lost}; a larger psf.pitch_um holds more", m.camera),
            );
        }
        if let Some(rough) = self.psf.rough_fields(m.psf_by_rays, None) {
            self.context.warning(WarningKind::PsfError, format!("{}: {rough}", m.camera));
        }
        let Some(errors) = m.psf_errors else { return };
        for (what, error, key, wanted) in [
            (
                "as many pupil cells as are tried",
                errors.pupil,
                "scoring_pupil_error",
                self.psf.scoring_pupil_error,
            ),
            (
                "as many patches as are tried",
                errors.blend,
                "scoring_blend_error",
                self.psf.scoring_blend_error,
            ),
        ] {
            if error > wanted {
                self.context.warning(WarningKind::PsfError, format!(
                    "{}: with {what}, its PSFs have an error of {error:.3} (L1), more than psf.{key} = {wanted}",
                    m.camera
                ));
            }
        }
    }
}
