//! Calls as processes of their own: designs that go on when the page or the studio ends.
//!
//! A process is this program with `call - --events`: it reads the call from its standard input, and writes what the job says, one JSON value a line,
//! into a log in the folder of the studio. The last line says how it ended. A run at work is found again by its folder alone.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;

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
        // The name becomes a part of paths: none but that of a job does.
        petzval_units::table().row(&call.job).map_err(|error| Box::new(error.report()))?;
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
            .and_then(|()| File::create(&log_path))
            .and_then(|log| Ok((log.try_clone()?, log)));
        let (log, end_of_log) = opened.map_err(|error| failed(&log_path.display().to_string(), &error))?;
        let mut command = Command::new(program);
        command.args(["call", "-", "--events"]).current_dir(self.folder.path());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(log);
        // Ctrl-C in the terminal of the studio ends the studio alone.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        // Whoever begins a process must look how it ended, or the system keeps its number: the thread for that comes first.
        let (begun, waits) = mpsc::channel();
        let waiting = std::thread::Builder::new().name("studio process".to_owned());
        let thread = waiting.spawn(move || waits.recv().map(|child| note_end(child, end_of_log)));
        thread.map_err(|error| failed("a thread for the process", &error))?;
        let mut child = command.spawn().map_err(|error| failed("the process", &error))?;
        let (process, input) = (child.id(), child.stdin.take());
        let _thread_is_gone = begun.send(child);
        if let Some(mut input) = input
            && let Err(error) = input.write_all(text.as_bytes())
        {
            return Err(failed("the process has ended", &error));
        }
        Ok(json!({"process": process, "log": format!("{LOGS}/{name}.jsonl")}))
    }
}

/// Waits for a process, and writes into its log how it ended: `{"event": "ended", "code": 0}`. A process that was killed has no code.
fn note_end(mut child: Child, mut log: File) {
    let code = child.wait().ok().and_then(|status| status.code());
    // Its last line may be half a line.
    let _no_room = writeln!(log, "\n{}", json!({"event": "ended", "code": code}));
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    /// The processes of a studio whose program is this test: it knows no `--events`, and ends with an error.
    fn processes(folder: &std::path::Path) -> Processes {
        Processes::new(std::env::current_exe().ok(), Folder::new(folder).unwrap())
    }

    #[test]
    fn the_name_of_no_job_begins_nothing_and_makes_no_file() {
        let around = tempfile::tempdir().unwrap();
        let folder = around.path().join("studio");
        std::fs::create_dir(&folder).unwrap();
        for name in ["../../x", "../x", "", "designn", "design/../../x"] {
            let refused = processes(&folder).begin(&Call::new(name, json!({}))).unwrap_err();
            assert!(refused.message.contains(&format!("there is no job `{name}`")), "{refused:?}");
        }
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
        assert_eq!(std::fs::read_dir(around.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_log_says_how_a_process_ended() {
        let folder = tempfile::tempdir().unwrap();
        // The process may have ended before it is given its call: its log is there in any case.
        if let Ok(begun) = processes(folder.path()).begin(&Call::new("lens-list", json!({}))) {
            assert!(begun["process"].as_u64().unwrap() > 0);
            assert!(folder.path().join(begun["log"].as_str().unwrap()).is_file());
        }
        let files = std::fs::read_dir(folder.path().join(LOGS)).unwrap().map(|entry| entry.unwrap().path());
        let mut logs = files.filter(|path| path.extension().is_some_and(|ending| ending == "jsonl"));
        let log = logs.next().unwrap();
        let start = Instant::now();
        loop {
            let text = std::fs::read_to_string(&log).unwrap();
            if let Some(last) = text.lines().last().filter(|line| line.contains("\"ended\"")) {
                let ended: Value = serde_json::from_str(last).unwrap();
                assert!(ended["event"] == "ended" && ended["code"].as_i64().unwrap() != 0, "{text}");
                // What the process said stands before it.
                assert!(text.contains("events"), "{text}");
                return;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "{text}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
