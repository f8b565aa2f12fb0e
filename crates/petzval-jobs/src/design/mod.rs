//! `design`: the joint optimisation of a camera, and the comparison with its controls.

mod variant_names;
mod watch;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_base::simd::level;
use petzval_design::assets::Text;
use petzval_design::design_loop::{DesignLoop, Ending};
use petzval_design::error::DesignError;
pub use petzval_design::experiment::Settings;
use petzval_design::experiment::{Experiment, PicturesKey, STREET, is_input};
use petzval_design::first_look::first_look;
use petzval_design::inputs::{Inputs, SetupFor, check_inputs, keep_inputs, setup_of_run};
use petzval_design::path_text::path_text;
use petzval_design::plausible::check;
use petzval_design::run::input_list::{InputList, check_pictures_are_there};
use petzval_design::run::{
    BegunRun, DigestCheck, RunFolder, RunRecord, VERSION, extend_run, read_events, write_file,
};
use petzval_design::scalar_log::ScalarLog;
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_design::task::{Purpose, Remark};
use petzval_learn::Device;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::device_check::Gate;
use crate::error::{JobError, Result, Stopped, json};
use crate::event::WarningKind;
pub use crate::experiment::DEFAULT_EXPERIMENT;
use crate::init;
use crate::input::ExperimentInput;
use crate::machine::environment;
use crate::missing_scores::warn_of_missing;
use crate::own_lens::{is_lens, own_lens};
use crate::own_pictures::{absolute, with_pictures};
use crate::range::check_ranges;
use crate::results::check_folder;
use watch::Watch;

pub use variant_names::VariantNames;

pub use petzval_design::first_look::FirstLook;
pub use petzval_design::run::Metrics;

/// How the names of a lens and a sensor end that are fitted to each other and are in no file.
pub const FITTED: &str = " (fitted)";

petzval_base::parameters! {
    /// A run to begin, or to go on with.
    pub struct Request {
        /// Begin a run, or go on with one.
        run: Run = Run::New(NewRun::default());
        /// Where tensors live.
        device: String = crate::usual::device();
        /// Further forms in which losses, scores and figures of lenses are written after every step. A run that has them goes on with them.
        log: Vec<LogForm> = Vec::new();
    }
}

/// A form of the curves of a run, beside its `events.jsonl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LogForm {
    /// `tensorboard/VARIANT/` with event files of TensorBoard, and `scalars.csv` with the same numbers.
    Tensorboard,
}

/// Which run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Run {
    /// A new one.
    New(NewRun),
    /// One that was begun before.
    Resume(Resume),
}

petzval_base::parameters! {
    /// A run to go on with.
    pub struct Resume {
        /// Make every camera longer, so that its network takes this many steps in all.
        extend_to: Option<usize> = None, "", 1..10_000_000, Log, "give the network steps in all";
    }
    also {
        /// Its folder.
        run: PathBuf = PathBuf::new();
        /// Where its photographs are now, if they were moved.
        photos: Option<PathBuf> = None;
        /// Where its labelled pictures are now, if they were moved.
        data: Option<PathBuf> = None;
        /// Files or folders of the run, by their path below it, that may differ from their digests.
        accept_changed: Vec<String> = Vec::new();
    }
}

petzval_base::parameters! {
    /// A run to begin.
    pub struct NewRun {
        /// Experiment: a built-in name, the path of a file, or the experiment itself; or the name or path of a lens, for which one is made as `init`
        /// does.
        experiment: ExperimentInput = DEFAULT_EXPERIMENT.into();
        /// Folder of the run; `runs/EXPERIMENT-seed-SEED` if none is given, where a file `experiment.toml` is called by its folder, and the name of
        /// a variant that is made alone stands before the seed.
        out: Option<PathBuf> = None;
        /// What differs from the experiment's file.
        changes: Changes = Changes::default();
    }
}

