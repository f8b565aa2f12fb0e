//! Runs units of a store: begins or goes on, keeps the claim alive, and keeps what came out.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant, SystemTime};

use petzval_base::counted;
use petzval_jobs::{Call, Context, ErrorReport, Fault, JobError, Result, Stopped, WarningKind};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::attempt::{Attempt, Begun, forget_peak};
use super::error::is_of_the_disk;
use super::log::Log;
use super::record::{Failure, StoredResult};
use super::state::Seen;
use super::{RENEWED_EVERY, Store, StoreError};
use crate::unit::{Digests, Prepared, Unit};
use petzval_design::run::Holder;

/// How units are run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// Run units again that have failed, or whose folder is damaged. All files of results are read for that; else only their sizes are compared. If two
    /// processes retry a unit at the same time, one runs it; its failure is that of both.
    pub retries: bool,
    /// Do not wait for units that other processes are working on.
    pub leaves_others: bool,
}

/// How a unit ended in this process.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Its result was there.
    There(Box<StoredResult>),
    /// It has a result now.
    Done(Box<StoredResult>),
    /// It has failed, now or earlier.
    Failed(Box<Failure>),
    /// Another process works on it.
    Elsewhere,
    /// A file of its folder in the store is damaged: it was not run.
    Damaged(Box<ErrorReport>),
    /// It was stopped. The next process goes on from its checkpoint, or begins again where the job has none.
    Stopped(Box<Stopped>),
}

/// A unit of which a file in the store is damaged.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Damage {
    /// Name of the unit.
    pub unit: String,
    /// Which file, what is wrong with it, and what to do.
    pub error: ErrorReport,
}

/// How the units of a file ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// Units whose result was there.
    pub there: usize,
    /// Units that have a result from this process.
    pub done: usize,
    /// Units that have failed.
    pub failed: Vec<Failure>,
    /// Units of which a file in the store is damaged.
    pub damaged: Vec<Damage>,
    /// Names of units that other processes are working on.
    pub elsewhere: Vec<String>,
    /// How the run was stopped, if it was.
    pub stopped: Option<Stopped>,
}

/// How long a process waits before it looks again at units of others.
const LOOK_AGAIN: Duration = Duration::from_secs(2);

/// How often a wait looks whether it is cancelled.
const CANCEL_LOOK: Duration = Duration::from_millis(100);

/// How many times a unit is begun without a checkpoint: a job that is longer than the time of a task would be begun for ever.
const MOST_BEGINNINGS: u32 = 5;

/// How far the time of day may go apart from the time that passed, s.
const CLOCK_JUMP_S: f64 = 60.0;

/// Runs one unit: with a result it ends at once, from a checkpoint it goes on, else it begins.
///
/// Fails if the unit cannot be run at all (its request, version or instruction set), or if the store cannot be read or written. A job that
/// fails is no error: [`Outcome::Failed`].
pub fn run_unit(unit: &Unit, store: &Store, context: &Context, options: RunOptions) -> Result<Outcome> {
    let prepared = ready(unit, context, &Digests::default())?;
    run_prepared(&prepared, store, context, options, &mut Seen::default())
}

/// Runs units one after another, each as [`run_unit`] does, until all have ended. Every unit is checked before the first is run. Units of two
/// instruction sets are refused.
///
/// Units on which other processes work come last: they are waited for, and taken over if their process is gone. A unit that fails or is damaged does
/// not end the others. Once the context is cancelled, the running unit keeps its checkpoint and no other is begun. The store is opened
/// once all units are checked, so that none is made for units that cannot be run.
pub fn run_all(
    units: &[&Unit],
    open: impl FnOnce() -> Result<Store, StoreError>,
    context: &Context,
    options: RunOptions,
) -> Result<Summary> {
    let (mut summary, mut seen) = (Summary::default(), Seen::default());
    let (digests, mut prepared) = (Digests::default(), Vec::new());
    check_one_level(units)?;
    for unit in units {
        if context.is_cancelled() {
            summary.stopped = Some(Stopped::new("stopped before the first unit"));
            return Ok(summary);
        }
        prepared.push(ready(unit, context, &digests)?);
    }
    let store = open()?;
    if options.retries {
        store.note_failures(prepared.iter().map(|unit| &unit.key), &mut seen)?;
    }
    let mut left: Vec<&Prepared> = prepared.iter().collect();
    loop {
        let mut others = Vec::new();
        for unit in &left {
            if context.is_cancelled() {
                summary.stopped.get_or_insert_with(|| Stopped::new("stopped before the next unit"));
            }
            if summary.stopped.is_some() {
                return Ok(summary);
            }
            match run_prepared(unit, &store, context, options, &mut seen)? {
                Outcome::There(_) => summary.there += 1,
                Outcome::Done(_) => summary.done += 1,
                Outcome::Failed(failure) => summary.failed.push(*failure),
                Outcome::Elsewhere => others.push(*unit),
                Outcome::Damaged(error) => {
                    summary.damaged.push(Damage { unit: unit.unit.name.clone(), error: *error });
                }
                Outcome::Stopped(stopped) => summary.stopped = Some(*stopped),
            }
        }
        if others.is_empty() || options.leaves_others || summary.stopped.is_some() {
            summary.elsewhere = others.iter().map(|unit| unit.unit.name.clone()).collect();
            return Ok(summary);
        }
        if others.len() == left.len() {
            wait(LOOK_AGAIN, context);
        } else {
            context.note(format!("waiting for {} of other processes", counted(others.len(), "unit")));
        }
        left = others;
    }
}

