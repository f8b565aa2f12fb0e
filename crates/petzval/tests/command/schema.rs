//! Schema, reader and defaults agree about the files that a user writes.

use crate::common::*;
use petzval::base::parameter::Parameters;
use petzval::design::experiment::{Experiment, OpticsConfig, PsfsBy};
use petzval::design::task::Tasks;
use serde_json::Value;

fn schema(kind: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    run_ok(folder.path(), &["schema", kind]).json()
}

/// The schema that a property of an object refers to.
fn property<'s>(root: &'s Value, of: &'s Value, key: &str) -> Option<&'s Value> {
    let found = &of["properties"][key];
    if found.is_null() { None } else { Some(resolved(root, found)) }
}

/// Follows `$ref`, and the one schema of a choice that is not `null`.
fn resolved<'s>(root: &'s Value, schema: &'s Value) -> &'s Value {
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.strip_prefix("#/$defs/").expect("a local reference");
        return resolved(root, &root["$defs"][name]);
    }
    for choice in ["anyOf", "oneOf", "allOf"] {
        let first = schema[choice].as_array().and_then(|all| all.iter().find(|s| s["type"] != "null"));
        if let Some(first) = first.filter(|_| schema["properties"].is_null()) {
            return resolved(root, first);
        }
    }
    schema
}

/// Fails for a key of a TOML file that is not in its schema.
fn assert_described(root: &Value, schema: &Value, value: &toml::Value, path: &str) {
    match value {
        toml::Value::Table(table) => {
            let is_map = schema["properties"].is_null() && schema["additionalProperties"].is_object();
            for (key, value) in table {
                let path = format!("{path}.{key}");
                let inner = if is_map {
                    resolved(root, &schema["additionalProperties"])
                } else {
                    property(root, schema, key).unwrap_or_else(|| panic!("no {path} in the schema"))
                };
                assert_described(root, inner, value, &path);
            }
            if !is_map {
                assert_eq!(schema["additionalProperties"], Value::Bool(false), "{path} takes any key");
            }
        }
        toml::Value::Array(items) => {
            for item in items.iter().filter(|i| i.is_table()) {
                assert_described(root, resolved(root, &schema["items"]), item, path);
            }
        }
        _ => {}
    }
}

#[test]
fn schemas_describe_every_built_in_file() {
    for (kind, folder) in [("experiment", "experiments"), ("lens", "lenses"), ("sensor", "sensors")] {
        let schema = schema(kind);
        let mut files = 0;
        for entry in std::fs::read_dir(data(folder)).unwrap() {
            let path = entry.unwrap().path();
            let table: toml::Table = read(&path).parse().unwrap();
            assert_described(&schema, &schema, &toml::Value::Table(table), &path.display().to_string());
            files += 1;
        }
        assert!(files > 0, "no {folder}");
    }
}

#[test]
fn a_schema_gives_type_range_unit_default_and_meaning_of_a_number() {
    let schema = schema("experiment");
    let exposure = property(&schema, &schema, "exposure").unwrap();
    let white = &exposure["properties"]["white_e"];
    assert_eq!((white["minimum"].as_f64(), white["maximum"].as_f64()), (Some(1.0), Some(1e7)));
    assert_eq!(white["default"].as_f64(), Some(16000.0));
    assert!(white["description"].as_str().unwrap().contains("Unit: e-"), "{white}");
    let wavelengths = &property(&schema, &schema, "psf").unwrap()["properties"]["wavelengths_um"];
    assert_eq!(wavelengths["items"]["minimum"].as_f64(), Some(0.2));
}

#[test]
fn only_a_job_has_a_schema_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let advice = [("lens-show", "petzval schema job lens-show"), ("foo", "leave the name out")];
    for (name, hint) in advice {
        run_fails(
            folder.path(),
            &["schema", "experiment", name],
            2,
            &["only the schema of a job has a name", hint],
        );
    }
}

