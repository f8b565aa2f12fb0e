//! A studio for the tests of this program, and clients of it: bare HTTP, and a WebSocket.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use petzval_jobs::{Context, Silent, built_in_assets};
use petzval_studio::{Settings, Studio};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Time in which an answer must come.
const PATIENCE: Duration = Duration::from_secs(60);

/// The folder of every studio of this program: it is the current folder, of which a process has one.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| TempDir::new().unwrap()).path()
}

/// A studio, with what a client has to know.
pub struct Server {
    pub studio: Studio,
    pub folder: &'static Path,
}

impl Server {
    pub fn start() -> Self {
        let context = Context::new(built_in_assets(), Arc::new(Silent));
        let folder = folder();
        let folder_of = Some(folder.to_path_buf());
        let settings =
            Settings { port: Some(0), folder: folder_of, open: Vec::new(), program: None, context };
        Self { studio: Studio::start(settings).unwrap(), folder }
    }

    pub fn host(&self) -> String {
        self.studio.address().to_string()
    }

    pub fn cookie(&self) -> String {
        format!("petzval_studio_{}={}", self.studio.address().port(), self.studio.token())
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.studio.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// The answer to a request with these headers beside its host; the connection ends with it.
    pub fn answer_to(&self, line: &str, headers: &[(&str, &str)], body: &[u8]) -> String {
        let mut head = format!("{line} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
        if !headers.iter().any(|(name, _)| *name == "Host") {
            head += &format!("Host: {}\r\n", self.host());
        }
        headers.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
        let mut stream = self.connect();
        stream.write_all((head + "\r\n").as_bytes()).unwrap();
        // A refusal may come before the body is read.
        let _refused = stream.write_all(body);
        let mut answer = Vec::new();
        let _reset = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// A page that knows the token.
    pub fn page(&self) -> Page {
        self.page_with(&[("Cookie", &self.cookie()), ("Origin", &format!("http://{}", self.host()))]).unwrap()
    }

    /// A page with these headers; the error is why it has no socket.
    pub fn page_with(&self, headers: &[(&str, &str)]) -> Result<Page, String> {
        let mut stream = self.connect();
        let mut head = format!(
            "GET /socket HTTP/1.1\r\nHost: {}\r\nUpgrade: websocket\r\nConnection: keep-alive, Upgrade\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
            self.host()
        );
        headers.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
        stream.write_all((head + "\r\n").as_bytes()).unwrap();
        let (mut answer, mut byte) = (Vec::new(), [0]);
        while !answer.ends_with(b"\r\n\r\n") {
            stream.read_exact(&mut byte).map_err(|error| error.to_string())?;
            answer.push(byte[0]);
        }
        let answer = String::from_utf8(answer).unwrap();
        if !answer.starts_with("HTTP/1.1 101 ") {
            return Err(answer);
        }
        // The answer to the key of the standard's example.
        assert!(answer.contains("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{answer}");
        Ok(Page { stream, next: 0 })
    }
}

/// A page with its socket.
pub struct Page {
    pub stream: TcpStream,
    next: u64,
}

impl Page {
    /// Sends a text in one frame, masked as those of a client are.
    pub fn say(&mut self, text: &str) -> io::Result<()> {
        let mask = [1, 2, 3, 4];
        let mut frame = vec![0x81, 0x80 | 127];
        frame.extend((text.len() as u64).to_be_bytes());
        frame.extend(mask);
        frame.extend(text.bytes().zip(mask.iter().cycle()).map(|(byte, mask)| byte ^ mask));
        self.stream.write_all(&frame)
    }

    /// Sends a call; returns its number.
    pub fn send(&mut self, job: &str, request: Value, live: Option<&str>) -> u64 {
        self.next += 1;
        let call = json!({"id": self.next, "job": job, "request": request, "live": live});
        self.say(&call.to_string()).unwrap();
        self.next
    }

    pub fn cancel(&mut self, id: u64) {
        self.say(&json!({"cancel": id}).to_string()).unwrap();
    }

    /// The kind and the payload of the next frame.
    pub fn frame(&mut self) -> io::Result<(u8, Vec<u8>)> {
        let mut head = [0; 2];
        self.stream.read_exact(&mut head)?;
        let length = match head[1] {
            126 => {
                let mut length = [0; 2];
                self.stream.read_exact(&mut length)?;
                usize::from(u16::from_be_bytes(length))
            }
            127 => {
                let mut length = [0; 8];
                self.stream.read_exact(&mut length)?;
                u64::from_be_bytes(length) as usize
            }
            short => usize::from(short),
        };
        let mut payload = vec![0; length];
        self.stream.read_exact(&mut payload)?;
        Ok((head[0] & 0x0F, payload))
    }

    /// The next message.
    pub fn hear(&mut self) -> Value {
        loop {
            let (kind, payload) = self.frame().unwrap();
            if kind == 1 {
                return serde_json::from_slice(&payload).unwrap();
            }
        }
    }

    /// The end of a call, after its events.
    pub fn end_of(&mut self, id: u64) -> Value {
        loop {
            let message = self.hear();
            if message["id"] == id && message.get("event").is_none() {
                return message;
            }
        }
    }

    /// The response of a call.
    pub fn call(&mut self, job: &str, request: Value) -> Value {
        let id = self.send(job, request, None);
        let mut end = self.end_of(id);
        assert!(end.get("error").is_none(), "{job}: {end}");
        end["response"].take()
    }
}
