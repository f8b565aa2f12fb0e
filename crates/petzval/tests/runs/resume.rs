//! A run that is killed or stopped and then resumed gives the same bits as an uninterrupted run.

#![cfg(unix)]

use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use crate::common::*;
use serde_json::Value;
use signal_hook::SigId;
use signal_hook::consts::SIGHUP;

/// Metrics of an uninterrupted run, and its events without their seconds.
static WHOLE: LazyLock<(String, Vec<Value>)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    (read(&run.join("metrics.json")), timeless_events(&run))
});

fn timeless_events(run: &Path) -> Vec<Value> {
    let mut events = events(run);
    for event in &mut events {
        event.as_object_mut().unwrap().remove("seconds");
    }
    events
}

/// Starts the tiny experiment and waits until it has taken `steps` steps.
fn started(folder: &Path, steps: usize) -> (Child, PathBuf) {
    write_tiny(folder);
    started_from(folder, steps)
}

/// Under `nohup` the tests ignore the loss of the terminal, and so would what they start. A signal with a handler has its default effect in a new
/// program; the handler itself does nothing, so that the tests still outlive the terminal.
fn hang_up_is_not_ignored() -> Option<SigId> {
    petzval::jobs::machine::ignores_signal(SIGHUP)
        .then(|| signal_hook::flag::register(SIGHUP, Arc::default()).expect("a handler"))
}

