//! The page of a run, which every verb writes that changes what it shows.

use std::path::PathBuf;

use petzval_design::report::run_report::report_of_run;
use petzval_design::run::{RunFolder, RunRecord, write_file};
use petzval_design::setup::Setup;
use petzval_report::design_report::{Report, html, sentences};

use crate::context::Context;
use crate::error::Result;
use crate::event::WarningKind;

/// The report of a finished run as a page.
pub(crate) fn page(setup: &Setup, folder: &RunFolder) -> Result<String> {
    Ok(html(&report(setup, folder)?))
}

fn report(setup: &Setup, folder: &RunFolder) -> Result<Report> {
    let command = format!("petzval design {}", folder.config().display());
    Ok(report_of_run(setup, folder, &command)?)
}

/// Writes the report of a run; returns its path, and the result in sentences.
pub(crate) fn write(setup: &Setup, folder: &RunFolder, context: &Context) -> Result<(PathBuf, Vec<String>)> {
    let report = report(setup, folder)?;
    warn_of_missing_pictures(&report, context);
    write_file(&folder.report(), html(&report).as_bytes())?;
    context.wrote(folder.report(), "page");
    Ok((folder.report(), sentences(&report)))
}

/// Says which pictures of a run its page does not show.
pub(crate) fn warn_of_missing_pictures(report: &Report, context: &Context) {
    if let Some(files) = &report.left_out {
        context.warning(WarningKind::Picture, files);
    }
}

/// Warns where `config.toml` is no longer what a finished run was made from: its figures are those of its record.
pub(crate) fn warn_of_changed_config(folder: &RunFolder, context: &Context) -> Result<()> {
    let Some(record) = RunRecord::read(folder)? else {
        context.warning(
            WarningKind::ChangedFile,
            format!(
                "{}: there is no such file: what the run was begun with is not known, and config.toml is taken as it is",
                folder.record().display()
            ),
        );
        return Ok(());
    };
    if let Some(error) = context.assets.changed_config(&record, folder)? {
        context.warning(
            WarningKind::ChangedFile,
            format!("{}; what follows is the run as it was made", error.message),
        );
    }
    Ok(())
}
