//! Units of work: one command, given again and again, whatever happens to its processes.

#![cfg(unix)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::*;
use serde_json::{Value, json};

/// A unit as a line of a file.
fn line(name: &str, job: &str, request: Value) -> String {
    json!({"name": name, "call": {"format": 1, "job": job, "request": request}}).to_string()
}

/// Writes a file of units.
fn write_units(folder: &Path, lines: &[String]) {
    std::fs::write(folder.join("units.jsonl"), lines.join("\n")).unwrap();
}

fn ray(name: &str, field_deg: f64) -> String {
    let request =
        json!({"lens": "cooke-triplet-nominal", "field": field_deg, "wavelength": 0.55, "pupil": [0, 1]});
    line(name, "lens-trace", request)
}

/// Starts `petzval unit run` on `units.jsonl`. On a busy machine a unit is killed more than five times before its first checkpoint, which is a failure
/// but for `--retry`.
fn worker(folder: &Path, store: &str) -> Child {
    let mut command = petzval(folder);
    command.args(["unit", "run", "units.jsonl", "--retry", "--store", store]);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// The folders of the units of a store.
fn folders(store: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(store).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.is_dir()).collect()
}

/// The results of a store with the names of their units, without what they cost.
fn results(store: &Path) -> Vec<(String, Value)> {
    let result = |folder: PathBuf| {
        let path = folder.join("result.json");
        let result = path.exists().then(|| read_json(&path))?;
        Some((result["unit"]["name"].as_str().unwrap().to_owned(), result["response"].clone()))
    };
    let mut all: Vec<_> = folders(store).into_iter().filter_map(result).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

#[test]
fn units_are_run_once_by_name_by_shard_and_again_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().join("in");
    std::fs::create_dir(&here).unwrap();
    // Paths are those of the folder of the file.
    std::fs::copy(data("lenses/cooke-triplet-nominal.toml"), here.join("own.toml")).unwrap();
    std::fs::write(here.join("bad.toml"), "name = \"x\"\n").unwrap();
    let convert = json!({"from": "own.toml", "to": "there/own.zmx"});
    let units = [
        ray("a", 0.0),
        ray("b", 5.0),
        line("convert", "lens-convert", convert),
        line("bad", "lens-show", json!({"lens": "bad.toml"})),
        ray("c", 10.0),
    ];
    write_units(&here, &units);
    let run_units = |more: &[&str], variables: &[(&str, &str)]| {
        let mut command = petzval(folder.path());
        command.args(["unit", "run", "in/units.jsonl", "--store", "store"]).args(more);
        for name in ["SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN", "HQ_TASK_ID"] {
            command.env_remove(name);
        }
        outcome(command.envs(variables.iter().copied()).output().unwrap())
    };
    // Nothing is run, and every unit is checked.
    let listed = run_ok(folder.path(), &["unit", "list", "in/units.jsonl", "--json"]).json();
    assert_eq!(listed.as_array().unwrap().len(), 5);
    assert!(listed[2]["inputs"][0]["path"].as_str().unwrap().ends_with("in/own.toml"), "{listed}");

    let only = run_units(&["--name", "b"], &[]);
    assert_eq!((only.code, only.stdout.as_str()), (Some(0), "1 unit: 1 done, 0 done before\n"));
    let shard = run_units(&["--shard", "1/3"], &[]);
    assert_eq!(shard.stdout, "2 units: 1 done, 1 done before\n", "{shard:?}");
    let array =
        [("SLURM_ARRAY_TASK_ID", "4"), ("SLURM_ARRAY_TASK_COUNT", "3"), ("SLURM_ARRAY_TASK_MIN", "2")];
    let slurm = run_units(&[], &array);
    assert!(
        slurm.says("shard 2/3 by SLURM_ARRAY_TASK_ID: 1 unit of 5") && slurm.code == Some(0),
        "{slurm:?}"
    );
    let queue = run_units(&[], &[("HQ_TASK_ID", "0")]);
    assert!(queue.says("shard 0/5 by HQ_TASK_ID: 1 unit of 5"), "{queue:?}");
    // The number of a task without that of all tasks may have come from elsewhere.
    let all = run_units(&[], &[("SLURM_ARRAY_TASK_ID", "3")]);
    assert!(all.says("SLURM_ARRAY_TASK_ID=3 without SLURM_ARRAY_TASK_COUNT: every unit is run"), "{all:?}");
    assert_eq!(all.code, Some(1), "{all:?}");
    assert!(all.stdout.starts_with("5 units: 0 done, 4 done before, 1 failed\n"), "{all:?}");
    let why = "bad: bad.toml:1:1: `units`: the key `units` is missing";
    assert!(all.stdout.contains(why) && all.stdout.contains("--retry --name bad"), "{all:?}");
    let again = run_units(&["--retry", "--name", "bad", "--json"], &[]);
    assert_eq!((again.code, &again.json()["failed"][0]["attempt"]), (Some(1), &json!(2)));

    let found = results(&folder.path().join("store"));
    assert_eq!(found.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["a", "b", "c", "convert"]);
    assert_eq!(found[3].1["to"], "files/own.zmx");
    let zmx = folders(&folder.path().join("store")).into_iter().filter(|f| f.join("files/own.zmx").is_file());
    assert!(zmx.count() == 1 && !here.join("there").exists());
    let status = run_ok(folder.path(), &["unit", "status", "store"]);
    assert!(status.stdout.ends_with("4 done, 1 failed\n"), "{status:?}");
    let runs = run_ok(folder.path(), &["runs", "."]);
    for listed in [&status, &runs] {
        assert!(listed.stdout.contains("bad.toml:1:1: `units`: the key"), "{listed:?}");
    }
    if cfg!(target_arch = "x86_64") {
        // The program starts again with the instruction set of the units.
        let status = run_ok(folder.path(), &["unit", "status", "store", "--json"]).json();
        assert!(status.as_array().unwrap().iter().all(|row| row["cost"]["simd"] == "avx2"), "{status}");
    }
}

