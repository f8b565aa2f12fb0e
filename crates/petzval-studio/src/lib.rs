//! The studio: one page in the browser that shows a camera while one changes it.
//!
//! It is a door to the table of jobs ([`petzval_units::table`]) and holds no optics: the page sends calls over one WebSocket, and gets events and
//! responses back. The server listens on this machine alone. It lets in those who know the token of this start, checks the host and the origin of
//! every request, and keeps paths of requests inside one folder. Sizes, connections and times are limited.
//!
//! Jobs run on threads of their own, never on those of the server. A *live* call belongs to a channel with one call in flight: the page keeps the
//! newest state of what is being dragged, and sends it when the last answer is there, so that nothing queues.

mod accept;
mod calls;
mod connections;
mod files;
mod folder;
mod frames;
mod gate;
mod http;
mod message;
mod opened;
mod outbox;
mod page;
mod processes;
mod routes;
mod shared;
mod socket;
mod uploads;

use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use petzval_base::Cancel;
use petzval_jobs::{Context, JobError};

use calls::Calls;
use connections::Connections;
use folder::Folder;
use gate::Gate;
use processes::Processes;
use shared::Shared;
use uploads::Uploads;

/// The port that is taken unless another one is named; if it is not free, any that is.
pub const PORT: u16 = 8710;

/// The folder unless another one is named: the current one. A run or an experiment outside of it brings its own.
const FOLDER: &str = ".";

/// What a studio serves.
pub struct Settings {
    /// Port; 0 takes any that is free. `None` takes [`PORT`] if it is free.
    pub port: Option<u16>,
    /// The folder in which the studio reads and writes; the current one if none is named, or that of the run that is opened. It becomes the
    /// current folder of the process.
    pub folder: Option<PathBuf>,
    /// What to open: lenses and experiments, by built-in name or path, and folders of runs and sweeps.
    pub open: Vec<String>,
    /// The program that makes calls in processes of their own by the verb `call`; without one the studio begins no processes.
    pub program: Option<PathBuf>,
    /// The library of the jobs. Its watcher gets the warnings of the lenses that are opened.
    pub context: Context,
}

/// Why a studio does not start, or ends.
#[derive(Debug, thiserror::Error)]
pub enum StudioError {
    /// What is to be opened cannot be.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The folder cannot be used.
    #[error("{}: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The port cannot be had.
    #[error("port {port}: {source}")]
    Port {
        /// The port.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
    /// The system refuses a thread, a file or a random number.
    #[error("{0}")]
    System(#[from] std::io::Error),
}

/// A studio that is being served.
pub struct Studio {
    address: SocketAddr,
    token: String,
    server: Option<std::thread::JoinHandle<()>>,
    shared: Arc<Shared>,
}

impl Studio {
    /// Opens what is to be opened, and begins to serve it on a thread of its own.
    pub fn start(settings: Settings) -> Result<Self, StudioError> {
        // Names are relative to the folder in which the command was called.
        let opening = opened::open(&settings.open, &settings.context)?;
        let wrong = |folder: &Path| {
            let folder = folder.to_path_buf();
            move |source| StudioError::Folder { folder, source }
        };
        let named = settings.folder.as_deref();
        let current = Folder::new(named.unwrap_or(Path::new(FOLDER)));
        let mut folder = current.map_err(wrong(named.unwrap_or(Path::new(FOLDER))))?;
        if let Some(outside) = opening.outside(folder.path()) {
            if named.is_some() {
                let message =
                    format!("{}: this lies outside of {}", outside.display(), folder.path().display());
                return Err(JobError::input(message, "name a folder with --folder that holds it").into());
            }
            let around = opening.folder().unwrap_or(outside);
            folder = Folder::new(around).map_err(wrong(around))?;
        }
        let (opened, first) = opening.seen_from(folder.path());
        std::env::set_current_dir(folder.path()).map_err(wrong(folder.path()))?;
        let listener = listen(settings.port)?;
        let address = listener.local_addr()?;
        let gate = Gate::new(address);
        let token = gate.token().to_owned();
        let processes = Processes::new(settings.program, folder.clone());
        let calls = Calls::new(settings.context, folder.clone(), processes)?;
        let (uploads, connections) = (Uploads::new()?, Connections::default());
        let shared = Arc::new(Shared { gate, calls, folder, opened, first, uploads, connections });
        let served = shared.clone();
        let serve = move || accept::serve(&listener, &served);
        let server = std::thread::Builder::new().name("studio".to_owned()).spawn(serve)?;
        Ok(Self { address, token, server: Some(server), shared })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The token of this start.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// The address for the browser of whoever started it.
    pub fn url(&self) -> String {
        format!("http://{}/?token={}", self.address, self.token)
    }

    /// Opens the page in the browser of this machine. The token stands in a file that only this user can read, not in the words of a process.
    pub fn open_in_browser(&self) -> std::io::Result<()> {
        let url = self.url();
        let text = format!(
            "<!doctype html><title>Petzval studio</title><meta http-equiv=\"refresh\" content=\"0;url={url}\">"
        );
        let path = self.shared.uploads.folder().join("open.html");
        petzval_base::write_whole(&path, text.as_bytes())?;
        let words: &[&str] = match std::env::consts::OS {
            "macos" => &["open"],
            "windows" => &["cmd", "/C", "start", ""],
            _ => &["xdg-open"],
        };
        let mut browser = Command::new(words[0]);
        browser.args(&words[1..]).arg(path).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        browser.spawn().map(|_| ())
    }

    /// Serves until the flag is set.
    pub fn wait(self, stop: &Cancel) {
        let ended = || self.server.as_ref().is_none_or(std::thread::JoinHandle::is_finished);
        while !stop.is_set() && !ended() {
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        self.shared.connections.stop();
        // The server looks at the stop when the next connection comes.
        let _refused = TcpStream::connect(self.address);
        if let Some(server) = self.server.take() {
            let _panicked = server.join();
        }
    }
}

/// A listener on this machine alone.
fn listen(port: Option<u16>) -> Result<TcpListener, StudioError> {
    let at = |port: u16| TcpListener::bind((Ipv4Addr::LOCALHOST, port));
    let found = match port {
        Some(port) => at(port).map_err(|source| (port, source)),
        None => at(PORT).or_else(|_| at(0)).map_err(|source| (0, source)),
    };
    found.map_err(|(port, source)| StudioError::Port { port, source })
}
