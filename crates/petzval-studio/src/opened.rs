//! What the studio is started with: lenses, and the lenses of runs.

use std::path::Path;

use petzval_jobs::{Call, Context, JobError};
use serde::Serialize;
use serde_json::{Value, json};

/// A lens that the page can open at once.
#[derive(Debug, Serialize)]
pub struct Opened {
    /// How the user called it.
    pub name: String,
    /// Its text in Petzval's format.
    pub toml: String,
    /// Records of its file that the lens does not represent.
    pub losses: Value,
}

/// The lens of the studio that is started without one.
const FIRST: &str = "cooke-triplet-nominal";

/// Folder of the cameras of a run, and the lens in each of them.
const CAMERAS: &str = "cameras";
const LENS: &str = "lens.toml";

/// Reads the lenses of names, paths and folders of runs.
pub fn open(names: &[String], context: &Context) -> Result<Vec<Opened>, JobError> {
    let mut found = Vec::new();
    for name in names {
        let folder = Path::new(name);
        if !folder.is_dir() {
            found.push(lens(name, name, context)?);
            continue;
        }
        let entries = std::fs::read_dir(folder.join(CAMERAS)).into_iter().flatten().flatten();
        let mut lenses: Vec<_> =
            entries.map(|entry| entry.path().join(LENS)).filter(|path| path.is_file()).collect();
        lenses.sort();
        if lenses.is_empty() {
            let message = format!("{name}: this folder has no {CAMERAS}/NAME/{LENS}");
            return Err(JobError::input(
                message,
                "name a lens file, or the folder of a run with finished cameras",
            ));
        }
        for path in lenses {
            let path = path.display().to_string();
            found.push(lens(&path, &path, context)?);
        }
    }
    if found.is_empty() {
        found.push(lens(FIRST, FIRST, context)?);
    }
    Ok(found)
}

/// A lens in Petzval's format.
fn lens(name: &str, called: &str, context: &Context) -> Result<Opened, JobError> {
    let response = Call::new("lens-edit", json!({"lens": name})).run(context)?;
    Ok(Opened {
        name: called.to_owned(),
        toml: response["text"].as_str().unwrap_or_default().to_owned(),
        losses: response["losses_of_reading"].clone(),
    })
}
