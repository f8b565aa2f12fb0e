//! The library of a program: its built-in files and its tasks, and the rule by which a name becomes an experiment.

use std::ops::Deref;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError};
use petzval_optics::glass::Catalog;

use crate::assets::{Assets, ExternalIsps, Guests, Text, WarningSink};
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, Settings, TaskFacts, WithSettings, is_input};
use crate::path_text::{path_text, without_detours};
use crate::run::input_list::pictures_of_run;
use crate::run::{ChangedFile, DigestCheck, RunFolder, RunRecord, config_text, json_record};
use crate::task::Tasks;

/// Built-in files and tasks.
#[derive(Clone, Default)]
pub struct Library {
    assets: Assets,
    tasks: Tasks,
}

impl Deref for Library {
    type Target = Assets;

    fn deref(&self) -> &Assets {
        &self.assets
    }
}

impl From<Assets> for Library {
    /// These files, with the tasks of this program.
    fn from(assets: Assets) -> Self {
        Self { assets, tasks: Tasks::built_in() }
    }
}

impl Library {
    /// All files below a folder on disk, for tests and for a changed library.
    pub fn from_folder(root: &Path) -> Result<Self> {
        Ok(Assets::from_folder(root)?.into())
    }

    /// The same files with other tasks.
    pub fn with_tasks(self, tasks: Tasks) -> Self {
        Self { tasks, ..self }
    }

    /// See [`Assets::with_glasses`].
    pub fn with_glasses(self, chosen: Catalog) -> Self {
        Self { assets: self.assets.with_glasses(chosen), ..self }
    }

    /// See [`Assets::with_files`].
    pub fn with_files(self, more: impl IntoIterator<Item = (String, String)>) -> Self {
        Self { assets: self.assets.with_files(more), ..self }
    }

    /// See [`Assets::with_text`].
    pub fn with_text(self, name: String, text: String) -> Self {
        Self { assets: self.assets.with_text(name, text), ..self }
    }

    /// See [`Assets::reporting_warnings`].
    pub fn reporting_warnings(self, warnings: WarningSink) -> Self {
        Self { assets: self.assets.reporting_warnings(warnings), ..self }
    }

    /// See [`Assets::with_external_isps`].
    pub fn with_external_isps(self, external_isps: ExternalIsps) -> Self {
        Self { assets: self.assets.with_external_isps(external_isps), ..self }
    }

    /// See [`Assets::with_guests`].
    pub fn with_guests(self, guests: Guests) -> Self {
        Self { assets: self.assets.with_guests(guests), ..self }
    }

    /// See [`Assets::stopped_by`].
    pub fn stopped_by(self, cancel: Cancel) -> Self {
        Self { assets: self.assets.stopped_by(cancel), ..self }
    }

    /// The tasks that experiments may name.
    pub fn tasks(&self) -> &Tasks {
        &self.tasks
    }

    /// What the task of an experiment decides.
    pub fn facts_of(&self, experiment: &Experiment) -> Result<TaskFacts> {
        Ok(self.tasks.of(experiment)?.facts())
    }

    /// An experiment by path or built-in name. Lens, sensor and photographs that it names by a relative path are
    /// looked for beside it first.
    pub fn experiment(&self, name: &str) -> Result<Experiment> {
        let source = self.text("experiment", "experiments", name)?;
        self.located(self.checked(&source)?, &source)
    }

    /// The experiment of a text, checked.
    fn checked(&self, source: &Text) -> Result<Experiment> {
        let experiment = self.tasks.parse(&source.text).and_then(|experiment| {
            self.tasks.check_new(&experiment, &source.text)?;
            Ok(experiment)
        });
        experiment.map_err(DesignError::input(&source.path))
    }

    /// The same with settings in place of values of its file. A path that is set is looked for from the working folder first.
    ///
    /// A setting that makes the experiment wrong is named by the error; an error that the file has without it names its place there.
    pub fn experiment_with(&self, name: &str, settings: &Settings) -> Result<Experiment> {
        if settings.is_empty() {
            return self.experiment(name);
        }
        let source = self.text("experiment", "experiments", name)?;
        self.with_settings(&source, settings)
    }

