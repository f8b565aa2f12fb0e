//! A task from outside the crate: how bright is the scene? Its network reads a number in each finished picture.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use burn::module::{Module, Param};
use burn::optim::{AdamConfig, ModuleOptimizer};
use burn::prelude::*;
use petzval_base::Cancel;
use petzval_camera::tape::Frames;
use petzval_design::assets::Assets;
use petzval_design::block::{CameraNetwork, NetworkBlock, Sight};
use petzval_design::camera::{Camera, Labels, Shot, host_image};
use petzval_design::cameras::Cameras;
use petzval_design::design_loop::{DesignLoop, Ending, Observer};
use petzval_design::error::DesignError;
use petzval_design::experiment::{Experiment, NetworkRole, PicturesKey, TaskFacts};
use petzval_design::inputs::keep_inputs;
use petzval_design::report::run_report::report_of_run;
use petzval_design::run::{
    CameraMetrics, Event, Metrics, PictureScore, RunFolder, latest_checkpoint, read_events,
};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_design::task::pictures::Photographs;
use petzval_design::task::{
    Depth, Findings, HeldOut, Judge, Objective, PreparedTask, ScoredPicture, Taken, Task, TaskReport, Tasks,
    WindowPlan, Windows, WindowsOf,
};
use petzval_learn::loss::NamedLoss;
use petzval_learn::score::ScoreDescription;
use petzval_report::design_report::{TaskPart, TaskSection};

use crate::common::{Silent, library};

const EXPERIMENT: &str = r#"
task = "brightness"
lens = "cooke-triplet-nominal"
[psf]
kind = "geometric"
fields = 3
scoring_fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
scoring_blend_error = 2.0
[training]
steps = 40
batch = 4
crop = 64
learning_rate = 0.02
final_learning_rate = 0.02
[scoring]
places_per_side = 1
crop = 64
[[variant]]
name = "a"
[[variant.stage]]
moves = ["network"]
"#;

struct Brightness(Option<CancelsAt>);

/// Cancels a run while its objective looks at a window, for the time of this number, from 1.
#[derive(Clone)]
struct CancelsAt {
    cancel: Cancel,
    looks: Arc<AtomicUsize>,
    at: usize,
}

impl Task for Brightness {
    fn facts(&self) -> TaskFacts {
        TaskFacts {
            name: "brightness",
            network: NetworkRole::Reads,
            network_name: "reader",
            has_detector: false,
            has_python_class: false,
            pictures: PicturesKey::Photos,
            has_classes: false,
            default_scores: Some(&["error"]),
            class_score: None,
            scored: "readings",
        }
    }

    fn scores(&self, _: &Experiment) -> Vec<String> {
        vec!["error".to_owned()]
    }

    fn prepare(&self, _: &Experiment, _: &Assets, _: &Device) -> Result<Box<dyn PreparedTask>, DesignError> {
        Ok(Box::new(Prepared(self.0.clone())))
    }
}

/// The photographs of the pictures' task, with a number for each window.
struct Numbered(Photographs);

fn numbered(shot: Shot) -> Shot {
    let mean = shot.scene.data.iter().sum::<f32>() / shot.scene.data.len() as f32;
    Shot { labels: Labels::new(mean), ..shot }
}

impl Windows for Numbered {
    fn training(&self, cameras: &Cameras, camera: &Camera, step: u64) -> Result<Vec<Shot>, DesignError> {
        Ok(self.0.training(cameras, camera, step)?.into_iter().map(numbered).collect())
    }

    fn validation(&self, cameras: &Cameras, camera: &Camera) -> Result<Vec<Vec<Shot>>, DesignError> {
        let all = self.0.validation(cameras, camera)?.into_iter();
        Ok(all.map(|batch| batch.into_iter().map(numbered).collect()).collect())
    }

