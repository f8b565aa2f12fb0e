//! Digests of what a run writes: the SHA-256 of every file of a checkpoint, of a finished camera, and of the figures and events of the run.
//! A file that was changed by hand, by a disk or by a copy that stopped half-way is named, and not believed.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{RunFolder, read_json_if_there, write_file};
use crate::error::{DesignError, Result};

/// The file of digests in the folder whose files it lists.
const FILE: &str = "digests.json";

/// Files of the run folder whose absence is no change: tables are made of the figures, and what needs the record says that it is missing.
const MAY_BE_MISSING: [&str; 3] = ["metrics.csv", "pictures.csv", "run.json"];

/// Digests of the files of a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Digests {
    /// SHA-256 by path below the folder, hexadecimal.
    files: BTreeMap<String, String>,
    /// The events until a checkpoint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub events: Option<EventsDigest>,
}

/// The digest of the first bytes of `events.jsonl`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventsDigest {
    /// How many bytes.
    pub bytes: u64,
    /// Their SHA-256, hexadecimal.
    pub sha256: String,
}

impl Digests {
    /// Those of all files below a folder.
    pub fn of_folder(folder: &Path) -> Result<Self> {
        let (mut files, mut open) = (BTreeMap::new(), vec![folder.to_path_buf()]);
        while let Some(next) = open.pop() {
            for entry in fs::read_dir(&next).map_err(DesignError::io(&next))? {
                let path = entry.map_err(DesignError::io(&next))?.path();
                let below = path.strip_prefix(folder).unwrap_or(&path);
                let name = below.to_string_lossy().replace('\\', "/");
                if path.is_dir() {
                    open.push(path);
                } else if name != FILE {
                    files.insert(name, sha256_of_file(&path)?);
                }
            }
        }
        Ok(Self { files, events: None })
    }

    /// The same without files of these names.
    pub fn without(mut self, names: &[&str]) -> Self {
        self.files.retain(|name, _| !names.contains(&name.as_str()));
        self
    }

    /// Those that a folder keeps; none in a folder of an earlier version.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        read_json_if_there(&folder.join(FILE))
    }

    /// Keeps them in their folder.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_file(&folder.join(FILE), DesignError::json("the digests", self)?.as_bytes())
    }

    /// The files that are missing or have another content, in order of their names.
    fn changed(&self, folder: &Path) -> Result<Vec<ChangedFile>> {
        let mut changed = Vec::new();
        for (name, digest) in &self.files {
            let path = folder.join(name);
            let is_missing = !path.is_file();
            if is_missing || sha256_of_file(&path)? != *digest {
                changed.push(ChangedFile { name: name.clone(), is_missing });
            }
        }
        Ok(changed)
    }
}

/// Notes the digests of some files of the run's own folder, in place of earlier ones. Files that are not there are forgotten.
pub fn note_digests(run: &RunFolder, files: &[PathBuf]) -> Result<()> {
    let mut digests = Digests::read(run.root())?.unwrap_or_default();
    for path in files {
        let name = path.strip_prefix(run.root()).unwrap_or(path).to_string_lossy().into_owned();
        if path.is_file() {
            digests.files.insert(name, sha256_of_file(path)?);
        } else {
            digests.files.remove(&name);
        }
    }
    digests.write(run.root())
}

/// Forgets the digests of the run's own folder: it goes on, and will have other figures and events.
pub fn forget_digests(run: &RunFolder) -> Result<()> {
    let path = run.root().join(FILE);
    match fs::remove_file(&path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(DesignError::io(&path)(error)),
        _ => Ok(()),
    }
}

/// A file that does not agree with its digest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChangedFile {
    /// Its path below the run folder.
    pub name: String,
    /// Whether it is not there.
    pub is_missing: bool,
}

impl std::fmt::Display for ChangedFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, is_missing } = self;
        if *is_missing {
            write!(f, "{name} is missing")
        } else {
            write!(f, "{name} is not as the run wrote it")
        }
    }
}

/// Compares files of a run with their digests. Changes that the user accepts become warnings. A run without digests brings one warning.
pub struct DigestCheck<'a> {
    run: &'a RunFolder,
    accepted: &'a [String],
    warn: &'a dyn Fn(&str),
    is_reported: Cell<bool>,
}

/// Name of the inputs of a run, whose change is accepted as a whole.
const INPUTS: &str = "inputs";

