//! The WebSocket of a page: calls come in, events and responses go out.

use std::io::{self, ErrorKind};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use crate::calls::AtWork;
use crate::frames::{self, Heard, ReadError, Reader};
use crate::http::{Answer, Head, head_text, write_within};
use crate::message::{Incoming, Outgoing, refusal};
use crate::outbox::Outbox;
use crate::page;
use crate::shared::Shared;

/// Most bytes of a message: a lens of the largest size that is read, and the request around it.
const MOST_MESSAGE: u64 = 20 << 20;

/// Time in which a page must take a message.
const TO_TAKE: Duration = Duration::from_secs(20);

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
    writer.spawn(move || write(&writing, &waiting))?;
    stream.set_read_timeout(Some(PING_EVERY))?;
    hear(Reader::new(stream, rest, MOST_MESSAGE), &page, shared);
    Ok(())
}

/// Writes what waits for a page, until the last sender is gone or the page takes nothing any more.
fn write(stream: &TcpStream, waiting: &Receiver<Vec<u8>>) {
    for frame in waiting {
        if write_within(stream, &frame, TO_TAKE).is_err() {
            break;
        }
    }
    // The reader ends as well.
    let _gone = stream.shutdown(Shutdown::Both);
}

/// Hears a page until it goes. Its calls end with it.
fn hear(mut reader: Reader<&TcpStream>, page: &Outbox, shared: &Shared) {
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
                    Heard::Close => {
                        page.offer(frames::close(None));
                        return;
                    }
                }
            }
            Err(ReadError::Io(error))
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
            {
                if heard.elapsed() > SILENT_FOR {
                    return;
                }
                page.offer(frames::ping());
            }
            Err(ReadError::Io(_)) => return,
            Err(ReadError::Wrong(wrong)) => {
                page.offer(frames::close(Some(wrong)));
                return;
            }
        }
    }
}

/// Takes a message.
fn take(text: &str, at_work: &AtWork, page: &Outbox, shared: &Shared) {
    match serde_json::from_str(text) {
        Ok(Incoming::Cancel(cancel)) => at_work.cancel(cancel.cancel),
        Ok(Incoming::Call(call)) => {
            let id = call.id;
            if let Err(refused) = shared.calls.begin(call, at_work, &shared.uploads, page) {
                page.send(&Outgoing::Error { id: Some(id), error: &refused }.text());
            }
        }
        Err(error) => {
            let hint =
                "a message is {\"id\": NUMBER, \"job\": NAME, \"request\": {...}} or {\"cancel\": NUMBER}";
            let refused = refusal(format!("message: {error}"), hint);
            page.send(&Outgoing::Error { id: None, error: &refused }.text());
        }
    }
}
