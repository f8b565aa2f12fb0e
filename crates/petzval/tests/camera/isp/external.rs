//! ISPs outside the program.

use std::path::Path;

use super::{write_raws, write_references};
use crate::common::{self, data, read, read_json, run_fails, run_ok};

#[cfg(unix)]
#[test]
fn an_external_isp_is_shown_tuned_and_its_failure_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let lab = folder.path().join("lab");
    std::fs::create_dir(&lab).unwrap();
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/examples");
    for file in ["external-isp.sh", "external-isp.toml"] {
        std::fs::copy(book.join(file), lab.join(file)).unwrap();
    }
    let text = run_ok(folder.path(), &["isp", "show", "lab/external-isp.toml"]).stdout;
    assert!(text.starts_with("Ten-line ISP: 2 parameters") && text.contains("tone.gamma"), "{text}");
    let develop = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--isp", "lab/external-isp.toml"];
    let set = ["--set", "tone.gain=1.6", "--bits", "16", "--strip", "--out", "reference"];
    run_ok(folder.path(), &[&develop[..], &set].concat());

    let args = ["isp", "tune", "raws", "--reference", "reference", "--isp", "lab/external-isp.toml"];
    let more = ["--evaluations", "31", "--out", "out", "--json"];
    let found = run_ok(folder.path(), &[&args[..], &more].concat()).json();
    assert!(found["best"].as_f64().unwrap() > found["start"].as_f64().unwrap());
    // The tuned settings know their ISP, from any folder.
    let shown = run_ok(&lab, &["isp", "show", "../out/tuned.toml", "--json"]).json();
    assert_eq!(shown["name"], "Ten-line ISP");
    assert_eq!(shown["parameters"][0]["value"], found["parameters"][0]["best"]);

    // The device goes away: the search stops with a clear error, and continues once it is back.
    let script = std::fs::read(lab.join("external-isp.sh")).unwrap();
    std::fs::write(lab.join("external-isp.sh"), "echo the device is off >&2; exit 4\n").unwrap();
    let resume = ["isp", "tune", "--resume", "out", "--evaluations", "43", "--json"];
    let says = ["the device is off", "exit status: 4", "Ten-line ISP", "tone.gain = ", "--resume out"];
    run_fails(folder.path(), &resume, 1, &says);
    assert_eq!(read_json(&folder.path().join("out/history.json")).as_array().unwrap().len(), 5);
    std::fs::write(lab.join("external-isp.sh"), script).unwrap();
    let more = run_ok(folder.path(), &resume).json();
    assert!(more["evaluations"].as_u64().unwrap() > 31);
}

#[cfg(unix)]
#[test]
fn settings_at_which_an_external_isp_fails_count_as_the_worst() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let lab = folder.path().join("lab");
    std::fs::create_dir(&lab).unwrap();
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/examples");
    std::fs::copy(book.join("external-isp.toml"), lab.join("external-isp.toml")).unwrap();
    let fails =
        "if awk '/tone.gain/ { exit !($3 < 0.9) }' \"$1/frame.toml\"; then echo too dark >&2; exit 4; fi";
    let script = format!("{fails}\n{}", read(&book.join("external-isp.sh")));
    std::fs::write(lab.join("external-isp.sh"), script).unwrap();
    let isp = ["--isp", "lab/external-isp.toml"];
    let develop =
        ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--bits", "16", "--out", "reference"];
    run_ok(folder.path(), &[&develop[..], &isp, &["--set", "tone.gain=1.6"]].concat());

    let tune = |more: &[&'static str]| {
        [&["isp", "tune", "raws", "--reference", "reference"], &isp[..], more].concat()
    };
    let whole = run_ok(folder.path(), &tune(&["--evaluations", "13", "--out", "whole"]));
    for words in ["count as the worst", "first at tone.gain = 0.", "too dark", "exit status: 4"] {
        assert!(whole.says(words), "{words}: {}", whole.stderr);
    }
    let generations = read_json(&folder.path().join("whole/history.json"));
    assert!(generations[0]["failed"].as_u64().unwrap() > 0, "{generations}");
    // In two parts it is the same search.
    run_ok(folder.path(), &tune(&["--evaluations", "7", "--out", "parts"]));
    run_ok(folder.path(), &["isp", "tune", "--resume", "parts", "--evaluations", "13"]);
    let tuned = |name: &str| read(&folder.path().join(name).join("tuned.toml"));
    assert_eq!(tuned("parts"), tuned("whole"));

    // Without a start there is nothing to be better than.
    let dark = tune(&["--set", "tone.gain=0.5", "--out", "dark"]);
    let dark = common::run(folder.path(), &dark);
    assert_eq!(dark.code, Some(1), "{}", dark.stderr);
    for words in ["too dark", "at tone.gain = 0.5, tone.gamma = 2.2", "run the ISP at these values"] {
        assert!(dark.says(words), "{words}: {}", dark.stderr);
    }
}

