//! A run folder in one row of a table: what it is, how far it has come, and what came out. Nothing in the folder is changed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_learn::score::ScoreDescription;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::experiment::Experiment;
use crate::library::Library;
use crate::report::run_report::read_metrics;
use crate::run::{
    CameraMetrics, DigestCheck, Event, RunFolder, RunRecord, read_events, read_json, seconds_of,
};

/// How a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RunState {
    /// Every camera is made and scored.
    Finished,
    /// A process works on it.
    Running,
    /// No process works on it, and it goes on with `--resume`.
    Stopped,
    /// A file of it cannot be read, or does not fit the others.
    Damaged,
}

/// A run in one row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunRow {
    /// Its folder.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub run: PathBuf,
    /// Title of its experiment; empty where it cannot be read.
    pub experiment: String,
    /// How it stands.
    pub state: RunState,
    /// What is damaged, and where.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Steps taken.
    pub step: u64,
    /// Steps in all, scores of cameras included; fewer are taken where validations end a stage.
    pub total: u64,
    /// The last finished camera that is no ceiling.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// Scores of that camera, in the order of the experiment.
    pub scores: Vec<RowScore>,
    /// Wall-clock seconds of all steps.
    pub seconds: f64,
    /// When it was begun: UTC, RFC 3339; empty where that is not known.
    pub begun: String,
    /// Every key of its experiment that differs from the other runs of the same title, with its value here.
    #[serde(default)]
    pub differs: BTreeMap<String, String>,
    /// Every value of its experiment by key.
    #[serde(skip)]
    pub values: BTreeMap<String, String>,
}

/// A score of a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RowScore {
    /// Its name: `psnr_db`.
    pub name: String,
    /// Heading; the name in words in runs of earlier versions that are not finished.
    pub title: String,
    /// Unit; empty for a plain number.
    pub unit: String,
    /// Digits after the decimal point in tables.
    pub decimals: usize,
    /// Its value.
    pub value: f64,
}

/// Whether a folder is that of a run, whole or damaged.
pub fn is_run(folder: &Path) -> bool {
    let has = |name: &str| folder.join(name).exists();
    has("config.toml") && (has("run.json") || has("checkpoints") || has("metrics.json"))
        || has("run.json") && has("checkpoints")
}

/// A run in one row. A folder that cannot be read is a row as well, with the reason.
pub fn run_row(folder: &Path, library: &Library) -> RunRow {
    match RunFiles::read(folder, library) {
        Ok(files) => files.row(),
        Err(error) => RunRow::empty(folder).damaged(error.to_string()),
    }
}

/// What the files of a run say that it is and how far it has come, as they were read. The error of a damaged file stands in its place.
pub struct RunFiles {
    /// The folder.
    pub folder: RunFolder,
    /// The record; none in a folder of a version that kept none.
    pub record: Result<Option<RunRecord>>,
    /// The values of its `config.toml`.
    pub experiment: Result<Experiment>,
    /// The events of its steps; empty where there is no log.
    pub events: Result<Vec<Event>>,
}

impl RunFiles {
    /// Reads the files. Fails if the folder is not that of a run.
    pub fn read(folder: &Path, library: &Library) -> Result<Self> {
        let folder = RunFolder::open(folder)?;
        let log = folder.events();
        Ok(Self {
            record: RunRecord::read(&folder),
            experiment: library.config_of_run(&folder),
            events: if log.exists() { read_events(&log) } else { Ok(Vec::new()) },
            folder,
        })
    }

    /// The run in one row, also where a file of it is damaged.
    pub fn row(&self) -> RunRow {
        let mut row = RunRow::empty(self.folder.root());
        match self.fill(&mut row) {
            Ok(()) => row,
            Err(reason) => row.damaged(reason),
        }
    }

    /// Fills a row with what can be read; what was read before an error stays. The error is the reason, in words.
    fn fill(&self, row: &mut RunRow) -> Result<(), String> {
        let record = self.record.as_ref().map_err(ToString::to_string)?.as_ref();
        if let Some(record) = record {
            row.begun.clone_from(&record.begun);
        }
        let experiment = self.experiment.as_ref().map_err(ToString::to_string)?;
        row.experiment.clone_from(&experiment.name);
        row.values = experiment.values();
        row.total = experiment
            .variants()
            .iter()
            .map(|v| v.stages.iter().map(|s| s.steps()).sum::<usize>() as u64 + 1)
            .sum();
        let events = self.events.as_ref().map_err(ToString::to_string)?;
        if let Some(last) = events.last() {
            row.step = last.step;
            row.seconds = seconds_of(events);
        }
        fill_outcome(row, &self.folder, record, experiment).map_err(|error| error.to_string())
    }
}