    fn held_out(
        &self,
        cameras: &Cameras,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<HeldOut>, DesignError> {
        let all = self.0.held_out(cameras, camera, is_chosen)?.into_iter();
        Ok(all.map(|window| HeldOut { shot: numbered(window.shot), ..window }).collect())
    }

    fn held_out_pictures(&self, experiment: &Experiment) -> [usize; 2] {
        self.0.held_out_pictures(experiment)
    }
}

/// A number for each picture: a weighted mean of its colours, and an offset.
#[derive(Module, Debug)]
struct Reader {
    weights: Param<Tensor<1>>,
}

impl Reader {
    fn read(&self, pictures: Tensor<4>) -> Tensor<1> {
        let [batch, ..] = pictures.dims();
        let means = pictures.mean_dims(&[2, 3]).reshape([batch, 3]);
        let ones = Tensor::ones([batch, 1], &means.device());
        let columns = Tensor::cat(vec![means, ones], 1);
        columns.matmul(self.weights.val().reshape([4, 1])).reshape([batch])
    }
}

/// The reader as the camera holds it.
struct Reading(Reader);

struct LearnsToRead;

impl CameraNetwork for LearnsToRead {
    type Module = Reader;

    fn attached(&self, network: Reader, camera: &Camera, sight: Sight) -> Camera {
        camera.with_reader(Reading(network), sight.sees)
    }

    fn optimizer(&self, _: &Reader) -> ModuleOptimizer {
        AdamConfig::new().init()
    }
}

struct Prepared(Option<CancelsAt>);

impl PreparedTask for Prepared {
    fn windows(&self, plan: &WindowPlan) -> Result<Box<dyn Windows>, DesignError> {
        Ok(Box::new(Numbered(Photographs::load(plan)?)))
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock, DesignError> {
        let weights = Tensor::zeros([4], &cameras.body.device);
        let reader = Reader { weights: Param::from_tensor(weights) };
        Ok(NetworkBlock::new(reader, LearnsToRead))
    }

    fn objective(&self, _: &Cameras) -> Result<Box<dyn Objective>, DesignError> {
        Ok(Box::new(SquaredError(self.0.clone())))
    }

    fn judge(&self, _: &Cameras) -> Result<Box<dyn Judge>, DesignError> {
        Ok(Box::new(Errors))
    }

    fn report(&self, _: &Cameras, _: &RunFolder, metrics: &Metrics) -> Result<TaskReport, DesignError> {
        let html = format!("<p>{} cameras read brightness.</p>", metrics.rows.len());
        let section = TaskSection { title: "Brightness".to_owned(), html };
        let part = TaskPart { sections: vec![section], ..TaskPart::default() };
        Ok(TaskReport { part, ..TaskReport::default() })
    }
}

fn reading(camera: &Camera, pictures: Tensor<4>) -> Result<Tensor<1>, DesignError> {
    let reader = camera.reader::<Reading>().ok_or(DesignError::OtherTask)?;
    Ok(reader.0.read(pictures))
}

struct SquaredError(Option<CancelsAt>);

impl Objective for SquaredError {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss, DesignError> {
        if let Some(CancelsAt { cancel, looks, at }) = &self.0
            && looks.fetch_add(1, Ordering::SeqCst) + 1 == *at
        {
            cancel.set();
        }
        let numbers: Option<Vec<f32>> = shots.iter().map(|shot| shot.labels.of().copied()).collect();
        let numbers = numbers.ok_or(DesignError::OtherTask)?;
        let device = &camera.body().device;
        let wanted = Tensor::from_data(TensorData::new(numbers, [shots.len()]), device);
        let error = reading(camera, frames.finished.clone())? - wanted;
        Ok(NamedLoss::sum(vec![("squared_error", error.square().mean())])?)
    }

    fn windows(&self) -> WindowsOf {
        WindowsOf::Apart
    }
}

struct Errors;

impl Judge for Errors {
    fn scores(&self) -> Vec<ScoreDescription> {
        vec![ScoreDescription {
            name: "error".to_owned(),
            title: "error".to_owned(),
            unit: String::new(),
            definition: "the mean absolute error of brightness".to_owned(),
            decimals: 4,
            higher_is_better: false,
        }]
    }