petzval_base::parameters! {
    /// What differs from the file of an experiment.
    pub struct Changes {
        /// Network steps of each variant in place of `training.steps`, or of `isp.steps` where a hardware ISP stands; lens steps in
        /// proportion. At least 1.
        steps: Option<usize> = None, "", 1..10_000_000, Log, "give at least one network step: a few hundred on a CPU, some ten thousand on a GPU";
    }
    also {
        /// Seed of everything random.
        seed: Option<u64> = None;
        /// Folder of pictures in place of the experiment's.
        photos: Option<PathBuf> = None;
        /// Labelled pictures in place of the experiment's scenes: a folder of pictures with boxes in COCO format, or with label images for a segmentation.
        data: Option<PathBuf> = None;
        /// Take the budget of a night on a GPU, see [`Experiment::to_full_size`]; then `steps` must be none.
        is_full: bool = false;
        /// Make this variant or these alone, and those from which they start.
        variant: Option<VariantNames> = None;
        /// Values in place of those of the file, by key path: `{"training.steps": 400, "psf.kind": "diffraction"}`. An element of a list of tables is
        /// named by its `name` or its place from 0, as in `variant.end-to-end.stage.2.schedule.optics.learning_rate`.
        set: Settings = Settings::new();
    }
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Folder of the run.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub run: PathBuf,
    /// The figures.
    pub metrics: Box<Metrics>,
    /// The report.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub report: PathBuf,
    /// The result in sentences, as the report has it.
    pub sentences: Vec<String>,
}

/// How a cancelled run ends that is kept in a folder, and goes on from there.
fn stopped(message: impl Into<String>, run: &Path, request: &Request) -> JobError {
    let run = run.to_path_buf();
    let resume = Run::Resume(Resume { run: run.clone(), ..Resume::default() });
    let again = Request { run: resume, ..request.clone() };
    Stopped::new(message).keeping(run).going_on_with(&again).into()
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    seed: Some(|request, seed| {
        if let Run::New(new) = &mut request.run {
            new.changes.seed = Some(seed);
        }
    }),
    place: Some(|request, folder| {
        if let Run::New(new) = &mut request.run {
            new.out = Some(folder.to_owned());
        }
    }),
    going_on: Some(|request, folder| {
        let is_begun = RunFolder::open(folder).is_ok_and(|run| run.record().is_file());
        is_begun.then(|| Request {
            run: Run::Resume(Resume { run: folder.to_owned(), ..Resume::default() }),
            ..request.clone()
        })
    }),
    behind: Some(|request, context| match &request.run {
        // The experiment that is made for a lens names built-in inputs alone.
        Run::New(new) => {
            let (name, placed) = new.experiment.placed(context)?;
            if is_lens(&name, &placed) { Ok(Vec::new()) } else { Ok(inputs_of(&resolved(new, context)?)) }
        }
        Run::Resume(_) => Ok(Vec::new()),
    }),
    ..AsUnit::PLAIN
};

/// Files and folders that an experiment names.
pub(crate) fn inputs_of(experiment: &Experiment) -> Vec<PathBuf> {
    let mut experiment = experiment.clone();
    let named = experiment.inputs_mut().map(|(key, name)| (key, PathBuf::from(&*name)));
    named.filter(|(key, path)| is_input(key, path)).map(|(_, path)| path).collect()
}

/// Starts or continues a run, until every camera is made and scored. A run that is cancelled leaves a checkpoint.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    run_from(request, context).map_err(|error| match (&request.run, error) {
        // A run that goes on is as it was until it takes a step.
        (Run::Resume(resume), JobError::Stopped(early)) if early.resume.is_none() => {
            stopped(early.message, &resume.run, request)
        }
        (_, error) => error,
    })
}

