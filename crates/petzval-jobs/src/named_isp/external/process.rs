//! Runs a command within a time limit.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use petzval_base::Cancel;

use super::workplace::Workplace;

/// Bytes of the end of standard error that an error shows.
const SHOWN_BYTES: u64 = 800;

/// How a command has ended.
pub(super) enum End {
    /// By itself.
    Exited(ExitStatus),
    /// It was stopped after the time limit, with every process that it had started.
    TimedOut,
    /// The same, because the job was cancelled.
    Cancelled,
}

/// How a command has ended, and the last that it wrote to standard error.
pub(super) struct Ended {
    pub end: End,
    stderr: String,
}

impl Ended {
    /// The end of standard error, as the end of a message; empty if the command wrote nothing.
    pub fn said(&self) -> String {
        if self.stderr.is_empty() { String::new() } else { format!("; it wrote: {}", self.stderr) }
    }
}

/// Runs a command, at most for `limit` and until `cancel` is set. Standard output and error go to files in its folder: a pipe that a forgotten process holds open
/// would never end.
pub(super) fn run_within(
    mut command: Command,
    workplace: &Workplace,
    limit: Duration,
    cancel: &Cancel,
) -> std::io::Result<Ended> {
    let folder = workplace.folder();
    let stderr = folder.join("stderr.txt");
    command
        .stdin(Stdio::null())
        .stdout(File::create(folder.join("stdout.txt"))?)
        .stderr(File::create(&stderr)?);
    // A group of its own, so that an end by the time limit or by the job reaches what the command has started.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let start = Instant::now();
    let mut child = command.spawn()?;
    if let Err(error) = workplace.begins(child.id()) {
        stop(&mut child);
        return Err(error);
    }
    let mut pause = Duration::from_millis(1);
    let end = loop {
        if let Some(status) = child.try_wait()? {
            break End::Exited(status);
        }
        if cancel.is_set() {
            stop(&mut child);
            break End::Cancelled;
        }
        let left = limit.saturating_sub(start.elapsed());
        if left.is_zero() {
            stop(&mut child);
            break End::TimedOut;
        }
        std::thread::sleep(pause.min(left));
        pause = (pause * 2).min(Duration::from_millis(20));
    };
    Ok(Ended { end, stderr: tail(&stderr) })
}

/// Ends a command with its group, and waits until the system has removed it.
pub(crate) fn stop(child: &mut Child) {
    #[cfg(unix)]
    if let Some(group) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
        // Fails only if the whole group has ended by itself.
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

/// The end of a text file on one line; empty if it cannot be read.
fn tail(path: &Path) -> String {
    let read = || -> std::io::Result<Vec<u8>> {
        let mut file = petzval_base::open_file(path)?;
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(length.saturating_sub(SHOWN_BYTES)))?;
        let mut bytes = Vec::new();
        file.take(SHOWN_BYTES).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let text = String::from_utf8_lossy(&read().unwrap_or_default()).into_owned();
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.join(" | ")
}