/// Starts the experiment `tiny.toml` of a folder and waits until it has taken `steps` steps.
pub(crate) fn started_from(folder: &Path, steps: usize) -> (Child, PathBuf) {
    let _hang_up = hang_up_is_not_ignored();
    let mut command = petzval(folder);
    command.args(["design", "tiny.toml", "--out", "run"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let run = folder.join("run");
    let began = Instant::now();
    // The step of the last whole line: where spots are minimised, many lines are one step.
    let taken = || {
        let text = std::fs::read_to_string(run.join("events.jsonl")).unwrap_or_default();
        let last =
            text.rsplit_once('\n').and_then(|(whole, _)| whole.lines().next_back()?.parse::<Value>().ok());
        last.map_or(0, |event| event["step"].as_u64().unwrap() as usize)
    };
    while !run.join("config.toml").exists() || taken() < steps {
        assert!(began.elapsed() < Duration::from_secs(60), "the run does not get to step {steps}");
        assert!(child.try_wait().unwrap().is_none(), "the run ended before step {steps}");
        std::thread::sleep(Duration::from_micros(200));
    }
    (child, run)
}

/// Starts the tiny experiment and kills it, as a power cut would, after `steps` steps.
pub(crate) fn killed(folder: &Path, steps: usize) -> PathBuf {
    let (mut child, run) = started(folder, steps);
    child.kill().unwrap();
    let status = child.wait().unwrap();
    assert_eq!(status.signal(), Some(9), "killed at {steps}, but it ended by itself: {status:?}");
    run
}

#[test]
fn a_killed_run_resumes_to_the_same_metrics_and_events_each_once() {
    // Before the first checkpoint, in the networks, on either side of a score, in the lens steps of both
    // kinds, and while the report is being written.
    for steps in [0, 2, 4, 5, 6, 11, 13, 17, 20, 21] {
        let folder = tempfile::tempdir().unwrap();
        let run = killed(folder.path(), steps);
        run_ok(folder.path(), &["design", "--resume", "run"]);
        assert_eq!(read(&run.join("metrics.json")), WHOLE.0, "killed after {steps} steps");
        let events = timeless_events(&run);
        let steps_of = |events: &[Value]| events.iter().map(|e| e["step"].clone()).collect::<Vec<_>>();
        assert_eq!(steps_of(&events), steps_of(&WHOLE.1), "killed after {steps} steps");
        assert_eq!(events, WHOLE.1, "killed after {steps} steps");
        assert!(run.join("report.html").is_file());
    }
}

/// What is left between two cameras is the lens of the one that finished last, which may have other numbers than the last one of the list.
#[test]
fn a_run_that_was_extended_in_its_last_camera_is_resumed_again_after_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    let variants: toml::Table =
        "[[variant]]\nname = \"moving\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n\
         [[variant]]\nname = \"perfect\"\nlens = \"perfect\"\n[[variant.stage]]\nmoves = [\"network\"]\n"
            .parse()
            .unwrap();
    table.extend(variants);
    table["checkpoint"].as_table_mut().unwrap().insert("every".to_owned(), toml::Value::Integer(1));
    std::fs::write(folder.path().join("tiny.toml"), toml::to_string(&table).unwrap()).unwrap();
    // Behind the steps of the moving camera, and its score.
    let (mut child, run) = started_from(folder.path(), NETWORK_STEPS + LENS_STEPS + 2);
    child.kill().unwrap();
    child.wait().unwrap();
    run_ok(folder.path(), &["design", "--resume", "run", "--extend-to", "5"]);
    let metrics = read(&run.join("metrics.json"));
    for name in ["metrics.json", "metrics.csv"] {
        std::fs::remove_file(run.join(name)).unwrap();
    }
    run_ok(folder.path(), &["design", "--resume", "run"]);
    assert_eq!(read(&run.join("metrics.json")), metrics);
    let endless = ["design", "--resume", "run", "--extend-to", "1000000000"];
    run_fails(folder.path(), &endless, 2, &["--extend-to 1000000000: must lie between 1 and 1e7"]);
}

#[test]
fn a_run_that_is_killed_repeatedly_finishes() {
    let folder = tempfile::tempdir().unwrap();
    let run = killed(folder.path(), 2);
    for wait_ms in [60, 150, 250, 360] {
        let mut command = petzval(folder.path());
        command.args(["design", "--resume", "run"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    run_ok(folder.path(), &["design", "--resume", "run"]);
    assert_eq!(read(&run.join("metrics.json")), WHOLE.0);
}

#[test]
fn half_written_files_of_a_crash_are_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let run = killed(folder.path(), 7);
    let half = run.join("checkpoints/.partial-000009");
    std::fs::create_dir_all(&half).unwrap();
    std::fs::write(half.join("position.json"), "{\"st").unwrap();
    // No step of this run is kept as the five hundredth, and no process has this number.
    let left =
        ["checkpoints/.partial-000500", "cameras/.nominal.1073741824-0.part", ".run.json.1073741824-12.part"];
    std::fs::create_dir_all(run.join(left[0])).unwrap();
    left[1..].iter().for_each(|name| std::fs::write(run.join(name), "{").unwrap());
    std::fs::write(run.join("metrics.json.partial"), "{").unwrap();
    let log = run.join("events.jsonl");
    std::fs::write(&log, read(&log) + "{\"step\":8,\"cam").unwrap();
    run_ok(folder.path(), &["design", "--resume", "run"]);
    assert_eq!(read(&run.join("metrics.json")), WHOLE.0);
    assert!(left.iter().all(|name| !run.join(name).exists()), "what crashes have left is still there");
}

#[test]
fn a_signal_stops_after_a_checkpoint_and_the_run_resumes() {
    // HUP is what a lost terminal sends, USR1 and USR2 what batch systems send before a time limit, XCPU the kernel at a limit of CPU time.
    for (signal, steps) in [("TERM", 0), ("USR1", 2), ("XCPU", 5), ("HUP", 7), ("INT", 13), ("USR2", 17)] {
        let folder = tempfile::tempdir().unwrap();
        let (child, run) = started(folder.path(), steps);
        let pid = child.id().to_string();
        let send = || Command::new("kill").args(["-s", signal, &pid]).stderr(Stdio::null()).status().unwrap();
        assert!(send().success());
        // Batch systems repeat their signals. The run may have ended by now.
        if signal != "INT" {
            send();
        }
        let status = { child }.wait().unwrap();
        assert_eq!(status.code(), Some(75), "SIG{signal} after {steps} steps: {status:?}");

        // The last step is the one of the checkpoint. A stage for the lens alone is a step, which a signal cuts short; its events go.
        let last = events(&run).last().map_or(0, |e| e["step"].as_u64().unwrap());
        assert!(last + 1 >= steps as u64 && last < ALL_STEPS as u64);
        let checkpoint = run.join(format!("checkpoints/step-{last:06}"));
        assert!(checkpoint.join("position.json").is_file(), "no checkpoint of step {last}");
        assert!(!run.join("metrics.json").exists());

        let said = run_ok(folder.path(), &["design", "--resume", "run"]);
        assert!(last == 0 || said.says(&format!("going on from step {last} of {ALL_STEPS}")));
        assert_eq!(read(&run.join("metrics.json")), WHOLE.0, "SIG{signal} after {steps} steps");
    }
}

/// The tiny experiment, started by a shell after a command of its own.
fn started_by_shell(folder: &Path, before: &str) -> Child {
    write_tiny(folder);
    let mut command = Command::new("sh");
    command.current_dir(folder).arg("-c");
    command.arg(format!("{before}; exec '{}' design tiny.toml --out run", env!("CARGO_BIN_EXE_petzval")));
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
#[cfg(target_os = "linux")]
fn a_run_that_is_to_outlive_its_terminal_does() {
    let folder = tempfile::tempdir().unwrap();
    // As nohup starts it.
    let child = started_by_shell(folder.path(), "trap '' HUP");
    let run = folder.path().join("run");
    let began = Instant::now();
    while !run.join("events.jsonl").exists() && began.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-s", "HUP", &child.id().to_string()]).status().unwrap().success());
    let ended = outcome(child.wait_with_output().unwrap());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(read(&run.join("metrics.json")), WHOLE.0);
}

#[test]
fn a_run_on_a_full_disk_ends_with_an_error_and_resumes() {
    // No file may grow beyond so many blocks of 512 bytes: no checkpoint, or no record of the run, which has not begun then.
    for (blocks, hint) in [(32, "--resume"), (8, "make room and try again")] {
        let folder = tempfile::tempdir().unwrap();
        let child = started_by_shell(folder.path(), &format!("trap '' XFSZ; ulimit -f {blocks}"));
        let full = outcome(child.wait_with_output().unwrap());
        assert_eq!(full.code, Some(1), "{blocks}: {}", full.stderr);
        assert!(
            full.says("File too large") && full.says("run/") && full.says(hint),
            "{blocks}: {}",
            full.stderr
        );
        let run = folder.path().join("run");
        // Where not even the experiment was kept, there is nothing to go on from, and the folder is taken again.
        if run.join("config.toml").exists() {
            run_ok(folder.path(), &["design", "--resume", "run"])
        } else {
            run_ok(folder.path(), &["design", "tiny.toml", "--out", "run"])
        };
        assert_eq!(read(&run.join("metrics.json")), WHOLE.0, "{blocks}");
    }
}

#[test]
fn a_stopped_run_prints_how_to_continue() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let mut command = petzval(folder.path());
    command.args(["design", "tiny.toml", "--out", "run", "--steps", "100000"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while !folder.path().join("run/events.jsonl").exists() && began.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-s", "TERM", &child.id().to_string()]).status().unwrap().success());
    let stopped = outcome(child.wait_with_output().unwrap());
    assert_eq!(stopped.code, Some(75), "{}", stopped.stderr);
    assert!(stopped.says("continue with: petzval design --resume run"), "{}", stopped.stderr);
    assert_eq!(stopped.stdout, "");
    // An unfinished run has no report and no scores yet; the message explains what to do.
    for verb in ["report", "evaluate"] {
        let needles = ["the run is not finished", "petzval design --resume run"];
        run_fails(folder.path(), &[verb, "run"], 2, &needles);
    }
}

#[test]
fn resuming_a_finished_run_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let before = snapshot(&run);
    run_ok(folder.path(), &["design", "--resume", "run"]);
    assert_same_files(&before, &snapshot(&run));
}

/// Replaces a piece of a run's `config.toml`.
fn edit_config(run: &Path, from: &str, to: &str) {
    let path = run.join("config.toml");
    let text = read(&path);
    assert!(text.contains(from), "{from:?} is not in {text}");
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn a_run_whose_configuration_was_changed_is_not_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let run = killed(folder.path(), 7);
    // Another layout of the same values is no change.
    edit_config(&run, "[training]\n", "\n# how it trains\n[training]\n\n");
    edit_config(&run, "steps = 4", "steps   =  4");
    let half = folder.path().join("half");
    copy_folder(&run, &half);
    edit_config(&run, "steps   =  4", "steps = 6");
    edit_config(&run, "l1_weight = 1.0", "l1_weight = 2.0");
    let needles = [
        "config.toml has changed since the run was begun",
        "`l1_weight = 2.0`",
        "loss.l1_weight was 1.0, training.steps was 4",
        "help: put it back as it was",
        "--extend-to N",
    ];
    run_fails(folder.path(), &["design", "--resume", "run"], 2, &needles);
    run_fails(folder.path(), &["design", "--resume", "run", "--extend-to", "6"], 2, &needles[..1]);
    run_ok(folder.path(), &["design", "--resume", "half"]);
    assert_eq!(read(&half.join("metrics.json")), WHOLE.0);
    std::fs::remove_file(half.join("run.json")).unwrap();
    let needles = ["half/run.json: is missing", "petzval design half/config.toml --out"];
    run_fails(folder.path(), &["design", "--resume", "half"], 2, &needles);
}

/// What a finished run reports is what was run, whatever its `config.toml` says since.
#[test]
fn the_report_of_an_edited_run_states_what_was_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = finished_run(folder.path());
    let html = read(&run.join("report.html"));
    edit_config(&run, "steps = 4", "steps = 80");
    let said = run_ok(folder.path(), &["report", "run"]);
    assert!(
        said.says("warning: config.toml has changed") && said.says("training.steps was 4"),
        "{}",
        said.stderr
    );
    assert_eq!(read(&run.join("report.html")), html);
    assert!(html.contains("nominal (4 network steps)") && !html.contains("80 network steps"));
    let said = run_ok(folder.path(), &["evaluate", "run"]);
    assert!(said.says("training.steps was 4") && !said.stdout.contains(" 80\n"), "{}", said.stdout);
}

#[test]
fn an_extended_run_makes_the_cameras_of_its_longer_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let extend = ["design", "--resume", "run", "--extend-to", "6"];
    let run = finished_run(folder.path());
    let short = folder.path().join("short");
    copy_folder(&run, &short);
    let fewer = ["design", "--resume", "run", "--extend-to", "3"];
    run_fails(folder.path(), &fewer, 2, &["--extend-to 3", "`nominal` has 4 network steps already", "help:"]);
    run_fails(folder.path(), &["design", "--extend-to", "6"], 2, &["--resume <RUN>"]);
    let beside_others = ["design", "tiny.toml", "--extend-to", "6"];
    run_fails(folder.path(), &beside_others, 2, &["--extend-to", "cannot be used with"]);

    let said = run_ok(folder.path(), &extend);
    assert!(said.stdout.contains(" 6\n"), "{}", said.stdout);
    let metrics = read(&run.join("metrics.json"));
    run_ok(folder.path(), &["design", "run/config.toml", "--out", "fresh"]);
    assert_eq!(read(&folder.path().join("fresh/metrics.json")), metrics);
    // All cameras alike: 4 and 2 network steps, and 3 and 2 lens steps.
    let html = read(&run.join("report.html"));
    assert!(
        html.contains("nominal (6 network steps)")
            && html.contains(
                "end-to-end (least spots, least error after restoration, 5 lens steps, 6 network steps)"
            )
    );

    // A run that an earlier version finished, whose checkpoints have the stages of its cameras alone.
    let old = folder.path().join("old");
    copy_folder(&short, &old);
    let mut changed = 0;
    for checkpoint in std::fs::read_dir(old.join("checkpoints")).unwrap() {
        let checkpoint = checkpoint.unwrap().path();
        // Nor had they digests.
        std::fs::remove_file(checkpoint.join("digests.json")).unwrap();
        let path = checkpoint.join("position.json");
        let mut position = read_json(&path);
        for done in position["finished"].as_object_mut().unwrap().values_mut() {
            *done = done["stages"].clone();
            changed += 1;
        }
        std::fs::write(&path, position.to_string()).unwrap();
    }
    assert!(changed > 0);
    run_ok(folder.path(), &["design", "--resume", "old", "--extend-to", "6"]);
    assert_eq!(read(&old.join("metrics.json")), metrics);

    // Extended before its end, and killed on the way.
    let early = folder.path().join("early");
    std::fs::create_dir(&early).unwrap();
    let early = killed(&early, 7);
    let mut command = petzval(early.parent().unwrap());
    let mut child = command.args(extend).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !read(&early.join("run.json")).contains("\"steps\": 2") {
        assert!(child.try_wait().unwrap().is_none_or(|status| status.success()));
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(150));
    child.kill().unwrap();
    child.wait().unwrap();
    run_ok(early.parent().unwrap(), &["design", "--resume", "run"]);
    assert_eq!(read(&early.join("metrics.json")), metrics);

    // An extension that was cut short after config.toml: refused as it stands, and completed by the same extension.
    std::fs::copy(run.join("config.toml"), short.join("config.toml")).unwrap();
    let needles = ["config.toml has changed", "variant.0.stage.1 was not there"];
    run_fails(folder.path(), &["design", "--resume", "short"], 2, &needles);
    run_ok(folder.path(), &["design", "--resume", "short", "--extend-to", "6"]);
    assert_eq!(read(&short.join("metrics.json")), metrics);
}

/// A run that keeps the best numbers of its validations, killed between them, before a stage ends, and behind it.
#[test]
fn a_killed_run_with_validations_resumes_to_the_same_files() {
    let folder = tempfile::tempdir().unwrap();
    let write = |folder: &Path| {
        let mut table: toml::Table = tiny_experiment().parse().unwrap();
        let validation = "every = 1\nwindows = 2\npatience = 2\nkeep = \"best\"\n";
        table.insert("validation".to_owned(), toml::Value::Table(validation.parse().unwrap()));
        std::fs::write(folder.join("tiny.toml"), toml::to_string(&table).unwrap()).unwrap();
    };
    write(folder.path());
    run_ok(folder.path(), &["design", "tiny.toml", "--out", "run"]);
    let run = folder.path().join("run");
    let (metrics, whole) = (read(&run.join("metrics.json")), timeless_events(&run));
    assert_ne!(metrics, WHOLE.0);
    for steps in [1, 3, 4, 5, 13] {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path());
        let (mut child, run) = started_from(folder.path(), steps);
        child.kill().unwrap();
        child.wait().unwrap();
        run_ok(folder.path(), &["design", "--resume", "run"]);
        assert_eq!(read(&run.join("metrics.json")), metrics, "killed after {steps} steps");
        assert_eq!(timeless_events(&run), whole, "killed after {steps} steps");
    }
}