/// Writes an external ISP that hangs after so many calls, with a process of its own.
#[cfg(unix)]
fn write_hanging(folder: &Path, calls: usize) {
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/examples");
    let hang = "{ sleep 61 & echo $! > child; sleep 62; }";
    let script = format!(
        "echo call >> calls\n[ $(wc -l < calls) -le {calls} ] || {hang}\n{}",
        read(&book.join("external-isp.sh"))
    );
    let about = read(&book.join("external-isp.toml")).replacen(
        "\n\n",
        "\ntimeout_s = 60\nretries = 2\nparallel = 2\n\n",
        1,
    );
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join("external-isp.sh"), script).unwrap();
    std::fs::write(folder.join("external-isp.toml"), about).unwrap();
}

/// Runs the command until the external ISP in the folder `lab` hangs, and sends a signal. Nothing of the ISP may be left.
#[cfg(unix)]
fn signalled(folder: &Path, signal: &str, args: &[&str]) -> common::Outcome {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let (temporary, child_file) = (folder.join("temporary"), folder.join("lab/child"));
    std::fs::create_dir_all(&temporary).unwrap();
    let mut command = common::petzval(folder);
    command.args(args).env("TMPDIR", &temporary).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = command.spawn().unwrap();
    let began = Instant::now();
    while !std::fs::read_to_string(&child_file).is_ok_and(|child| child.ends_with('\n')) {
        let is_over = running.try_wait().unwrap().is_some() || began.elapsed() > Duration::from_secs(120);
        if is_over {
            running.kill().unwrap();
            panic!(
                "{args:?}: the ISP never hangs: {:?}",
                common::outcome(running.wait_with_output().unwrap())
            );
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(std::fs::read_dir(&temporary).unwrap().next().is_some());
    let signalled = Instant::now();
    assert!(Command::new("kill").args(["-s", signal, &running.id().to_string()]).status().unwrap().success());
    let outcome = common::outcome(running.wait_with_output().unwrap());
    assert!(signalled.elapsed() < Duration::from_secs(5), "{args:?}: {:?}", signalled.elapsed());
    // After SIGKILL somebody else has to remove it.
    let is_left = || std::fs::read_dir(&temporary).unwrap().next().is_some();
    let patience = if signal == "KILL" { Duration::from_secs(5) } else { Duration::ZERO };
    while is_left() && signalled.elapsed() < patience {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(!is_left(), "{args:?}: a folder is left");
    // A process that was killed may need a moment to disappear.
    let state = || std::fs::read_to_string(format!("/proc/{}/stat", read(&child_file).trim()));
    let is_gone = (0..200).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        state().map_or(true, |stat| stat.contains(") Z "))
    });
    assert!(is_gone, "{args:?}: {:?}", state());
    std::fs::remove_file(&child_file).unwrap();
    std::fs::remove_file(folder.join("lab/calls")).unwrap();
    outcome
}

#[cfg(unix)]
#[test]
fn a_signal_stops_an_external_isp_that_hangs_and_what_was_finished_stays() {
    let folder = tempfile::tempdir().unwrap();
    let lab = folder.path().join("lab");
    write_raws(&folder.path().join("raws"));
    std::fs::copy(data("photos/coffee.png"), folder.path().join("coffee.png")).unwrap();
    write_hanging(&lab, 1);
    let isp = ["--isp", "lab/external-isp.toml"];
    let develop = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--out", "out"];
    let stopped = signalled(folder.path(), "INT", &[&develop[..], &isp].concat());
    assert_eq!(stopped.code, Some(1), "{}", stopped.stderr);
    assert!(stopped.says("right.tiff: the external ISP Ten-line ISP was stopped"), "{}", stopped.stderr);
    assert!(folder.path().join("out/left.png").is_file() && !folder.path().join("out/right.png").exists());

    write_hanging(&lab, 0);
    let simulate = ["simulate", "coffee.png", "--size", "32x48", "--no-distortion", "--out", "simulated"];
    let stopped = signalled(folder.path(), "TERM", &[&simulate[..], &isp].concat());
    assert_eq!(stopped.code, Some(1), "{}", stopped.stderr);
    assert!(stopped.says("Ten-line ISP was stopped"), "{}", stopped.stderr);
    let left = std::fs::read_dir(folder.path().join("simulated")).map_or(0, Iterator::count);
    assert_eq!(left, 0);
}

/// Killed without a word, the command cannot stop anything itself.
#[cfg(target_os = "linux")]
#[test]
fn an_external_isp_dies_with_its_master_and_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let lab = folder.path().join("lab");
    write_raws(&folder.path().join("raws"));
    write_hanging(&lab, 0);
    let develop = ["isp", "develop", "raws/left.tiff", "raws/right.tiff", "--isp", "lab/external-isp.toml"];
    let killed = signalled(folder.path(), "KILL", &[&develop[..], &["--out", "out"]].concat());
    assert_eq!((killed.code, killed.stderr.as_str()), (None, ""));
}