/// Fills a row with the state of the run and the scores that it has by now.
fn fill_outcome(
    row: &mut RunRow,
    run: &RunFolder,
    record: Option<&RunRecord>,
    experiment: &Experiment,
) -> Result<()> {
    let finish = record.and_then(|record| record.finished.as_ref());
    if run.metrics().exists() {
        // Runs of earlier versions have no digests, and a table says so of none of its rows.
        if let Some(change) = DigestCheck::new(run, &[], &|_| {}).changes("")?.first() {
            return Err(DesignError::Run { path: run.root().to_path_buf(), problem: change.to_string() });
        }
        let metrics = read_metrics(run)?;
        // Cameras cannot be made again alone: without one of them the run is not what it was.
        if let Some(missing) = metrics.rows.iter().find(|row| !run.camera_metrics(&row.camera).is_file()) {
            let problem = format!("cameras/{}/metrics.json is missing", missing.camera);
            return Err(DesignError::Run { path: run.root().to_path_buf(), problem });
        }
        row.take(&metrics.rows, &metrics.scores);
        row.state = RunState::Finished;
        row.seconds = finish.map_or(row.seconds, |finish| finish.seconds);
        return Ok(());
    }
    if let Some(finish) = finish {
        let problem = format!("metrics.json is missing, and the run was finished on {}", finish.date);
        return Err(DesignError::Run { path: run.root().to_path_buf(), problem });
    }
    row.state = if run.is_at_work() { RunState::Running } else { RunState::Stopped };
    row.take(&finished_cameras(run, experiment)?, &scores_so_far(record, experiment));
    Ok(())
}

/// The scores of a run that is not finished. Of those that an earlier version began, the names are known.
pub fn scores_so_far(record: Option<&RunRecord>, experiment: &Experiment) -> Vec<ScoreDescription> {
    match record {
        Some(record) if !record.scores.is_empty() => record.scores.clone(),
        _ => experiment.scoring.scores.iter().map(|name| ScoreDescription::of_name(name)).collect(),
    }
}

/// The figures of the cameras that are finished, in the order of the experiment.
pub fn finished_cameras(run: &RunFolder, experiment: &Experiment) -> Result<Vec<CameraMetrics>> {
    let names = experiment.variant.iter().map(|variant| variant.name.as_str());
    run.finished(names).into_iter().map(|name| read_json(&run.camera_metrics(name))).collect()
}

impl RunRow {
    /// A run of which nothing is known yet but its folder.
    fn empty(folder: &Path) -> Self {
        Self {
            run: folder.to_path_buf(),
            experiment: String::new(),
            state: RunState::Stopped,
            reason: None,
            step: 0,
            total: 0,
            camera: None,
            scores: Vec::new(),
            seconds: 0.0,
            begun: String::new(),
            differs: BTreeMap::new(),
            values: BTreeMap::new(),
        }
    }

    /// The same row of a damaged run, with what is damaged.
    fn damaged(self, reason: String) -> Self {
        Self { state: RunState::Damaged, reason: Some(reason), ..self }
    }

    /// Takes the scores of the last camera that is no ceiling.
    fn take(&mut self, cameras: &[CameraMetrics], scores: &[ScoreDescription]) {
        let Some(camera) = cameras.iter().rfind(|camera| !camera.is_ceiling).or(cameras.last()) else {
            return;
        };
        self.camera = Some(camera.camera.clone());
        let score = |score: &ScoreDescription| {
            let value = *camera.scores.get(&score.name)?;
            let ScoreDescription { name, title, unit, decimals, .. } = score.clone();
            Some(RowScore { name, title, unit, decimals, value })
        };
        self.scores = scores.iter().filter_map(score).collect();
    }
}

/// Notes in every row the keys by which it differs from the other rows of the same title. Names and paths of folders are none of them.
pub fn note_differences(rows: &mut [RunRow]) {
    let mut seen: BTreeMap<(String, String), Vec<Option<String>>> = BTreeMap::new();
    let mut keys: BTreeMap<String, std::collections::BTreeSet<String>> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.values.is_empty()) {
        keys.entry(row.experiment.clone()).or_default().extend(row.values.keys().cloned());
    }
    for row in rows.iter().filter(|row| !row.values.is_empty()) {
        for key in &keys[&row.experiment] {
            let value = row.values.get(key).cloned();
            let values = seen.entry((row.experiment.clone(), key.clone())).or_default();
            if !values.contains(&value) {
                values.push(value);
            }
        }
    }
    for row in rows.iter_mut().filter(|row| !row.values.is_empty()) {
        let differs = keys[&row.experiment].iter().filter(|key| {
            seen.get(&(row.experiment.clone(), (*key).clone())).is_some_and(|values| values.len() > 1)
        });
        let value = |key: &String| row.values.get(key).cloned().unwrap_or_else(|| "-".to_owned());
        row.differs = differs.map(|key| (key.clone(), value(key))).collect();
    }
}