fn run_from(request: &Request, context: &Context) -> Result<Response> {
    let device = context.device(&request.device)?;
    let mut extension = None;
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    let accepted = match &request.run {
        Run::Resume(resume) => &resume.accept_changed[..],
        Run::New(_) => &[],
    };
    // Only one process works on a run until the lock is dropped.
    let (scorer, folder, _lock) = match &request.run {
        Run::Resume(resume) => {
            let folder = RunFolder::open(&resume.run)?;
            let lock = folder.lock()?;
            DigestCheck::of_request(&folder, accepted, &warn)?.check_before_going_on()?;
            let (record, config) = resumed(resume, &folder, context)?;
            if record.version != VERSION {
                let begun = &record.version;
                context.warning(
                    WarningKind::OtherVersion,
                    format!("the run was begun by Petzval {begun}, and goes on with {VERSION}"),
                );
            }
            warn_of_another_level(&folder, context)?;
            let key = context.assets.facts_of(&config)?.pictures;
            let pictures = pictures_now(key, resume.photos.as_deref(), resume.data.as_deref())?;
            let experiment = context.assets.experiment_in(&folder, config.clone(), pictures)?;
            check_pictures_are_there(&folder, &experiment, key)?;
            note_check_of_pictures(&experiment, context);
            let needed = SetupFor::Windows(Purpose::Training, None);
            let setup = setup_of_run(&folder, experiment, &context.assets, device, needed)?;
            remember_pictures(check_inputs(&setup, &folder)?, &folder)?;
            Gate { device: &request.device, setup: &setup, folder: &folder }.pass(context)?;
            extension = (config != record.config).then_some((record, config));
            (scorer(setup)?, folder, lock)
        }
        Run::New(new) => {
            // Everything is checked before the folder is made, so that a mistake leaves nothing behind.
            let (setup, look, own, usual_steps) = looked_at(new, device, context)?;
            if let Some(problem) = look.problems.first() {
                let hint = "`petzval lens focus` moves the image plane; a larger psf.pitch_um or psf.grid holds more light";
                return Err(JobError::input(problem.clone(), hint));
            }
            context.note(look.steps_in_words());
            let scorer = scorer(setup)?;
            let setup = scorer.setup();
            let root = root_of(new, &setup.experiment);
            let begun = BegunRun::new(&root)?;
            let gate = Gate { device: &request.device, setup, folder: begun.folder() };
            if let Err(refused) = gate.pass(context) {
                if let Err(stays) = begun.take_back() {
                    context.note(format!("{stays}; what was made for the run stays in {}", root.display()));
                }
                return Err(refused);
            }
            let (folder, lock) = begun.keep();
            write_file(&folder.environment(), json(&environment(context))?.as_bytes())?;
            keep_inputs(&scorer, &own.assets, &folder, usual_steps)?;
            (scorer, folder, lock)
        }
    };
    let setup = scorer.setup().clone();
    let scores = scorer.scores();
    // What is damaged is found before anything changes.
    let check = DigestCheck::new(&folder, accepted, &warn);
    let design = DesignLoop::checked(folder.clone(), scorer, &check)?;
    if let Some((record, longer)) = extension {
        extend_run(&folder, record, longer)?;
        context.note("config.toml and run.json are extended; the figures and the report are made again");
    }
    context.note(&setup.experiment.name);
    context.note(format!("run folder: {}", folder.root().display()));
    report_pictures(&setup, context);
    report_weights(&setup, context);
    let psf = setup.experiment.psf.clone();
    let is_logged = !request.log.is_empty() || ScalarLog::is_there(&folder);
    let curves = is_logged.then(|| ScalarLog::open(setup.clone(), &folder)).transpose()?;
    let log = folder.events();
    let events = if log.is_file() { read_events(&log)? } else { Vec::new() };
    let mut watch = Watch::new(context, scores, psf, events, curves);
    match design.run(&mut watch).map_err(JobError::of_run)? {
        Ending::Stopped(step) => Err(stopped(format!("stopped at step {step}"), folder.root(), request)),
        Ending::Finished(metrics) => {
            warn_of_missing(&metrics, context);
            let (report, sentences) = crate::run_page::write(&setup, &folder, context)?;
            Ok(Response { run: folder.root().to_path_buf(), metrics, report, sentences })
        }
    }
}

