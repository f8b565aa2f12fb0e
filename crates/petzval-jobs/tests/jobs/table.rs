//! The table of jobs: stored calls stay readable, and every row can be called from JSON and stopped.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use petzval_jobs::{
    Call, Context, Fault, JobError, Progress, Silent, Watcher, built_in_assets, jobs, lens, row,
};
use serde_json::{Value, json};

/// A call of each row with its smallest request; `DIR` stands for an empty folder.
const CALLS: &str = include_str!("../calls.json");

fn calls(folder: &str) -> Vec<Call> {
    let calls: Vec<Value> = serde_json::from_str(&CALLS.replace("DIR", folder)).unwrap();
    calls.iter().map(|call| Call::parse(&call.to_string()).unwrap()).collect()
}

fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

fn hint(error: &JobError) -> String {
    match error {
        JobError::Setting { hint, .. } | JobError::Input { hint, .. } => hint.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_row_has_a_stored_call_whose_request_it_reads() {
    let stored: BTreeSet<String> = calls("x").into_iter().map(|call| call.job).collect();
    let rows: BTreeSet<String> = jobs().iter().map(|row| row.name.to_owned()).collect();
    assert_eq!(stored, rows);
    assert_eq!(rows.len(), jobs().len());
    let mut filled = Vec::new();
    for call in calls("x") {
        let row = row(&call.job).unwrap();
        let whole = row.filled_in(call.request.clone()).unwrap_or_else(|e| panic!("{}: {e}", call.job));
        filled.push(json!({"job": call.job, "request": whole}));
        assert_eq!(row.filled_in(whole.clone()).unwrap(), whole, "{}", call.job);
        let back: Call = serde_json::from_value(serde_json::to_value(&call).unwrap()).unwrap();
        assert_eq!(back, call);
        // What the schema requires is what a request cannot do without.
        let schema = row.schema();
        assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema", "{}", call.job);
        for key in schema.get("required").and_then(Value::as_array).into_iter().flatten() {
            let mut without = call.request.clone();
            without.as_object_mut().unwrap().remove(key.as_str().unwrap()).unwrap();
            let error = row.filled_in(without).unwrap_err();
            assert!(error.to_string().contains("is missing"), "{}: {error}", call.job);
        }
    }
    // Every key with its default, as stored: one that is renamed or has another default shows here.
    let stored = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/requests.json");
    if std::env::var_os("PETZVAL_STORE_REQUESTS").is_some() {
        std::fs::write(&stored, serde_json::to_string_pretty(&filled).unwrap() + "\n").unwrap();
    }
    let stored: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(stored).unwrap()).unwrap();
    for (now, then) in filled.iter().zip(&stored) {
        assert_eq!(now, then);
    }
    assert_eq!(filled.len(), stored.len());
}

#[test]
fn wrong_calls_are_refused_with_the_key_and_a_hint() {
    let run = |job: &str, request: Value| Call::new(job, request).run(&context()).unwrap_err();
    let error = run("lens-shwo", json!({}));
    assert_eq!(hint(&error), "did you mean `lens-show`?");
    let error = run("lens-show", json!({"lens": "cooke-triplet-nominal", "fokus": "file"}));
    assert!(error.to_string().contains("unknown field `fokus`"), "{error}");
    assert!(hint(&error).contains("petzval schema job lens-show"), "{}", hint(&error));
    let error = run("lens-show", json!({}));
    assert_eq!(error.to_string(), "request of lens-show: `lens` is missing");
    for changed in [json!({"format": 2}), json!({"threads": 5000}), json!({"glasses": ["no-such.agf"]})] {
        let mut call = json!({"format": 1, "job": "doctor"});
        call.as_object_mut().unwrap().extend(changed.as_object().unwrap().clone());
        let error = Call::parse(&call.to_string()).and_then(|call| call.run(&context())).unwrap_err();
        assert_eq!(error.fault(), Fault::Input, "{error}");
    }
    assert!(Call::parse("{\"job\": \"doctor\"}").unwrap_err().to_string().contains("format"));
    assert!(
        Call::parse("{\"format\": 1,\n \"jobb\": \"doctor\"}").unwrap_err().to_string().contains("line 2")
    );
}

#[test]
fn a_call_answers_as_the_job_does_whatever_its_threads() {
    let request = json!({"lens": "cooke-triplet-nominal", "grade": "commercial", "trials": 40});
    let call = Call::new("lens-tolerance", request.clone());
    let one = Call { threads: 1, ..call.clone() }.run(&context()).unwrap();
    assert_eq!(one, call.run(&context()).unwrap());
    let request = serde_json::from_value(row("lens-tolerance").unwrap().filled_in(request).unwrap()).unwrap();
    let direct = lens::tolerance::run(&request, &context()).unwrap();
    assert_eq!(one, serde_json::to_value(direct).unwrap());
}

/// Stops its job at the first thing that the job says.
struct Stopper(Arc<AtomicBool>);

impl Watcher for Stopper {
    fn warning(&self, _: &str) {
        self.0.store(true, Ordering::Relaxed);
    }

    fn note(&self, _: &str) {
        self.0.store(true, Ordering::Relaxed);
    }

    fn progress(&self, _: &Progress) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn every_row_is_started_from_its_smallest_request_and_stops_when_cancelled() {
    let folder = tempfile::tempdir().unwrap();
    for call in calls(&folder.path().display().to_string().replace('\\', "/")) {
        let stop = Arc::new(AtomicBool::new(false));
        let context = Context::new(built_in_assets(), Arc::new(Stopper(stop.clone())));
        let job = call.job.clone();
        let wants_what_is_missing = call.request.to_string().contains("missing");
        match call.run(&context.with_cancellation(stop.clone())) {
            Ok(_) => assert!(!wants_what_is_missing, "{job}"),
            // A request that is right fails for no other reason than that it was stopped. Those of long jobs would take hours.
            Err(error) if wants_what_is_missing => assert_eq!(error.fault(), Fault::Input, "{job}: {error}"),
            Err(error) => {
                let text = error.to_string();
                let says_so = text.contains("stopped") || text.contains("cancelled");
                assert!(stop.load(Ordering::Relaxed) && says_so, "{job}: {error}");
            }
        }
    }
}
