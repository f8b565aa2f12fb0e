//! What waits for a page: frames, in the order in which they go.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use crate::frames;

/// Frames that wait for a page. Of more, events are left out, and responses wait.
const WAITING: usize = 256;

/// Where the messages for a page go.
#[derive(Clone)]
pub struct Outbox(SyncSender<Vec<u8>>);

impl Outbox {
    /// An outbox, and what waits in it.
    pub fn new() -> (Self, Receiver<Vec<u8>>) {
        let (sender, waiting) = sync_channel(WAITING);
        (Self(sender), waiting)
    }

    /// Sends a message as soon as there is room; a page that is gone takes none.
    pub fn send(&self, text: &str) {
        self.send_frame(frames::text(text));
    }

    /// Sends a frame as soon as there is room.
    pub fn send_frame(&self, frame: Vec<u8>) {
        let _gone = self.0.send(frame);
    }

    /// Sends a frame if there is room.
    pub fn offer(&self, frame: Vec<u8>) {
        let _full_or_gone = self.0.try_send(frame);
    }
}
