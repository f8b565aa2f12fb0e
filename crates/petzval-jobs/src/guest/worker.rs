//! The process of a worker: it is started with the text of `_worker.py`, takes one request at a time, and is ended with all that it has started.

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use petzval_base::Cancel;
use petzval_learn::guest::{Answer, Call, GuestError};
use serde_json::Value;

use super::message::{self, AnswerHeader};
use crate::named_isp::external::process::stop;
use crate::named_isp::external::workplace::Workplace;
use crate::temporary_folder::TemporaryFolder;

/// Receives each line that classes print, and the traceback of each exception of theirs.
pub type Said = Arc<dyn Fn(&str) + Send + Sync>;

/// What the process runs: a link to the file of the Python package, which runs it for classes in its own process. A published crate holds the file.
pub(super) const SOURCE: &str = include_str!("worker.py");

/// Reads as much text from standard input as its argument says, and runs it. The folder of the run is not on its path yet.
const BOOT: &str = "\
import sys
sys.path[:] = [place for place in sys.path if place]
import os
count, text = int(sys.argv[1]), b''
while len(text) < count:
    more = os.read(0, count - len(text))
    if not more:
        sys.exit('Petzval has ended')
    text += more
space = {'__name__': 'petzval_worker'}
exec(compile(text, 'petzval/_worker.py', 'exec'), space)
space['main']()
";

/// The version of the channel.
const PROTOCOL: u64 = 1;

/// Names the interpreter.
const INTERPRETER: &str = "PETZVAL_PYTHON";

/// How often a waiting call looks whether the job is cancelled.
const TICK: Duration = Duration::from_millis(20);

/// How long a call may go on after the job is cancelled: a step that ends leaves a checkpoint.
const GRACE: Duration = Duration::from_secs(10);

/// How long a worker may take to start, and to end.
const START: Duration = Duration::from_secs(120);
const END: Duration = Duration::from_secs(2);

/// Last lines of standard error that an error shows.
const SHOWN_LINES: usize = 8;

/// A worker.
pub(super) struct Worker {
    channel: Mutex<Channel>,
    child: Mutex<Child>,
    lines: Arc<Mutex<VecDeque<String>>>,
    timeout: Duration,
    cancel: Cancel,
    said: Said,
    /// Ends the process if this one dies. Dropped last.
    workplace: Workplace,
}

/// The pipes; without them the worker is of no more use.
struct Channel {
    requests: Option<ChildStdin>,
    answers: Receiver<io::Result<(AnswerHeader, Vec<u8>)>>,
}

/// Why no answer came.
enum NoAnswer {
    /// The pipe is at its end, or damaged.
    Ended(String),
    TimedOut,
    Cancelled,
}

impl Worker {
    /// Starts a worker with the interpreter of `PETZVAL_PYTHON`, or the first `python3`.
    pub fn start(timeout: Duration, cancel: Cancel, said: Said) -> Result<Self, GuestError> {
        let usual = if cfg!(windows) { "python" } else { "python3" };
        let interpreter = std::env::var_os(INTERPRETER).filter(|name| !name.is_empty());
        let interpreter = interpreter.unwrap_or_else(|| usual.into());
        let mut command = Command::new(&interpreter);
        command.args(["-c", BOOT]).arg(SOURCE.len().to_string());
        Self::run(command, SOURCE, timeout, cancel, said).map_err(|error| match error {
            stopped @ GuestError::Stopped(_) => stopped,
            other => GuestError::Unusable {
                message: format!("{}: {other}", Path::new(&interpreter).display()),
                hint: format!("{INTERPRETER} names an interpreter of Python 3.11 or newer that has NumPy"),
            },
        })
    }

    /// Starts a command that is given a text and then serves requests.
    pub fn run(
        mut command: Command,
        text: &str,
        timeout: Duration,
        cancel: Cancel,
        said: Said,
    ) -> Result<Self, GuestError> {
        let system = |error: io::Error| GuestError::Gone(format!("cannot be started: {error}"));
        TemporaryFolder::sweep_left();
        let workplace = Workplace::new().map_err(system)?;
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A group of its own: an interrupt of the terminal is for the job, and an end reaches what the worker has started.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(system)?;
        let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let group = child.id();
        let (sender, answers) = channel();
        let lines = Arc::new(Mutex::new(VecDeque::new()));
        let worker = Self {
            channel: Mutex::new(Channel { requests: stdin, answers }),
            child: Mutex::new(child),
            lines: lines.clone(),
            timeout,
            cancel,
            said: said.clone(),
            workplace,
        };
        worker.workplace.begins(group).map_err(system)?;
        if let Some(stdout) = stdout {
            thread::spawn(move || {
                let mut stdout = BufReader::new(stdout);
                while let Some(answer) = message::read(&mut stdout).transpose() {
                    let is_last = answer.is_err();
                    if sender.send(answer).is_err() || is_last {
                        break;
                    }
                }
            });
        }
        if let Some(stderr) = stderr {
            thread::spawn(move || {
                for line in BufReader::new(stderr).split(b'\n').map_while(Result::ok) {
                    let line = String::from_utf8_lossy(&line).trim_end().to_owned();
                    let mut last = lines.lock().unwrap_or_else(PoisonError::into_inner);
                    last.push_back(line.clone());
                    if last.len() > SHOWN_LINES {
                        last.pop_front();
                    }
                    drop(last);
                    if !line.is_empty() {
                        said(&line);
                    }
                }
            });
        }
        worker.greet(text)?;
        Ok(worker)
    }

