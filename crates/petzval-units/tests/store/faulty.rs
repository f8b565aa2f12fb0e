//! A disk that is full, that has become read-only, or whose replies are lost, from any operation on.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use petzval_base::Cancel;
use petzval_jobs::JobError;
use petzval_units::store::{
    Attempt, Begun, Clock, Disk, FileLayer, Holder, Outcome, RunOptions, STALE_AFTER, Seen, Store,
    StoreError, UnitState, may_pass, run_all, run_unit,
};
use petzval_units::unit::{Prepared, Unit};
use serde_json::json;

use crate::layers::{Digesting, Fault, Faulty, Simulated};
use crate::{context, prepared, trivial, unit};

/// Another process each time, of whose end nobody knows.
fn holder(pid: u32) -> Holder {
    Holder { host: "node".to_owned(), pid, process_start: 0, system: String::new() }
}

/// Runs a unit to its end. Returns the number of the attempt whose result counts.
fn run(store: &Store, unit: &Prepared, pid: u32, seen: &mut Seen) -> Result<Option<u32>, StoreError> {
    let mut attempt: Box<Attempt> = match store.begin(unit, &holder(pid), false, seen, &Cancel::default())? {
        Begun::Mine(attempt) => attempt,
        Begun::Done(result) => return Ok(Some(result.attempt)),
        Begun::Elsewhere(_) | Begun::Failed(_) | Begun::Damaged(_) | Begun::Cancelled => return Ok(None),
    };
    if let Some((earlier, has_ended)) = attempt.earlier()?.first() {
        attempt.take_over(earlier, *has_ended)?;
    }
    // The job writes its files past the layer.
    std::fs::create_dir_all(attempt.folder()).unwrap();
    std::fs::write(attempt.folder().join("out.txt"), "done").unwrap();
    attempt.renew()?;
    attempt.keep_contents()?;
    attempt.finish(json!({"value": 7})).map(|result| Some(result.attempt))
}

#[test]
fn no_unit_is_lost_or_counted_twice_where_any_operation_fails() {
    let unit = prepared(&trivial("unit", 1.0));
    for fault in [Fault::Full, Fault::ReadOnly, Fault::ReplyLost] {
        let mut failures = 0;
        for after in 0.. {
            let folder = tempfile::tempdir().unwrap();
            let root = folder.path().join("store");
            let clock = Arc::new(Simulated::default());
            let layer = Arc::new(Faulty { fault, after, changes: AtomicUsize::new(0) });
            let first = Store::on(&root, layer.clone(), clock.clone())
                .and_then(|store| run(&store, &unit, 1, &mut Seen::default()));
            let has_failed = layer.changes.load(Ordering::Relaxed) > after;
            if let Err(error) = &first {
                failures += 1;
                names_the_fault(fault, error);
            }
            // The disk works again, and another process comes: at once, and once the claim that could not be ended is stale.
            let store = Store::on(&root, Arc::new(Disk), clock.clone()).unwrap();
            let mut seen = Seen::default();
            let mut second = run(&store, &unit, 2, &mut seen).unwrap();
            if second.is_none() {
                clock.wait(STALE_AFTER);
                second = run(&store, &unit, 2, &mut seen).unwrap();
            }
            let result = store.result(&unit.key).unwrap().unwrap();
            assert_eq!(second, Some(result.attempt), "{fault:?} after {after}");
            assert_eq!(result.response, json!({"value": 7}));
            if let Ok(Some(counted)) = first {
                assert_eq!(
                    counted, result.attempt,
                    "{fault:?} after {after}: a result that was reported counts"
                );
            }
            let files = store.files(&result).unwrap();
            assert_eq!(std::fs::read_to_string(files.join("out.txt")).unwrap(), "done");
            if !has_failed {
                break;
            }
        }
        assert!(failures >= 6, "{fault:?}: only {failures} operations failed");
    }
}

/// The error names the disk; one of a full or read-only disk says what to do.
fn names_the_fault(fault: Fault, error: &StoreError) {
    let (number, hint) = match fault {
        Fault::Full => (28, "make room and run the same command again"),
        Fault::ReadOnly => (30, "a store that this process may write to"),
        Fault::ReplyLost => (5, "run the same command again"),
    };
    let text = error.to_string();
    assert!(text.contains(&format!("os error {number}")) && text.contains("store"), "{text}");
    let job = match error {
        StoreError::Io { path, source } => JobError::from(StoreError::Io {
            path: path.clone(),
            source: std::io::Error::from_raw_os_error(source.raw_os_error().unwrap()),
        }),
        StoreError::Wrong { .. } => panic!("{text}"),
    };
    assert_eq!(may_pass(&job), !matches!(fault, Fault::ReadOnly), "{job}");
    let report = job.report();
    assert!(report.message.contains(hint) || report.hint.contains(hint), "{report:?}");
}