/// Where the user says that the pictures of a run are now. A run has either photographs or labelled pictures.
pub(crate) fn pictures_now<'p>(
    key: PicturesKey,
    photos: Option<&'p Path>,
    data: Option<&'p Path>,
) -> Result<Option<&'p Path>> {
    let there = match (key, photos, data) {
        (PicturesKey::Data, Some(photos), _) => {
            let hint = "its pictures have labels: name them with --data";
            return Err(JobError::setting(
                "photos",
                photos.display(),
                "the run looks at labelled scenes",
                hint,
            ));
        }
        (PicturesKey::Photos, _, Some(data)) => {
            let hint = "its pictures have no labels: name them with --photos";
            return Err(JobError::setting("data", data.display(), "the run makes pictures", hint));
        }
        (_, photos, data) => photos.or(data),
    };
    match there {
        Some(path) if !path.exists() => {
            let key = if data.is_some() { "data" } else { "photos" };
            Err(JobError::setting(
                key,
                path.display(),
                "there is no such folder or file",
                "give one that exists",
            ))
        }
        there => Ok(there),
    }
}

/// Notes where the pictures of a run are now, for the next time.
fn remember_pictures(now: Inputs, folder: &RunFolder) -> Result<()> {
    let Some(then) = InputList::read(folder)? else { return Ok(()) };
    let place = |list: &InputList| list.pictures.as_ref().map(|pictures| pictures.place.clone());
    if place(&then) != place(&now.list) {
        now.list.write(folder)?;
    }
    Ok(())
}

/// Warns where another instruction set goes on with a run: its rounding differs in the last digits.
fn warn_of_another_level(folder: &RunFolder, context: &Context) -> Result<()> {
    let path = folder.environment();
    if !path.is_file() {
        return Ok(());
    }
    let text = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
    let begun: serde_json::Value = serde_json::from_str(&text).map_err(|e| {
        JobError::input(format!("{}: {e}", path.display()), "it was changed since it was written")
    })?;
    match begun["simd_used"].as_str() {
        Some(begun) if begun != level() => context.warning(WarningKind::InstructionSet, format!(
            "the run was begun with the instruction set {begun}, and goes on with {}: its figures differ from those of an uninterrupted run \
             in their last digits, and small steps may lead elsewhere",
            level()
        )),
        _ => {}
    }
    Ok(())
}

/// A run to look at before it begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookRequest {
    /// The run.
    pub run: NewRun,
    /// Where tensors live.
    #[serde(default = "crate::usual::device")]
    pub device: String,
}

/// As [`look`].
pub fn look_at(request: &LookRequest, context: &Context) -> Result<FirstLook> {
    look(&request.run, &request.device, context)
}

/// Looks at the experiment of a new run, as before its first step: what its lenses show on its sensor, what they violate, how its photographs fit, and
/// how many steps it takes. Nothing is written.
pub fn look(new: &NewRun, device: &str, context: &Context) -> Result<FirstLook> {
    let (setup, mut look, ..) = looked_at(new, context.device(device)?, context)?;
    look.warnings.extend(report_pictures(&setup, context));
    Ok(look)
}

/// Makes the experiment of a new run ready and checks it before the first step. Returns it with the findings, with the context in which
/// its lens and sensor are found, and with the steps that it has without the request, where that changes them. Every warning is reported.
fn looked_at(
    new: &NewRun,
    device: Device,
    context: &Context,
) -> Result<(Setup, FirstLook, Context, Option<usize>)> {
    let NewExperiment { experiment, context: own, usual_steps } = prepared(new, context)?;
    check_root(new, &experiment, context)?;
    note_check_of_pictures(&experiment, &own);
    let setup = Setup::new(experiment, &own.assets, device)?;
    let name = new.experiment.name();
    let source = if is_lens(&name, &own) {
        // There is no file of the experiment to show.
        Text { path: PathBuf::from(name.as_ref()), text: String::new() }
    } else {
        own.assets.text("experiment", "experiments", &name)?
    };
    let mut look = first_look(&setup)?;
    let others = check(&setup, &source)?;
    look.warnings.extend(others);
    look.warnings.iter().for_each(|warning| context.warning(WarningKind::Experiment, warning));
    Ok((setup, look, own, usual_steps))
}

/// Says that the setup decodes every picture of a data set to find damaged ones, which takes minutes for thousands of them.
fn note_check_of_pictures(experiment: &Experiment, context: &Context) {
    if experiment.data != STREET {
        context.note(format!("checking every picture of {}", experiment.data));
    }
}