    fn begin(&self, _: Depth) -> Box<dyn Findings> {
        Box::new(Found(Vec::new()))
    }
}

struct Found(Vec<f64>);

impl Findings for Found {
    fn add(&mut self, taken: Taken) -> Result<ScoredPicture, DesignError> {
        let Taken { camera, window, finished, developed, .. } = taken;
        let wanted: f32 = *window.shot.labels.of().ok_or(DesignError::OtherTask)?;
        let found = reading(camera, finished.clone())?.into_data().try_to_vec::<f32>().unwrap()[0];
        self.0.push(f64::from((found - wanted).abs()));
        let scores = BTreeMap::from([("error".to_owned(), self.0[self.0.len() - 1])]);
        Ok(ScoredPicture {
            score: PictureScore { photo: window.name, relative_field: window.relative_field, scores },
            truth: host_image(camera.truths(&[window.shot])?)?,
            developed,
            output: host_image(finished)?,
        })
    }

    fn scores(&self) -> BTreeMap<String, f64> {
        BTreeMap::from([("error".to_owned(), self.0.iter().sum::<f64>() / self.0.len() as f64)])
    }
}

#[test]
fn a_task_from_outside_is_designed_for_scored_reported_and_read_again() {
    let tasks = Tasks::built_in().with(Brightness(None));
    let library = library().with_tasks(tasks.clone());
    let folder = tempfile::tempdir().unwrap();
    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    // Without it in the registry, the experiment names no task.
    assert!(Experiment::parse(EXPERIMENT).unwrap_err().to_string().contains("`brightness` is no task"));

    let experiment = tasks.parse(EXPERIMENT).unwrap();
    let setup = Arc::new(Setup::new(experiment, &library, Device::flex().autodiff()).unwrap());
    let scorer = Scorer::new(setup.clone()).unwrap();
    keep_inputs(&scorer, &library, &run, None).unwrap();
    let design = DesignLoop::new(run.clone(), scorer).unwrap();
    let Ending::Finished(metrics) = design.run(&mut Silent).unwrap() else {
        panic!("nothing stops it");
    };
    // Pictures are bright by about 0.2: a reader that had learnt nothing would read 0.
    let error = metrics.rows[0].scores["error"];
    let bright: f32 = setup
        .held_out_shots(&setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap(), &|_| true)
        .unwrap()
        .iter()
        .map(|window| *window.shot.labels.of::<f32>().unwrap())
        .sum::<f32>()
        / metrics.held_out_images as f32;
    assert!(error < 0.5 * f64::from(bright), "{error} {bright}");

    // The facts of the machine, which a program writes that begins runs.
    std::fs::write(run.environment(), "{}").unwrap();
    let report = report_of_run(&setup, &run, "").unwrap();
    assert_eq!(report.task.sections[0].title, "Brightness");
    assert!(petzval_report::design_report::html(&report).contains("1 cameras read brightness."));
    // The run names its task, and is read again where that is known.
    let again = library.experiment_of_run(&run).unwrap();
    assert_eq!((again.task.as_str(), &again.scoring.scores[..]), ("brightness", &["error".to_owned()][..]));
}

/// Four network steps of four windows each, and a score.
fn short(more: &str) -> String {
    EXPERIMENT.replacen("steps = 40", "steps = 4", 1) + more
}

/// Starts a run, or goes on with it, on one thread, where each window begins after the one before.
fn designed(
    run: &RunFolder,
    text: &str,
    cancels: Option<CancelsAt>,
    keep_every: Duration,
    watch: &mut Watch,
) -> Ending {
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one_thread.install(|| {
        let tasks = Tasks::built_in().with(Brightness(cancels.clone()));
        let cancel = cancels.map_or_else(|| watch.cancel.clone(), |cancels| cancels.cancel);
        let library = library().with_tasks(tasks.clone()).stopped_by(cancel);
        let experiment = tasks.parse(text).unwrap();
        let setup = Setup::new(experiment, &library, Device::flex().autodiff()).unwrap();
        let scorer = Scorer::new(Arc::new(setup)).unwrap();
        if !run.config().exists() {
            keep_inputs(&scorer, &library, run, None).unwrap();
        }
        let design = DesignLoop::new(run.clone(), scorer).unwrap().keeping_every(keep_every);
        design.run(watch).unwrap()
    })
}

/// Sees which step is the last one that is kept, and may cancel a score.
struct Watch {
    run: RunFolder,
    cancel: Cancel,
    cancels_scores: bool,
    /// Where the run began or went on.
    from: u64,
    /// After each step, before anything is kept of it.
    kept_in_steps: Vec<u64>,
    /// Before each picture of a score.
    kept_in_scores: Vec<u64>,
}

impl Watch {
    fn new(run: &RunFolder, cancels_scores: bool) -> Self {
        let (cancel, from) = (Cancel::default(), 0);
        let (kept_in_steps, kept_in_scores) = (Vec::new(), Vec::new());
        Self { run: run.clone(), cancel, cancels_scores, from, kept_in_steps, kept_in_scores }
    }

