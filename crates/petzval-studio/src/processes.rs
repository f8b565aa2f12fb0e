//! Calls as processes of their own: designs that go on when the page or the studio ends.
//!
//! A process is this program with `call - --events`: it reads the call from its standard input, and writes what the job says, one JSON value a line,
//! into a log in the folder of the studio. A run at work is found again by its folder alone.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use petzval_base::write_whole;
use petzval_jobs::{Call, ErrorReport};
use serde_json::{Value, json};

use crate::folder::Folder;
use crate::message::refusal;

/// Folder of the calls and of what they say, in that of the studio.
const LOGS: &str = "studio-jobs";

/// Begins calls as processes.
pub struct Processes {
    /// This program; none where the studio is a part of another one.
    program: Option<PathBuf>,
    folder: Folder,
}

impl Processes {
    pub fn new(program: Option<PathBuf>, folder: Folder) -> Self {
        Self { program, folder }
    }

    /// Begins a call. The answer names the process and its log.
    pub fn begin(&self, call: &Call) -> Result<Value, Box<ErrorReport>> {
        let Some(program) = &self.program else {
            let hint = "call it without `process`, or start the studio by the command `petzval studio`";
            return Err(refusal("this studio begins no processes", hint));
        };
        let failed = |what: &str, error: &dyn std::fmt::Display| {
            refusal(format!("{what}: {error}"), "make room in the folder of the studio, or try again")
        };
        let name = format!("{}-{:08x}", call.job, rand::random::<u32>());
        let text = serde_json::to_string(call).map_err(|error| failed("the call", &error))?;
        let logs = self.folder.path().join(LOGS);
        let log_path = logs.join(format!("{name}.jsonl"));
        let opened = std::fs::create_dir_all(&logs)
            .and_then(|()| write_whole(&logs.join(format!("{name}.json")), text.as_bytes()))
            .and_then(|()| File::create(&log_path));
        let log = opened.map_err(|error| failed(&log_path.display().to_string(), &error))?;
        let mut command = Command::new(program);
        command.args(["call", "-", "--events"]).current_dir(self.folder.path());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(log);
        // Ctrl-C in the terminal of the studio ends the studio alone.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| failed("the process", &error))?;
        if let Some(mut input) = child.stdin.take()
            && let Err(error) = input.write_all(text.as_bytes())
        {
            return Err(failed("the process has ended", &error));
        }
        let process = child.id();
        // Whoever began a process must look how it ended, or the system keeps its number.
        let waiting = std::thread::Builder::new().name("studio process".to_owned());
        let _no_thread = waiting.spawn(move || child.wait());
        Ok(json!({"process": process, "log": format!("{LOGS}/{name}.jsonl")}))
    }
}