/// A unit that this process can run. Fails as well if it would give another result than the unit says.
fn ready(unit: &Unit, context: &Context, digests: &Digests) -> Result<Prepared> {
    // Before inputs are read, which may be large.
    unit.check()?;
    unit.check_level()?;
    Prepared::checked(unit, context, digests)
}

/// Fails at the first unit with another instruction set than the first one: a process computes with one.
fn check_one_level(units: &[&Unit]) -> Result<()> {
    let Some(first) = units.first() else { return Ok(()) };
    let Some(other) = units.iter().find(|unit| unit.simd != first.simd) else { return Ok(()) };
    first.check()?;
    other.check()?;
    let message = format!(
        "`simd` is {}, and that of the unit \"{}\" is {}: a process computes with one instruction set",
        other.simd, first.name, first.simd
    );
    let hint = "write a file of units for each instruction set, or run units one by one with --name NAME";
    Err(other.refused(&message, hint))
}

/// Waits, but not longer than until the context is cancelled.
fn wait(time: Duration, context: &Context) {
    let start = Instant::now();
    while start.elapsed() < time && !context.is_cancelled() {
        std::thread::sleep(CANCEL_LOOK);
    }
}

/// Runs a unit that is ready.
pub(crate) fn run_prepared(
    prepared: &Prepared,
    store: &Store,
    context: &Context,
    options: RunOptions,
    seen: &mut Seen,
) -> Result<Outcome> {
    let attempt = match store.begin(prepared, Holder::own(), options.retries, seen, context.cancel())? {
        Begun::Mine(attempt) => attempt,
        Begun::Done(result) => return Ok(Outcome::There(result)),
        Begun::Failed(failure) => return Ok(Outcome::Failed(failure)),
        Begun::Elsewhere(_) => return Ok(Outcome::Elsewhere),
        Begun::Damaged(error) => return Ok(Outcome::Damaged(error)),
        Begun::Cancelled => {
            let stopped = Stopped::new("stopped while the files of a result were read");
            return Ok(Outcome::Stopped(Box::new(stopped)));
        }
    };
    context.note(match attempt.number() {
        1 => format!("unit {}", prepared.unit.name),
        number => format!("unit {}, attempt {number}", prepared.unit.name),
    });
    let log = Arc::new(Log::new(store, attempt.log(), context));
    let own = Context::new(context.assets.clone(), log.clone())
        .with_cancellation(context.cancel().clone())
        .with_command(format!("petzval unit run # unit {}", prepared.unit.name));
    let (day, time) = (SystemTime::now(), Instant::now());
    forget_peak();
    let place = match checkpoint(&attempt) {
        Ok(place) => place,
        Err(error) => {
            let _unended = attempt.stop_by_disk();
            return Err(error);
        }
    };
    if place.from == Beginning::Nothing && attempt.stops_before() >= MOST_BEGINNINGS && !options.retries {
        let error = never_ends(&attempt);
        return Ok(Outcome::Failed(Box::new(attempt.fail(error.report())?)));
    }
    if place.from == Beginning::Nothing && attempt.number() > 1 && !options.retries {
        own.note(format!(
            "no attempt has left a checkpoint: the unit begins again, and {:.0} CPU s are lost; if tasks end before it does, give them more time, \
             or cut it into parts",
            attempt.cpu_seconds_before()
        ));
    }
    let number = attempt.number();
    let (attempt, made) = kept_alive(*attempt, context, || {
        let response = work(&place, prepared, store, &own, &log)?;
        // Many files may take longer to read than a claim lives.
        Ok((response, store.keep_contents(&prepared.key, number)))
    });
    warn_of_a_jump(day, time, &own);
    match made {
        Ok((response, Ok(()))) => {
            let result = attempt.finish(response)?;
            Ok(Outcome::Done(Box::new(result)))
        }
        Ok((_, Err(error))) => unlisted(attempt, error, prepared, store),
        Err(error) => ended_without(attempt, error, prepared, store),
    }
}