/// Refuses accepted names that no run has as a file or folder: a change that they were to accept would be refused, or there is none.
pub fn check_accepted(runs: &[&RunFolder], accepted: &[String]) -> Result<()> {
    let is_there = |name: &str| {
        let name = name.trim_end_matches('/');
        name == INPUTS || !name.is_empty() && runs.iter().any(|run| run.root().join(name).exists())
    };
    match (runs.first(), accepted.iter().find(|name| !is_there(name))) {
        (Some(run), Some(unknown)) => Err(DesignError::Run {
            path: run.root().to_path_buf(),
            problem: format!(
                "accept_changed = \"{unknown}\": the run has no such file or folder; hint: name one by its path below the run, such as cameras/NAME or {INPUTS}"
            ),
        }),
        _ => Ok(()),
    }
}

impl<'a> DigestCheck<'a> {
    /// A check of a run. `accepted`: files or folders of the run, by their path below it, that may differ from their digests.
    pub fn new(run: &'a RunFolder, accepted: &'a [String], warn: &'a dyn Fn(&str)) -> Self {
        Self { run, accepted, warn, is_reported: Cell::new(false) }
    }

    /// A check of the only run of a request. Refuses accepted names as [`check_accepted`] does.
    pub fn of_request(run: &'a RunFolder, accepted: &'a [String], warn: &'a dyn Fn(&str)) -> Result<Self> {
        check_accepted(&[run], accepted)?;
        Ok(Self::new(run, accepted, warn))
    }

    /// Reports a warning.
    pub fn warn(&self, text: &str) {
        (self.warn)(text);
    }

    /// The changes of a part of the run that are not accepted. `part`: `checkpoints/step-000012`, `cameras/nominal`; empty for the
    /// figures and events of the run itself.
    pub fn changes(&self, part: &str) -> Result<Vec<ChangedFile>> {
        let folder = self.run.root().join(part);
        let Some(digests) = Digests::read(&folder)? else {
            self.warn_of_missing_digests();
            return Ok(Vec::new());
        };
        let prefix = if part.is_empty() { String::new() } else { format!("{part}/") };
        let whole = digests.changed(&folder)?.into_iter();
        let whole = whole.map(|change| ChangedFile { name: format!("{prefix}{}", change.name), ..change });
        let whole =
            whole.filter(|change| !change.is_missing || !MAY_BE_MISSING.contains(&change.name.as_str()));
        Ok(whole.filter(|change| !self.is_accepted(change)).collect())
    }

    /// Refuses changed figures of a run that goes on. What is missing is made again, and the events are checked with a checkpoint.
    pub fn check_before_going_on(&self) -> Result<()> {
        // What is said of missing digests is said of the checkpoint.
        if !self.run.metrics().is_file() || Digests::read(self.run.root())?.is_none() {
            return Ok(());
        }
        let mut changes = self.changes("")?;
        changes.retain(|change| !change.is_missing && change.name != "events.jsonl");
        self.refuse(changes)
    }

    /// Refuses a part of the run with a change that is not accepted.
    pub fn check(&self, part: &str) -> Result<()> {
        self.refuse(self.changes(part)?)
    }

    /// Checks the finished cameras among those of these names. Where the run is finished, all of them are.
    pub fn check_cameras<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<()> {
        let mut changes = Vec::new();
        for name in names {
            let part = format!("cameras/{name}");
            if self.run.camera_metrics(name).is_file() {
                changes.extend(self.changes(&part)?);
            } else if self.run.metrics().is_file() {
                changes.push(ChangedFile { name: format!("{part}/metrics.json"), is_missing: true });
            }
        }
        self.refuse(changes)
    }

    /// Fails with the names of changes, if there are any.
    pub fn refuse(&self, changes: Vec<ChangedFile>) -> Result<()> {
        let Some(first) = changes.first() else { return Ok(()) };
        let all: Vec<String> = changes.iter().map(ToString::to_string).collect();
        // Of a file that is not there nothing can be accepted.
        let hint = match changes.iter().find(|change| !change.is_missing) {
            Some(there) => {
                format!(
                    "put it back from a copy, or add `--accept-changed {}` if you mean the change",
                    there.name
                )
            }
            None => format!("put it back from a copy of the run: {} cannot be made again alone", first.name),
        };
        let problem = format!("{}; hint: {hint}", all.join(", "));
        Err(DesignError::Run { path: self.run.root().to_path_buf(), problem })
    }

    /// Whether the user accepts a change; then a warning says so.
    pub fn is_accepted(&self, change: &ChangedFile) -> bool {
        let is_accepted = self.accepts(change);
        if is_accepted {
            self.warn(&format!("{}: {change}; accepted", self.run.root().display()));
        }
        is_accepted
    }

    /// Whether the user accepts a change.
    pub fn accepts(&self, change: &ChangedFile) -> bool {
        let is_named = |accepted: &String| {
            let accepted = accepted.trim_end_matches('/');
            let below = change.name.strip_prefix(accepted);
            !accepted.is_empty() && below.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        };
        // Of a file that is not there nothing can be accepted.
        !change.is_missing && self.accepted.iter().any(is_named)
    }

