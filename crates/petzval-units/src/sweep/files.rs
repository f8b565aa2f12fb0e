//! What a sweep writes beside the units: scripts, logs, tables and the page.

use std::fs::{File, create_dir_all};
use std::path::{Path, PathBuf};

use petzval_base::write_whole;
use petzval_jobs::{JobError, Result};
use petzval_report::sweep_page::{SweepView, page};

use super::gather::Gathered;
use super::kept::logs_folder;
use super::script::{Engine, Submission};

/// Files of the results: a row for each combination, one for each unit, and the page.
pub const RESULTS: [&str; 3] = ["table.csv", "units.csv", "sweep.html"];

/// Writes the scripts of all schedulers into the folder of a store.
pub fn keep_scripts(submission: &Submission, root: &Path) -> Result<()> {
    for engine in [Engine::Slurm, Engine::Hq, Engine::Ray] {
        let path = root.join(engine.file());
        write_whole(&path, engine.script(submission).as_bytes()).map_err(failed(&path))?;
    }
    Ok(())
}

/// The log of a process that works on a sweep on this machine, by its place among them; an earlier one is overwritten.
pub fn log_of(root: &Path, place: usize) -> Result<File> {
    let path = logs_folder(root).join(format!("here-{place}.log"));
    File::create(&path).map_err(failed(&path))
}

/// Writes tables and page into a folder, which is made. With `keeps`, results that are there already are an error.
pub fn keep_results(
    gathered: &Gathered,
    view: &SweepView,
    folder: &Path,
    keeps: bool,
) -> Result<Vec<PathBuf>> {
    let paths: Vec<PathBuf> = RESULTS.iter().map(|name| folder.join(name)).collect();
    if let Some(there) = paths.iter().find(|path| keeps && path.exists()) {
        return Err(JobError::input(
            format!("{}: is there already", there.display()),
            "--force overwrites it",
        ));
    }
    create_dir_all(folder).map_err(|e| {
        JobError::input(format!("{}: {e}", folder.display()), "give a folder that can be made")
    })?;
    for (path, text) in paths.iter().zip([gathered.csv(), gathered.units_csv(), page(view)]) {
        write_whole(path, text.as_bytes()).map_err(|e| {
            let hint = "name a folder that can be written with --out";
            JobError::system(format!("{}: {e}", path.display()), &e, hint)
        })?;
    }
    Ok(paths)
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> JobError {
    move |error| JobError::failed(format!("{}: {error}", path.display()))
}
