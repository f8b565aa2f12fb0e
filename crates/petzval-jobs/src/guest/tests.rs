use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use petzval_base::Cancel;
use petzval_camera::tape::View;
use petzval_learn::guest::{Answer, Array, Call, GuestError};
use serde_json::{Value, json};

use super::message;
use super::worker::{SOURCE, Worker};

#[test]
fn the_python_package_runs_the_same_file() {
    let package = concat!(env!("CARGO_MANIFEST_DIR"), "/../petzval-python/python/petzval/_worker.py");
    assert_eq!(
        petzval_base::read_text(package).unwrap(),
        SOURCE,
        "`worker.py` is a link to it: check it out as one"
    );
}

/// An answer as a worker writes it.
fn framed(header: &Value, body: &[u8]) -> Vec<u8> {
    let text = header.to_string();
    let lengths = [&(text.len() as u32).to_le_bytes()[..], &(body.len() as u64).to_le_bytes()[..]];
    [b"PTZG", lengths[0], lengths[1], text.as_bytes(), body].concat()
}

fn read(bytes: &[u8]) -> std::io::Result<Option<Result<Answer, String>>> {
    Ok(message::read(&mut &bytes[..])?.map(|(header, body)| message::answer(header, &body)))
}

#[test]
fn arrays_and_bytes_come_through_and_damaged_answers_are_refused() {
    let arrays = [View { values: &[1.0, -2.5], shape: vec![1, 2] }, View { values: &[], shape: vec![0] }];
    let mut written = Vec::new();
    message::write(&mut written, &json!({"value": {"loss": 0.1}}), &arrays, b"state").unwrap();
    let answer = read(&written).unwrap().unwrap().unwrap();
    let array = |values: &[f32], shape: &[usize]| Array { values: values.to_vec(), shape: shape.to_vec() };
    assert_eq!(answer.arrays, [array(&[1.0, -2.5], &[1, 2]), array(&[], &[0])]);
    assert_eq!((answer.bytes.as_slice(), &answer.value), (&b"state"[..], &json!({"loss": 0.1})));
    // Cut anywhere it is no answer, and before its first byte it is the end.
    assert!(read(&[]).unwrap().is_none());
    for end in 16..written.len() {
        assert!(read(&written[..end]).is_err(), "{end}");
    }
    assert!(read(b"Traceback (most recent call last)").is_err());
    let short = framed(&json!({"shapes": [[2]], "bytes": 0}), &[0; 4]);
    assert_eq!(read(&short).unwrap().unwrap(), Err("an answer has 4 bytes, not 8".to_owned()));
}

#[test]
fn errors_are_those_that_the_worker_reports_with_their_traceback() {
    let lines = Mutex::new(Vec::new());
    let refused = |kind: &str| {
        let error = json!({"error": {"kind": kind, "message": "m", "hint": "h", "traceback": "a\nb\n"}});
        let said = |line: &str| lines.lock().unwrap().push(line.to_owned());
        super::read_answer(&error.to_string(), "nets:Net", "step", &said).unwrap_err()
    };
    assert_eq!(refused("raised"), GuestError::Raised("m".to_owned()));
    assert_eq!(*lines.lock().unwrap(), ["a", "b"]);
    assert_eq!(refused("answer").to_string(), "`nets:Net.step` m");
    assert_eq!(refused("unusable").to_string(), "m; hint: h");
}

/// A worker of a shell script, which greets before its text. Its limit is half a second.
#[cfg(unix)]
fn scripted(script: &str, cancel: &Cancel) -> Result<Worker, GuestError> {
    let greeting = framed(&json!({"value": {"protocol": 1}}), &[]);
    let greeting: String = greeting.iter().map(|byte| format!("\\{byte:03o}")).collect();
    let mut command = Command::new("/bin/sh");
    command.args(["-c", &format!("printf '{greeting}'\n{script}")]);
    Worker::run(command, "", Duration::from_millis(500), cancel.clone(), Arc::new(|_: &str| ()))
}

#[cfg(unix)]
fn failure(worker: &Worker) -> String {
    let header = json!({"verb": "call"});
    worker.request(&header, "nets:Net", &Call { method: "step", ..Call::default() }).unwrap_err().to_string()
}

#[test]
#[cfg(unix)]
fn a_worker_that_dies_or_hangs_is_reported_with_its_last_lines() {
    let cancel = Cancel::default();
    let dies = scripted("head -c 20 >/dev/null; echo out of memory >&2; exit 3", &cancel).unwrap();
    let said = failure(&dies);
    assert!(said.contains("`nets:Net.step`: its Python process has ended (exit status: 3"), "{said}");
    assert!(said.ends_with("it wrote: out of memory"), "{said}");
    assert!(failure(&dies).contains("has ended before"));

    let folder = tempfile::tempdir().unwrap();
    let child = folder.path().join("child");
    let hangs = format!("sleep 60 & echo $! > {}; echo waiting >&2; wait", child.display());
    let hangs = scripted(&hangs, &cancel).unwrap();
    let start = Instant::now();
    let said = failure(&hangs);
    assert!(said.contains("no answer within 0.5 s") && said.ends_with("waiting"), "{said}");
    assert!(start.elapsed() < Duration::from_secs(10));
    // What it started is ended with it.
    let id = std::fs::read_to_string(child).unwrap();
    let state = || std::fs::read_to_string(format!("/proc/{}/stat", id.trim()));
    let is_gone = || state().map_or(true, |stat| stat.contains(") Z "));
    let ended = (0..200).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        is_gone()
    });
    assert!(ended, "{:?}", state());
}

#[test]
#[cfg(unix)]
fn what_cannot_be_started_or_does_not_speak_is_no_worker() {
    let start = |command: Command| {
        let limit = Duration::from_secs(5);
        Worker::run(command, "text", limit, Cancel::default(), Arc::new(|_: &str| ())).err().unwrap()
    };
    let missing = start(Command::new("/no/such/python")).to_string();
    assert!(missing.contains("cannot be started"), "{missing}");
    let mut without_numpy = Command::new("/bin/sh");
    without_numpy.args(["-c", "cat >/dev/null & echo \"No module named 'numpy'\" >&2; exit 1"]);
    let said = start(without_numpy).to_string();
    assert!(said.contains("exit status: 1") && said.contains("No module named 'numpy'"), "{said}");
    let mut talks = Command::new("/bin/sh");
    talks.args(["-c", "echo hello, this is no frame at all; sleep 5"]);
    let said = start(talks).to_string();
    assert!(said.contains("the channel holds no answer"), "{said}");
}