#[cfg(unix)]
#[test]
fn a_signal_stops_searches_and_trainings_with_an_isp_that_hangs_and_both_resume() {
    let folder = tempfile::tempdir().unwrap();
    let lab = folder.path().join("lab");
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let isp = ["--isp", "lab/external-isp.toml"];
    // Two frames, and six settings in a generation: the second generation is interrupted.
    write_hanging(&lab, 2 + 12 + 4);
    let tune = ["isp", "tune", "raws", "--reference", "reference", "--evaluations", "13", "--out", "search"];
    let stopped = signalled(folder.path(), "INT", &[&tune[..], &isp].concat());
    assert_eq!(stopped.code, Some(75), "{}", stopped.stderr);
    let history = |name: &str| read_json(&folder.path().join(name)).as_array().unwrap().len();
    assert_eq!(history("search/history.json"), 1);
    write_hanging(&lab, 1000);
    // As many settings as the search began with.
    run_ok(folder.path(), &["isp", "tune", "--resume", "search"]);
    assert_eq!(history("search/history.json"), 2);

    // The second step is interrupted.
    write_hanging(&lab, 70);
    let sizes = ["--steps", "3", "--base-channels", "8", "--levels", "2", "--out", "proxy"];
    let train = [&["train", "isp-proxy"], &isp[..], &sizes].concat();
    let stopped = signalled(folder.path(), "TERM", &train);
    assert_eq!(stopped.code, Some(75), "{}", stopped.stderr);
    let kept = read_json(&folder.path().join("proxy/training.json"))["step"].as_u64().unwrap();
    assert!(kept < 3 && stopped.says(&format!("stopped after {kept} steps; --resume continues")), "{kept}");
}