/// The error of a unit that was begun so many times that its processes seem to end before it can.
fn never_ends(attempt: &Attempt) -> JobError {
    let message = format!(
        "it was stopped {} times before its end and left no checkpoint: {:.0} CPU s are lost",
        attempt.stops_before(),
        attempt.cpu_seconds_before()
    );
    JobError::input(
        message,
        "give each task more time (`petzval sweep --time`), cut the unit into parts, or run it again with `petzval unit run --retry`",
    )
}

/// How a unit ends whose job has no response.
fn ended_without(attempt: Attempt, error: JobError, prepared: &Prepared, store: &Store) -> Result<Outcome> {
    // The files of this attempt were removed once another one had finished.
    if let Some(result) = store.result(&prepared.key)? {
        return Ok(Outcome::There(Box::new(result)));
    }
    match error {
        JobError::Stopped(stopped) => {
            attempt.stop()?;
            Ok(Outcome::Stopped(stopped))
        }
        error if is_of_the_disk(&error.to_string()) => {
            // The unit is not to blame: the next process goes on. That the claim cannot be ended either is no other error.
            let _unended = attempt.stop_by_disk();
            Err(error)
        }
        error => Ok(Outcome::Failed(Box::new(attempt.fail(error.report())?))),
    }
}

/// How a unit ends whose files could not be listed. The unit is not to blame.
fn unlisted(attempt: Attempt, error: StoreError, prepared: &Prepared, store: &Store) -> Result<Outcome> {
    // The files of this attempt were removed once another one had finished.
    if let Some(result) = store.result(&prepared.key)? {
        return Ok(Outcome::There(Box::new(result)));
    }
    // Others need not wait until the claim is stale. A disk that is full may not even take this.
    let _unended = attempt.stop_by_disk();
    Err(error.into())
}

/// Where an attempt works.
struct Place {
    folder: PathBuf,
    /// What is in it at first.
    from: Beginning,
}

/// What the folder of an attempt begins with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Beginning {
    /// Nothing.
    Nothing,
    /// The checkpoint of an attempt that has ended.
    Checkpoint,
    /// A copy of that of a process that is gone, or perhaps still works there. It may be torn, and the original stays.
    Copy,
}

/// Takes over the newest folder of an earlier attempt from which the job can go on.
fn checkpoint(attempt: &Attempt) -> Result<Place> {
    let (prepared, folder) = (attempt.prepared(), attempt.folder());
    let row = prepared.row()?;
    attempt.clear()?;
    for (earlier, has_ended) in attempt.earlier()? {
        if row.going_on(prepared.request.clone(), &earlier)?.is_some() {
            attempt.take_over(&earlier, has_ended)?;
            let from = if has_ended { Beginning::Checkpoint } else { Beginning::Copy };
            return Ok(Place { folder, from });
        }
    }
    Ok(Place { folder, from: Beginning::Nothing })
}

/// Does the job of an attempt, from a checkpoint where there is one that can be read.
fn work(place: &Place, prepared: &Prepared, store: &Store, context: &Context, log: &Log) -> Result<Value> {
    let row = prepared.row()?;
    let folder = place.folder.as_path();
    let fresh = || row.kept_in(prepared.request.clone(), folder);
    let run = |request: Value| {
        // A job that writes a single file does not make its folder.
        store.layer.make_folder(folder).map_err(StoreError::io(folder))?;
        let call = Call { request, ..prepared.unit.call.clone() };
        call.run(context).map(|response| relative(response, folder))
    };
    let again = match place.from {
        Beginning::Nothing => None,
        Beginning::Checkpoint | Beginning::Copy => row.going_on(prepared.request.clone(), folder)?,
    };
    let Some(again) = again else { return run(fresh()?) };
    context.note("going on from a checkpoint");
    match run(again) {
        Err(error)
            if place.from == Beginning::Copy
                && error.fault() == Fault::Input
                && !log.has_advanced()
                && !is_of_the_disk(&error.to_string()) =>
        {
            // Somebody still worked in the folder while it was copied, or a disk lost its last writes.
            context.warning(
                WarningKind::ChangedFile,
                format!("the checkpoint cannot be used, and the unit begins again: {error}"),
            );
            store.layer.remove_folder(folder).map_err(StoreError::io(folder))?;
            run(fresh()?)
        }
        ended => ended,
    }
}

