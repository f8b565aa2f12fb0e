//! The event log: one JSON line a step.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{EventsDigest, hex};
use crate::error::{DesignError, Result};

/// The block of the event of a camera that was scored.
pub const SCORE: &str = "score";

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
    /// Wall-clock seconds of the step. A lens alone has an event for each iteration, and one for the whole stage behind them, which has the
    /// number of the same step.
    pub seconds: f64,
}

/// Wall-clock seconds of all steps.
pub fn seconds_of(events: &[Event]) -> f64 {
    let of_step = |step: &[Event]| {
        let (last, iterations) = step.split_last().map_or((0.0, step), |(last, rest)| (last.seconds, rest));
        let before: f64 = iterations.iter().map(|event| event.seconds).sum();
        // A whole stage took as long as its iterations; a stage at work ends with one of them.
        if last >= before { last } else { before + last }
    };
    events.chunk_by(|a, b| a.step == b.step).map(of_step).sum()
}

/// An open event log, with the digest of all that is in it.
pub struct EventLog {
    file: fs::File,
    path: std::path::PathBuf,
    hash: Sha256,
    bytes: u64,
}

impl EventLog {
    /// Opens the log for appending behind the events up to `step`; later ones, of a run that went on
    /// after its last checkpoint and was killed, are taken away.
    pub fn resume(path: &Path, step: u64) -> Result<Self> {
        if !path.exists() {
            return Self::open(path, &[]);
        }
        let text = petzval_base::read_text(path).map_err(DesignError::io(path))?;
        let events = read_events(path)?;
        // The lines themselves stay as they are.
        let lines = text.split_inclusive('\n').zip(&events).filter(|(_, event)| event.step <= step);
        let mut kept: String = lines.map(|(line, _)| line).collect();
        if !kept.is_empty() && !kept.ends_with('\n') {
            kept.push('\n');
        }
        super::write_file(path, kept.as_bytes())?;
        Self::open(path, kept.as_bytes())
    }

    /// Whether the first bytes of a log agree with the digest of a checkpoint.
    pub fn agrees(path: &Path, until: &EventsDigest) -> Result<bool> {
        Ok(until.is_of(&bytes_of(path)?))
    }

    /// Opens the log for appending behind its first bytes, if they agree with the digest of a checkpoint; what follows them is taken away.
    /// None if they do not agree, or are not there.
    pub fn resume_at(path: &Path, until: &EventsDigest) -> Result<Option<Self>> {
        let mut bytes = bytes_of(path)?;
        if !until.is_of(&bytes) {
            return Ok(None);
        }
        let is_longer = bytes.len() as u64 > until.bytes;
        bytes.truncate(until.bytes as usize);
        if is_longer {
            super::write_file(path, &bytes)?;
        }
        Self::open(path, &bytes).map(Some)
    }

    /// Opens the log, which holds these bytes.
    fn open(path: &Path, bytes: &[u8]) -> Result<Self> {
        let file = fs::OpenOptions::new().create(true).append(true).open(path);
        Ok(Self {
            file: file.map_err(DesignError::io(path))?,
            path: path.to_path_buf(),
            hash: Sha256::new_with_prefix(bytes),
            bytes: bytes.len() as u64,
        })
    }

    /// Adds an event, without losses that are not finite: JSON has no such numbers, and the line could not be read again.
    pub fn write(&mut self, event: &Event) -> Result<()> {
        let mut event = event.clone();
        event.losses.retain(|_, loss| loss.is_finite());
        let line = line_of(&event)? + "\n";
        self.hash.update(&line);
        self.bytes += line.len() as u64;
        self.file.write_all(line.as_bytes()).map_err(DesignError::io(&self.path))
    }

    /// The digest of all events so far, which are on the disk then.
    pub fn digest(&self) -> Result<EventsDigest> {
        self.file.sync_data().map_err(DesignError::io(&self.path))?;
        Ok(EventsDigest { bytes: self.bytes, sha256: hex(self.hash.clone()) })
    }
}

impl EventsDigest {
    /// Whether it is the digest of the first of these bytes.
    fn is_of(&self, bytes: &[u8]) -> bool {
        let first = usize::try_from(self.bytes).ok().and_then(|until| bytes.get(..until));
        first.is_some_and(|first| hex(Sha256::new_with_prefix(first)) == self.sha256)
    }
}

/// The bytes of a log; none where there is no log yet.
fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    if path.exists() { petzval_base::read_whole(path).map_err(DesignError::io(path)) } else { Ok(Vec::new()) }
}

/// An event as one line of JSON.
fn line_of(event: &Event) -> Result<String> {
    serde_json::to_string(event)
        .map_err(|e| DesignError::Unwritable { what: "an event", problem: e.to_string() })
}

