//! Frames of a WebSocket, as RFC 6455 has them: the side of the server.
//!
//! Crates for WebSockets bring `bytes` with other features than the tensor framework takes; all of that would be built anew for them. What a
//! server needs of the standard is small: unmasking, fragments, and four kinds of control frames.

use std::io::{self, ErrorKind, Read};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// What the key of a request is followed by under the digest (RFC 6455, section 1.3).
const GUID: &str = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";

/// Most bytes of a control frame.
const MOST_CONTROL: u64 = 125;

/// What the client said.
#[derive(Debug, PartialEq)]
pub enum Heard {
    /// A message of text.
    Text(String),
    /// A ping, to be answered by its bytes.
    Ping(Vec<u8>),
    /// A pong.
    Pong,
    /// The end.
    Close,
}

/// Why the client cannot go on, as the code of a closing frame (RFC 6455, section 7.4.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrong {
    /// It does not keep to the standard.
    Protocol = 1002,
    /// It sends something else than text.
    Kind = 1003,
    /// Its text is not UTF-8.
    Encoding = 1007,
    /// Its message is too large.
    Size = 1009,
}

/// A failure of reading.
#[derive(Debug)]
pub enum ReadError {
    /// The connection.
    Io(io::Error),
    /// The client.
    Wrong(Wrong),
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<Wrong> for ReadError {
    fn from(wrong: Wrong) -> Self {
        Self::Wrong(wrong)
    }
}

/// The value of `Sec-WebSocket-Accept` for that of `Sec-WebSocket-Key`.
pub fn accept(key: &str) -> String {
    let digest = sha1_smol::Sha1::from(format!("{key}{GUID}")).digest();
    STANDARD.encode(digest.bytes())
}

/// Kinds of frames.
const CONTINUED: u8 = 0x0;
const TEXT: u8 = 0x1;
const BINARY: u8 = 0x2;
const CLOSE: u8 = 0x8;
const PING: u8 = 0x9;
const PONG: u8 = 0xA;

/// A whole frame of the server, which masks nothing.
fn frame(kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0x80 | kind];
    match payload.len() {
        length @ 0..=125 => bytes.push(length as u8),
        length @ 126..=0xFFFF => {
            bytes.push(126);
            bytes.extend((length as u16).to_be_bytes());
        }
        length => {
            bytes.push(127);
            bytes.extend((length as u64).to_be_bytes());
        }
    }
    bytes.extend(payload);
    bytes
}

/// A message of text.
pub fn text(text: &str) -> Vec<u8> {
    frame(TEXT, text.as_bytes())
}

/// A message of bytes.
pub fn bytes(bytes: &[u8]) -> Vec<u8> {
    frame(BINARY, bytes)
}

/// A ping.
pub fn ping() -> Vec<u8> {
    frame(PING, &[])
}

/// The answer to a ping.
pub fn pong(payload: &[u8]) -> Vec<u8> {
    frame(PONG, payload)
}

/// The end, with why.
pub fn close(wrong: Option<Wrong>) -> Vec<u8> {
    frame(CLOSE, &(wrong.map_or(1000, |wrong| wrong as u16)).to_be_bytes())
}

/// Whether a frame of the server is the last one.
pub fn is_close(frame: &[u8]) -> bool {
    frame.first() == Some(&(0x80 | CLOSE))
}

/// Reads frames of a client. What has come of a message stays until its end.
pub struct Reader<R> {
    stream: R,
    most_bytes: u64,
    /// What came of the frame that is being read: a read that runs out of time loses nothing.
    raw: Vec<u8>,
    /// Fragments of a message; none outside of one.
    message: Option<Vec<u8>>,
}

impl<R: Read> Reader<R> {
    /// A reader of messages of so many bytes at most, which begins with what has come already.
    pub fn new(stream: R, begun: Vec<u8>, most_bytes: u64) -> Self {
        Self { stream, most_bytes, raw: begun, message: None }
    }