    fn kept(&self) -> u64 {
        latest_checkpoint(&self.run).unwrap().map_or(0, |(step, _)| step)
    }
}

impl Observer for Watch {
    fn start(&mut self, done: u64, _: u64) {
        self.from = done;
    }
    fn step(&mut self, _: &Event) {
        self.kept_in_steps.push(self.kept());
    }
    fn scoring(&mut self, _: &str, _: usize, _: usize) {
        self.kept_in_scores.push(self.kept());
        if self.cancels_scores {
            self.cancel.set();
        }
    }
    fn camera(&mut self, _: &CameraMetrics) {}
}

const NEVER: Duration = Duration::MAX;

#[test]
fn a_run_that_is_stopped_in_its_first_score_goes_on_with_that_score() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str| RunFolder::create(&folder.path().join(name)).unwrap();
    let whole = run("whole");
    let finished = designed(&whole, &short(""), None, NEVER, &mut Watch::new(&whole, false));
    assert!(matches!(finished, Ending::Finished(_)));

    let stopped = run("stopped");
    let mut watch = Watch::new(&stopped, true);
    assert_eq!(designed(&stopped, &short(""), None, NEVER, &mut watch), Ending::Stopped(4));
    // Before the first picture, so that a run that is killed in its score goes on there as well.
    assert_eq!((&watch.kept_in_steps[..], &watch.kept_in_scores[..]), (&[0; 4][..], &[4][..]));
    let mut watch = Watch::new(&stopped, false);
    assert_eq!(designed(&stopped, &short(""), None, NEVER, &mut watch), finished);
    assert_eq!((watch.from, watch.kept_in_steps), (4, vec![4]));
}

#[test]
fn steps_that_end_so_long_after_the_last_checkpoint_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    let mut watch = Watch::new(&run, false);
    designed(&run, &short(""), None, Duration::ZERO, &mut watch);
    assert_eq!(watch.kept_in_steps, [0, 1, 2, 3, 4]);
}

#[test]
fn a_step_that_is_cancelled_between_its_windows_is_taken_again_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str| RunFolder::create(&folder.path().join(name)).unwrap();
    let text = short("[validation]\nevery = 2\nwindows = 4\n");
    let losses = |run: &RunFolder| -> Vec<_> {
        read_events(&run.events()).unwrap().into_iter().map(|event| (event.step, event.losses)).collect()
    };
    let whole = run("whole");
    let finished = designed(&whole, &text, None, NEVER, &mut Watch::new(&whole, false));
    assert_eq!(losses(&whole).len(), 5);

    // In the second step, in the validation at its end, and in the third step.
    for (at, last) in [(6, 1), (10, 1), (14, 2)] {
        let stopped = run(&at.to_string());
        let cancels = CancelsAt { cancel: Cancel::default(), looks: Arc::default(), at };
        let looks = cancels.looks.clone();
        let ending = designed(&stopped, &text, Some(cancels), NEVER, &mut Watch::new(&stopped, false));
        assert_eq!(ending, Ending::Stopped(last), "{at}");
        assert_eq!(looks.load(Ordering::SeqCst), at, "a window was begun after the run was cancelled");
        assert_eq!((Watch::new(&stopped, false).kept(), losses(&stopped).len()), (last, last as usize));
        let mut watch = Watch::new(&stopped, false);
        assert_eq!(designed(&stopped, &text, None, NEVER, &mut watch), finished, "{at}");
        assert_eq!(watch.from, last);
        // With the scores of the last weights, which are in `finished`: the file of weights has identifiers of its run as well.
        assert_eq!(losses(&stopped), losses(&whole), "{at}");
    }
}