/// Reads a log; a last line that a crash cut short is left out. Any other line that is no event is an error: what follows it must not be lost.
pub fn read_events(path: &Path) -> Result<Vec<Event>> {
    let file = petzval_base::open_file(path).map_err(DesignError::io(path))?;
    let mut events = Vec::new();
    let mut damaged = None;
    for (i, line) in BufReader::new(file).lines().enumerate() {
        if let Some(problem) = damaged {
            return Err(DesignError::Run { path: path.to_path_buf(), problem });
        }
        match serde_json::from_str(&line.map_err(DesignError::io(path))?) {
            Ok(event) => events.push(event),
            Err(error) => damaged = Some(format!("line {}: {error}; put it back, or delete it", i + 1)),
        }
    }
    Ok(events)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of the network of camera `a`.
    fn event(step: u64, losses: &[(&str, f64)]) -> Event {
        Event {
            step,
            camera: "a".to_owned(),
            block: "network".to_owned(),
            losses: losses.iter().map(|(name, loss)| ((*name).to_owned(), *loss)).collect(),
            lowered: Vec::new(),
            learning_rate: 1e-3,
            seconds: 0.1,
        }
    }

    #[test]
    fn a_last_line_that_is_cut_short_is_left_out_and_any_other_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.jsonl");
        let event = |step| event(step, &[("loss", 0.5), ("psnr", f64::INFINITY)]);
        let mut log = EventLog::resume(&path, 0).unwrap();
        (1..=3).for_each(|step| log.write(&event(step)).unwrap());
        let steps = |path: &Path| read_events(path).map(|all| all.iter().map(|e| e.step).collect::<Vec<_>>());
        assert_eq!(steps(&path).unwrap(), [1, 2, 3]);
        assert_eq!(read_events(&path).unwrap()[0].losses.len(), 1, "an infinite number is not written");
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() - 20]).unwrap();
        assert_eq!(steps(&path).unwrap(), [1, 2]);
        fs::write(&path, text.replace("\"step\":2", "\"step\":\"two\"")).unwrap();
        let said = EventLog::resume(&path, 3).err().unwrap().to_string();
        assert!(said.contains("events.jsonl") && said.contains("line 2"), "{said}");
        assert_eq!(fs::read_to_string(&path).unwrap().lines().count(), 3, "nothing is lost");
    }

    #[test]
    fn a_log_goes_on_behind_the_digest_of_a_checkpoint_and_not_where_it_was_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.jsonl");
        let event = |step| event(step, &[("loss", 0.1 + 0.2)]);
        let mut log = EventLog::resume(&path, 0).unwrap();
        (1..=2).for_each(|step| log.write(&event(step)).unwrap());
        let until = log.digest().unwrap();
        let (two, whole) = (fs::read(&path).unwrap(), {
            log.write(&event(3)).unwrap();
            fs::read(&path).unwrap()
        });
        drop(log);
        assert_eq!(until.bytes, two.len() as u64);
        assert!(EventLog::agrees(&path, &until).unwrap());
        let damaged = EventsDigest { sha256: "0".repeat(64), ..until.clone() };
        assert!(!EventLog::agrees(&path, &damaged).unwrap());
        let longer = EventsDigest { bytes: whole.len() as u64 + 1, ..until.clone() };
        assert!(!EventLog::agrees(&path, &longer).unwrap());
        // The third event came after the checkpoint, and is taken away.
        let again = EventLog::resume_at(&path, &until).unwrap().unwrap();
        assert_eq!((again.digest().unwrap(), fs::read(&path).unwrap()), (until.clone(), two.clone()));
        drop(again);
        for changed in [&two[..two.len() - 1], &whole[1..], b""] {
            fs::write(&path, changed).unwrap();
            assert!(EventLog::resume_at(&path, &until).unwrap().is_none());
            assert_eq!(fs::read(&path).unwrap(), changed, "nothing is lost");
        }
    }

    #[test]
    fn the_time_of_a_stage_is_not_counted_twice() {
        let events = |steps: &[(u64, f64)]| -> Vec<Event> {
            steps.iter().map(|(step, seconds)| Event { seconds: *seconds, ..event(*step, &[]) }).collect()
        };
        // Three iterations of a lens alone, and the whole stage.
        let whole = events(&[(1, 2.0), (2, 1.0), (2, 1.5), (2, 1.0), (2, 3.75), (3, 2.0)]);
        assert_eq!(seconds_of(&whole), 7.75);
        // Stopped in it.
        assert_eq!(seconds_of(&whole[..4]), 5.5);
        assert_eq!(seconds_of(&[]), 0.0);
    }
}