    /// What the client says next. An error of the kind `WouldBlock` or `TimedOut` says that nothing came in time; reading may go on.
    pub fn hear(&mut self) -> Result<Heard, ReadError> {
        loop {
            self.fill(2)?;
            let [first, second] = [self.raw[0], self.raw[1]];
            let (is_last, kind) = (first & 0x80 != 0, first & 0x0F);
            // No extension was agreed on, and every client masks.
            if first & 0x70 != 0 || second & 0x80 == 0 {
                return Err(Wrong::Protocol.into());
            }
            let (head, length) = match second & 0x7F {
                126 => {
                    self.fill(4)?;
                    (4, u64::from(u16::from_be_bytes([self.raw[2], self.raw[3]])))
                }
                127 => {
                    self.fill(10)?;
                    let mut length = [0; 8];
                    length.copy_from_slice(&self.raw[2..10]);
                    (10, u64::from_be_bytes(length))
                }
                short => (2, u64::from(short)),
            };
            let is_control = kind & 0x8 != 0;
            if is_control && (!is_last || length > MOST_CONTROL) {
                return Err(Wrong::Protocol.into());
            }
            // A frame that is too large is refused before it is read.
            let before = self.message.as_ref().map_or(0, Vec::len) as u64;
            if length.saturating_add(before) > self.most_bytes {
                return Err(Wrong::Size.into());
            }
            self.fill(head + 4 + length as usize)?;
            let rest = self.raw.split_off(head + 4 + length as usize);
            let frame = std::mem::replace(&mut self.raw, rest);
            let mask = &frame[head..head + 4];
            let payload: Vec<u8> =
                frame[head + 4..].iter().zip(mask.iter().cycle()).map(|(byte, mask)| byte ^ mask).collect();
            match (kind, self.message.take()) {
                (TEXT, None) => self.message = Some(payload),
                (CONTINUED, Some(mut message)) => {
                    message.extend(payload);
                    self.message = Some(message);
                }
                (PING, message) => {
                    self.message = message;
                    return Ok(Heard::Ping(payload));
                }
                (PONG, message) => {
                    self.message = message;
                    return Ok(Heard::Pong);
                }
                (CLOSE, _) => return Ok(Heard::Close),
                (BINARY, None) => return Err(Wrong::Kind.into()),
                _ => return Err(Wrong::Protocol.into()),
            }
            if is_last && let Some(message) = self.message.take() {
                let text = String::from_utf8(message).map_err(|_| Wrong::Encoding)?;
                return Ok(Heard::Text(text));
            }
        }
    }