    /// An experiment that is in no file with settings in place of its values.
    pub fn changed_by(&self, experiment: Experiment, settings: &Settings) -> Result<Experiment> {
        if settings.is_empty() {
            return Ok(experiment);
        }
        self.with_settings(&Text { path: PathBuf::new(), text: experiment.to_toml()? }, settings)
    }

    fn with_settings(&self, source: &Text, settings: &Settings) -> Result<Experiment> {
        let mut complete = Experiment::read(&source.text).map_err(DesignError::input(&source.path))?;
        self.tasks.complete(&mut complete);
        let with = WithSettings::new(&source.text, &complete, settings)?;
        let text = Text { path: source.path.clone(), text: with.text.clone() };
        let found = self.checked(&text).and_then(|mut experiment| {
            for (key, input) in experiment.inputs_mut() {
                let path = Path::new(input.as_str());
                if with.is_set(&key) && path.is_relative() && is_input(&key, path) {
                    *input = path_text(&std::path::absolute(path).map_err(DesignError::io(path))?)?;
                }
            }
            self.located(experiment, &text)
        });
        found.map_err(|error| {
            let DesignError::Input { error, .. } = &error else { return error };
            // What the file itself has wrong is shown there.
            match self.checked(source).and_then(|experiment| self.located(experiment, source)) {
                Err(DesignError::Input { path, error: own })
                    if own.message == error.message && own.key == error.key =>
                {
                    DesignError::Input { path, error: own }
                }
                _ => with.wrong(error, settings).into(),
            }
        })
    }

    /// An experiment with the paths that it names made those of files beside its own.
    fn located(&self, experiment: Experiment, source: &Text) -> Result<Experiment> {
        self.beside(experiment, source, &[])
    }

    /// The same, where the inputs of some keys need not be there.
    fn beside(
        &self,
        mut experiment: Experiment,
        source: &Text,
        may_be_missing: &[&str],
    ) -> Result<Experiment> {
        let folder = source.path.parent().unwrap_or(Path::new(""));
        for (key, input) in experiment.inputs_mut() {
            let beside = folder.join(input.as_str());
            let path: Vec<&str> = key.iter().map(String::as_str).collect();
            let may_be_missing = may_be_missing.contains(&path[0]);
            if is_input(&key, &beside) || may_be_missing {
                *input = path_text(&without_detours(&beside))?;
            }
            if may_be_missing {
                continue;
            }
            let Some(hint) = self.missing_input(&path, input) else { continue };
            let error = FileError::at_key(&source.text, &path, "neither a file nor built in");
            // A key that the file leaves out has a default that exists.
            if error.line.is_some() {
                return Err(DesignError::input(&source.path)(error.hint(hint)));
            }
        }
        Ok(experiment)
    }

    /// What to write in place of an input of an experiment that is neither there nor built in; `None` if it is.
    fn missing_input(&self, key: &[&str], name: &str) -> Option<String> {
        let folder = match key[key.len() - 1] {
            "lens" => "lenses",
            "sensor" => "sensors",
            "preset" => "isp",
            "optics_proxy" => {
                let hint = "the proxy.toml of a folder that `petzval train optics-proxy` made";
                return (!Path::new(name).is_file()).then(|| hint.to_owned());
            }
            "file" => {
                let hint = "a folder that `petzval psf` or `petzval psf-calibrate` wrote, or its psf.json";
                return (!Path::new(name).exists()).then(|| hint.to_owned());
            }
            "weights" => {
                let hint = match key[0] {
                    "network" => {
                        "cameras/NAME/network.safetensors in the folder of a run, \"built-in\" or \"none\""
                    }
                    _ => {
                        "cameras/NAME/blocks/network/weights.bin in the folder of a run that looks for objects, or weights of torchvision (.safetensors)"
                    }
                };
                return (!Path::new(name).is_file()).then(|| hint.to_owned());
            }
            "data" => {
                let hint = "a folder of labelled pictures, or \"street\"";
                return (!Path::new(name).exists()).then(|| hint.to_owned());
            }
            _ => {
                let hint = "a folder of pictures, or \"built-in\"";
                return (!Path::new(name).exists()).then(|| hint.to_owned());
            }
        };
        match self.text("input", folder, name) {
            Err(DesignError::Unknown { near: Some(near), .. }) => Some(format!("did you mean \"{near}\"?")),
            Err(DesignError::Unknown { known, .. }) => Some(format!("a path, or one of {known}")),
            _ => None,
        }
    }

