//! Keys: what belongs to them, and that they stay what they are.

use std::collections::BTreeMap;
use std::path::Path;

use petzval_jobs::{Call, JobError, row};
use petzval_units::unit::{Digests, PROGRAM, Prepared, Unit, UnitFile};
use serde_json::{Value, json};

use crate::{context, prepared, trivial};

/// Units whose keys are stored.
fn stored() -> Vec<Unit> {
    let mut units = vec![
        Unit::new("list", Call::new("lens-list", json!({}))),
        Unit::new("show", Call::new("lens-show", json!({"lens": "cooke-triplet-nominal"}))),
        Unit::new(
            "tolerance",
            Call::new("lens-tolerance", json!({"lens": "cooke-triplet-nominal", "trials": 10})),
        ),
        Unit::new(
            "search",
            Call::new(
                "lens-optimize",
                json!({"start": {"new": {"lens": "cooke-triplet-spot", "out": "x", "global": true}}}),
            ),
        ),
    ];
    units[2].seed = Some(5);
    units[3].seed = Some(2);
    for unit in &mut units {
        // The version of the program is a part of keys; those of the list are of this one.
        unit.version = "0.1.0".to_owned();
    }
    units
}

/// A key changes where a default of its job changes: then results do as well, and the list is written anew with `PETZVAL_STORE_KEYS=1`.
#[test]
fn keys_are_those_that_are_stored() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/store/keys.json");
    let keys: BTreeMap<String, String> =
        stored().iter().map(|unit| (unit.name.clone(), prepared(unit).key.to_string())).collect();
    if std::env::var_os("PETZVAL_STORE_KEYS").is_some() {
        std::fs::write(&path, serde_json::to_string_pretty(&keys).unwrap() + "\n").unwrap();
    }
    let known: BTreeMap<String, String> =
        serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(keys, known);
}

#[test]
fn a_key_has_what_decides_the_result_and_nothing_else() {
    let bare = trivial("a", 1.0);
    let key = |unit: &Unit| prepared(unit).key;
    let with = |change: &dyn Fn(&mut Unit)| {
        let mut unit = bare.clone();
        change(&mut unit);
        key(&unit)
    };
    for same in [
        with(&|unit| unit.name = "b".to_owned()),
        with(&|unit| unit.call.threads = 3),
        with(&|unit| unit.call.overwrite = true),
        // A default that is written out.
        with(&|unit| {
            unit.call.request["field"] = json!(1);
        }),
    ] {
        assert_eq!(same, key(&bare));
    }
    let mut others = vec![
        key(&bare),
        with(&|unit| unit.call.request["field"] = json!(2.0)),
        with(&|unit| unit.simd = "scalar".to_owned()),
        with(&|unit| unit.version = "0.0.1".to_owned()),
    ];
    others.sort();
    others.dedup();
    assert_eq!(others.len(), 4);
    // A seed is that of the request, wherever it is written.
    let tolerance = |seed: Option<u64>, own: u64| Unit {
        seed,
        ..Unit::new("t", Call::new("lens-tolerance", json!({"lens": "cooke-triplet-nominal", "seed": own})))
    };
    assert_eq!(key(&tolerance(Some(7), 1)), key(&tolerance(None, 7)));
    assert_ne!(key(&tolerance(Some(7), 1)), key(&tolerance(None, 1)));
    // The folder of results is one of the store.
    let out = |out: &str| {
        let request = json!({"lens": "cooke-triplet-nominal", "out": out});
        key(&Unit::new("p", Call::new("psf", request)))
    };
    assert_eq!(out("a"), out("b/c"));
    let without = Call::new("psf", json!({"lens": "cooke-triplet-nominal"}));
    assert_eq!(out("a"), key(&Unit::new("p", without)));
}

#[test]
fn inputs_count_by_content() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let lens = std::fs::read(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/lenses/cooke-triplet-nominal.toml"),
    );
    let lens = lens.unwrap();
    std::fs::write(at("a.toml"), &lens).unwrap();
    std::fs::write(at("b.toml"), &lens).unwrap();
    std::fs::write(at("c.toml"), [&lens[..], b"\n# another\n"].concat()).unwrap();
    let shown = |name: &str| {
        prepared(&Unit::new("s", Call::new("lens-show", json!({"lens": at(name).to_str().unwrap()}))))
    };
    let (a, b, c) = (shown("a.toml"), shown("b.toml"), shown("c.toml"));
    assert_eq!(a.key, b.key);
    assert_ne!(a.key, c.key);
    assert_eq!((a.inputs.len(), a.inputs[0].path.clone()), (1, at("a.toml")));
    // The lens that an experiment names counts as well.
    let experiment = "lens = \"a.toml\"\n";
    std::fs::write(at("e.toml"), experiment).unwrap();
    let designed = || {
        let request = json!({"run": {"new": {"experiment": at("e.toml").to_str().unwrap()}}});
        prepared(&Unit::new("d", Call::new("design", request)))
    };
    let before = designed();
    assert_eq!(before.inputs.len(), 2, "{:?}", before.inputs);
    // So it is where the experiment stands in the request, in whatever folder its files lie.
    let inline = |folder: &str| {
        let toml = format!("name = \"a.toml\"\nlens = {:?}\n", at(folder).join("a.toml"));
        let request = json!({"run": {"new": {"experiment": {"toml": toml}}}});
        prepared(&Unit::new("d", Call::new("design", request))).key
    };
    std::fs::create_dir(at("moved")).unwrap();
    std::fs::copy(at("a.toml"), at("moved/a.toml")).unwrap();
    let unmoved = inline("");
    assert_eq!(unmoved, inline("moved"));
    std::fs::copy(at("c.toml"), at("a.toml")).unwrap();
    assert_ne!(designed().key, before.key);
    assert_ne!(inline(""), unmoved);
}

