//! The table of jobs: stored calls stay readable, and every row can be called from JSON and stopped.

use std::path::Path;
use std::sync::Arc;

use petzval_jobs::{
    Call, Context, Fault, Job, JobError, Row, Silent, Table, built_in_assets, jobs, lens, row,
};
use serde_json::{Value, json};

use crate::row_check;

/// A call of each row with its smallest request; `DIR` stands for an empty folder.
const CALLS: &str = include_str!("../calls.json");

fn calls(folder: &str) -> Vec<Call> {
    row_check::calls(CALLS, folder)
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
    let filled = row_check::check_stored(jobs(), &calls("x"));
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

struct Double;

impl Job for Double {
    const NAME: &'static str = "double";
    const ABOUT: &'static str = "Doubles a number.";
    const NEEDS: &'static [&'static str] = &[];
    type Request = u32;
    type Response = u32;

    fn run(request: &u32, _: &Context) -> Result<u32, JobError> {
        Ok(2 * request)
    }
}

#[test]
fn a_table_takes_further_rows_which_calls_find_by_name() {
    let table = Table::built_in().with(&[Row::of::<Double>()]);
    assert_eq!(table.rows().len(), jobs().len() + 1);
    assert_eq!(Call::new("double", json!(21)).run_by(&table, &context()).unwrap(), 42);
    let error = Call::new("double", json!("x")).run_by(&table, &context()).unwrap_err();
    assert!(error.to_string().starts_with("request of double: "), "{error}");
    assert_eq!(hint(&table.row("doubel").err().unwrap()), "did you mean `double`?");
    assert!(table.row("lens-show").is_ok());
    let error = Call::new("double", json!(21)).run(&context()).unwrap_err();
    assert!(error.to_string().contains("there is no job `double`"), "{error}");
}

#[test]
fn wrong_calls_are_refused_with_the_key_and_a_hint() {
    let run = |job: &str, request: Value| Call::new(job, request).run(&context()).unwrap_err();
    let error = run("lens-shwo", json!({}));
    assert_eq!(hint(&error), "did you mean `lens-show`?");
    let error = run("lens-show", json!({"lens": "cooke-triplet-nominal", "fokus": "file"}));
    assert_eq!(error.to_string(), "request of lens-show: `fokus`: no such key here");
    assert!(hint(&error).starts_with("did you mean `focus`?"), "{}", hint(&error));
    assert!(hint(&error).contains("petzval schema job lens-show"), "{}", hint(&error));
    let error = run("lens-show", json!({}));
    assert_eq!(error.to_string(), "request of lens-show: `lens`: the key is missing");
    for (job, request, says) in [
        (
            "design",
            json!({"run": {"new": {"changes": {"steps": "ten"}}}}),
            "`run.new.changes.steps`: expected a number",
        ),
        (
            "design",
            json!({"run": {"new": {"changes": {"stepps": 1}}}}),
            "`run.new.changes.stepps`: no such key",
        ),
        ("lens-show", json!({"lens": 5}), "`lens`: expected the name of a lens, a path, or the lens itself"),
        ("lens-show", json!({"lens": {"text": "x", "format": "zemax"}}), "`lens.format`: \"zemax\""),
        (
            "psf",
            json!({"lens": "x", "out": "x", "wavelengths": [0.5, "x", 0.6]}),
            "`wavelengths[1]`: expected a number",
        ),
        ("lens-show", json!([]), "expected an object"),
    ] {
        let error = run(job, request).to_string();
        assert!(error.starts_with(&format!("request of {job}: {says}")), "{error}");
    }
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

/// Requests for files that are not there; [`crate::whole_table`] runs those for files that are.
#[test]
fn a_request_for_what_is_missing_is_wrong_input_of_every_row() {
    let folder = tempfile::tempdir().unwrap();
    let calls = calls(&folder.path().display().to_string().replace('\\', "/"));
    let mut checked = 0;
    for call in calls.into_iter().filter(|call| call.request.to_string().contains("missing")) {
        let job = call.job.clone();
        let error = call.run(&context()).unwrap_err();
        assert_eq!(error.fault(), Fault::Input, "{job}: {error}");
        checked += 1;
    }
    assert!(checked > 12, "{checked}");
}

#[test]
fn the_device_of_a_call_is_that_of_its_job_and_messages_name_keys() {
    let call =
        |job: &str, request: Value| Call { device: Some("abacus".to_owned()), ..Call::new(job, request) };
    let run = |call: Call| call.run(&context()).unwrap_err();
    let resumed = json!({"run": {"resume": {"run": "missing"}}});
    let error = run(call("design", resumed.clone()));
    assert!(
        matches!(&error, JobError::Setting { key: "device", value, .. } if value == "abacus"),
        "{error:?}"
    );
    let mut twice = resumed.clone();
    twice["device"] = "cpu".into();
    assert!(run(call("design", twice)).to_string().contains("the request has `device`: \"cpu\""));
    assert!(run(call("lens-list", json!({}))).to_string().contains("takes no device"));
    let text = json!({"format": 1, "job": "design", "request": resumed, "device": "cpu"}).to_string();
    assert_eq!(Call::parse(&text).unwrap().device.as_deref(), Some("cpu"));

    // Where the command would name --force.
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("a.toml");
    std::fs::write(&to, "").unwrap();
    let error = run(Call::new("lens-convert", json!({"from": "cooke-triplet-nominal", "to": to})));
    assert!(hint(&error).contains("\"overwrite\": true"), "{}", hint(&error));
}

#[test]
fn the_keys_of_a_request_and_where_to_read_more_are_two_clauses() {
    let call = |request: Value| row("design").unwrap().filled_in(request).unwrap_err();
    let unknown = call(json!({"run": {"new": {"experiment": "x", "variant": "nominal"}}}));
    let more = "`petzval schema job design` prints what a request may hold";
    let keys = hint(&unknown).strip_suffix(&format!("; {more}")).map(str::to_owned);
    assert!(keys.is_some_and(|keys| keys.ends_with(char::is_alphabetic)), "{}", hint(&unknown));
    let misspelt = call(json!({"runs": {}}));
    assert!(hint(&misspelt).ends_with(&format!("? {more}")), "{}", hint(&misspelt));
}