    /// Gives the process its text, and waits until it is ready.
    fn greet(&self, text: &str) -> Result<(), GuestError> {
        let mut channel = self.channel.lock().unwrap_or_else(PoisonError::into_inner);
        let written = match &mut channel.requests {
            Some(pipe) => pipe.write_all(text.as_bytes()).map_err(|e| NoAnswer::Ended(e.to_string())),
            None => Err(NoAnswer::Ended("no pipe".to_owned())),
        };
        let greeting = written.and_then(|()| self.wait(&channel, START));
        let (header, body) = greeting.map_err(|why| self.lost(&mut channel, why, "the worker", START))?;
        let value = message::answer(header, &body).map_err(GuestError::Gone)?.value;
        match value["protocol"].as_u64() {
            Some(PROTOCOL) => Ok(()),
            other => {
                Err(GuestError::Gone(format!("speaks version {other:?} of the channel, not {PROTOCOL}")))
            }
        }
    }

    /// Sends a request and waits for its answer.
    pub fn request(&self, header: &Value, class: &str, call: &Call) -> Result<Answer, GuestError> {
        let mut channel = self.channel.lock().unwrap_or_else(PoisonError::into_inner);
        let name = format!("`{class}.{}`", call.method);
        let Some(pipe) = &mut channel.requests else {
            return Err(GuestError::Gone(format!("{name}: its Python process has ended before")));
        };
        let written = message::write(pipe, header, &call.arrays, call.bytes.unwrap_or_default());
        let answer = written
            .map_err(|error| NoAnswer::Ended(error.to_string()))
            .and_then(|()| self.wait(&channel, self.timeout));
        let (header, body) = answer.map_err(|why| self.lost(&mut channel, why, &name, self.timeout))?;
        let header = header.checked(class, call.method, &*self.said)?;
        message::answer(header, &body).map_err(|problem| GuestError::Gone(format!("{name}: {problem}")))
    }

    /// Sends a request that has no answer. A worker that has ended needs none.
    pub fn notify(&self, header: &Value) {
        let mut channel = self.channel.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipe) = &mut channel.requests {
            let _ended = message::write(pipe, header, &[], &[]);
        }
    }

    fn wait(&self, channel: &Channel, limit: Duration) -> Result<(AnswerHeader, Vec<u8>), NoAnswer> {
        let start = Instant::now();
        let mut cancelled: Option<Instant> = None;
        loop {
            match channel.answers.recv_timeout(TICK) {
                Ok(Ok(answer)) => return Ok(answer),
                Ok(Err(error)) => return Err(NoAnswer::Ended(error.to_string())),
                Err(RecvTimeoutError::Disconnected) => return Err(NoAnswer::Ended(String::new())),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if self.cancel.is_set() && cancelled.get_or_insert_with(Instant::now).elapsed() > GRACE {
                return Err(NoAnswer::Cancelled);
            }
            if start.elapsed() > limit {
                return Err(NoAnswer::TimedOut);
            }
        }
    }

    /// Ends the process, which is of no more use, and says what it printed last.
    fn lost(&self, channel: &mut Channel, why: NoAnswer, name: &str, limit: Duration) -> GuestError {
        channel.requests = None;
        let mut child = self.child.lock().unwrap_or_else(PoisonError::into_inner);
        let message = match why {
            NoAnswer::Cancelled => {
                stop(&mut child);
                return GuestError::Stopped(name.trim_matches('`').to_owned());
            }
            NoAnswer::TimedOut => {
                stop(&mut child);
                format!("{name}: no answer within {} s; its Python process was ended", limit.as_secs_f64())
            }
            NoAnswer::Ended(problem) => {
                let status = ended_within(&mut child, END).unwrap_or_else(|| "not by itself".to_owned());
                stop(&mut child);
                let problem = if problem.is_empty() { problem } else { format!(", {problem}") };
                format!("{name}: its Python process has ended ({status}{problem})")
            }
        };
        // What it printed last may still be in the pipe.
        thread::sleep(Duration::from_millis(100));
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        let lines: Vec<&str> = lines.iter().map(|line| line.trim()).filter(|line| !line.is_empty()).collect();
        GuestError::Gone(match &lines[..] {
            [] => message,
            lines => format!("{message}; it wrote: {}", lines.join(" | ")),
        })
    }
}

/// How a process has ended within a time.
fn ended_within(child: &mut Child, limit: Duration) -> Option<String> {
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status.to_string()),
            Ok(None) if start.elapsed() < limit => thread::sleep(Duration::from_millis(10)),
            _ => return None,
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The end of its requests is the end of the worker.
        let channel = self.channel.get_mut().unwrap_or_else(PoisonError::into_inner);
        if channel.requests.take().is_some() {
            let child = self.child.get_mut().unwrap_or_else(PoisonError::into_inner);
            ended_within(child, END);
            stop(child);
        }
    }
}
