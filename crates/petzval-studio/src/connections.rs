//! The connections that are open: how many there may be, and which one goes first.

use std::collections::VecDeque;
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Most connections that are no sockets of pages. For a further one the oldest ends: those who only hold connections keep nobody out.
const MOST: usize = 128;

/// Most sockets of pages: tabs of one person.
const MOST_SOCKETS: usize = 32;

/// The connections that are open, the oldest first.
#[derive(Default)]
pub struct Connections {
    open: Mutex<VecDeque<Connection>>,
    is_stopped: AtomicBool,
}

struct Connection {
    number: u64,
    stream: TcpStream,
    is_socket: bool,
}

impl Connections {
    /// Adds a connection; ends the oldest one if there are too many.
    pub fn add(&self, number: u64, stream: &TcpStream) -> std::io::Result<()> {
        let stream = stream.try_clone()?;
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        while open.iter().filter(|c| !c.is_socket).count() >= MOST {
            let oldest = open.iter().position(|c| !c.is_socket).and_then(|at| open.remove(at));
            if let Some(oldest) = oldest {
                let _gone = oldest.stream.shutdown(Shutdown::Both);
            }
        }
        open.push_back(Connection { number, stream, is_socket: false });
        Ok(())
    }

    /// Forgets a connection that has ended.
    pub fn remove(&self, number: u64) {
        self.open.lock().unwrap_or_else(PoisonError::into_inner).retain(|c| c.number != number);
    }

    /// Makes a socket of a connection; false if there are too many.
    pub fn becomes_socket(&self, number: u64) -> bool {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let is_full = open.iter().filter(|c| c.is_socket).count() >= MOST_SOCKETS;
        match open.iter_mut().find(|c| c.number == number) {
            Some(connection) if !is_full => {
                connection.is_socket = true;
                true
            }
            _ => false,
        }
    }

    /// Whether no further connection is taken.
    pub fn are_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    /// Ends all of them; no further one is taken.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
        let open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        open.iter().for_each(|connection| {
            let _gone = connection.stream.shutdown(Shutdown::Both);
        });
    }
}
