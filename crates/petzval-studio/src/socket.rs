//! The WebSocket of a page: calls come in, events and responses go out.

use std::io::{self, ErrorKind, Read};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use crate::calls::AtWork;
use crate::frames::{self, Heard, ReadError, Reader};
use crate::http::{Answer, Head, head_text, write_within};
use crate::message::{Incoming, Outgoing, Unreadable};
use crate::outbox::Outbox;
use crate::page;
use crate::shared::Shared;

/// Most bytes of a message: a lens of the largest size that is read, and the request around it.
const MOST_MESSAGE: u64 = 20 << 20;

/// Time in which a page must take a message.
const TO_TAKE: Duration = Duration::from_secs(20);

/// Time in which a page must end its connection after the last frame.
const TO_END: Duration = Duration::from_secs(2);

/// How often a page is pinged, and the silence after which it counts as gone.
const PING_EVERY: Duration = Duration::from_secs(15);
const SILENT_FOR: Duration = Duration::from_secs(60);

/// Makes a WebSocket of a request, and serves it until the page goes, or takes nothing any more.
pub fn serve(stream: &TcpStream, number: u64, head: &Head, rest: Vec<u8>, shared: &Shared) -> io::Result<()> {
    let is_upgrade = head.holds("connection", "upgrade") && head.holds("upgrade", "websocket");
    let key = head.one("sec-websocket-key").filter(|_| head.one("sec-websocket-version") == Some("13"));
    let Some(key) = key.filter(|_| is_upgrade) else {
        return Answer::plain("426 Upgrade Required", "this address is for a WebSocket").send(stream, true);
    };
    if !shared.connections.becomes_socket(number) {
        return Answer::plain("503 Service Unavailable", "too many pages are open").send(stream, true);
    }
    let mut headers = page::headers();
    headers.extend([
        ("Upgrade", "websocket".to_owned()),
        ("Connection", "Upgrade".to_owned()),
        ("Sec-WebSocket-Accept", frames::accept(key)),
    ]);
    let head = head_text("101 Switching Protocols", headers.iter());
    write_within(stream, head.as_bytes(), TO_TAKE)?;
    // Small messages go at once.
    stream.set_nodelay(true)?;
    let (page, waiting) = Outbox::new();
    let writing = stream.try_clone()?;
    let writer = std::thread::Builder::new().name("studio answers".to_owned());
    let writer = writer.spawn(move || write(&writing, &waiting))?;
    stream.set_read_timeout(Some(PING_EVERY))?;
    if let Some(end) = hear(Reader::new(stream, rest, MOST_MESSAGE), &page, shared) {
        page.send_frame(end);
        drop(page);
        // The caller ends the connection: only once the frame is written, and what the page still sends is read. A connection that ends with
        // bytes unread takes what it has written with it.
        let _ended = writer.join();
        hear_out(stream);
    }
    Ok(())
}

/// Writes what waits for a page, until its last frame, until the last sender is gone, or until the page takes nothing any more.
fn write(stream: &TcpStream, waiting: &Receiver<Vec<u8>>) {
    for frame in waiting {
        if write_within(stream, &frame, TO_TAKE).is_err() {
            break;
        }
        if frames::is_close(&frame) {
            let _gone = stream.shutdown(Shutdown::Write);
            return;
        }
    }
    // The reader ends as well.
    let _gone = stream.shutdown(Shutdown::Both);
}

/// Reads what a page still sends after the last frame, until it ends the connection or the time is over.
fn hear_out(mut stream: &TcpStream) {
    let begun = Instant::now();
    let mut piece = [0; 16 << 10];
    while let Some(left) = TO_END.checked_sub(begun.elapsed()).filter(|left| !left.is_zero()) {
        let is_timed = stream.set_read_timeout(Some(left)).is_ok();
        if !is_timed || matches!(stream.read(&mut piece), Ok(0) | Err(_)) {
            return;
        }
    }
}

/// Hears a page until it goes. Its calls end with it. Returns the last frame for a page that can still read it.
fn hear(mut reader: Reader<&TcpStream>, page: &Outbox, shared: &Shared) -> Option<Vec<u8>> {
    let at_work = AtWork::default();
    let mut heard = Instant::now();
    loop {
        match reader.hear() {
            Ok(said) => {
                heard = Instant::now();
                match said {
                    Heard::Text(text) => take(&text, &at_work, page, shared),
                    Heard::Ping(payload) => {
                        page.offer(frames::pong(&payload));
                    }
                    Heard::Pong => {}
                    Heard::Close => return Some(frames::close(None)),
                }
            }
            Err(ReadError::Io(error))
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
            {
                if heard.elapsed() > SILENT_FOR {
                    return None;
                }
                page.offer(frames::ping());
            }
            Err(ReadError::Io(_)) => return None,
            Err(ReadError::Wrong(wrong)) => return Some(frames::close(Some(wrong))),
        }
    }
}

/// Takes a message.
fn take(text: &str, at_work: &AtWork, page: &Outbox, shared: &Shared) {
    match Incoming::read(text) {
        Ok(Incoming::Cancel(cancel)) => at_work.cancel(cancel.cancel),
        Ok(Incoming::Call(call)) => {
            let id = call.id;
            if let Err(refused) = shared.calls.begin(call, at_work, &shared.uploads, page) {
                page.send(&Outgoing::Error { id: Some(id), error: &refused }.text());
            }
        }
        Err(Unreadable { id, error }) => page.send(&Outgoing::Error { id, error: &error }.text()),
    }
}