    /// One warning for a run whose files cannot be checked.
    pub fn warn_of_missing_digests(&self) {
        if !self.is_reported.replace(true) {
            let run = self.run.root().display();
            self.warn(&format!(
                "{run}: files of an earlier version have no digests; they are read as they are, and a change in them would not be noticed"
            ));
        }
    }
}

/// The SHA-256 of a file, hexadecimal.
pub fn sha256_of_file(path: &Path) -> Result<String> {
    petzval_files::coco::content_digest(path).map_err(DesignError::io(path))
}

/// A digest in hexadecimal.
pub fn hex(hash: Sha256) -> String {
    petzval_base::hex(&hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    #[test]
    fn what_does_not_agree_is_named_and_what_is_accepted_is_a_warning() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::create(&folder.path().join("run")).unwrap();
        let camera = run.camera("wide");
        fs::create_dir_all(camera.join("blocks/network")).unwrap();
        fs::write(camera.join("lens.toml"), "a lens").unwrap();
        fs::write(camera.join("blocks/network/weights.bin"), [1, 2, 3]).unwrap();
        // SHA-256 of the three bytes 1, 2, 3, by `sha256sum`.
        let of_three = "039058c6f2c0cb492c533b0a4d14ef77cc0f78abccced5287d84a1a2011cfb81";
        let digests = Digests::of_folder(&camera).unwrap();
        assert_eq!(digests.files["blocks/network/weights.bin"], of_three);
        digests.write(&camera).unwrap();
        assert_eq!(Digests::of_folder(&camera).unwrap(), digests, "the file of digests is none of them");

        let said = RefCell::new(Vec::new());
        let warn = |text: &str| said.borrow_mut().push(text.to_owned());
        let names = |accepted: &[String]| {
            let changes = DigestCheck::new(&run, accepted, &warn).changes("cameras/wide").unwrap();
            changes.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert!(names(&[]).is_empty());
        fs::write(camera.join("blocks/network/weights.bin"), [1, 2, 2]).unwrap();
        fs::remove_file(camera.join("lens.toml")).unwrap();
        let weights = "cameras/wide/blocks/network/weights.bin is not as the run wrote it";
        assert_eq!(names(&[]), [weights, "cameras/wide/lens.toml is missing"]);
        for accepted in ["cameras/wide", "cameras/wide/", "cameras/wide/blocks/network/weights.bin"] {
            assert_eq!(names(&[accepted.to_owned()]), ["cameras/wide/lens.toml is missing"], "{accepted}");
        }
        assert_eq!(names(&["cameras/wi".to_owned()]).len(), 2);
        assert!(said.borrow().len() == 3 && said.borrow()[0].contains("accepted"));
        said.borrow_mut().clear();
        let check = DigestCheck::new(&run, &[], &warn);
        assert!(check.changes("").unwrap().is_empty() && check.changes("inputs").unwrap().is_empty());
        assert_eq!(said.borrow().len(), 1, "one warning for all that has no digests");

        // Tables and the record have digests, too, but may be taken away.
        let [table, record] = [run.metrics_csv(), run.record()];
        fs::write(&table, "camera").unwrap();
        fs::write(&record, "{}").unwrap();
        note_digests(&run, &[table.clone(), record.clone()]).unwrap();
        fs::write(&table, "cameras").unwrap();
        fs::write(&record, "{ }").unwrap();
        let changed: Vec<String> = check.changes("").unwrap().into_iter().map(|change| change.name).collect();
        assert_eq!(changed, ["metrics.csv", "run.json"]);
        fs::remove_file(&table).unwrap();
        fs::remove_file(&record).unwrap();
        assert!(check.changes("").unwrap().is_empty());

        // A name that the run does not have accepts nothing.
        let known = ["cameras/wide", "cameras/wide/", "inputs"].map(str::to_owned);
        assert!(check_accepted(&[&run], &known).is_ok());
        for unknown in ["cameras/wid", ""] {
            let error = check_accepted(&[&run], &[unknown.to_owned()]).unwrap_err().to_string();
            assert!(
                error.contains(&format!("accept_changed = \"{unknown}\": the run has no such")),
                "{error}"
            );
        }

        // What is missing cannot be accepted, and no hint says so.
        fs::write(camera.join("blocks/network/weights.bin"), [1, 2, 3]).unwrap();
        fs::write(camera.join("metrics.json"), "{}").unwrap();
        fs::write(run.metrics(), "{}").unwrap();
        for _ in 0..2 {
            let error = check.check_cameras(["wide"]).unwrap_err().to_string();
            assert!(error.contains("is missing; hint: put it back") && !error.contains("accept"), "{error}");
            fs::remove_dir_all(run.camera("wide")).unwrap_or_default();
        }
    }
}
