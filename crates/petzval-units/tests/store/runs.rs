//! Units run by the jobs that they name.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use petzval_base::Cancel;
use petzval_design::run::Holder;
use petzval_jobs::{Context, Event, Watcher, built_in_assets};
use petzval_units::store::Seen;
use petzval_units::store::{
    Begun, Disk, FileLayer, Outcome, RENEWED_EVERY, RunOptions, Store, SystemClock, UnitState, run_all,
    run_unit,
};
use petzval_units::unit::Unit;
use serde_json::json;

use crate::layers::Digesting;
use crate::{context, prepared, trivial, unit};

const USUAL: RunOptions = RunOptions { retries: false, leaves_others: false };

fn store(folder: &Path) -> Store {
    Store::open_or_new(&folder.join("store")).unwrap()
}

#[test]
fn a_unit_with_a_result_is_not_run_again() {
    let folder = tempfile::tempdir().unwrap();
    let (store, unit) = (store(folder.path()), trivial("ray", 10.0));
    let Outcome::Done(first) = run_unit(&unit, &store, &context(), USUAL).unwrap() else { panic!() };
    assert_eq!((first.attempt, first.files.clone()), (1, None));
    assert!(first.response.is_object(), "{first:?}");
    assert!(first.cost.seconds > 0.0 && first.cost.all_cpu_seconds >= first.cost.cpu_seconds);
    let before = first.cost.began.clone();
    let Outcome::There(again) = run_unit(&unit, &store, &context(), USUAL).unwrap() else { panic!() };
    assert_eq!((again.cost.began.clone(), *again), (before, *first));
    // Another name is the same work.
    let other = Unit { name: "other".to_owned(), ..unit };
    assert!(matches!(run_unit(&other, &store, &context(), USUAL).unwrap(), Outcome::There(_)));
    assert_eq!(store.keys().unwrap().len(), 1);
}

#[test]
fn files_of_a_job_are_in_the_store_and_named_from_there() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let convert =
        unit("convert", "lens-convert", json!({"from": "cooke-triplet-nominal", "to": "elsewhere/a.zmx"}));
    let Outcome::Done(result) = run_unit(&convert, &store, &context(), USUAL).unwrap() else { panic!() };
    assert_eq!(result.response["to"], "files/a.zmx");
    let files = store.files(&result).unwrap();
    assert_eq!(files, store.folder(&result.key).join("files"));
    assert!(files.join("a.zmx").is_file() && !Path::new("elsewhere").exists());
    assert!(store.unit(&result.key).unwrap() == Some(convert));
}

#[test]
fn a_unit_whose_job_needs_a_folder_of_results_has_one_in_the_store() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let small = json!({"lens": "cooke-triplet-nominal", "fields": 2, "grid": 16, "pupil_cells": 12, "pupil_error": 2});
    let Outcome::Done(result) = run_unit(&unit("psf", "psf", small), &store, &context(), USUAL).unwrap()
    else {
        panic!()
    };
    assert_eq!(result.response["files"][0], "files/psf.npy");
    assert!(store.files(&result).unwrap().join("psf.npy").is_file());
}

#[test]
fn units_of_two_instruction_sets_are_refused_with_a_way_to_run_both() {
    let folder = tempfile::tempdir().unwrap();
    let own = trivial("own", 1.0);
    let simd = if own.simd == "scalar" { "avx2" } else { "scalar" };
    let other = Unit { simd: simd.to_owned(), ..trivial("other", 2.0) };
    // In both orders: the instruction set of the process decides about neither.
    for units in [[&own, &other], [&other, &own]] {
        let refused = run_all(&units, || Ok(store(folder.path())), &context(), USUAL).unwrap_err().report();
        assert!(
            refused.message.contains("unit \"own\"") && refused.message.contains("unit \"other\""),
            "{refused:?}"
        );
        assert!(refused.hint.contains("--name") && !refused.hint.contains("PETZVAL_SIMD"), "{refused:?}");
    }
    assert!(!folder.path().join("store").exists());
}

