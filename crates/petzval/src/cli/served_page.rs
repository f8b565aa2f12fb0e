//! A page that grows, for a browser on this machine.
//!
//! Each reader has a thread and little time: a slow reader delays no other. Only requests that name this machine as their host are
//! answered, so that a page from elsewhere cannot read the run through its reader's browser.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use crate::cli::code::Code;
use crate::jobs::JobError;

use super::failure::Failure;
use super::output;

/// Port of the page unless another one is named.
pub const PORT: u16 = 8700;

/// Most bytes of a request's head: a browser sends about a thousand.
const MOST_HEAD: usize = 16 << 10;

/// Most headers of a request.
const MOST_HEADERS: usize = 64;

/// Most readers at one time; further ones get status 503.
const MOST_READERS: usize = 32;

/// Time in which a reader must send its request.
const TO_REQUEST: Duration = Duration::from_secs(5);

/// Time in which a reader has to take the page, of a few megabytes.
const TO_READ: Duration = Duration::from_secs(60);

/// Bytes of the page that are sent at once; the time that is left is looked at between two pieces.
const PIECE: usize = 64 << 10;

/// A request for the page; it goes back as HTML, or as what is wrong.
type Request = mpsc::Sender<Result<String, String>>;

/// Answers every request for `/` with the page as it then is, until a signal ends the process. Other machines cannot reach it.
pub fn serve(port: u16, page: impl Fn() -> Result<String, JobError>) -> Result<Code, Failure> {
    let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
    let (listener, address) = bound.and_then(|l| l.local_addr().map(|a| (l, a))).map_err(|error| {
        Failure::input(
            format!("port {port}: {error}"),
            "choose another with --port; 0 takes any that is free",
        )
    })?;
    outln!("http://{address}/ shows the run as it grows; Ctrl-C ends this, and not the run");
    if output::is_lost() {
        return Ok(Code::SUCCESS);
    }
    let (requests, received) = mpsc::channel::<Request>();
    std::thread::spawn(move || accept(&listener, &requests));
    // One page is made at a time: many readers need no more memory than one.
    for reader in received {
        let _gone = reader.send(page().map_err(|error| error.to_string()));
    }
    Ok(Code::SUCCESS)
}

/// Gives each reader a thread.
fn accept(listener: &TcpListener, requests: &mpsc::Sender<Request>) {
    let readers = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        let Ok(stream) = stream else {
            // No descriptor may be free for the moment.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        let (counted, requests) = (readers.clone(), requests.clone());
        let is_full = readers.fetch_add(1, Ordering::Relaxed) >= MOST_READERS;
        let answering = move || {
            // A browser that has gone meanwhile is no failure.
            let _gone =
                if is_full { send(&stream, &Answer::busy(), true) } else { answer(&stream, &requests) };
            counted.fetch_sub(1, Ordering::Relaxed);
        };
        if std::thread::Builder::new().spawn(answering).is_err() {
            readers.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

/// What a reader gets.
struct Answer {
    status: &'static str,
    kind: &'static str,
    text: String,
}

impl Answer {
    fn plain(status: &'static str, text: impl Into<String>) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", text: text.into() }
    }

    fn busy() -> Self {
        Self::plain("503 Service Unavailable", "too many readers at once; try again")
    }
}

/// Reads a request and answers it.
fn answer(stream: &TcpStream, requests: &mpsc::Sender<Request>) -> io::Result<()> {
    let head = match head(stream) {
        Ok(head) => head,
        Err(error) if error.kind() == ErrorKind::FileTooLarge => {
            return send(
                stream,
                &Answer::plain("431 Request Header Fields Too Large", error.to_string()),
                true,
            );
        }
        Err(error) => return Err(error),
    };
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    let is_whole = request.parse(&head).is_ok_and(|status| status.is_complete());
    let answer = match (request.method, request.path) {
        _ if !is_whole => Answer::plain("400 Bad Request", "this is no request for a page"),
        _ if !is_for_this_machine(request.headers) => {
            Answer::plain("403 Forbidden", "this page is for localhost alone; the request names another host")
        }
        (Some("GET" | "HEAD"), Some("/")) => match page(requests) {
            Ok(page) => Answer { status: "200 OK", kind: "text/html; charset=utf-8", text: page },
            Err(error) => Answer::plain("500 Internal Server Error", error),
        },
        (Some("GET" | "HEAD"), _) => Answer::plain("404 Not Found", "the page is at /"),
        _ => Answer::plain("405 Method Not Allowed", "the page can only be read"),
    };
    send(stream, &answer, request.method != Some("HEAD"))
}

/// Requests the page, and waits for it.
fn page(requests: &mpsc::Sender<Request>) -> Result<String, String> {
    let (reader, page) = mpsc::channel();
    let ended = || "the page is no longer made".to_owned();
    requests.send(reader).map_err(|_| ended())?;
    page.recv().map_err(|_| ended())?
}

/// The head of a request, up to its empty line. Fails if it is too long, or not there in time.
fn head(mut stream: &TcpStream) -> io::Result<Vec<u8>> {
    let (start, mut head, mut piece) = (Instant::now(), Vec::new(), [0; 1024]);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        if head.len() > MOST_HEAD {
            return Err(io::Error::new(ErrorKind::FileTooLarge, "the head of the request is too long"));
        }
        stream.set_read_timeout(Some(left(start, TO_REQUEST)?))?;
        match stream.read(&mut piece)? {
            0 => return Err(ErrorKind::UnexpectedEof.into()),
            read => head.extend(&piece[..read]),
        }
    }
    Ok(head)
}

/// Whether the one host of a request is this machine, under whatever port: it may be forwarded from another.
fn is_for_this_machine(headers: &[httparse::Header]) -> bool {
    let mut hosts = headers.iter().filter(|header| header.name.eq_ignore_ascii_case("host"));
    let (Some(host), None) = (hosts.next(), hosts.next()) else { return false };
    let host = String::from_utf8_lossy(host.value);
    let host = host.trim();
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|digit| digit.is_ascii_digit()) => name,
        _ => host,
    };
    ["127.0.0.1", "localhost", "[::1]"].iter().any(|own| name.eq_ignore_ascii_case(own))
}