#[test]
fn what_cannot_be_run_is_named_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |lines: &[String], more: &[&str], needles: &[&str]| {
        write_units(folder.path(), lines);
        let args = [&["unit", "run", "units.jsonl", "--store", "store"], more].concat();
        run_fails(folder.path(), &args, 2, needles);
    };
    let wrong = line("w", "lens-show", json!({"lenz": 1}));
    refused(&[ray("a", 0.0), wrong], &["--no-wait"], &["units.jsonl:2", "unit \"w\"", "lenz"]);
    refused(&[ray("a", 0.0), ray("a", 1.0)], &[], &["units.jsonl:2", "`name`", "line 1"]);
    refused(&[ray("a", 0.0)], &["--name", "b"], &["--name b", "no unit of this name"]);
    refused(&[ray("a", 0.0)], &["--shard", "2/2"], &["0/4 to 3/4"]);
    let versioned = ray("a", 0.0).replacen('{', "{\"version\": \"0.0.1\", ", 1);
    // The list of units refuses what no machine can run, too.
    let refused_by_both = |lines: &[String], needles: &[&str]| {
        refused(lines, &[], needles);
        run_fails(folder.path(), &["unit", "list", "units.jsonl"], 2, needles);
    };
    refused_by_both(&[versioned], &["units.jsonl:1", "`version` is 0.0.1"]);
    let unknown = ray("a", 0.0).replacen('{', "{\"simd\": \"sse9\", ", 1);
    refused_by_both(&[unknown], &["units.jsonl:1", "`simd` is sse9", "avx2, avx512, neon or scalar"]);
    let foreign = if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" };
    let other = ray("a", 0.0).replacen('{', &format!("{{\"simd\": \"{foreign}\", "), 1);
    refused(&[other], &[], &[foreign, "the widest of this machine"]);
    run_ok(folder.path(), &["unit", "list", "units.jsonl"]);
}

