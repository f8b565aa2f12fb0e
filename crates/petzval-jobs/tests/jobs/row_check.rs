//! What every row of a table of jobs keeps to: its stored calls, and how it ends once it is cancelled. Crates above this one check theirs by it.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use cpu_time::ProcessTime;
use petzval_base::Cancel;
use petzval_jobs::{Call, Context, ErrorReport, Event, JobError, Row, Table, Watcher, built_in_assets};
use serde_json::{Value, json};

use crate::schema_check::check;

/// Most events of a job after it is cancelled: those of the running step, and of what is kept.
const FURTHER: usize = 64;

/// Time after which a job that says nothing is cancelled.
const PATIENCE: Duration = Duration::from_secs(2);

/// Cancels its job at the first event, and counts those that follow.
struct Stopper {
    cancel: Cancel,
    further: AtomicUsize,
}

impl Watcher for Stopper {
    fn event(&self, event: &Event) {
        // Whatever a job says can be sent, and is what was sent.
        let text = serde_json::to_string(event).unwrap();
        let back: Event = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
        if self.cancel.set() {
            self.further.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The calls of a file of them, in which `DIR` stands for a folder.
pub fn calls(text: &str, folder: &str) -> Vec<Call> {
    let calls: Vec<Value> = serde_json::from_str(&text.replace("DIR", folder)).unwrap();
    calls.iter().map(|call| Call::parse(&call.to_string()).unwrap()).collect()
}

/// Sees that each of these rows has a stored call, and that their requests are read. The answer has the requests with every key.
pub fn check_stored(rows: &[Row], calls: &[Call]) -> Vec<Value> {
    let stored: BTreeSet<&str> = calls.iter().map(|call| call.job.as_str()).collect();
    let names: BTreeSet<&str> = rows.iter().map(|row| row.name).collect();
    assert_eq!(stored, names);
    assert_eq!(names.len(), rows.len());
    let mut filled = Vec::new();
    for call in calls {
        let row = rows.iter().find(|row| row.name == call.job).unwrap();
        let whole = row.filled_in(call.request.clone()).unwrap_or_else(|e| panic!("{}: {e}", call.job));
        assert_eq!(row.filled_in(whole.clone()).unwrap(), whole, "{}", call.job);
        let back: Call = serde_json::from_value(serde_json::to_value(call).unwrap()).unwrap();
        assert_eq!(back, *call);
        let schema = row.schema();
        assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema", "{}", call.job);
        for request in [&call.request, &whole] {
            check(&schema, &schema, request, &call.job).unwrap_or_else(|error| panic!("{error}"));
        }
        // What the schema requires is what a request cannot do without.
        for key in schema.get("required").and_then(Value::as_array).into_iter().flatten() {
            let property = &schema["properties"][key.as_str().unwrap()];
            assert!(property.get("default").is_none(), "{}: {key} is required and has a default", call.job);
            let mut without = call.request.clone();
            without.as_object_mut().unwrap().remove(key.as_str().unwrap()).unwrap();
            let error = row.filled_in(without).unwrap_err();
            assert!(error.to_string().contains("is missing"), "{}: {error}", call.job);
        }
        filled.push(json!({"job": call.job, "request": whole}));
    }
    filled
}

/// Makes a call, and cancels it as soon as it says something. The answer is its response, if it had one by then.
pub fn start_and_cancel(table: &Table, call: Call) -> Option<Value> {
    let row = *table.row(&call.job).unwrap();
    let cancel = Cancel::default();
    let stopper = Arc::new(Stopper { cancel: cancel.clone(), further: AtomicUsize::new(0) });
    let context = Context::new(built_in_assets(), stopper.clone()).with_cancellation(cancel.clone());
    // The timer ends with the job.
    let (ended, end) = std::sync::mpsc::channel::<()>();
    let timer = std::thread::spawn(move || {
        if end.recv_timeout(PATIENCE).is_err() {
            cancel.set();
        }
    });
    let before = ProcessTime::now();
    let outcome = call.run_by(table, &context);
    let _gone = ended.send(());
    timer.join().unwrap();
    let further = stopper.further.load(Ordering::Relaxed);
    let (how, response) = match outcome {
        Ok(response) => {
            let text = response.to_string();
            assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), response, "{}", row.name);
            ("ends".to_owned(), Some(response))
        }
        Err(error) => {
            let report = serde_json::to_string(&error).unwrap();
            assert_eq!(serde_json::from_str::<ErrorReport>(&report).unwrap(), error.report());
            let JobError::Stopped(stopped) = error else { panic!("{}: {error}", row.name) };
            let there = stopped.kept.iter().filter(|path| path.exists()).count();
            assert_eq!(there, stopped.kept.len(), "{}: {:?}", row.name, stopped.kept);
            // What goes on is a request of the same row.
            if let Some(request) = &stopped.resume {
                row.filled_in(request.clone()).unwrap_or_else(|e| panic!("{}: {e}", row.name));
            }
            (stopped.message.clone(), None)
        }
    };
    println!("{}: {further} further events, {:.1} s: {how}", row.name, before.elapsed().as_secs_f64());
    assert!(further <= FURTHER, "{}: {further} events after it was cancelled", row.name);
    response
}