#[test]
fn a_schema_refuses_variants_that_the_reader_refuses() {
    let schema = schema("experiment");
    assert_eq!(schema["properties"]["variant"]["minItems"], 1);
    let variant = resolved(&schema, &schema["properties"]["variant"]["items"]);
    assert_eq!(variant["properties"]["name"]["pattern"], "^[A-Za-z0-9_-]+$");
    assert_eq!(variant["properties"]["stage"]["minItems"], 1);
    let stage = resolved(&schema, &variant["properties"]["stage"]["items"]);
    assert_eq!(stage["properties"]["moves"]["minItems"], 1);
    // A schedule has the ranges of the table that it replaces.
    let schedule = &schema["$defs"]["ScheduleConfig"]["properties"];
    let table = OpticsConfig::table();
    for (key, of_table) in [
        ("learning_rate", "learning_rate"),
        ("final_learning_rate", "final_learning_rate"),
        ("share", "moving_share"),
        ("proximal", "proximal"),
    ] {
        let range = table.parameters.iter().find(|p| p.name == of_table).unwrap();
        let found = (schedule[key]["minimum"].as_f64(), schedule[key]["maximum"].as_f64());
        assert_eq!(found, (Some(range.min), Some(range.max)), "{key}");
    }
}

#[test]
fn the_printed_configuration_is_complete_and_reads_back_to_the_same_experiment() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.toml"), "name = \"mine\"\n[training]\nsteps = 7\n").unwrap();
    let printed = run_ok(folder.path(), &["design", "mine.toml", "--seed", "5", "--print-config"]).stdout;
    let every_key = serde_json::to_value(Experiment::default()).unwrap();
    let read_back = Tasks::built_in().parse_complete(&printed, &every_key).unwrap();
    assert_eq!((read_back.name.as_str(), read_back.seed, read_back.training.steps), ("mine", 5, 7));
    assert_eq!(read_back.to_toml().unwrap().parse::<toml::Table>().unwrap(), printed.parse().unwrap());
    // An empty file is the main job, except for its title and the texts of its file. Its PSFs are by rays: files that say nothing of them are older
    // than the key in every built-in file, and stay as they were.
    let built_in = read(&data("experiments/cooke-triplet-image-quality.toml"));
    let mut built_in = Experiment::parse(&built_in).unwrap();
    built_in.name = "Camera design".to_owned();
    assert_eq!(std::mem::replace(&mut built_in.psf.kind, PsfsBy::Geometric), PsfsBy::Diffraction);
    assert_eq!(Experiment::parse("").unwrap(), built_in);
}

#[test]
fn built_in_experiments_are_listed_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let listed = run_ok(folder.path(), &["experiment", "list", "--json"]).json();
    let main_job = listed.as_array().unwrap().iter().find(|e| e["name"] == "cooke-triplet-image-quality");
    assert_eq!(main_job.unwrap()["variants"], serde_json::json!(["nominal", "spot-optimised", "end-to-end"]));
    let shown = run_ok(folder.path(), &["experiment", "show", "cooke-triplet-image-quality"]).stdout;
    assert_eq!(shown, read(&data("experiments/cooke-triplet-image-quality.toml")));
    run_fails(folder.path(), &["experiment", "show", "nothing"], 2, &["no experiment called `nothing`"]);
}

#[test]
fn one_variant_can_be_made_alone() {
    let folder = tempfile::tempdir().unwrap();
    let run = tiny_run(folder.path(), "run", &["--variant", "end-to-end"]);
    let metrics = read_json(&run.join("metrics.json"));
    assert_eq!(metrics["rows"].as_array().unwrap().len(), 1);
    let two = ["design", "tiny.toml", "--variant", "end-to-end", "--variant", "nominal", "--out", "two"];
    run_ok(folder.path(), &two);
    let rows = read_json(&folder.path().join("two/metrics.json"))["rows"].clone();
    let names: Vec<&str> =
        rows.as_array().unwrap().iter().map(|row| row["camera"].as_str().unwrap()).collect();
    assert_eq!(names, ["nominal", "end-to-end"], "in the order of the experiment");
    assert_eq!(rows[1], metrics["rows"][0], "a camera is the same whatever is made beside it");
    for names in [&["--variant", "best"][..], &["--variant", "nominal", "--variant", "best"]] {
        run_fails(
            folder.path(),
            &[&["design", "tiny.toml"][..], names].concat(),
            2,
            &["--variant best", "nominal, spot-optimised, end-to-end"],
        );
    }
}