    /// Reads until so many bytes of the frame are there.
    fn fill(&mut self, count: usize) -> Result<(), ReadError> {
        let mut piece = [0; 16 << 10];
        while self.raw.len() < count {
            match self.stream.read(&mut piece) {
                Ok(0) => return Err(io::Error::from(ErrorKind::UnexpectedEof).into()),
                Ok(read) => self.raw.extend(&piece[..read]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASK: [u8; 4] = [0x37, 0xFA, 0x21, 0x3D];

    /// A frame of a client.
    fn masked(first: u8, payload: &[u8]) -> Vec<u8> {
        let mut bytes = frame(0, payload);
        bytes[0] = first;
        bytes[1] |= 0x80;
        let head = bytes.len() - payload.len();
        let hidden: Vec<u8> =
            payload.iter().zip(MASK.iter().cycle()).map(|(byte, mask)| byte ^ mask).collect();
        bytes.truncate(head);
        bytes.extend(MASK);
        bytes.extend(hidden);
        bytes
    }

    fn reader(bytes: &[u8]) -> Reader<&[u8]> {
        Reader::new(bytes, Vec::new(), 100_000)
    }

    fn wrong(bytes: &[u8]) -> Wrong {
        match reader(bytes).hear() {
            Err(ReadError::Wrong(wrong)) => wrong,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_key_of_the_standard_gives_its_answer() {
        // RFC 6455, section 1.3.
        assert_eq!(accept("dGhlIHNhbXBsZSBub25jZQ=="), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
    }

    #[test]
    fn messages_come_whole_whatever_their_frames() {
        // RFC 6455, section 5.7: a masked and an unmasked "Hello".
        let hello = [0x81, 0x85, 0x37, 0xFA, 0x21, 0x3D, 0x7F, 0x9F, 0x4D, 0x51, 0x58];
        assert_eq!(reader(&hello).hear().unwrap(), Heard::Text("Hello".to_owned()));
        assert_eq!(text("Hello"), [0x81, 0x05, 0x48, 0x65, 0x6C, 0x6C, 0x6F]);
        // A ping may come between two fragments.
        let parts =
            [masked(0x01, b"one "), masked(0x89, b"!"), masked(0x00, b"and "), masked(0x80, b"two")].concat();
        let mut parts = reader(&parts);
        assert_eq!(parts.hear().unwrap(), Heard::Ping(b"!".to_vec()));
        assert_eq!(parts.hear().unwrap(), Heard::Text("one and two".to_owned()));
        assert!(matches!(parts.hear(), Err(ReadError::Io(_))));
        for length in [0, 125, 126, 65_535, 65_536] {
            let long = "x".repeat(length);
            assert_eq!(reader(&masked(0x81, long.as_bytes())).hear().unwrap(), Heard::Text(long.clone()));
            // What the server sends has the same form, without a mask.
            let sent = text(&long);
            assert_eq!(&sent[sent.len() - length..], long.as_bytes());
        }
        assert_eq!(reader(&masked(0x88, &[])).hear().unwrap(), Heard::Close);
        assert_eq!(close(Some(Wrong::Size)), [0x88, 2, 0x03, 0xF1]);
        assert!(is_close(&close(None)) && !is_close(&ping()) && !is_close(&text("Hello")));
    }

    #[test]
    fn what_the_standard_forbids_is_refused_with_its_code() {
        assert_eq!(wrong(&text("unmasked")), Wrong::Protocol);
        assert_eq!(wrong(&masked(0xC1, b"compressed")), Wrong::Protocol);
        assert_eq!(wrong(&masked(0x80, b"the rest of nothing")), Wrong::Protocol);
        assert_eq!(wrong(&masked(0x83, b"a kind that is not")), Wrong::Protocol);
        assert_eq!(wrong(&masked(0x09, b"a ping in parts")), Wrong::Protocol);
        assert_eq!(wrong(&masked(0x89, &[0; 126])), Wrong::Protocol);
        assert_eq!(wrong(&[masked(0x01, b"a"), masked(0x81, b"b")].concat()), Wrong::Protocol);
        assert_eq!(wrong(&masked(0x82, b"bytes")), Wrong::Kind);
        assert_eq!(wrong(&masked(0x81, &[0xFF])), Wrong::Encoding);
        // The length alone is enough, in one frame and over several.
        assert_eq!(wrong(&[0x81, 0xFF, 0, 0, 0, 0, 6, 0, 0, 0]), Wrong::Size);
        let parts = [masked(0x01, &[b'x'; 60_000]), masked(0x80, &[b'x'; 60_000])].concat();
        assert_eq!(wrong(&parts), Wrong::Size);
    }

    #[test]
    fn a_read_that_runs_out_of_time_loses_nothing() {
        /// Gives a byte, and then says that nothing came.
        struct Slow<'a>(&'a [u8], bool);
        impl Read for Slow<'_> {
            fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
                self.1 = !self.1;
                if self.1 {
                    return Err(ErrorKind::WouldBlock.into());
                }
                let Some((first, rest)) = self.0.split_first() else { return Ok(0) };
                (to[0], self.0) = (*first, rest);
                Ok(1)
            }
        }
        let bytes = masked(0x81, b"slow");
        let mut reader = Reader::new(Slow(&bytes, false), Vec::new(), 100);
        let heard = loop {
            match reader.hear() {
                Ok(heard) => break heard,
                Err(ReadError::Io(error)) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
                Err(ReadError::Wrong(wrong)) => panic!("{wrong:?}"),
            }
        };
        assert_eq!(heard, Heard::Text("slow".to_owned()));
    }
}