/// A response in which paths below a folder begin with `files`.
fn relative(response: Value, folder: &Path) -> Value {
    let Some(root) = folder.to_str() else { return response };
    match response {
        Value::String(text) => match text.strip_prefix(root) {
            Some("") => "files".into(),
            Some(below) if below.starts_with('/') => format!("files{below}").into(),
            _ => text.into(),
        },
        Value::Array(items) => items.into_iter().map(|item| relative(item, folder)).collect(),
        Value::Object(keys) => keys.into_iter().map(|(key, value)| (key, relative(value, folder))).collect(),
        other => other,
    }
}

/// Does work while a thread renews the claim of its attempt.
fn kept_alive<T>(
    attempt: Attempt,
    context: &Context,
    work: impl FnOnce() -> Result<T>,
) -> (Attempt, Result<T>) {
    let (end, ended) = channel::<()>();
    let mut attempt = attempt;
    let made = std::thread::scope(|scope| {
        let renewed = &mut attempt;
        scope.spawn(move || {
            let (mut is_warned, mut is_lost) = (false, false);
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(RENEWED_EVERY) {
                match renewed.renew() {
                    Ok(Some(other)) if !is_lost => {
                        is_lost = true;
                        context.warning(WarningKind::Other, format!(
                            "unit {}: {} took it over, as this process had not renewed its claim for long; both work on, and the first result counts",
                            renewed.prepared().unit.name, other.holder
                        ));
                    }
                    Err(error) if !is_warned => {
                        is_warned = true;
                        context.warning(WarningKind::Other, format!("the claim could not be renewed: {error}"));
                    }
                    _ => {}
                }
            }
        });
        let _ended = EndOnDrop(end);
        work()
    });
    (attempt, made)
}

/// Ends the thread that renews, also if the work panics.
struct EndOnDrop(Sender<()>);

impl Drop for EndOnDrop {
    fn drop(&mut self) {
        // The thread may have ended.
        let _ended = self.0.send(());
    }
}

/// Warns if the time of day went apart from the time that passed: times in results are those of a clock that does not jump.
fn warn_of_a_jump(day: SystemTime, time: Instant, context: &Context) {
    let passed = time.elapsed().as_secs_f64();
    let by_day = match SystemTime::now().duration_since(day) {
        Ok(later) => later.as_secs_f64(),
        Err(earlier) => -earlier.duration().as_secs_f64(),
    };
    if (by_day - passed).abs() > CLOCK_JUMP_S {
        context.warning(
            WarningKind::Other,
            format!(
                "the clock of this machine jumped by {:.0} s while the unit ran; claims and durations do not depend on it",
                by_day - passed
            ),
        );
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, PoisonError};

    use petzval_jobs::{Event, Watcher, built_in_assets};

    use super::*;

    /// Keeps the texts of warnings.
    #[derive(Default)]
    struct Warnings(Mutex<Vec<String>>);

    impl Watcher for Warnings {
        fn event(&self, event: &Event) {
            if let Event::Warning { text, .. } = event {
                self.0.lock().unwrap_or_else(PoisonError::into_inner).push(text.clone());
            }
        }
    }

    /// The warnings after a unit that ends at once and began at this time of day.
    fn warnings(began: SystemTime) -> Vec<String> {
        let found = Arc::new(Warnings::default());
        warn_of_a_jump(began, Instant::now(), &Context::new(built_in_assets(), found.clone()));
        found.0.lock().unwrap().clone()
    }

    #[test]
    fn a_clock_that_jumps_either_way_while_a_unit_runs_is_warned_of() {
        let (now, jump) = (SystemTime::now(), Duration::from_secs(3600));
        for (began, says) in [(now - jump, "jumped by 3600 s"), (now + jump, "jumped by -3600 s")] {
            let said = warnings(began);
            assert!(said.len() == 1 && said[0].contains(says), "{said:?}");
        }
        // A clock that is set right by a few seconds is none.
        for began in [now, now - Duration::from_secs(10), now + Duration::from_secs(10)] {
            assert_eq!(warnings(began), [""; 0]);
        }
    }
}