/// Sends an answer, and ends the connection. Fails if it is not taken in time.
fn send(mut stream: &TcpStream, answer: &Answer, has_body: bool) -> io::Result<()> {
    let start = Instant::now();
    let Answer { status, kind, text } = answer;
    let length = text.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n"
    );
    let body = if has_body { text.as_bytes() } else { &[] };
    for piece in [head.as_bytes()].into_iter().chain(body.chunks(PIECE)) {
        let mut rest = piece;
        while !rest.is_empty() {
            stream.set_write_timeout(Some(left(start, TO_READ)?))?;
            match stream.write(rest)? {
                0 => return Err(ErrorKind::WriteZero.into()),
                written => rest = &rest[written..],
            }
        }
    }
    stream.shutdown(Shutdown::Write)?;
    // What the reader still sends is read, or the answer could be lost with the connection.
    stream.set_read_timeout(Some(Duration::from_secs(1)))?;
    let (mut piece, end) = ([0; 1024], Instant::now());
    while end.elapsed() < Duration::from_secs(1) && stream.read(&mut piece)? > 0 {}
    Ok(())
}

/// What is left of a time; fails once it is over.
fn left(start: Instant, limit: Duration) -> io::Result<Duration> {
    let left = limit.saturating_sub(start.elapsed());
    if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
}

#[cfg(test)]
mod tests {
    use super::is_for_this_machine;

    #[test]
    fn only_this_machine_is_answered_under_any_port() {
        let is_own = |values: &[&str]| {
            let header = |value| httparse::Header { name: "Host", value: str::as_bytes(value) };
            is_for_this_machine(&values.iter().copied().map(header).collect::<Vec<_>>())
        };
        for own in ["127.0.0.1:8700", "localhost", "LocalHost:80", "[::1]:9000", "127.0.0.1"] {
            assert!(is_own(&[own]), "{own}");
        }
        for foreign in [
            "example.org",
            "example.org:8700",
            "127.0.0.1.example.org",
            "localhost.example.org:8700",
            "",
            "0.0.0.0:8700",
            "[::1",
        ] {
            assert!(!is_own(&[foreign]), "{foreign}");
        }
        assert!(!is_own(&[]) && !is_own(&["localhost", "example.org"]));
    }
}