/// Lists the training, held-out and skipped pictures, and what their files say that is not obeyed: this is returned as well.
pub(crate) fn report_pictures(setup: &Setup, context: &Context) -> Vec<String> {
    let mut warnings = Vec::new();
    for remark in setup.windows().iter().flat_map(|windows| windows.remarks()) {
        match remark {
            Remark::Note(text) => context.note(text),
            Remark::Warning(text) => {
                context.warning(WarningKind::DataSet, &text);
                warnings.push(text);
            }
        }
    }
    warnings
}

/// Says from which weights the networks for pictures start, if they have any.
fn report_weights(setup: &Setup, context: &Context) {
    let network = &setup.experiment.network;
    if !setup.experiment.has_picture_network(setup.facts.network) {
        return;
    }
    context.note(match setup.task.given_weights() {
        Some(_) if network.has_built_in_weights() => "networks start from the built-in weights".to_owned(),
        Some(_) => format!("networks start from the weights of {}", network.weights),
        None => "networks start from weights drawn from the seed".to_owned(),
    });
}

/// The record of a run and the experiment to go on with, which is longer where the request extends it. A `config.toml` that differs
/// from the record is refused.
fn resumed(resume: &Resume, folder: &RunFolder, context: &Context) -> Result<(RunRecord, Experiment)> {
    check_ranges(resume)?;
    let found = context.assets.config_of_run(folder)?;
    let record = RunRecord::read(folder)?.ok_or_else(|| {
        let message =
            format!("{}: is missing, or an earlier version began the run", folder.record().display());
        let hint = format!("begin it again: petzval design {} --out FOLDER", folder.config().display());
        JobError::input(message, hint)
    })?;
    let longer = match resume.extend_to {
        None => record.config.clone(),
        Some(steps) => (record.config.extended_to(steps, context.assets.facts_of(&record.config)?.network))
            .map_err(|(message, hint)| JobError::setting("extend_to", steps, message, hint))?,
    };
    // An extension that was cut short has changed config.toml already.
    if found != longer
        && let Some(error) = context.assets.changed_config(&record, folder)?
    {
        let hint = format!(
            "put it back as it was; or make all cameras longer with --extend-to N; or begin another run: petzval design {} --out FOLDER",
            folder.config().display()
        );
        return Err(JobError::File { path: folder.config(), error: Box::new(error.hint(hint)) });
    }
    Ok((record, longer))
}

/// What scores the cameras of an experiment.
pub(crate) fn scorer(setup: Setup) -> Result<Scorer> {
    Ok(Scorer::new(Arc::new(setup))?)
}

/// The experiment of a new run, complete: every default and every change is in it.
///
/// Paths are made absolute, so that its text can be run again from any folder.
pub fn resolved(new: &NewRun, context: &Context) -> Result<Experiment> {
    Ok(prepared(new, context)?.experiment)
}

/// The experiment of a new run, see [`resolved`], and the folder that the run would have.
pub(crate) fn config_of(new: &NewRun, context: &Context) -> Result<(Experiment, PathBuf)> {
    let experiment = resolved(new, context)?;
    let folder = root_of(new, &experiment);
    Ok((experiment, folder))
}

/// The experiment of a new run.
pub(crate) struct NewExperiment {
    pub experiment: Experiment,
    /// Where its lens and sensor are found.
    pub context: Context,
    /// Most network steps of a camera where the request says nothing of steps; none if it changes none.
    usual_steps: Option<usize>,
}

impl NewExperiment {
    /// What `made` makes with the settings of the request, with all other changes.
    fn new(
        made: impl Fn(&Settings) -> Result<Experiment>,
        changes: &Changes,
        context: Context,
    ) -> Result<Self> {
        let complete = |changes: &Changes| changed(made(&changes.set)?, changes, &context);
        let experiment = complete(changes)?;
        let role = context.assets.facts_of(&experiment)?.network;
        let mut usual = Changes { steps: None, ..changes.clone() };
        usual.set.retain(|key, _| key.rsplit('.').next() != Some(STEPS));
        usual.set.values_mut().for_each(forget_steps);
        // An experiment that is wrong without these settings has no usual steps.
        let usual = (usual != *changes).then(|| complete(&usual)).and_then(Result::ok);
        let usual_steps = usual.map(|usual| usual.most_steps(role));
        let usual_steps = usual_steps.filter(|usual| *usual != experiment.most_steps(role));
        Ok(Self { experiment, context, usual_steps })
    }
}