/// A design and an optimisation that are killed as by a power cut, and stopped by signals, end with the bits of an uninterrupted run.
#[test]
fn killed_and_stopped_units_go_on_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let design = json!({"run": {"new": {"experiment": "tiny.toml"}}});
    let search = json!({"start": {"new": {"lens": "cooke-triplet-nominal", "out": "", "global": true,
        "goal": {"wavelengths": [0.5876]}}}, "rounds": 2});
    write_units(folder.path(), &[line("design", "design", design), line("search", "lens-optimize", search)]);
    let units = ["unit", "run", "units.jsonl", "--store"];
    run_ok(folder.path(), &[&units[..], &["whole"]].concat());
    let store = folder.path().join("store");
    let (mut killed, mut stopped) = (0, 0);
    for round in 0.. {
        let mut child = worker(folder.path(), "store");
        std::thread::sleep(Duration::from_millis(250 + 83 * (round % 7)));
        if round % 2 == 0 {
            child.kill().unwrap();
        } else {
            let signal = ["TERM", "USR1", "USR2", "INT", "HUP"][round as usize / 2 % 5];
            assert!(Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().is_ok());
        }
        match child.wait().unwrap().code() {
            None => killed += 1,
            Some(75) => stopped += 1,
            Some(0) => break,
            other => panic!("round {round}: {other:?}"),
        }
        assert!(round < 200, "the units do not end");
        if killed > 4 && stopped > 3 {
            run_ok(folder.path(), &[&units[..], &["store", "--retry"]].concat());
            break;
        }
    }
    assert!(killed > 0 && stopped > 0, "{killed} killed, {stopped} stopped");
    assert_eq!(timeless(results(&store)), timeless(results(&folder.path().join("whole"))));
    let files = |store: &Path, name: &str| {
        let mut all =
            folders(store).into_iter().filter_map(|f| std::fs::read(f.join("files").join(name)).ok());
        let (one, none) = (all.next(), all.next());
        assert!(one.is_some() && none.is_none(), "{name}");
        one
    };
    for name in ["metrics.json", "best.toml"] {
        assert_eq!(files(&store, name), files(&folder.path().join("whole"), name), "{name}");
    }
}

/// Results without measured times.
fn timeless(results: Vec<(String, Value)>) -> Vec<(String, Value)> {
    fn without(value: Value) -> Value {
        match value {
            Value::Object(keys) => keys
                .into_iter()
                .filter(|(key, _)| !["seconds", "hours", "peak_memory_mb"].contains(&key.as_str()))
                .map(|(key, value)| (key, without(value)))
                .collect(),
            Value::Array(items) => items.into_iter().map(without).collect(),
            other => other,
        }
    }
    results.into_iter().map(|(name, value)| (name, without(value))).collect()
}

/// Eight worker processes on one store, one of which is killed each second.
#[test]
#[ignore = "a minute of work: `cargo xtask full` runs it"]
fn eight_workers_of_which_one_is_killed_each_second_do_every_unit_once() {
    let folder = tempfile::tempdir().unwrap();
    let search = |seed: u64| {
        let request = json!({"start": {"new": {"lens": "cooke-triplet-nominal", "out": "", "global": true, "seed": seed,
            "goal": {"wavelengths": [0.5876]}}}, "rounds": 2});
        line(&format!("search {seed}"), "lens-optimize", request)
    };
    let units: Vec<String> = (1..=12).map(search).collect();
    write_units(folder.path(), &units);
    let mut workers: Vec<Child> = (0..8).map(|_| worker(folder.path(), "store")).collect();
    let (began, mut kills) = (Instant::now(), 0);
    while workers.iter_mut().any(|worker| worker.try_wait().unwrap().is_none()) {
        assert!(began.elapsed() < Duration::from_secs(900), "the units do not end");
        std::thread::sleep(Duration::from_secs(1));
        let which = kills % workers.len();
        if kills < 60 && workers[which].try_wait().unwrap().is_none() {
            workers[which].kill().unwrap();
            workers[which].wait().unwrap();
            workers[which] = worker(folder.path(), "store");
        }
        kills += 1;
    }
    assert!(workers.iter_mut().all(|worker| worker.wait().unwrap().code() == Some(0)));
    let found = results(&folder.path().join("store"));
    assert_eq!(found.iter().map(|(name, _)| name).collect::<BTreeSet<_>>().len(), 12);
    // Each is what it is without anyone killed.
    write_units(folder.path(), &units[..2]);
    run_ok(folder.path(), &["unit", "run", "units.jsonl", "--store", "whole"]);
    for one in timeless(results(&folder.path().join("whole"))) {
        assert!(timeless(found.clone()).contains(&one), "{}", one.0);
    }
}

