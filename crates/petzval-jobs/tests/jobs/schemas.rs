//! The schemas of requests and responses describe what jobs take and give.

use std::sync::Arc;

use petzval_jobs::{Context, Silent, built_in_assets, jobs, row};
use serde_json::{Value, json};

use crate::row_check::calls;
use crate::schema_check::check;
use crate::small_sensor;

/// A call of each row with its smallest request; `DIR` stands for an empty folder.
const CALLS: &str = include_str!("../calls.json");

/// Jobs whose stored calls take a moment.
const QUICK: [&str; 24] = [
    "design-config",
    "experiment-list",
    "experiment-show",
    "schema",
    "lens-show",
    "lens-view",
    "lens-edit",
    "lens-trace",
    "lens-analyze",
    "lens-convert",
    "lens-focus",
    "lens-list",
    "glass-find",
    "glass-list",
    "glass-show",
    "psf",
    "sensor-list",
    "sensor-show",
    "sensor-capture",
    "camera-view",
    "photo-list",
    "isp-show",
    "isp-chart",
    "doctor",
];

#[test]
fn requests_that_a_job_refuses_break_its_schema() {
    let trace = json!({"lens": "x", "field": 10, "wavelength": 0.55, "pupil": [0, 1]});
    let with = |key: &str, value: Value| {
        let mut request = trace.clone();
        request[key] = value;
        request
    };
    let schema = row("lens-trace").unwrap().schema();
    check(&schema, &schema, &trace, "").unwrap();
    check(&schema, &schema, &with("lens", json!({"text": "x", "format": "zmx"})), "").unwrap();
    for (key, value, says) in [
        ("wavelength", json!(550), ".wavelength: 20.0 at most"),
        ("field", json!("ten"), ".field: a value of type \"number\""),
        ("colour", json!(1), ".colour: nothing may be here"),
        ("aim", json!("middle"), "paraxial"),
        ("lens", json!(["x"]), ".lens"),
    ] {
        let error = check(&schema, &schema, &with(key, value), "").unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn every_number_with_a_range_has_its_default_and_sentence() {
    let schema = row("psf").unwrap().schema();
    let grid = &schema["properties"]["grid"];
    assert_eq!(grid["minimum"], 16.0);
    assert_eq!(grid["maximum"], 1024.0);
    assert_eq!(grid["default"], 128);
    assert!(grid["description"].as_str().unwrap().contains("Cells a side"));
}

#[test]
fn responses_keep_their_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let context = Context::new(built_in_assets(), Arc::new(Silent));
    let mut seen = 0;
    for mut call in calls(CALLS, &folder.path().display().to_string().replace('\\', "/")) {
        if !QUICK.contains(&call.job.as_str()) {
            continue;
        }
        // The chart has the size of its sensor.
        if call.job == "isp-chart" {
            call.request["camera"] = json!({"sensor": small_sensor(folder.path(), 300, 420), "samples": 2});
        }
        let (job, schema) = (call.job.clone(), row(&call.job).unwrap().response_schema());
        let response = call.run(&context).unwrap_or_else(|error| panic!("{job}: {error}"));
        check(&schema, &schema, &response, &job).unwrap_or_else(|error| panic!("{error}"));
        // A schema that takes anything would say nothing.
        if !["experiment-show", "schema"].contains(&job.as_str()) {
            assert!(check(&schema, &schema, &json!("no response"), "").is_err(), "{job}");
        }
        seen += 1;
    }
    assert_eq!(seen, QUICK.len());
}

#[test]
fn every_row_has_a_schema_of_its_response() {
    for row in jobs() {
        let schema = row.response_schema();
        assert!(schema.is_object(), "{}", row.name);
        assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema", "{}", row.name);
    }
}
