//! The record of a run, `run.json`: the experiment that it was begun with, and when it was made. `metrics.json` has no place for dates
//! and durations, because a second run repeats it to the bit.

use std::time::{Duration, SystemTime};

use petzval_learn::score::ScoreDescription;
use serde::{Deserialize, Serialize};

use super::{RunFolder, date, forget_digests, note_digests, read_json, write_file};
use crate::error::{DesignError, Result};
use crate::experiment::Experiment;

/// Version of Petzval.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What a run was begun with, and when.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// Version of Petzval that began the run.
    pub version: String,
    /// When the run was begun: UTC, RFC 3339.
    pub begun: String,
    /// The end of the run; none before it.
    pub finished: Option<Finish>,
    /// Most network steps of a camera that the experiment has, where a request changed them for this run; of a hardware ISP where that is what is
    /// trained last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usual_steps: Option<usize>,
    /// The scores of its cameras, in the order of the experiment; none in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scores: Vec<ScoreDescription>,
    /// `config.toml` as the run was begun with it, or as it was last extended.
    pub config: Experiment,
}

/// The end of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finish {
    /// When the last camera was scored: UTC, RFC 3339.
    pub date: String,
    /// Wall-clock seconds of all steps of the run, pauses between sessions left out.
    pub seconds: f64,
    /// Peak memory of the last session, GB; none if the system does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_gb: Option<f64>,
}

impl RunRecord {
    /// The record of a run that begins now, with its [usual steps](Self::usual_steps) and the scores of its cameras.
    pub fn begin(config: Experiment, usual_steps: Option<usize>, scores: Vec<ScoreDescription>) -> Self {
        Self { version: VERSION.to_owned(), begun: now(), finished: None, usual_steps, scores, config }
    }

    /// The record of a run; none in a folder of a version that kept none.
    pub fn read(run: &RunFolder) -> Result<Option<Self>> {
        let path = run.record();
        if path.exists() { read_json(&path).map(Some) } else { Ok(None) }
    }

    /// Writes the record into the folder of its run.
    pub fn write(&self, run: &RunFolder) -> Result<()> {
        write_file(&run.record(), DesignError::json("the record of the run", self)?.as_bytes())
    }

    /// Notes the end of a run, once, and the digest of the record, which then stays as it is.
    pub fn finish(run: &RunFolder, seconds: f64) -> Result<()> {
        if Self::read(run)?.is_none_or(|record| record.finished.is_some()) {
            return Ok(());
        }
        // The rest stays as it was written: keys that are younger than the run do not come in.
        let mut record = json_record(run)?;
        let finish = Finish { date: now(), seconds, memory_gb: most_memory_gb() };
        record["finished"] = serde_json::to_value(finish).unwrap_or_default();
        write_file(&run.record(), DesignError::json("the record of the run", &record)?.as_bytes())?;
        note_digests(run, &[run.record()])
    }

    /// Names and values for the reader of a report.
    pub fn facts(&self) -> Vec<(String, String)> {
        let mut facts = vec![("seed", self.config.seed.to_string()), ("begun", self.begun.clone())];
        if let Some(Finish { date, seconds, memory_gb }) = &self.finished {
            let seconds = Duration::from_secs(seconds.max(1.0).round() as u64);
            facts.push(("finished", date.clone()));
            facts.push(("duration", humantime::format_duration(seconds).to_string()));
            facts.extend(memory_gb.map(|gb| ("memory", format!("{gb:.2} GB"))));
        }
        facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// Forgets how much memory this process has taken so far, where the system allows it: one process may make several runs.
pub fn forget_most_memory() {
    // Linux: 5 resets the peak. Without it the figure is that of the whole process.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Most memory that this process has taken, GB: `VmHWM` of Linux.
fn most_memory_gb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e9)
}

fn now() -> String {
    date(SystemTime::now())
}

/// The record of a run as it is written.
pub(crate) fn json_record(run: &RunFolder) -> Result<serde_json::Value> {
    read_json(&run.record())
}

/// Makes a run longer: `longer` becomes what it was begun with, and what was made of the finished cameras together is removed.
///
/// The record is written last. Where this is cut short, `config.toml` differs from the record; the same extension then completes it.
pub fn extend_run(run: &RunFolder, record: RunRecord, longer: Experiment) -> Result<()> {
    for stale in [run.metrics(), run.metrics_csv(), run.pictures_csv(), run.tolerance(), run.report()] {
        if stale.exists() {
            std::fs::remove_file(&stale).map_err(DesignError::io(&stale))?;
        }
    }
    forget_digests(run)?;
    write_file(&run.config(), longer.to_toml()?.as_bytes())?;
    RunRecord { config: longer, finished: None, ..record }.write(run)
}

/// The `config.toml` of a run.
pub(crate) fn config_text(run: &RunFolder) -> Result<String> {
    let path = run.config();
    petzval_base::read_text(&path).map_err(DesignError::io(&path))
}
