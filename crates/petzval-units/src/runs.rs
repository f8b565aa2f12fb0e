//! All runs below a folder in one table.

use std::fs;
use std::path::{Path, PathBuf};

use petzval_design::run_row::{RunRow, is_run, note_differences, run_row};
use petzval_jobs::{Context, JobError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The folder in which runs are looked for where none is named.
pub const USUAL_FOLDER: &str = "runs";

/// How deep folders are looked into.
const DEEPEST: usize = 12;

/// All runs below a folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Runs {
    /// One row each, by path.
    pub runs: Vec<RunRow>,
}

/// Every run in a folder and below it; a folder that is a run itself is the only row. A damaged run is a row with its reason. Links are not followed.
pub fn runs_in(folder: &Path, context: &Context) -> Result<Runs, JobError> {
    if !folder.is_dir() {
        let what = if folder.exists() { "is no folder" } else { "there is no such folder" };
        return Err(JobError::input(
            format!("{}: {what}", folder.display()),
            "give a folder with runs, such as runs",
        ));
    }
    let mut found = Vec::new();
    collect(folder, 0, &mut found, context)?;
    found.sort();
    let mut runs = Vec::with_capacity(found.len());
    for path in found {
        context.check(|| format!("stopped after {} runs", runs.len()))?;
        runs.push(run_row(&path, &context.assets));
    }
    note_differences(&mut runs);
    Ok(Runs { runs })
}

/// Adds the runs in a folder and below it. A folder that cannot be read holds none.
fn collect(folder: &Path, depth: usize, found: &mut Vec<PathBuf>, context: &Context) -> Result<(), JobError> {
    if is_run(folder) {
        found.push(folder.to_path_buf());
        return Ok(());
    }
    context.check(|| "stopped while looking for runs")?;
    if depth == DEEPEST {
        return Ok(());
    }
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            collect(&entry.path(), depth + 1, found, context)?;
        }
    }
    Ok(())
}
