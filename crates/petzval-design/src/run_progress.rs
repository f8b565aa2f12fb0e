//! How far a run at work has come, from what its folder holds: its events, its finished cameras and the lenses of its checkpoints.

use std::time::Duration;

use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;
use petzval_report::design_report::{CameraProgress, CameraState, Progress};

use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, Stage, Variant};
use crate::pace::{Pace, TimeLeft};
use crate::position::{POSITION_FILE, Position};
use crate::run::{Event, Metrics, RunFolder, SCORE, latest_checkpoint, read_json};
use crate::setup::Setup;

/// The loss of a step, the sum of all its terms.
pub(crate) const TOTAL: &str = "total";

/// The camera at work: that of the last event, unless this was its score.
pub(crate) fn at_work<'s>(setup: &'s Setup, events: &[Event]) -> Option<&'s Variant> {
    let last = events.last().filter(|event| event.block != SCORE)?;
    setup.variants.iter().find(|variant| variant.name == last.camera)
}

/// The lens of a camera at work in its latest checkpoint; none before the first.
pub(crate) fn latest_lens(run: &RunFolder, variant: &Variant, events: &[Event]) -> Result<Option<Lens>> {
    let steps = events.iter().rev().filter(|event| event.camera == variant.name).map(|event| event.step);
    let Some(path) = steps.map(|step| run.lens_at_step(step)).find(|path| path.is_file()) else {
        return Ok(None);
    };
    let text = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
    // A lens that we wrote carries its glasses with it.
    let file = petzval_files::parse_lens(&text, &Catalog::default()).map_err(DesignError::input(&path))?;
    Ok(Some(file.lens))
}

/// How far every camera has come, and how long the rest will take.
pub(crate) fn progress(setup: &Setup, run: &RunFolder, metrics: &Metrics, events: &[Event]) -> Progress {
    let at_work = at_work(setup, events);
    let camera = |variant: &Variant| {
        let state = match at_work {
            Some(other) if other.name == variant.name => CameraState::AtWork,
            _ if is_scored(metrics, variant) => CameraState::Finished,
            _ => CameraState::Waiting,
        };
        let own = || events.iter().filter(|event| event.camera == variant.name);
        let taken = |block: &str| own().filter(|event| event.block == block).count();
        let lenses = variant.stages.iter().filter_map(|stage| match stage {
            Stage::Lens { goal, iterations, .. } => Some((goal.event(), *iterations)),
            Stage::Task(_) => None,
        });
        let blocks = BlockName::ALL.map(|block| (block.name(), variant.task_steps_of(block)));
        let planned = lenses.chain(blocks.into_iter().filter(|(_, steps)| *steps > 0));
        let latest = own().rev().find_map(|event| event.losses.get(TOTAL));
        CameraProgress {
            camera: variant.name.clone(),
            state,
            steps: planned.map(|(block, all)| (moved_part(block).to_owned(), taken(block), all)).collect(),
            loss: latest.copied().unwrap_or(f64::NAN),
        }
    };
    Progress {
        cameras: setup.variants.iter().map(camera).collect(),
        time_left: time_left(run, &setup.variants, events).map(in_words),
    }
}

/// What moves in the steps of an event.
pub(crate) fn moved_part(block: &str) -> &str {
    match block {
        "optics" => "lens",
        "isp" => "ISP",
        "spot" => "lens towards least spots",
        "restored" => "lens towards least error after restoration",
        other => other,
    }
}

/// Whether a camera of the run is finished.
pub(crate) fn is_scored(metrics: &Metrics, variant: &Variant) -> bool {
    metrics.rows.iter().any(|row| row.camera == variant.name)
}

/// How long the rest of a run takes, by its latest checkpoint and the events after it. `None` before its first event, at its end, and where the
/// checkpoint cannot be read.
pub fn time_left(run: &RunFolder, variants: &[Variant], events: &[Event]) -> Option<TimeLeft> {
    let position = match latest_checkpoint(run).ok()? {
        Some((_, folder)) => read_json(&folder.join(POSITION_FILE)).ok()?,
        None => Position::default(),
    };
    let (before, after) = events.split_at(events.partition_point(|event| event.step <= position.step));
    let mut pace = Pace::new(position.units_left(variants), before);
    for event in after {
        pace.note(event, event.seconds);
    }
    pace.time_left()
}

/// The time that is left, as a report says it: to the minute, unless it is less than one.
fn in_words(left: TimeLeft) -> String {
    let least = if left.is_least { "at least" } else { "about" };
    let seconds = left.seconds.ceil() as u64;
    let rounded = if seconds < 60 { seconds } else { seconds.div_ceil(60) * 60 };
    let time = humantime::format_duration(Duration::from_secs(rounded));
    format!("The rest takes {least} {time} at the pace of the latest steps.")
}
