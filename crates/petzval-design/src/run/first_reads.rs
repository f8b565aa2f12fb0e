//! Digests of the pictures of a large set, each from its first read: `inputs/first-reads.jsonl`, a line a picture.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};

use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::run::{RunFolder, write_file};

/// A line.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FirstRead {
    /// Name of the picture.
    name: String,
    /// SHA-256 of its file, hexadecimal.
    sha256: String,
}

/// What the run has read so far, by name. A line that was cut off while it was written does not count.
pub fn read(run: &RunFolder) -> Result<BTreeMap<String, String>> {
    let path = run.first_reads();
    let text = match petzval_base::read_text(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(DesignError::io(&path)(error)),
    };
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    let read = |(line, text): (usize, &str)| {
        let read: FirstRead = serde_json::from_str(text).map_err(|error| DesignError::Run {
            path: path.clone(),
            problem: format!("line {line}: {error}; hint: take the file away, and pictures are noted anew"),
        })?;
        Ok((read.name, read.sha256))
    };
    (1..).zip(whole).map(read).collect()
}

/// Adds pictures to those that the run has read.
pub fn add(run: &RunFolder, fresh: BTreeMap<String, String>) -> Result<()> {
    if fresh.is_empty() {
        return Ok(());
    }
    let path = run.first_reads();
    // A line that was cut off goes.
    if let Ok(text) = petzval_base::read_text(&path)
        && !text.ends_with('\n')
    {
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        write_file(&path, whole.as_bytes())?;
    }
    let mut text = String::new();
    for (name, sha256) in fresh {
        let line = FirstRead { name, sha256 };
        text += &serde_json::to_string(&line).map_err(|error| DesignError::Unwritable {
            what: "the pictures that were read",
            problem: error.to_string(),
        })?;
        text.push('\n');
    }
    let mut file =
        OpenOptions::new().create(true).append(true).open(&path).map_err(DesignError::io(&path))?;
    file.write_all(text.as_bytes()).map_err(DesignError::io(&path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_added_and_a_cut_one_does_not_count() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::create(&root.path().join("run")).unwrap();
        std::fs::create_dir_all(run.first_reads().parent().unwrap()).unwrap();
        let of = |names: &[&str]| -> BTreeMap<String, String> {
            names.iter().map(|name| ((*name).to_owned(), format!("digest of {name}"))).collect()
        };
        assert!(read(&run).unwrap().is_empty());
        add(&run, of(&["a", "b \"quoted\""])).unwrap();
        add(&run, BTreeMap::new()).unwrap();
        add(&run, of(&["c"])).unwrap();
        assert_eq!(read(&run).unwrap(), of(&["a", "b \"quoted\"", "c"]));
        // The program was killed while it wrote the last line.
        let text = std::fs::read_to_string(run.first_reads()).unwrap();
        std::fs::write(run.first_reads(), &text[..text.len() - 5]).unwrap();
        assert_eq!(read(&run).unwrap(), of(&["a", "b \"quoted\""]));
        add(&run, of(&["d"])).unwrap();
        assert_eq!(read(&run).unwrap(), of(&["a", "b \"quoted\"", "d"]));
    }
}
