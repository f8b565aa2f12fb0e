//! `design-stop`: ends the process that designs a run, with a checkpoint.

use std::path::PathBuf;

use petzval_design::run::{Holder, RunFolder};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, Result};

/// A run at work.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Its folder.
    pub run: PathBuf,
}

/// Which process is to end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The process. It gives its step up and ends by itself: `run-view` says when it has. None if no process works on the run.
    pub holder: Option<Holder>,
}

/// Sends the process the signal that ends a design with a checkpoint.
pub fn run(request: &Request, _: &Context) -> Result<Response> {
    let folder = RunFolder::open(&request.run)?;
    let run = request.run.display();
    if !folder.is_at_work() {
        return Ok(Response { holder: None });
    }
    let Some(holder) = folder.holder() else {
        let message = format!("{run}: the process that works on this run has not written its name");
        return Err(JobError::input(message, "end it where it was started, by Ctrl-C or SIGTERM"));
    };
    if holder.pid == Holder::own().pid && holder.is_here() {
        let message = format!("{run}: this process itself works on the run");
        return Err(JobError::input(message, "cancel the call of the job `design`"));
    }
    // Whoever has locked the run writes its name next; until then the file holds that of a process which was killed.
    if holder.is_gone() {
        let message = format!("{run}: the process that works on this run has not written its name yet");
        return Err(JobError::input(message, "try again in a second"));
    }
    if !holder.is_here() {
        let message = format!("{run}: {holder} works on this run, and can only be ended there");
        return Err(JobError::input(message, "end it there, by Ctrl-C or SIGTERM"));
    }
    end(&holder)?;
    Ok(Response { holder: Some(holder) })
}

#[cfg(unix)]
fn end(holder: &Holder) -> Result<()> {
    let pid = i32::try_from(holder.pid).ok().and_then(rustix::process::Pid::from_raw);
    let pid = pid.ok_or_else(|| JobError::failed(format!("{holder}: this is no number of a process")))?;
    rustix::process::kill_process(pid, rustix::process::Signal::TERM)
        .map_err(|error| JobError::failed(format!("{holder}: {error}")))
}

#[cfg(not(unix))]
fn end(holder: &Holder) -> Result<()> {
    Err(JobError::input(format!("{holder}: this system has no signals"), "end it by Ctrl-C in its window"))
}