#[test]
fn a_folder_that_is_no_store_and_a_store_of_another_version_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = |name: &str| folder.path().join(name);
    let refused = |root: &Path| {
        let error = JobError::from(Store::open_or_new(root).err().unwrap()).report();
        format!("{} | {}", error.message, error.hint)
    };
    std::fs::create_dir(here("photos")).unwrap();
    std::fs::write(here("photos/a.png"), "x").unwrap();
    assert!(refused(&here("photos")).contains("something else than a store"));
    assert!(!here("photos/store.json").exists());
    let text = Store::open(&here("none")).err().unwrap().to_string();
    assert!(text.contains("no store.json") && !here("none").exists(), "{text}");
    Store::open_or_new(&here("store")).unwrap();
    Store::open(&here("store")).unwrap();
    std::fs::write(here("store/store.json"), r#"{"format": 1, "program": "0.0.9"}"#).unwrap();
    let text = refused(&here("store"));
    assert!(text.contains("Petzval 0.0.9, format 1") && text.contains("another store"), "{text}");
    std::fs::write(here("store/store.json"), r#"{"format": 2, "program": "9.0.0"}"#).unwrap();
    assert!(refused(&here("store")).contains("format 2"));
    std::fs::write(here("store/store.json"), "{").unwrap();
    let text = refused(&here("store"));
    assert!(text.contains("store.json") && text.contains("changed since it was written"), "{text}");
    // The hint says what to write: without the file, the folder would not be taken for a store.
    let (_, rest) = text.split_once("write {").unwrap();
    let (record, _) = rest.split_once('}').unwrap();
    std::fs::write(here("store/store.json"), format!("{{{record}}}")).unwrap();
    Store::open(&here("store")).unwrap();
}

#[test]
fn a_damaged_result_and_that_of_another_unit_are_refused_until_they_are_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open_or_new(&folder.path().join("store")).unwrap();
    let options = RunOptions { retries: false, leaves_others: false };
    let run = |unit: &Unit| run_unit(unit, &store, &context(), options);
    let (one, other) = (trivial("one", 1.0), trivial("other", 2.0));
    let Outcome::Done(first) = run(&one).unwrap() else { panic!() };
    let Outcome::Done(second) = run(&other).unwrap() else { panic!() };
    let place = store.folder(&first.key).join("result.json");
    let of_other = std::fs::read_to_string(store.folder(&second.key).join("result.json")).unwrap();
    let own = std::fs::read_to_string(&place).unwrap();
    // Another digit of the response: still a result by its form.
    let response = own.find("\"response\"").unwrap();
    let digit = response + own[response..].find(|c: char| c.is_ascii_digit()).unwrap();
    let other_digit = if &own[digit..=digit] == "1" { "2" } else { "1" };
    let edited = format!("{}{other_digit}{}", &own[..digit], &own[digit + 1..]);
    for (text, says) in [
        (of_other.as_str(), "the result of another unit, \"other\""),
        (edited.as_str(), "not what the unit wrote"),
        ("{", "EOF"),
    ] {
        std::fs::write(&place, text).unwrap();
        let Outcome::Damaged(error) = run(&one).unwrap() else { panic!() };
        assert!(error.message.contains(says), "{error:?}");
        assert!(
            error.message.contains("result.json")
                && error.hint.contains("--retry, which sets its folder aside"),
            "{error:?}"
        );
    }
    // One of an earlier build has no digest, and is read as it is.
    let mut earlier: serde_json::Value = serde_json::from_str(&edited).unwrap();
    assert!(earlier.as_object_mut().unwrap().remove("sha256").is_some());
    std::fs::write(&place, earlier.to_string()).unwrap();
    assert!(matches!(run(&one).unwrap(), Outcome::There(_)));
    std::fs::write(&place, "{").unwrap();
    // The others go on.
    let third = trivial("third", 3.0);
    let summary = run_all(&[&one, &third, &other], || Ok(store.clone()), &context(), options).unwrap();
    let names: Vec<&str> = summary.damaged.iter().map(|damaged| damaged.unit.as_str()).collect();
    assert_eq!((summary.done, summary.there, names), (1, 1, vec!["one"]));
    // With leave it is run again, and what was damaged can be looked at.
    let retry = RunOptions { retries: true, leaves_others: false };
    let Outcome::Done(again) = run_unit(&one, &store, &context(), retry).unwrap() else { panic!() };
    assert_eq!((&again.key, &again.response), (&first.key, &first.response));
    let aside = store.root().join(format!(".damaged-{}-1/result.json", first.key.as_str()));
    assert_eq!(std::fs::read_to_string(&aside).unwrap(), "{");
    assert!(matches!(run(&one).unwrap(), Outcome::There(_)));
    // So it is once its folder was taken away.
    std::fs::remove_dir_all(store.folder(&first.key)).unwrap();
    let Outcome::Done(again) = run(&one).unwrap() else { panic!() };
    assert_eq!((again.key, again.response), (first.key, first.response));
    // The place of a store is a folder.
    for path in [&aside, &aside.join("below")] {
        let error = JobError::from(Store::open_or_new(path).err().unwrap());
        assert_eq!(error.fault(), petzval_jobs::Fault::Input);
        assert!(error.to_string().contains("result.json: this is a file"), "{error}");
    }
}