    /// The experiment that a run was made from, by its record; that of its `config.toml` if it has none. Its setup is made by
    /// [`setup_of_run`](crate::inputs::setup_of_run).
    pub fn experiment_of_run(&self, run: &RunFolder) -> Result<Experiment> {
        let config = match RunRecord::read(run)? {
            Some(record) => record.config,
            None => self.config_of_run(run)?,
        };
        self.experiment_in(run, config, None)
    }

    /// An experiment with its lens, sensor and pictures looked for in a run folder. Pictures need not be there; `pictures` says where
    /// they are now.
    pub fn experiment_in(
        &self,
        run: &RunFolder,
        mut config: Experiment,
        pictures: Option<&Path>,
    ) -> Result<Experiment> {
        check_kept_inputs(&mut config, run)?;
        self.tasks.complete(&mut config);
        let source = Text { path: run.config(), text: config.to_toml()? };
        let mut experiment = self.beside(config, &source, &["photos", "data"])?;
        let key = self.facts_of(&experiment)?.pictures;
        pictures_of_run(run, &mut experiment, key, pictures)?;
        Ok(experiment)
    }

    /// The values of a run's `config.toml`, which must hold every key of its record.
    pub fn config_of_run(&self, run: &RunFolder) -> Result<Experiment> {
        let text = config_text(run)?;
        let experiment = if run.record().exists() {
            self.tasks.parse_complete(&text, &json_record(run)?["config"])
        } else {
            self.tasks.parse(&text)
        };
        experiment.map_err(DesignError::input(&run.config()))
    }

    /// How the values of a run's `config.toml` differ from those of its record: the place of the first key, and every key by name.
    pub fn changed_config(&self, record: &RunRecord, run: &RunFolder) -> Result<Option<FileError>> {
        let mut recorded = record.config.clone();
        self.tasks.complete(&mut recorded);
        let changes = self.config_of_run(run)?.differences(&recorded);
        let Some((first, _)) = changes.first() else { return Ok(None) };
        let path: Vec<&str> = first.split('.').collect();
        let was: Vec<String> = changes.iter().map(|(key, was)| format!("{key} was {was}")).collect();
        let message = format!("config.toml has changed since the run was begun: {}", was.join(", "));
        Ok(Some(FileError::at_key(&config_text(run)?, &path, message)))
    }
}

/// Refuses a run without the inputs that it keeps in its folder `inputs`: no others could be meant. Pictures of a user may be elsewhere.
fn check_kept_inputs(config: &mut Experiment, run: &RunFolder) -> Result<()> {
    let is_kept = |key: &[String], name: &str| {
        !["photos", "data"].contains(&key[0].as_str()) && name.starts_with("inputs/")
    };
    let kept = config.inputs_mut().filter(|(key, name)| is_kept(key, name)).map(|(_, name)| name.clone());
    let mut missing: Vec<String> = kept.filter(|name| !run.root().join(name).exists()).collect();
    if !missing.is_empty() && !run.input("").is_dir() {
        missing = vec!["inputs".to_owned()];
    }
    let changes = missing.into_iter().map(|name| ChangedFile { name, is_missing: true }).collect();
    DigestCheck::new(run, &[], &|_| {}).refuse(changes)
}
