//! Requests and answers: one a connection, each within its time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Most bytes of a request's head: a browser sends about a thousand.
const MOST_HEAD: usize = 16 << 10;

/// Most headers of a request.
const MOST_HEADERS: usize = 64;

/// Time in which the head of a request must arrive.
const TO_REQUEST: Duration = Duration::from_secs(5);

/// Time in which an answer must be taken.
const TO_READ: Duration = Duration::from_secs(60);

/// Bytes that are sent or read at once; the time that is left is looked at between two pieces.
const PIECE: usize = 64 << 10;

/// The head of a request.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Head {
    pub method: String,
    /// The path without the query.
    pub path: String,
    /// What stands behind the question mark.
    pub query: String,
    /// Names in lower case, and values.
    headers: Vec<(String, String)>,
}

impl Head {
    /// A request for a path with these headers.
    #[cfg(test)]
    pub fn of(target: &str, headers: &[(&str, &str)]) -> Self {
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let headers = headers.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        Self { method: "GET".to_owned(), path: path.to_owned(), query: query.to_owned(), headers }
    }

    /// The values of a header, whose name is in lower case.
    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        self.headers.iter().filter(move |(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The value of a header that may stand there once.
    pub fn one<'a>(&'a self, name: &'a str) -> Option<&'a str> {
        let mut all = self.all(name);
        let first = all.next()?;
        all.next().is_none().then_some(first)
    }

    /// Whether a header holds a word, among others that are separated by commas.
    pub fn holds(&self, name: &str, word: &str) -> bool {
        self.all(name).flat_map(|value| value.split(',')).any(|part| part.trim().eq_ignore_ascii_case(word))
    }
}

/// What is answered.
#[derive(Clone, Debug)]
pub struct Answer {
    pub status: &'static str,
    pub headers: Vec<(&'static str, String)>,
    pub body: Vec<u8>,
}

impl Answer {
    /// A line of text.
    pub fn plain(status: &'static str, text: impl Into<String>) -> Self {
        let kind = ("Content-Type", "text/plain; charset=utf-8".to_owned());
        Self { status, headers: vec![kind], body: (text.into() + "\n").into_bytes() }
    }

    /// A value as JSON.
    pub fn json(value: &serde_json::Value) -> Self {
        let headers = [("Content-Type", "application/json"), ("Cache-Control", "no-store")];
        let headers = headers.map(|(name, value)| (name, value.to_owned())).to_vec();
        Self { status: "200 OK", headers, body: value.to_string().into_bytes() }
    }

    /// Sends it, and ends the connection.
    pub fn send(&self, stream: &TcpStream, has_body: bool) -> io::Result<()> {
        let length = self.body.len().to_string();
        let more = [("Content-Length", length), ("Connection", "close".to_owned())];
        let head = head_text(self.status, self.headers.iter().chain(&more));
        write_within(stream, head.as_bytes(), TO_READ)?;
        if has_body {
            write_within(stream, &self.body, TO_READ)?;
        }
        stream.shutdown(Shutdown::Write)?;
        // What the reader still sends is read, or the answer could be lost with the connection.
        let (mut stream, end) = (stream, Instant::now());
        stream.set_read_timeout(Some(Duration::from_millis(500)))?;
        let mut piece = vec![0; PIECE];
        while end.elapsed() < Duration::from_secs(2) && stream.read(&mut piece)? > 0 {}
        Ok(())
    }
}

/// The head of an answer.
pub fn head_text<'a>(status: &str, headers: impl Iterator<Item = &'a (&'static str, String)>) -> String {
    let lines: String = headers.map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    format!("HTTP/1.1 {status}\r\n{lines}\r\n")
}

/// Reads the head of a request, and what came behind it. `None` is a request that cannot be read.
pub fn read_head(mut stream: &TcpStream) -> io::Result<Option<(Head, Vec<u8>)>> {
    let (start, mut bytes, mut piece) = (Instant::now(), Vec::new(), [0; 4096]);
    loop {
        if let Some(end) = bytes.windows(4).position(|end| end == b"\r\n\r\n") {
            let rest = bytes.split_off(end + 4);
            return Ok(parsed(&bytes).map(|head| (head, rest)));
        }
        if bytes.len() > MOST_HEAD {
            return Ok(None);
        }
        stream.set_read_timeout(Some(left(start, TO_REQUEST)?))?;
        match stream.read(&mut piece)? {
            0 => return Err(ErrorKind::UnexpectedEof.into()),
            read => bytes.extend(&piece[..read]),
        }
    }
}

fn parsed(bytes: &[u8]) -> Option<Head> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    request.parse(bytes).ok().filter(httparse::Status::is_complete)?;
    let (path, query) = request.path?.split_once('?').unwrap_or((request.path?, ""));
    let headers = request
        .headers
        .iter()
        .map(|header| (header.name.to_lowercase(), String::from_utf8_lossy(header.value).trim().to_owned()));
    Some(Head {
        method: request.method?.to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        headers: headers.collect(),
    })
}

/// Reads a body of so many bytes, of which some may have come with the head.
pub fn read_body(
    mut stream: &TcpStream,
    mut body: Vec<u8>,
    length: usize,
    within: Duration,
) -> io::Result<Vec<u8>> {
    let (start, mut piece) = (Instant::now(), vec![0; PIECE]);
    while body.len() < length {
        stream.set_read_timeout(Some(left(start, within)?))?;
        match stream.read(&mut piece)? {
            0 => return Err(ErrorKind::UnexpectedEof.into()),
            read => body.extend(&piece[..read]),
        }
    }
    body.truncate(length);
    Ok(body)
}

/// Writes all bytes within a time.
pub fn write_within(mut stream: &TcpStream, bytes: &[u8], within: Duration) -> io::Result<()> {
    let start = Instant::now();
    for piece in bytes.chunks(PIECE) {
        let mut rest = piece;
        while !rest.is_empty() {
            stream.set_write_timeout(Some(left(start, within)?))?;
            match stream.write(rest)? {
                0 => return Err(ErrorKind::WriteZero.into()),
                written => rest = &rest[written..],
            }
        }
    }
    Ok(())
}

/// What is left of a time; fails once it is over.
fn left(start: Instant, limit: Duration) -> io::Result<Duration> {
    let left = limit.saturating_sub(start.elapsed());
    if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
}
