//! Calls of jobs, on threads of their own.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use petzval_base::Cancel;
use petzval_jobs::{Call, Context, ErrorReport, Event, JobError, Watcher};
use serde_json::Value;

use crate::folder::{Folder, inline_experiment};
use crate::frames;
use crate::message::{MakeCall, Outgoing, Packed, refusal};
use crate::outbox::Outbox;
use crate::processes::Processes;
use crate::uploads::Uploads;

/// Most calls of one page that are at work at a time.
const MOST: usize = 8;

/// The jobs, and where they run.
pub struct Calls {
    context: Context,
    folder: Folder,
    /// Live calls have a pool of their own, so that a long job beside them does not delay them.
    live: Arc<rayon::ThreadPool>,
    processes: Processes,
}

/// The calls of one page that are at work.
#[derive(Default)]
pub struct AtWork {
    calls: Arc<Mutex<HashMap<u64, Running>>>,
}

struct Running {
    cancel: Cancel,
    live: Option<String>,
}

/// Sends events of a call to its page. What a page does not take in time is left out: a slow reader delays no job.
struct ToPage {
    id: u64,
    page: Outbox,
}

impl Watcher for ToPage {
    fn event(&self, event: &Event) {
        self.page.offer(frames::text(&Outgoing::Event { id: self.id, event }.text()));
    }
}

impl Calls {
    /// The jobs of a library.
    pub fn new(context: Context, folder: Folder, processes: Processes) -> std::io::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().thread_name(|i| format!("studio live {i}")).build();
        Ok(Self { context, folder, live: Arc::new(pool.map_err(std::io::Error::other)?), processes })
    }

    /// Begins a call; its answers go to `page`. The error says why it is not made.
    pub fn begin(
        &self,
        call: MakeCall,
        at_work: &AtWork,
        uploads: &Uploads,
        page: &Outbox,
    ) -> Result<(), Box<ErrorReport>> {
        let MakeCall { id, job, mut request, live, overwrite, bytes, process } = call;
        if let Some(path) = self.folder.way_out(&request) {
            let hint = format!("name files in {}, by their paths in it", self.folder.path().display());
            return Err(refusal(format!("{path}: this path leads out of the folder of the studio"), &hint));
        }
        if let Some(key) = inline_experiment(&job, &request) {
            let hint = format!("write it into a file in {}, and name that", self.folder.path().display());
            return Err(refusal(format!("{key}: the studio takes an experiment by its name alone"), &hint));
        }
        uploads.put_in(&mut request);
        if process {
            let begun = self.processes.begin(&Call { overwrite, ..Call::new(&job, request) })?;
            page.send(&Outgoing::Response { id, response: &begun }.text());
            return Ok(());
        }
        let context = self.context.watched_by(Arc::new(ToPage { id, page: page.clone() }));
        let cancel = Cancel::default();
        let context = context.with_cancellation(cancel.clone());
        at_work.add(id, Running { cancel, live: live.clone() })?;
        let (calls, page) = (at_work.calls.clone(), page.clone());
        let pool = live.map(|_| self.live.clone());
        let work = move || {
            let call = Call { overwrite, ..Call::new(&job, request) };
            let jobs = petzval_units::table();
            let ended = match pool {
                Some(pool) => pool.install(|| call.run_by(&jobs, &context)),
                None => call.run_by(&jobs, &context),
            };
            let frame = answer(id, ended, &bytes);
            // The channel is free before its page knows: it may send the next call at once.
            calls.lock().unwrap_or_else(PoisonError::into_inner).remove(&id);
            page.send_frame(frame);
        };
        let begun = std::thread::Builder::new().name("studio job".to_owned()).spawn(work);
        begun.map(|_| ()).map_err(|error| {
            at_work.calls.lock().unwrap_or_else(PoisonError::into_inner).remove(&id);
            refusal(format!("no thread for the call: {error}"), "try again")
        })
    }
}

/// The last message of a call, with bytes for these keys of its response.
fn answer(id: u64, ended: Result<Value, JobError>, bytes: &[String]) -> Vec<u8> {
    match ended {
        Ok(mut response) => match Packed::new(id, &mut response, bytes) {
            Some(Packed { payload }) => frames::bytes(&payload),
            None => frames::text(&Outgoing::Response { id, response: &response }.text()),
        },
        Err(error) => frames::text(&Outgoing::Error { id: Some(id), error: &error.report() }.text()),
    }
}

impl AtWork {
    fn add(&self, id: u64, call: Running) -> Result<(), Box<ErrorReport>> {
        let mut calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
        if calls.contains_key(&id) {
            return Err(refusal(
                format!("a call with the number {id} is at work"),
                "number calls one by one",
            ));
        }
        if let Some(channel) = &call.live
            && calls.values().any(|other| other.live.as_ref() == Some(channel))
        {
            let hint = "keep the newest state, and send it when the answer is there";
            return Err(refusal(format!("a call of the live channel `{channel}` is in flight"), hint));
        }
        if calls.len() >= MOST {
            return Err(refusal(format!("{MOST} calls are at work"), "wait for one of them, or cancel it"));
        }
        calls.insert(id, call);
        Ok(())
    }

    /// Cancels a call, if it is at work.
    pub fn cancel(&self, id: u64) {
        if let Some(call) = self.calls.lock().unwrap_or_else(PoisonError::into_inner).get(&id) {
            call.cancel.set();
        }
    }
}

impl Drop for AtWork {
    /// Calls end with their page.
    fn drop(&mut self) {
        let calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
        for call in calls.values() {
            call.cancel.set();
        }
    }
}
