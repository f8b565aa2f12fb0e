//! A lens, a sensor or an experiment that a request holds itself gives what its file gives.

use std::path::Path;
use std::sync::Arc;

use petzval_jobs::{Call, Context, Fault, JobError, Silent, built_in_assets};
use serde_json::{Value, json};

const LENS: &str = "cooke-triplet-nominal";
const SENSOR: &str = "imx249-fitted";

fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

fn run(job: &str, request: &Value) -> Result<Value, JobError> {
    Call::new(job, request.clone()).run(&context())
}

/// The text of a built-in file.
fn text(folder: &'static str, name: &str) -> String {
    built_in_assets().text("file", folder, name).unwrap().text
}

/// The response, with `DIR` in place of the folder of the results.
fn response(job: &str, request: &Value, folder: &Path) -> Value {
    let folder = folder.display().to_string().replace('\\', "/");
    let request: Value = serde_json::from_str(&request.to_string().replace("DIR", &folder)).unwrap();
    let response = run(job, &request).unwrap_or_else(|error| panic!("{job}: {error}"));
    serde_json::from_str(&response.to_string().replace(&folder, "DIR")).unwrap()
}

#[test]
fn an_inline_lens_gives_what_its_name_and_its_file_give() {
    let here = tempfile::tempdir().unwrap();
    let zmx = here.path().join("triplet.zmx");
    run("lens-convert", &json!({"from": LENS, "to": zmx})).unwrap();
    let ways = [
        (json!(LENS), json!({"toml": text("lenses", LENS)})),
        (json!(LENS), json!({"text": text("lenses", LENS), "format": "toml"})),
        (json!(zmx), json!({"text": std::fs::read_to_string(&zmx).unwrap(), "format": "zmx"})),
    ];
    for (named, inline) in &ways {
        for (job, mut request) in [
            ("lens-show", json!({})),
            ("lens-trace", json!({"field": 10, "wavelength": 0.55, "pupil": [0, 0.7]})),
            ("lens-focus", json!({})),
        ] {
            request["lens"] = named.clone();
            let of_name = run(job, &request).unwrap();
            request["lens"] = inline.clone();
            assert_eq!(run(job, &request).unwrap(), of_name, "{job}");
        }
    }
}

#[test]
fn results_of_an_inline_lens_and_sensor_are_those_of_their_files() {
    let (lens, sensor) = (json!({"toml": text("lenses", LENS)}), json!({"toml": text("sensors", SENSOR)}));
    let optimize =
        |lens: &Value| json!({"start": {"new": {"lens": lens, "out": "DIR/best"}}, "iterations": 2});
    let psf = |lens: &Value| json!({"lens": lens, "out": "DIR/psf", "fields": 2, "grid": 32, "pitch_um": 4});
    let simulate = |lens: &Value, sensor: &Value| {
        json!({"lens": lens, "sensor": sensor, "images": ["scene:flat"], "spectral": {"qe": "flat:0.6"},
            "size": [32, 32], "out": "DIR"})
    };
    for (job, of_names, inline) in [
        ("psf", psf(&json!(LENS)), psf(&lens)),
        ("simulate", simulate(&json!(LENS), &json!(SENSOR)), simulate(&lens, &sensor)),
        ("lens-optimize", optimize(&json!(LENS)), optimize(&lens)),
        ("sensor-show", json!({"sensor": SENSOR}), json!({"sensor": sensor})),
    ] {
        let [first, second] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let of_names = response(job, &of_names, first.path());
        assert_eq!(response(job, &inline, second.path()), of_names, "{job}");
        for file in ["psf/psf.npy", "flat-raw.tiff", "best/best.toml"] {
            let bytes = |folder: &Path| std::fs::read(folder.join(file)).ok();
            assert_eq!(bytes(first.path()), bytes(second.path()), "{job}: {file}");
        }
    }
}

#[test]
fn an_inline_experiment_is_looked_at_as_its_file() {
    const NAME: &str = "cooke-triplet-tight-bounds";
    let toml = text("experiments", NAME);
    let tables: toml::Table = toml.parse().unwrap();
    let look = |experiment: Value| run("design-check", &json!({"run": {"experiment": experiment}})).unwrap();
    let of_name = look(json!(NAME));
    assert_eq!(look(json!({"toml": toml})), of_name);
    assert_eq!(look(serde_json::to_value(tables).unwrap()), of_name);
}

#[test]
fn an_experiment_is_fitted_to_an_inline_lens_as_to_its_file() {
    let here = tempfile::tempdir().unwrap();
    let file = here.path().join("own.toml");
    std::fs::write(&file, text("lenses", LENS)).unwrap();
    let config = |experiment: Value| {
        let mut found = run("design-config", &json!({"run": {"experiment": experiment}})).unwrap();
        let values = found["values"].take();
        (values["lens"].clone(), values["psf"].clone(), values["variant"].clone())
    };
    let (lens, psf, variants) = config(json!({"toml": text("lenses", LENS)}));
    assert_eq!(lens, "lens (fitted)");
    let of_file = config(json!(file));
    assert_eq!((psf, variants), (of_file.1, of_file.2));
}

#[test]
fn errors_in_what_a_request_holds_name_the_line_and_the_key() {
    let lens = text("lenses", LENS);
    let line = lens.lines().position(|line| line.starts_with("units")).unwrap() + 1;
    let lens = lens.replace("units = ", "unitz = ");
    let trace = |lens: Value| json!({"lens": lens, "field": 0, "wavelength": 0.55, "pupil": [0, 0]});
    for (job, request, says) in [
        (
            "lens-trace",
            trace(json!({"toml": lens})),
            vec![format!("lens (inline), line {line}"), "unitz".to_owned()],
        ),
        (
            "lens-trace",
            trace(json!({"text": "nothing", "format": "zmx"})),
            vec!["lens (inline).zmx".to_owned()],
        ),
        (
            "sensor-show",
            json!({"sensor": {"toml": "name = 5\n"}}),
            vec!["sensor (inline), line 1".to_owned(), "name = 5".to_owned()],
        ),
        (
            "design-check",
            json!({"run": {"experiment": {"psf": {"grid": "x"}}}}),
            vec!["experiment (tables): `grid = \"x\"`".to_owned()],
        ),
        (
            "design-check",
            json!({"run": {"experiment": {"psf": {"grid": null}}}}),
            vec!["experiment (tables)".to_owned()],
        ),
    ] {
        let error = run(job, &request).unwrap_err();
        assert_eq!(error.fault(), Fault::Input, "{error}");
        for says in says {
            assert!(error.to_string().contains(&says), "{job}: {error}");
        }
    }
}
