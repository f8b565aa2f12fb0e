//! Curves of a run for other programs, and the list of runs.

#![cfg(unix)]

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::*;

/// Tag, step of the tag and value of every line of a table of scalars.
fn scalars(run: &Path) -> Vec<(String, u64, f64)> {
    let text = read(&run.join("scalars.csv"));
    assert!(text.starts_with("step,seconds,camera,tag,tag_step,value\n"), "{text}");
    let line = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        (format!("{}/{}", cells[2], cells[3]), cells[4].parse().unwrap(), cells[5].parse().unwrap())
    };
    text.lines().skip(1).map(line).collect()
}

/// The records of an event file: their lengths fill the file.
fn records(path: &Path) -> usize {
    let (bytes, mut at, mut count) = (std::fs::read(path).unwrap(), 0, 0);
    while at < bytes.len() {
        let length = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        at += 8 + 4 + length + 4;
        count += 1;
    }
    assert_eq!(at, bytes.len(), "the last record is cut");
    count
}

#[test]
fn curves_go_on_after_a_kill_without_a_step_twice_and_runs_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let design = ["design", "tiny.toml", "--log", "tensorboard", "--set", "checkpoint.every=2", "--out"];
    run_ok(folder.path(), &[&design[..], &["runs/whole"]].concat());
    let whole = scalars(&folder.path().join("runs/whole"));
    let has = |tag: &str| whole.iter().any(|(name, ..)| name == tag);
    for tag in [
        "nominal/network/total",
        "end-to-end/optics/total",
        "nominal/score/psnr_db",
        "end-to-end/lens/rms_spot_um",
        "spot-optimised/lens/efl_mm",
    ] {
        assert!(has(tag), "{tag}: {:?}", whole.iter().map(|(tag, ..)| tag).collect::<BTreeSet<_>>());
    }
    let networks = whole.iter().filter(|(tag, ..)| tag == "nominal/network/total");
    assert_eq!(
        networks.map(|(_, step, _)| *step).collect::<Vec<_>>(),
        (1..=NETWORK_STEPS as u64).collect::<Vec<_>>()
    );

    // Killed in the middle, and resumed without the option.
    let mut child = petzval(folder.path())
        .args(design)
        .arg("runs/killed")
        .stderr(std::process::Stdio::null())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let run = folder.path().join("runs/killed");
    let lines = || {
        std::fs::read_to_string(run.join("events.jsonl")).unwrap_or_default().matches("\"network\"").count()
    };
    let began = std::time::Instant::now();
    while lines() < NETWORK_STEPS + 1 {
        assert!(began.elapsed().as_secs() < 60, "the run does not get to its second camera");
        assert!(child.try_wait().unwrap().is_none(), "the run ended before its second camera");
        std::thread::sleep(std::time::Duration::from_micros(200));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let listed = run_ok(folder.path(), &["runs", "--json"]).json();
    let states: Vec<&str> =
        listed["runs"].as_array().unwrap().iter().map(|row| row["state"].as_str().unwrap()).collect();
    assert_eq!(states, ["stopped", "finished"]);
    run_ok(folder.path(), &["design", "--resume", "runs/killed"]);
    let resumed = scalars(&run);
    let names: BTreeSet<(&String, u64)> = resumed.iter().map(|(tag, step, _)| (tag, *step)).collect();
    assert_eq!(names.len(), resumed.len(), "a step stands twice");
    assert_eq!(resumed, whole);
    for camera in ["nominal", "spot-optimised", "end-to-end"] {
        let only = |run: &str| {
            let below = folder.path().join(run).join("tensorboard").join(camera);
            let files: Vec<_> =
                std::fs::read_dir(below).unwrap().map(|entry| entry.unwrap().path()).collect();
            assert_eq!(files.len(), 1, "{files:?}");
            records(&files[0])
        };
        assert_eq!(only("runs/killed"), only("runs/whole"));
    }

    // A run that differs in one key, and a damaged one: a row with its reason.
    run_ok(
        folder.path(),
        &["design", "tiny.toml", "--set", "training.batch=2", "--variant", "nominal", "--out", "runs/batch"],
    );
    copy_folder(&run, &folder.path().join("runs/damaged"));
    std::fs::write(folder.path().join("runs/damaged/metrics.json"), "{").unwrap();
    // One whose figures were edited is damaged, too.
    let edited = folder.path().join("runs/edited");
    copy_folder(&run, &edited);
    let mut metrics = read_json(&edited.join("metrics.json"));
    metrics["rows"][0]["efl_mm"] = serde_json::json!(99.0);
    std::fs::write(edited.join("metrics.json"), metrics.to_string()).unwrap();
    // So is a finished one whose cameras are lost.
    let lost = folder.path().join("runs/lost");
    copy_folder(&run, &lost);
    std::fs::remove_dir_all(lost.join("cameras")).unwrap();
    let listed = run_ok(folder.path(), &["runs", "--json"]).json();
    let row = |name: &str| {
        let rows = listed["runs"].as_array().unwrap();
        rows.iter().find(|row| row["run"].as_str().unwrap().ends_with(name)).unwrap()
    };
    assert_eq!(row("lost")["state"], "damaged");
    let reason = row("lost")["reason"].as_str().unwrap();
    assert!(reason.contains("cameras/") && reason.ends_with("metrics.json is missing"), "{reason}");
    let photo = data("photos/coffee.png").display().to_string();
    run_fails(
        folder.path(),
        &["apply", "runs/lost", &photo, "--out", "applied"],
        2,
        &["the run is finished", "from a copy of the run, or make the run again"],
    );
    assert_eq!(row("batch")["differs"]["training.batch"], "2");
    assert_eq!(row("whole")["differs"]["training.batch"], "1");
    assert_eq!(row("whole")["camera"], "end-to-end");
    assert_eq!(row("damaged")["state"], "damaged");
    assert!(row("damaged")["reason"].as_str().unwrap().contains("metrics.json"), "{}", row("damaged"));
    assert_eq!(row("edited")["state"], "damaged");
    assert!(row("edited")["scores"].as_array().unwrap().is_empty());
    let reason = row("edited")["reason"].as_str().unwrap();
    assert!(reason.ends_with("metrics.json is not as the run wrote it"), "{reason}");
    let text = run_ok(folder.path(), &["runs"]).stdout;
    assert!(text.contains("damaged") && text.contains("training.batch=2"), "{text}");
    run_fails(folder.path(), &["runs", "none"], 2, &["none: there is no such folder"]);
}
