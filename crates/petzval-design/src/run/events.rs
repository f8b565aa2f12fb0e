//! The event log: one JSON line a step.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::DesignError;

/// One step of one block.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Step of the run, from 1.
    pub step: u64,
    /// Camera.
    pub camera: String,
    /// Block that stepped: `optics`, `network`; the goal of a lens alone, `spot` or `restored`; or `score`.
    pub block: String,
    /// Losses by name, before the step; that of a validation, after it.
    pub losses: BTreeMap<String, f64>,
    /// Of a lens step for the task: by how much each coordinate lowered the batch's loss to first order, `-dL/dx dx`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lowered: Vec<f64>,
    /// Learning rate of the step.
    pub learning_rate: f64,
    /// Wall-clock seconds of the step.
    pub seconds: f64,
}

/// An open event log.
pub struct EventLog {
    file: fs::File,
    path: std::path::PathBuf,
}

impl EventLog {
    /// Opens the log for appending behind the events up to `step`; later ones, of a run that went on
    /// after its last checkpoint and was killed, are taken away.
    pub fn resume(path: &Path, step: u64) -> Result<Self, DesignError> {
        if path.exists() {
            let kept: Vec<Event> = read_events(path)?.into_iter().filter(|e| e.step <= step).collect();
            let mut text = String::new();
            for event in &kept {
                text.push_str(&line_of(event)?);
                text.push('\n');
            }
            super::write_file(path, text.as_bytes())?;
        }
        let file = fs::OpenOptions::new().create(true).append(true).open(path);
        Ok(Self { file: file.map_err(DesignError::io(path))?, path: path.to_path_buf() })
    }

    /// Adds an event.
    pub fn write(&mut self, event: &Event) -> Result<(), DesignError> {
        let line = line_of(event)?;
        writeln!(self.file, "{line}").map_err(DesignError::io(&self.path))
    }
}

/// An event as one line of JSON.
fn line_of(event: &Event) -> Result<String, DesignError> {
    serde_json::to_string(event)
        .map_err(|e| DesignError::Unwritable { what: "an event", problem: e.to_string() })
}

/// Reads a log; a last line that a crash cut short is left out.
pub fn read_events(path: &Path) -> Result<Vec<Event>, DesignError> {
    let file = petzval_base::open_file(path).map_err(DesignError::io(path))?;
    let mut events = Vec::new();
    for line in BufReader::new(file).lines() {
        let line = line.map_err(DesignError::io(path))?;
        match serde_json::from_str(&line) {
            Ok(event) => events.push(event),
            Err(_) => break,
        }
    }
    Ok(events)
}