/// The key of a number of steps, in every table of an experiment.
const STEPS: &str = "steps";

/// Leaves numbers of steps out of the value of a setting, where that is a table.
fn forget_steps(value: &mut Value) {
    match value {
        Value::Object(table) => {
            table.remove(STEPS);
            table.values_mut().for_each(forget_steps);
        }
        Value::Array(values) => values.iter_mut().for_each(forget_steps),
        _ => {}
    }
}

/// The experiment of a new run, and the context in which its lens and sensor are found. If the request names a lens in place of an
/// experiment, lens and experiment are fitted to each other as by `init`; they are then in no file.
pub(crate) fn prepared(new: &NewRun, context: &Context) -> Result<NewExperiment> {
    let (name, context) = &new.experiment.placed(context)?;
    let is_built_in =
        ["experiments", "lenses"].iter().any(|folder| context.assets.names(folder).contains(&name.as_str()));
    if !is_built_in {
        check_is_no_folder(Path::new(name))?;
    }
    if !is_lens(name, context) {
        let made = |set: &Settings| Ok(context.assets.experiment_with(name, set)?);
        return NewExperiment::new(made, &new.changes, context.clone());
    }
    let usual = context.assets.experiment(DEFAULT_EXPERIMENT)?;
    // Settings are those of the fitted experiment; whether their keys are known does not depend on the lens.
    let with_settings = context.assets.experiment_with(DEFAULT_EXPERIMENT, &new.changes.set)?;
    // What is refused for every lens is refused before this one is fitted, which takes seconds and many notes.
    let as_requested = changed(with_settings, &new.changes, context)?;
    check_root(new, &as_requested, context)?;
    // Windows and the grid of the PSFs are fitted to the photographs of the run.
    let usual = Experiment { photos: as_requested.photos, ..usual };
    let made = own_lens(usual, name, None, context)?;
    let is_in_no_file = context.assets.text_in_no_file(name).is_some();
    let stem = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
    let stem = if is_in_no_file { "lens".into() } else { stem };
    let fitted = format!("{stem}{FITTED}");
    let files = [("lenses", made.lens_text), ("sensors", made.sensor_text)];
    let files = files.map(|(folder, text)| (format!("{folder}/{fitted}.toml"), text));
    let assets = context.assets.clone().with_files(files);
    let fitted_grid = (made.experiment.psf.grid, made.experiment.psf.pitch_um);
    let experiment = Experiment { lens: fitted.clone(), sensor: fitted, ..made.experiment };
    let set = |set: &Settings| Ok(assets.changed_by(experiment.clone(), set)?);
    let prepared = NewExperiment::new(set, &new.changes, context.clone().with_assets(assets.clone()))?;
    let (grid, pitch_um) = (prepared.experiment.psf.grid, prepared.experiment.psf.pitch_um);
    if (grid, pitch_um) != fitted_grid {
        context.note(format!(
            "psf: the settings of the request give a grid of {grid} x {grid} cells of {pitch_um} um in place of the fitted one"
        ));
    }
    Ok(prepared)
}

/// Refuses a folder in place of an experiment, and says how to go on with the run or the experiment in it.
fn check_is_no_folder(path: &Path) -> Result<()> {
    if !path.is_dir() {
        return Ok(());
    }
    let (what, hint) = if RunFolder::open(path).is_ok() {
        ("the folder of a run", format!("go on with it: petzval design --resume {}", path.display()))
    } else if path.join(init::EXPERIMENT).is_file() {
        ("a folder", format!("name the experiment in it: {}", path.join(init::EXPERIMENT).display()))
    } else {
        ("a folder", "name a file of an experiment or of a lens, or a built-in one".to_owned())
    };
    Err(JobError::input(format!("{}: is {what}, not an experiment", path.display()), hint))
}

