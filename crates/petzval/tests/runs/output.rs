//! Nobody at the other end: a full disk, a reader that has gone, a terminal that is closed. No run ends by it, and no data are lost in silence.

#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::Read;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Output, Stdio};

use crate::common::*;

/// Signal that ends a program whose reader is gone.
const SIGPIPE: i32 = 13;

/// Verbs of all kinds that end within a second: tables, pages of facts, files, JSON.
const QUICK: [&[&str]; 16] = [
    &["lens", "list"],
    &["lens", "show", "cooke-triplet-nominal"],
    &["lens", "show", "cooke-triplet-nominal", "--json"],
    &["lens", "trace", "cooke-triplet-nominal", "--field", "5", "--wavelength", "0.55", "--pupil", "0,0.7"],
    &["glass", "list"],
    &["glass", "show", "N-BK7"],
    &["glass", "find", "--nd", "1.6", "--vd", "50"],
    &["sensor", "list"],
    &["sensor", "show", "imx249-fitted"],
    &["isp", "show", "automotive"],
    &["experiment", "list"],
    &["experiment", "show", "cooke-triplet-image-quality"],
    &["schema", "lens"],
    &["doctor"],
    &["--help"],
    &["--version"],
];

fn full_disk() -> Stdio {
    File::options().write(true).open("/dev/full").unwrap().into()
}

/// A pipe whose reader is gone.
fn nobody() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

fn with(folder: &Path, args: &[&str], stdout: Stdio, stderr: Stdio) -> Output {
    petzval(folder).args(args).stdout(stdout).stderr(stderr).spawn().unwrap().wait_with_output().unwrap()
}

#[test]
fn data_that_meet_a_full_disk_are_exit_1_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for args in QUICK {
        let outcome = outcome(with(folder.path(), args, full_disk(), Stdio::piped()));
        assert_eq!(outcome.code, Some(1), "{args:?}\n{}", outcome.stderr);
        assert!(
            outcome.says("stdout: the results cannot be printed: No space left"),
            "{args:?}: {outcome:?}"
        );
        assert_eq!(outcome.stderr.matches("No space").count(), 1, "{args:?}: {}", outcome.stderr);
        // Where nobody can read the sentence either, the exit code remains.
        assert_eq!(with(folder.path(), args, full_disk(), full_disk()).status.code(), Some(1), "{args:?}");
    }
}

#[test]
fn a_reader_that_has_read_enough_ends_the_command_quietly_as_other_programs_end() {
    let folder = tempfile::tempdir().unwrap();
    for args in QUICK {
        let output = with(folder.path(), args, nobody(), Stdio::piped());
        assert_eq!(output.status.signal(), Some(SIGPIPE), "{args:?}: {output:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{args:?}");
    }
}

#[test]
fn an_error_that_cannot_be_printed_keeps_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    for args in
        [&["lens", "show", "nothing.toml"][..], &["design", "nothing.toml"], &["lens", "show"], &["x"]]
    {
        for stderr in [full_disk(), nobody()] {
            assert_eq!(with(folder.path(), args, Stdio::null(), stderr).status.code(), Some(2), "{args:?}");
        }
    }
}

#[test]
fn a_run_outlives_the_reader_of_its_progress() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    for (name, stderr) in [("full", full_disk()), ("nobody", nobody())] {
        let args = ["design", "tiny.toml", "--out", name];
        let outcome = outcome(with(folder.path(), &args, Stdio::piped(), stderr));
        assert_eq!(outcome.code, Some(0), "{name}: {}", outcome.stdout);
        assert!(outcome.stdout.contains("report: "), "{name}: {}", outcome.stdout);
        assert!(folder.path().join(name).join("report.html").is_file(), "{name}");
    }
}

/// A terminal: the side of the screen, and the side of programs.
fn terminal() -> (File, File) {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let screen: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&screen).unwrap();
    unlockpt(&screen).unwrap();
    let name = ptsname(&screen, Vec::new()).unwrap();
    let path = Path::new(std::ffi::OsStr::from_bytes(name.as_bytes())).to_path_buf();
    (screen.into(), File::options().read(true).write(true).open(path).unwrap())
}

#[test]
fn a_run_outlives_its_terminal() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let (mut screen, programs) = terminal();
    let mut command = petzval(folder.path());
    command.args(["design", "tiny.toml", "--out", "run"]);
    command.stdout(programs.try_clone().unwrap()).stderr(programs);
    let mut child = command.spawn().unwrap();
    // The command keeps copies of the terminal.
    drop(command);
    // The bar has begun. The window is closed.
    let mut drawn = [0; 64];
    assert!(screen.read(&mut drawn).unwrap() > 0);
    drop(screen);
    let status = child.wait().unwrap();
    let run = folder.path().join("run");
    assert!(run.join("report.html").is_file(), "{status:?}");
    assert_eq!(read_json(&run.join("metrics.json"))["rows"].as_array().unwrap().len(), 3);
    // The table could not be printed.
    assert_eq!(status.code(), Some(1), "{status:?}");
}