#[test]
fn a_unit_that_fails_keeps_its_error_and_is_run_again_only_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let lens = folder.path().join("lens.toml");
    // It can be read, so that the unit is ready, and is no lens.
    std::fs::write(&lens, "name = \"x\"\n").unwrap();
    let broken = unit("broken", "lens-show", json!({"lens": lens.to_str().unwrap()}));
    let (good, key) = (trivial("good", 1.0), prepared(&broken).key);
    let run = |options| run_all(&[&broken, &good], || Ok(store.clone()), &context(), options).unwrap();
    let summary = run(USUAL);
    assert_eq!((summary.done, summary.failed.len(), summary.stopped.is_none()), (1, 1, true));
    let failure = &summary.failed[0];
    assert_eq!((failure.unit.as_str(), failure.attempt), ("broken", 1));
    assert!(failure.error.place.as_ref().unwrap().path.as_deref() == Some(lens.as_path()), "{failure:?}");
    let kept = std::fs::read_to_string(store.folder(&key).join("error.json")).unwrap();
    assert_eq!(kept.parse::<serde_json::Value>().unwrap()["error"]["message"], json!(failure.error.message));
    let summary = run(USUAL);
    assert_eq!((summary.there, summary.failed[0].attempt), (1, 1));
    let summary = run(RunOptions { retries: true, ..USUAL });
    assert_eq!((summary.there, summary.failed[0].attempt), (1, 2));
    let state = store.state(&key, &mut Seen::default()).unwrap();
    assert!(matches!(state, UnitState::Failed(failure) if failure.attempt == 2));
}

#[test]
fn a_claim_is_renewed_while_the_files_of_a_result_are_read() {
    let folder = tempfile::tempdir().unwrap();
    // Reading a file takes until the next renewal.
    let layer = Digesting(|path: &Path| {
        let record = path.ancestors().nth(2).unwrap().join("attempt-0001.json");
        let renewals = || {
            let record: serde_json::Value = serde_json::from_slice(&Disk.read(&record).unwrap()).unwrap();
            record["renewed"].as_u64().unwrap()
        };
        let (first, start) = (renewals(), Instant::now());
        while renewals() == first {
            assert!(start.elapsed() < 3 * RENEWED_EVERY, "the claim is not renewed");
            std::thread::sleep(Duration::from_millis(100));
        }
        Disk.digest(path)
    });
    let clock = Arc::new(SystemClock::default());
    let store = Store::on(&folder.path().join("store"), Arc::new(layer), clock).unwrap();
    let convert = unit("convert", "lens-convert", json!({"from": "cooke-triplet-nominal", "to": "a.zmx"}));
    assert!(matches!(run_unit(&convert, &store, &context(), USUAL).unwrap(), Outcome::Done(_)));
}

/// Keeps the notes of a job.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Watcher for Notes {
    fn event(&self, event: &Event) {
        self.0.lock().unwrap().push(event.to_string());
    }
}

#[test]
fn many_workers_on_one_store_do_each_unit_once() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let units: Vec<Unit> = (0..24).map(|i| trivial(&format!("ray {i}"), f64::from(i) * 0.5)).collect();
    let all: Vec<&Unit> = units.iter().collect();
    let done: usize = std::thread::scope(|scope| {
        let work = || run_all(&all, || Ok(store.clone()), &context(), USUAL).unwrap();
        let workers: Vec<_> = (0..8).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .map(|worker| {
                let summary = worker.join().unwrap();
                assert_eq!(summary.done + summary.there, 24, "{summary:?}");
                summary.done
            })
            .sum()
    });
    assert_eq!(done, 24);
    let attempts: BTreeSet<u32> =
        store.keys().unwrap().iter().map(|key| store.result(key).unwrap().unwrap().attempt).collect();
    assert_eq!(attempts, BTreeSet::from([1]));
}

/// A search of two rounds.
fn search() -> Unit {
    let goal = json!({"wavelengths": [0.5876]});
    let start = json!({"new": {"lens": "cooke-triplet-nominal", "out": "", "global": true, "goal": goal}});
    unit("search", "lens-optimize", json!({"start": start, "rounds": 2}))
}

/// A context that cancels a search after its first round.
fn stopping() -> Context {
    struct Stopper(petzval_base::Cancel);
    impl Watcher for Stopper {
        fn event(&self, event: &Event) {
            if matches!(event, Event::Progress { done: 1.., .. }) {
                self.0.set();
            }
        }
    }
    let cancel = petzval_base::Cancel::default();
    Context::new(built_in_assets(), Arc::new(Stopper(cancel.clone()))).with_cancellation(cancel)
}

/// The time of each task is shorter than the job: without an end to it, a cluster would begin the unit for ever.
#[test]
fn a_unit_that_is_stopped_before_its_end_each_time_fails_and_is_run_again_only_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let long = unit("long", "lens-tolerance", json!({"lens": "cooke-triplet-nominal", "trials": 300}));
    // A disk that is full ends attempts as well, but they are no sign that the time is too short.
    for _ in 0..6 {
        let begun =
            store.begin(&prepared(&long), Holder::own(), false, &mut Seen::default(), &Cancel::default());
        let Begun::Mine(attempt) = begun.unwrap() else { panic!() };
        attempt.stop_by_disk().unwrap();
    }
    for _ in 0..5 {
        assert!(matches!(run_unit(&long, &store, &stopping(), USUAL).unwrap(), Outcome::Stopped(_)));
    }
    let Outcome::Failed(failure) = run_unit(&long, &store, &context(), USUAL).unwrap() else { panic!() };
    assert_eq!(failure.attempt, 12);
    assert!(failure.error.message.starts_with("it was stopped 5 times before its end"), "{failure:?}");
    assert!(failure.error.hint.contains("--time") && failure.error.hint.contains("--retry"), "{failure:?}");
    assert!(matches!(run_unit(&long, &store, &context(), USUAL).unwrap(), Outcome::Failed(_)));
    let again = RunOptions { retries: true, ..USUAL };
    assert!(matches!(run_unit(&long, &store, &context(), again).unwrap(), Outcome::Done(_)));
}