#[test]
fn a_unit_whose_inputs_have_changed_since_its_file_was_made_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let lens = folder.path().join("lens.toml");
    std::fs::write(&lens, "name = \"a\"\n").unwrap();
    let bare = Unit::new("u 1", Call::new("lens-show", json!({"lens": lens.to_str().unwrap()})));
    let before = prepared(&bare).key;
    let kept = Unit { key: Some(before.clone()), ..bare.clone() };
    // The key is no part of itself, and comes back from a file.
    assert_eq!(prepared(&kept).key, before);
    let file = UnitFile { units: vec![kept.clone()] };
    assert_eq!(UnitFile::parse(&file.text().unwrap()).unwrap(), file);
    std::fs::write(&lens, "name = \"b\"\n").unwrap();
    assert_ne!(prepared(&bare).key, before);
    let report = Prepared::new(&kept, &context(), &Digests::default()).unwrap_err().report();
    assert!(report.message.starts_with("unit \"u 1\": its request or its inputs have changed"), "{report:?}");
    assert!(report.message.contains("lens.toml") && report.hint.contains("petzval sweep FILE"), "{report:?}");
}

#[test]
fn a_unit_that_cannot_be_run_is_refused_with_its_name_and_key() {
    let refused = |unit: &Unit| {
        let error = Prepared::new(unit, &context(), &Digests::default()).unwrap_err().report();
        format!("{} | {}", error.message, error.hint)
    };
    let of = |job: &str, request| Unit::new("u 1", Call::new(job, request));
    for (unit, says) in [
        (
            of("lens-shw", json!({})),
            "unit \"u 1\": call: there is no job `lens-shw` | did you mean `lens-show`?",
        ),
        (of("lens-show", json!({"lens": "a", "lenz": 1})), "unit \"u 1\": request of lens-show: `lenz`"),
        (
            of("lens-show", json!({"lens": "a", "entirely_other": 1})),
            "; `petzval schema job lens-show` prints what a request may hold",
        ),
        (Unit { seed: Some(1), ..of("lens-list", json!({})) }, "draws nothing at random"),
        (
            of("lens-tolerance", json!({"lens": "cooke-triplet-nominal", "trials": 5_000_000})),
            "unit \"u 1\": request of lens-tolerance: `trials = 5000000`: must lie between ",
        ),
        (
            of("lens-trace", json!({"lens": "a", "field": 1, "wavelength": 550, "pupil": [0, 1]})),
            "did you mean 0.55?",
        ),
        (
            Unit {
                call: Call { format: 2, ..Call::new("lens-list", json!({})) },
                ..of("lens-list", json!({}))
            },
            "unit \"u 1\": `call.format` is 2, which is not known | this program reads and writes format 1",
        ),
    ] {
        let text = refused(&unit);
        assert!(text.contains(says), "{text}");
    }
    let mut other = of("lens-list", json!({}));
    other.version = "0.0.1".to_owned();
    let text = other.check_version().unwrap_err().to_string();
    assert!(text.contains("0.0.1") && text.contains(PROGRAM), "{text}");
    other.simd = "sse9".to_owned();
    assert!(other.check_level().unwrap_err().to_string().contains("sse9"));
    other.simd = if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" }.to_owned();
    let report = other.check_level().unwrap_err().report();
    assert!(report.message.contains("computes with") && report.hint.contains("PETZVAL_SIMD="), "{report:?}");
}