#[test]
fn a_file_of_a_result_that_is_not_what_the_unit_wrote_is_named_until_it_is_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open_or_new(&folder.path().join("store")).unwrap();
    let convert = unit("convert", "lens-convert", json!({"from": "cooke-triplet-nominal", "to": "a.zmx"}));
    let run = |retries: bool| {
        run_unit(&convert, &store, &context(), RunOptions { retries, leaves_others: false }).unwrap()
    };
    let Outcome::Done(first) = run(false) else { panic!() };
    let (files, own) = (store.files(&first).unwrap(), store.folder(&first.key));
    let (file, list) = (files.join("a.zmx"), own.join("contents-0001.json"));
    let whole = std::fs::read(&file).unwrap();
    let json =
        |path: &Path| -> serde_json::Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
    let listed = json(&list)["files"].clone();
    assert_eq!(listed.as_array().unwrap().len(), 1);
    assert_eq!((&listed[0]["path"], &listed[0]["bytes"]), (&json!("a.zmx"), &json!(whole.len())));
    // An earlier build reads the result: it refuses any further field.
    let result = json(&own.join("result.json"));
    let mut fields: Vec<&str> = result.as_object().unwrap().keys().map(String::as_str).collect();
    fields.sort_unstable();
    let known = ["attempt", "cost", "files", "format", "inputs", "key", "response", "sha256", "unit"];
    assert_eq!(fields, known);
    let is_done = || {
        let state = store.state(&first.key, &mut Seen::default()).unwrap();
        assert!(matches!(state, UnitState::Done(_) | UnitState::Damaged(_)), "{state:?}");
        matches!(state, UnitState::Done(_))
    };
    let named = |place: &str, says: &str| {
        let Outcome::Damaged(error) = run(false) else { panic!("{says}") };
        assert!(error.message.contains(&format!("{place}: {says}")), "{error:?}");
        assert!(error.hint.contains("--retry, which sets its folder aside"), "{error:?}");
    };
    // Further files are those of the user.
    std::fs::write(files.join("mine.txt"), "mine").unwrap();
    assert!(is_done() && matches!(run(false), Outcome::There(_)));
    std::fs::write(&file, &whole[1..]).unwrap();
    assert!(!is_done());
    named("a.zmx", &format!("it has {} bytes, and the unit wrote {}", whole.len() - 1, whole.len()));
    // An edit that keeps the size is found only where the file is read.
    let mut edited = whole.clone();
    edited[0] ^= 1;
    std::fs::write(&file, &edited).unwrap();
    assert!(is_done() && matches!(run(false), Outcome::There(_)));
    assert!(matches!(run(true), Outcome::Done(_)));
    let aside = |number: u32| store.root().join(format!(".damaged-{}-{number}", first.key.as_str()));
    assert_eq!(std::fs::read(aside(1).join("files/a.zmx")).unwrap(), edited);
    assert_eq!(std::fs::read(&file).unwrap(), whole);
    // So is the list itself.
    let text = std::fs::read_to_string(&list).unwrap();
    std::fs::write(&list, text.replace("a.zmx", "b.zmx")).unwrap();
    assert!(!is_done());
    named("contents-0001.json", "this is not what the unit wrote");
    std::fs::write(&list, text).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert!(!is_done());
    named("a.zmx", "this file of the result is missing");
    std::fs::write(&file, &whole).unwrap();
    assert!(is_done() && matches!(run(false), Outcome::There(_)));
    std::fs::rename(&files, folder.path().join("away")).unwrap();
    assert!(!is_done());
    named("files", "the folder of the results is missing");
    // With leave it is run again.
    assert!(matches!(run(true), Outcome::Done(_)));
    assert!(list.is_file() && file.is_file() && is_done());
    assert!(aside(2).join("result.json").is_file());
    // One of an earlier build has no list of its files, which are believed.
    std::fs::remove_file(&list).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert!(is_done() && matches!(run(false), Outcome::There(_)));
    assert!(matches!(run(true), Outcome::There(_)));
}