/// An experiment with the changes of a request.
fn changed(mut experiment: Experiment, changes: &Changes, context: &Context) -> Result<Experiment> {
    check_ranges(changes)?;
    check_said_once(changes)?;
    let facts = context.assets.facts_of(&experiment)?;
    if let Some(seed) = changes.seed {
        experiment.seed = seed;
    }
    let (photos, data) = (changes.photos.as_deref(), changes.data.as_deref());
    experiment = with_pictures(experiment, photos, data, facts.pictures)?;
    for (key, name) in experiment.inputs_mut() {
        let path = Path::new(name.as_str());
        if is_input(&key, path) {
            *name = absolute(path)?;
        }
    }
    if changes.is_full {
        if let Some(steps) = changes.steps {
            let hint = "the full size has its own: leave one of the two out";
            return Err(JobError::setting("steps", steps, "contradicts the full size", hint));
        }
        experiment.to_full_size(facts.network);
    }
    if let Some(steps) = changes.steps {
        experiment.scale_steps(steps, facts.network);
    }
    if let Some(variant) = &changes.variant {
        let names = variant.names();
        let known: Vec<&str> = experiment.variant.iter().map(|v| v.name.as_str()).collect();
        let refused = || {
            let there = format!("there are {}", known.join(", "));
            match names.iter().find(|name| !known.contains(&name.as_str())) {
                Some(name) => JobError::setting("variant", name, "no such variant", there),
                None => JobError::setting("variant", "[]", "names no variant", there),
            }
        };
        experiment = experiment.only(names).ok_or_else(refused)?;
    }
    Ok(experiment)
}

/// Refuses settings of keys for which the request has a field that is used.
fn check_said_once(changes: &Changes) -> Result<()> {
    let Changes { seed, photos, data, steps, is_full, set, .. } = changes;
    let fields = [
        ("--seed", seed.is_some(), &["seed"][..]),
        ("--photos", photos.is_some(), &["photos"]),
        ("--data", data.is_some(), &["data"]),
        ("--steps", steps.is_some(), &["training.steps", "isp.steps"]),
        ("--full", *is_full, &["training.steps", "isp.steps", "network.base_channels", "training.batch"]),
    ];
    for (option, _, keys) in fields.into_iter().filter(|(_, is_used, _)| *is_used) {
        if let Some((key, value)) = set.iter().find(|(key, _)| keys.contains(&key.as_str())) {
            let message = format!("{option} decides that as well");
            return Err(JobError::setting(
                "set",
                format!("{key}={value}"),
                message,
                "leave one of the two out",
            ));
        }
    }
    Ok(())
}

/// Sees that a new run can have its folder. A folder that the request leaves out may hold a run, so that its experiment can be looked at again.
fn check_root(new: &NewRun, experiment: &Experiment, context: &Context) -> Result<()> {
    let root = root_of(new, experiment);
    // A run is opened again by this text.
    path_text(&root)?;
    check_folder(&root, NO_NAMES, context)?;
    if new.out.is_some() {
        RunFolder::check_new(&root)?;
    }
    Ok(())
}

/// No files: those of a run have names of their own.
const NO_NAMES: [&Path; 0] = [];

/// The folder of a new run.
fn root_of(new: &NewRun, experiment: &Experiment) -> PathBuf {
    new.out.clone().unwrap_or_else(|| {
        default_root(new.experiment.short_name(), new.changes.variant.as_ref(), experiment)
    })
}

fn default_root(name: &str, variant: Option<&VariantNames>, experiment: &Experiment) -> PathBuf {
    let path = Path::new(name);
    // Every folder of `init` has a file of this name.
    let of_init = Some(path).filter(|path| path.ends_with(init::EXPERIMENT));
    let whole = of_init.and_then(|path| std::fs::canonicalize(path).ok());
    let folder = whole.as_ref().and_then(|path| path.parent()?.file_name());
    let stem = folder.or(path.file_stem()).map_or_else(|| "run".into(), |s| s.to_string_lossy());
    let variant: String = variant.iter().flat_map(|v| v.names()).map(|name| format!("-{name}")).collect();
    Path::new("runs").join(format!("{stem}{variant}-seed-{}", experiment.seed))
}