#[test]
fn a_file_of_units_names_the_line_and_the_key_that_is_wrong() {
    let line = r#"{"name": "a", "call": {"format": 1, "job": "lens-list"}}"#;
    let file = UnitFile::parse(&format!("{line}\n\n{}\n", line.replace("\"a\"", "\"b\""))).unwrap();
    assert_eq!(file.units.iter().map(|unit| unit.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(UnitFile::parse(&file.text().unwrap()).unwrap(), file);
    assert_eq!(UnitFile::parse(&format!("\u{feff}{}", file.text().unwrap())).unwrap(), file);
    for (second, says) in [
        (line.to_owned(), "\"a\" is the name of the unit in line 1 as well"),
        (line.replace("\"job\"", "\"jobs\""), "`call.jobs`: no such key here"),
        (line.replace("\"a\"", "\"\""), "a name has 1 to"),
        (line.replace("}}", ", \"request\": {\"x\": 1, \"x\": 2}}}"), "duplicate key `x`"),
        (line.replace("}}", "}"), "EOF"),
        (format!("{line} {line}"), "trailing"),
    ] {
        let error = UnitFile::parse(&format!("{line}\n{second}\n")).unwrap_err();
        assert_eq!(error.line, Some(2));
        assert!(error.to_string().contains(says), "{error}");
    }
    assert!(UnitFile::parse("\n").unwrap_err().hint.unwrap().starts_with("a unit is {"));
    // So does a unit that cannot be run.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("units.jsonl");
    let wrong = line.replace("\"a\"", "\"b\"").replace("lens-list", "lens-show");
    std::fs::write(&path, format!("{line}\n\n{wrong}\n")).unwrap();
    let mut unit = UnitFile::read(&path).unwrap().units.remove(1);
    let place = |error: JobError| {
        let report = error.report();
        let place = report.place.unwrap();
        assert!(report.message.starts_with("unit \"b\": ") && !report.hint.is_empty(), "{}", report.message);
        (place.path, place.line)
    };
    let error = Prepared::new(&unit, &context(), &Digests::default()).unwrap_err();
    assert_eq!(place(error), (Some(path.clone()), Some(3)));
    unit.version = "0.0.1".to_owned();
    unit.simd = "sse9".to_owned();
    assert_eq!(place(unit.check_version().unwrap_err()), (Some(path.clone()), Some(3)));
    assert_eq!(place(unit.check_level().unwrap_err()), (Some(path), Some(3)));
    let missing = file.named(Path::new("units.jsonl"), &["aa".to_owned()]).unwrap_err();
    assert!(missing.to_string().contains("units.jsonl has no unit of this name"), "{missing}");
}

/// The places of a value whose key is one of these, with the texts there.
fn texts(of: &Value, keys: &[&str], found: &mut Vec<String>) {
    match of {
        Value::Object(all) => all.iter().for_each(|(key, value)| match value {
            Value::String(text) if keys.contains(&key.as_str()) => found.push(text.clone()),
            other => texts(other, keys, found),
        }),
        Value::Array(all) => all.iter().for_each(|value| texts(value, keys, found)),
        _ => {}
    }
}

#[test]
fn every_job_writes_where_its_unit_says_and_takes_a_seed_if_it_has_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-jobs/tests/calls.json");
    let calls: Vec<Call> = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let (mut placed, mut seeded, mut left_out) = (0, 0, 0);
    for call in calls {
        let row = row(&call.job).unwrap();
        let request = row.filled_in(call.request.clone()).unwrap();
        let mut before = Vec::new();
        texts(&request, &["out", "to", "output", "csv"], &mut before);
        let kept = row.kept_in(request.clone(), Path::new("/store/work")).unwrap();
        let mut after = Vec::new();
        texts(&kept, &["out", "to", "output", "csv"], &mut after);
        // The camera of a test chart is a request in the request, whose own folder is not used.
        after.retain(|text| text != ".");
        assert!(after.iter().all(|text| text.starts_with("/store/work")), "{}: {kept}", call.job);
        placed += usize::from(!after.is_empty() && before != after);
        // A unit may leave out a folder that a call must name.
        let mut without = call.request.clone();
        leave_out(&mut without);
        if row.filled_in(without.clone()).is_err() {
            let bare = row.filled_in_as_unit(without).unwrap_or_else(|e| panic!("{}: {e}", call.job));
            assert_eq!(row.kept_in(bare, Path::new("/store/work")).unwrap(), kept, "{}", call.job);
            left_out += 1;
        }
        if let Some(with_seed) = row.seeded(request.clone(), 987_654).unwrap() {
            let is_new = with_seed.to_string().contains("987654");
            let goes_on = ["resume", "made\":null"].iter().any(|part| request.to_string().contains(part));
            assert!(is_new || goes_on, "{}: {with_seed}", call.job);
            seeded += usize::from(is_new);
        }
    }
    assert_eq!((placed, seeded), (19, 11), "calls that write, and calls that draw at random");
    assert_eq!(left_out, 9, "calls that must name a folder");
}

/// Takes every key `out` out of a request.
fn leave_out(of: &mut Value) {
    if let Some(keys) = of.as_object_mut() {
        keys.remove("out");
        keys.values_mut().for_each(leave_out);
    }
}