#[test]
fn parts_of_a_tolerance_analysis_become_the_analysis_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let part = |from: usize, to: usize| {
        let request = json!({"lens": "cooke-triplet-nominal", "trials": 60, "seed": 3, "limit": 13.4,
            "part": {"from": from, "to": to}});
        line(&format!("{from}"), "lens-tolerance", request)
    };
    write_units(folder.path(), &[part(40, 60), part(0, 25), part(25, 40)]);
    let gather = ["unit", "gather", "units.jsonl", "--store", "store", "--out", "joined", "--json"];
    run_ok(folder.path(), &["unit", "run", "units.jsonl", "--store", "store", "--name", "25"]);
    let early = run(folder.path(), &gather);
    assert!(early.code == Some(2) && early.says("unit \"40\" has no result yet"), "{early:?}");
    run_ok(folder.path(), &["unit", "run", "units.jsonl", "--store", "store"]);
    let joined = run_ok(folder.path(), &gather).json();
    let whole =
        ["lens", "tolerance", "cooke-triplet-nominal", "--trials", "60", "--seed", "3", "--limit", "13.4"];
    // On the instruction set of the units.
    let mut command = petzval(folder.path());
    command.args([&whole[..], &["--out", "whole", "--json"]].concat());
    if cfg!(target_arch = "x86_64") {
        command.env("PETZVAL_SIMD", "avx2");
    }
    let whole = outcome(command.output().unwrap()).json();
    assert_eq!(joined[0]["report"], whole);
    assert_eq!(joined[0]["units"].as_array().unwrap().len(), 3);
    assert_same(&folder.path().join("joined"), &folder.path().join("whole"));
    // What is there stays, unless it may be overwritten.
    let page = folder.path().join("joined/tolerance.html");
    std::fs::write(&page, "mine").unwrap();
    run_fails(folder.path(), &gather, 2, &["tolerance.html: exists already", "--force"]);
    assert_eq!(std::fs::read(&page).unwrap(), b"mine");
    run_ok(folder.path(), &[&gather[..], &["--force"]].concat());
    assert_same(&folder.path().join("joined"), &folder.path().join("whole"));
    // One part alone, on the command line, has the numbers of its lenses and no sensitivities.
    let alone = run_ok(
        folder.path(),
        &["lens", "tolerance", "cooke-triplet-nominal", "--trials", "25..40", "--seed", "3", "--json"],
    );
    let alone = alone.json();
    assert_eq!(alone["made"]["part"], json!({"from": 25, "to": 40}));
    assert_eq!(alone["report"]["sensitivities"], json!([]));
    for (trials, needle) in [("5..5", "`5..5` holds no lens"), ("a..5", "give N or A..B")] {
        run_fails(
            folder.path(),
            &["lens", "tolerance", "cooke-triplet-nominal", "--trials", trials],
            2,
            &[needle],
        );
    }
}

/// Two folders hold the same files.
fn assert_same(one: &Path, other: &Path) {
    let below = |root: &Path| {
        let named = |(path, bytes): (PathBuf, Vec<u8>)| (path.strip_prefix(root).unwrap().to_owned(), bytes);
        snapshot(root).into_iter().map(named).collect::<Vec<_>>()
    };
    let (one, other) = (below(one), below(other));
    let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&one), names(&other));
    for ((name, a), (_, b)) in one.iter().zip(&other) {
        assert!(a == b, "{} differs", name.display());
    }
}
