//! Classes of a user in Python, in a process of their own: a worker for each run, which ends with it or with this process.
//!
//! | part | holds |
//! |---|---|
//! | [`Workers`] | the host: it starts the worker when the first object is made |
//! | `message` | how requests and answers stand in the pipes |
//! | `worker` | the process, its channel, and what it prints |

mod message;
#[cfg(test)]
mod tests;
mod worker;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use petzval_base::Cancel;
use serde_json::{Map, Value, json};

use self::worker::Worker;

pub use self::message::read_answer;
pub use self::worker::Said;
pub use petzval_learn::guest::{Answer, Array, Call, Guest, GuestError, Host, Role};

/// The host of one run's classes: a process that is started when the first object is made.
pub struct Workers {
    /// Longest time of a call.
    timeout: Duration,
    cancel: Cancel,
    said: Said,
    state: Mutex<State>,
}

/// The process, and how many objects it has made.
#[derive(Default)]
struct State {
    worker: Option<Arc<Worker>>,
    made: u64,
}

impl Workers {
    /// A host whose calls take at most so many seconds, and end once the job is cancelled.
    pub fn new(timeout_s: f64, cancel: Cancel, said: Said) -> Self {
        Self { timeout: Duration::from_secs_f64(timeout_s), cancel, said, state: Mutex::default() }
    }

    /// The process, and the number of the next object.
    fn worker(&self) -> Result<(Arc<Worker>, u64), GuestError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let worker = match &state.worker {
            Some(worker) => worker.clone(),
            None => Arc::new(Worker::start(self.timeout, self.cancel.clone(), self.said.clone())?),
        };
        state.worker = Some(worker.clone());
        state.made += 1;
        Ok((worker, state.made))
    }
}

impl Host for Workers {
    fn make(
        &self,
        class: &str,
        role: Role,
        arguments: &Map<String, Value>,
    ) -> Result<(Arc<dyn Guest>, Value), GuestError> {
        let (worker, id) = self.worker()?;
        let header = json!({"verb": "make", "id": id, "class": class, "role": role, "arguments": arguments});
        let answer = worker.request(&header, class, &Call { method: "__init__", ..Call::default() })?;
        let guest = InWorker { worker, id, class: class.to_owned() };
        Ok((Arc::new(guest), answer.value))
    }
}

/// An object in the process.
struct InWorker {
    worker: Arc<Worker>,
    id: u64,
    class: String,
}

impl Guest for InWorker {
    fn call(&self, call: &Call) -> Result<Answer, GuestError> {
        let header = json!({"verb": "call", "id": self.id, "method": call.method, "number": call.number});
        self.worker.request(&header, &self.class, call)
    }
}

impl Drop for InWorker {
    fn drop(&mut self) {
        self.worker.notify(&json!({"verb": "forget", "id": self.id}));
    }
}
