//! Work outside Python's lock: its events go to Python, and an interrupt stops it.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use petzval_base::Cancel;
use petzval_jobs::guest::Host;
use petzval_jobs::{Context, Event, JobError, Library, Watcher, built_in_assets, error_in_keys, guarded};
use pyo3::prelude::*;

use crate::error::exception;
use crate::guest::InProcess;
use crate::pool::pool;

/// How often the calling thread looks for interrupts.
const TICK: Duration = Duration::from_millis(50);

/// The built-in files, with their glasses read: that takes longer than most calls.
static LIBRARY: LazyLock<Library> = LazyLock::new(|| {
    let library = built_in_assets();
    // An error comes back where a lens is read.
    let _read = library.catalog();
    library
});

/// A flag that stops work, from any thread.
#[pyclass(frozen, name = "Cancel", module = "petzval._petzval")]
pub struct PyCancel(Cancel);

#[pymethods]
impl PyCancel {
    #[new]
    fn new() -> Self {
        Self(Cancel::default())
    }

    /// Sets the flag; the work stops at its next safe point.
    fn set(&self) {
        self.0.set();
    }

    /// Whether the flag is set.
    fn is_set(&self) -> bool {
        self.0.is_set()
    }
}

/// How work is watched: a function that takes each event as JSON, and a flag that stops it.
#[derive(FromPyObject)]
pub struct Watch<'py>(Option<Bound<'py, PyAny>>, Option<Bound<'py, PyCancel>>);

/// Sends events to the thread that called.
struct Events(Sender<Event>);

impl Watcher for Events {
    fn event(&self, event: &Event) {
        // Nobody listens any more once the caller has failed.
        let _nobody = self.0.send(event.clone());
    }
}

/// Does work on the threads of this process without Python's lock.
///
/// The calling thread passes events on and looks for interrupts twenty times a second. An exception of either stops the work at its next safe
/// point, and is raised when it has stopped.
pub fn watched<T: Send>(
    py: Python<'_>,
    watch: &Watch<'_>,
    work: impl FnOnce(&Context) -> Result<T, JobError> + Send,
) -> PyResult<T> {
    let Watch(listener, flag) = watch;
    let cancel = flag.as_ref().map(|flag| flag.get().0.clone()).unwrap_or_default();
    let (sender, mut events) = channel();
    let said = Events(sender.clone());
    let said = Arc::new(move |line: &str| said.event(&Event::note(line)));
    // Messages name keys of requests in place of flags of the command.
    let context = Context::new(LIBRARY.clone(), Arc::new(Events(sender)));
    let context = context.with_cancellation(cancel.clone()).in_keys();
    let context =
        context.with_guests(Arc::new(move |_| -> Arc<dyn Host> { Arc::new(InProcess::new(said.clone())) }));
    // A class of the user works on a thread of the pool: what it calls has to be done there.
    if rayon::current_thread_index().is_some() {
        let done = py.detach(|| guarded("petzval", || work(&context)));
        return done.map_err(|error| exception(py, &error));
    }
    let (done, raised) = std::thread::scope(|scope| {
        let worker = scope
            .spawn(move || pool().and_then(|pool| guarded("petzval", || pool.install(|| work(&context)))));
        let raised = listen(py, &mut events, listener.as_ref(), &cancel, &|| worker.is_finished());
        (py.detach(|| worker.join()), raised)
    });
    match (raised, done) {
        (Some(raised), _) => Err(raised),
        (None, Ok(done)) => done.map_err(|error| exception(py, &error_in_keys(error))),
        (None, Err(panic)) => std::panic::resume_unwind(panic),
    }
}

/// Passes events on until the work has ended. Returns the exception that stopped it.
fn listen(
    py: Python<'_>,
    events: &mut Receiver<Event>,
    listener: Option<&Bound<'_, PyAny>>,
    cancel: &Cancel,
    is_done: &dyn Fn() -> bool,
) -> Option<PyErr> {
    let mut raised = None;
    loop {
        // The receiver itself goes along: it may move between threads, and is not shared.
        let waiting = &mut *events;
        let event = py.detach(move || waiting.recv_timeout(TICK));
        let event = match event {
            Ok(event) => Some(event),
            // The result of the work may keep the sender alive. All events precede the end of the work.
            Err(RecvTimeoutError::Timeout) if is_done() => match events.try_recv() {
                Ok(event) => Some(event),
                Err(_) => return raised,
            },
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return raised,
        };
        if raised.is_none()
            && let Err(error) = heard(py, event, listener)
        {
            cancel.set();
            raised = Some(error);
        }
    }
}

fn heard(py: Python<'_>, event: Option<Event>, listener: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    if let (Some(event), Some(listener)) = (event, listener) {
        let json =
            serde_json::to_string(&event).map_err(|e| exception(py, &JobError::failed(e.to_string())))?;
        listener.call1((json,))?;
    }
    py.check_signals()
}