#[test]
fn a_stopped_optimisation_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let search = search();
    let whole = store(&folder.path().join("whole"));
    let Outcome::Done(whole) = run_unit(&search, &whole, &context(), USUAL).unwrap() else { panic!() };
    let store = store(folder.path());
    assert!(matches!(run_unit(&search, &store, &stopping(), USUAL).unwrap(), Outcome::Stopped(_)));
    let state = store.state(&prepared(&search).key, &mut Seen::default()).unwrap();
    assert_eq!(state, UnitState::Stopped { attempt: 1 });
    let notes = Arc::new(Notes::default());
    let watched = Context::new(built_in_assets(), notes.clone());
    let Outcome::Done(result) = run_unit(&search, &store, &watched, USUAL).unwrap() else { panic!() };
    assert!(notes.0.lock().unwrap().iter().any(|note| note == "going on from a checkpoint"));
    assert_eq!((result.attempt, &result.response), (2, &whole.response));
    let best = std::fs::read(store.files(&result).unwrap().join("best.toml")).unwrap();
    let other = folder.path().join("whole/store").join(whole.key.as_str()).join("files/best.toml");
    assert_eq!(best, std::fs::read(other).unwrap());
}

#[test]
fn a_job_without_checkpoints_that_was_stopped_says_that_it_begins_again() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let lenses = unit("lenses", "lens-tolerance", json!({"lens": "cooke-triplet-nominal", "trials": 20}));
    for stops in [true, false] {
        let notes = Arc::new(Notes::default());
        let watched = Context::new(built_in_assets(), notes.clone());
        let context = if stops { stopping() } else { watched };
        let outcome = run_unit(&lenses, &store, &context, USUAL).unwrap();
        assert_eq!(matches!(outcome, Outcome::Stopped(_)), stops, "{outcome:?}");
        let begins_again = notes.0.lock().unwrap().iter().any(|note| note.contains("the unit begins again"));
        assert_eq!(begins_again, !stops);
    }
    // A unit that goes on says nothing of the kind.
    let search = search();
    assert!(matches!(run_unit(&search, &store, &stopping(), USUAL).unwrap(), Outcome::Stopped(_)));
    let notes = Arc::new(Notes::default());
    run_unit(&search, &store, &Context::new(built_in_assets(), notes.clone()), USUAL).unwrap();
    assert!(!notes.0.lock().unwrap().iter().any(|note| note.contains("begins again")));
}

/// A process is killed, and the disk has lost its last writes: the unit begins again. What a process has ended itself is whole, and never removed.
#[test]
fn a_damaged_checkpoint_of_a_killed_process_is_no_end() {
    let folder = tempfile::tempdir().unwrap();
    let search = search();
    let key = prepared(&search).key;
    for (was_killed, name) in [(true, "killed"), (false, "stopped")] {
        let store = store(&folder.path().join(name));
        assert!(matches!(run_unit(&search, &store, &stopping(), USUAL).unwrap(), Outcome::Stopped(_)));
        let at = |name: &str| store.folder(&key).join(name);
        std::fs::write(at("work-0001/search.json"), "{").unwrap();
        if was_killed {
            let claim = std::fs::read_to_string(at("claim-0001.json")).unwrap();
            let mut claim: serde_json::Value = claim.parse().unwrap();
            claim["holder"]["process_start"] = json!(1);
            std::fs::write(at("claim-0001.json"), claim.to_string()).unwrap();
            std::fs::remove_file(at("attempt-0001.json")).unwrap();
        }
        let notes = Arc::new(Notes::default());
        let watched = Context::new(built_in_assets(), notes.clone());
        match run_unit(&search, &store, &watched, USUAL).unwrap() {
            Outcome::Done(result) => {
                assert!(was_killed && result.attempt == 2);
                assert!(notes.0.lock().unwrap().iter().any(|note| note.contains("the unit begins again")));
            }
            Outcome::Failed(failure) => {
                assert!(!was_killed && failure.error.message.contains("search.json"), "{failure:?}");
                assert!(at("work-0002/config.json").is_file());
            }
            other => panic!("{other:?}"),
        }
    }
}
