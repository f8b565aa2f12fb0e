//! Figures and cameras of a run as the run wrote them: where a file was changed since, reading it is refused unless the user accepts the change.

use petzval_design::report::run_report::read_metrics;
use petzval_design::run::{DigestCheck, Event, Metrics, RunFolder, read_events};

use crate::context::Context;
use crate::error::Result;
use crate::event::WarningKind;

/// The figures of a finished run. `accept_changed` names files or folders of the run that may differ from their digests.
pub fn figures(folder: &RunFolder, accept_changed: &[String], context: &Context) -> Result<Metrics> {
    let metrics = read_metrics(folder)?;
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    check_figures(&metrics, &DigestCheck::new(folder, accept_changed, &warn))?;
    Ok(metrics)
}

/// The steps of a run. Those of a finished run are refused where the run or its events were changed.
pub fn events(folder: &RunFolder, accept_changed: &[String], context: &Context) -> Result<Vec<Event>> {
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    if folder.metrics().is_file() {
        DigestCheck::new(folder, accept_changed, &warn).check("")?;
    }
    Ok(read_events(&folder.events())?)
}

/// Refuses a finished camera that was changed: its lens, its values, its weights.
pub fn check_camera(
    folder: &RunFolder,
    camera: &str,
    accept_changed: &[String],
    context: &Context,
) -> Result<()> {
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    Ok(DigestCheck::new(folder, accept_changed, &warn).check_cameras([camera])?)
}

/// Refuses a finished run whose figures, events or cameras are not as the run wrote them, unless the user accepts the change.
pub(crate) fn check_figures(metrics: &Metrics, check: &DigestCheck<'_>) -> Result<()> {
    check.check("")?;
    Ok(check.check_cameras(metrics.rows.iter().map(|row| row.camera.as_str()))?)
}