/// Runs a unit to a result with two files. Both are read for their digests.
fn run_with_two_files(store: &Store, unit: &Prepared) {
    let (mut seen, cancel) = (Seen::default(), Cancel::default());
    let Begun::Mine(attempt) = store.begin(unit, &holder(1), false, &mut seen, &cancel).unwrap() else {
        panic!()
    };
    std::fs::create_dir_all(attempt.folder()).unwrap();
    for name in ["a.txt", "b.txt"] {
        std::fs::write(attempt.folder().join(name), name).unwrap();
    }
    attempt.keep_contents().unwrap();
    attempt.finish(json!({"value": 7})).unwrap();
}

#[test]
fn files_of_a_result_are_read_only_to_run_units_again_and_that_can_be_cancelled() {
    let folder = tempfile::tempdir().unwrap();
    let (reads, cancel) = (Arc::new(AtomicUsize::new(0)), Cancel::default());
    let (counted, cancelled) = (reads.clone(), cancel.clone());
    let layer = Digesting(move |path: &Path| {
        // In the middle of the second time that all are compared.
        if counted.fetch_add(1, Ordering::Relaxed) == 4 {
            cancelled.set();
        }
        Disk.digest(path)
    });
    let clock = Arc::new(Simulated::default());
    let store = Store::on(&folder.path().join("store"), Arc::new(layer), clock).unwrap();
    let unit = prepared(&trivial("unit", 1.0));
    run_with_two_files(&store, &unit);
    let begin = |retries: bool| {
        let begun = store.begin(&unit, &holder(2), retries, &mut Seen::default(), &cancel).unwrap();
        (begun, reads.load(Ordering::Relaxed))
    };
    assert!(matches!(begin(false), (Begun::Done(_), 2)));
    assert!(matches!(begin(true), (Begun::Done(_), 4)));
    assert!(matches!(begin(true), (Begun::Cancelled, 5)));
}

#[test]
fn a_file_that_another_machine_replaces_while_it_is_read_is_no_damage() {
    let folder = tempfile::tempdir().unwrap();
    let is_replaced = Arc::new(AtomicUsize::new(0));
    let flag = is_replaced.clone();
    // The number of ESTALE.
    let layer = Digesting(move |path: &Path| match flag.load(Ordering::Relaxed) {
        0 => Disk.digest(path),
        _ => Err(std::io::Error::from_raw_os_error(116)),
    });
    let clock = Arc::new(Simulated::default());
    let store = Store::on(&folder.path().join("store"), Arc::new(layer), clock).unwrap();
    let unit = prepared(&trivial("unit", 1.0));
    run_with_two_files(&store, &unit);
    is_replaced.store(1, Ordering::Relaxed);
    let begun = store.begin(&unit, &holder(2), true, &mut Seen::default(), &Cancel::default());
    assert!(matches!(begun, Ok(Begun::Done(_))));
}

#[test]
fn a_result_that_was_taken_away_is_made_again_with_its_own_files() {
    let folder = tempfile::tempdir().unwrap();
    let clock = Arc::new(Simulated::default());
    let store = Store::on(&folder.path().join("store"), Arc::new(Disk), clock.clone()).unwrap();
    let unit = prepared(&trivial("unit", 1.0));
    run_with_two_files(&store, &unit);
    let of_unit = store.folder(&unit.key);
    std::fs::remove_file(of_unit.join("result.json")).unwrap();
    // The attempt has ended with a result, which may come to be visible.
    let (mut seen, cancel) = (Seen::default(), Cancel::default());
    let mut begin = || store.begin(&unit, &holder(2), false, &mut seen, &cancel).unwrap();
    assert!(matches!(begin(), Begun::Elsewhere(_)));
    clock.wait(STALE_AFTER);
    let Begun::Mine(attempt) = begin() else { panic!() };
    std::fs::create_dir_all(attempt.folder()).unwrap();
    std::fs::write(attempt.folder().join("a.txt"), "another").unwrap();
    attempt.keep_contents().unwrap();
    attempt.finish(json!({"value": 8})).unwrap();
    assert_eq!(std::fs::read_to_string(of_unit.join("files/a.txt")).unwrap(), "another");
    assert!(!of_unit.join("files/b.txt").exists());
    let state = store.state(&unit.key, &mut Seen::default()).unwrap();
    assert!(matches!(state, UnitState::Done(_)), "{state:?}");
}
