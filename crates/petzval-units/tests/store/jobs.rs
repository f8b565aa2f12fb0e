//! The verbs of runs, sweeps and units as rows of the table of jobs.

use std::path::Path;

use petzval_base::simd::level;
use petzval_jobs::{Call, jobs};
use petzval_units::sweep::{Source, keyed, plan};
use petzval_units::unit::{Digests, Prepared, Unit};
use petzval_units::{RunOptions, Store, rows, run_all, table};
use serde_json::{Value, json};

use crate::row_check::{calls, check_stored, start_and_cancel};
use crate::schema_check::check;
use crate::{context, unit};

/// A call of each row with its smallest request; `DIR` stands for a folder that [`prepare`] has filled.
const CALLS: &str = include_str!("../calls.json");

/// The stored calls. Their units are of the instruction set of this machine.
fn stored(folder: &Path) -> Vec<Call> {
    let mut calls = calls(CALLS, &folder.display().to_string().replace('\\', "/"));
    for call in &mut calls {
        let units = call.request.get_mut("units").and_then(Value::as_array_mut);
        units.into_iter().flatten().for_each(|unit| unit["simd"] = level().into());
    }
    calls
}

/// Makes a sweep of two rays, and the parts of a tolerance analysis, both with their results.
fn prepare(folder: &Path) {
    let file = folder.join("rays.toml");
    let rays = "[request]\nlens = \"cooke-triplet-nominal\"\nwavelength = 0.55\npupil = [0.0, 0.5]\n[grid]\nfield = [0.0, 5.0]\n";
    std::fs::write(&file, format!("job = \"lens-trace\"\nsimd = \"{}\"\n{rays}", level())).unwrap();
    let source = Source::read(&file).unwrap();
    let plan = plan(&source, &context()).unwrap();
    let (kept, units) = keyed(&plan, &source, &context()).unwrap();
    run(&units.units, kept.keep(&units, &source, &folder.join("rays")).unwrap());
    let parts: Vec<Unit> = serde_json::from_value(parts(folder)["units"].clone()).unwrap();
    run(&parts, Store::open_or_new(&folder.join("parts")).unwrap());
}

/// The stored request of `unit-gather`.
fn parts(folder: &Path) -> Value {
    stored(folder).into_iter().find(|call| call.job == "unit-gather").unwrap().request
}

fn run(units: &[Unit], store: Store) {
    let all: Vec<&Unit> = units.iter().collect();
    let summary = run_all(&all, || Ok(store), &context(), RunOptions::default()).unwrap();
    assert_eq!(summary.done, all.len(), "{summary:?}");
}

#[test]
fn every_row_over_units_has_a_stored_call_whose_request_it_reads() {
    check_stored(rows(), &stored(Path::new("x")));
    let below: Vec<&str> = jobs().iter().map(|row| row.name).collect();
    assert!(rows().iter().all(|row| !below.contains(&row.name)), "two rows have one name");
    assert_eq!(table().rows().len(), jobs().len() + rows().len());
}

#[test]
fn every_row_over_units_starts_from_its_smallest_request_and_keeps_its_schema() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let table = table();
    for call in stored(folder.path()) {
        let job = call.job.clone();
        let Some(response) = start_and_cancel(&table, call) else { continue };
        let schema = table.row(&job).unwrap().response_schema();
        check(&schema, &schema, &response, &job).unwrap_or_else(|error| panic!("{error}"));
        assert!(check(&schema, &schema, &json!("no response"), "").is_err(), "{job}");
    }
}

#[test]
fn a_sweep_is_planned_looked_at_and_gathered_by_calls() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let at = |name: &str| folder.path().join(name);
    let called = |job: &str, request: Value| {
        Call::new(job, request).run_by(&table(), &context()).unwrap_or_else(|e| panic!("{job}: {e}"))
    };
    let count = |of: &Value| of.as_array().map(Vec::len);
    let planned = called("sweep-plan", json!({"file": at("rays.toml"), "store": at("rays")}));
    assert_eq!((count(&planned["units"]), &planned["estimate"]["done"]), (Some(2), &json!(2)));
    let status = called("sweep-status", json!({"store": at("rays")}));
    assert_eq!((&status["units"][1]["state"], &status["units"][1]["attempt"]), (&json!("done"), &json!(1)));
    assert_eq!(status["units"][1]["key"], planned["units"][1]["key"]);
    let begun = called("unit-status", json!({"store": at("rays")}));
    assert_eq!((count(&begun), &begun[0]["state"]), (Some(2), &json!("done")));
    let runs = called("runs", json!({"folder": folder.path()}));
    assert_eq!((count(&runs["runs"]), count(&runs["units"])), (Some(0), Some(4)));

    // Without a folder nothing is written.
    let gathered = called("sweep-gather", json!({"store": at("rays")}));
    assert_eq!((count(&gathered["rows"]), count(&gathered["files"])), (Some(2), Some(0)));
    assert!(!at("rays/table.csv").exists());
    // Tables in the store are replaced, those elsewhere stay.
    for _ in 0..2 {
        called("sweep-gather", json!({"store": at("rays"), "out": at("rays")}));
    }
    let elsewhere = json!({"store": at("rays"), "out": at("tables")});
    assert_eq!(count(&called("sweep-gather", elsewhere.clone())["files"]), Some(3));
    let there = Call::new("sweep-gather", elsewhere).run_by(&table(), &context()).unwrap_err().report();
    assert!(there.message.contains("is there already"), "{}", there.message);
    assert!(there.hint.contains("\"overwrite\": true"), "{}", there.hint);

    let joined = called("unit-gather", parts(folder.path()));
    assert_eq!(joined[0]["units"], json!(["first", "second"]));
    assert_eq!(joined[0]["report"]["monte_carlo"]["trials"], 4);
}

#[test]
fn a_job_over_units_is_no_unit() {
    for row in rows() {
        let unit = unit("over", row.name, json!({}));
        let error = Prepared::new(&unit, &context(), &Digests::default()).unwrap_err().to_string();
        assert!(error.starts_with("unit \"over\": the job"), "{error}");
        assert!(error.contains("cannot be a unit itself"), "{error}");
    }
}
