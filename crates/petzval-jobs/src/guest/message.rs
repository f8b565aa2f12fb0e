//! Requests and answers as they stand in the pipes of a worker: 16 bytes (`PTZG`, length of the header, length of the body), a header in JSON, and a body.
//! The body has arrays of 32-bit floats in the shapes of the header, then bytes. All numbers are little-endian.

use std::io::{self, Read, Write};

use petzval_camera::tape::View;
use petzval_learn::guest::{Answer, Array, GuestError};
use serde::Deserialize;
use serde_json::{Value, json};

const MAGIC: &[u8; 4] = b"PTZG";

/// Longest header, bytes.
const LONGEST_HEADER: u32 = 1 << 26;

/// Longest body, bytes: more than the planes of any frame.
const LONGEST_BODY: u64 = 1 << 36;

/// The header of an answer.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct AnswerHeader {
    /// What is no array and no bytes.
    value: Value,
    shapes: Vec<Vec<usize>>,
    bytes: usize,
    error: Option<ReportedError>,
}

/// An error as a worker reports it.
#[derive(Debug, Deserialize)]
pub struct ReportedError {
    kind: String,
    message: String,
    hint: String,
    traceback: String,
}

/// Writes a request.
pub fn write(to: &mut impl Write, header: &Value, arrays: &[View], bytes: &[u8]) -> io::Result<()> {
    let mut header = header.clone();
    header["shapes"] = json!(arrays.iter().map(|array| &array.shape).collect::<Vec<_>>());
    header["bytes"] = json!(bytes.len());
    let text = header.to_string();
    let values: usize = arrays.iter().map(|array| array.values.len()).sum();
    let mut start = Vec::with_capacity(16 + text.len());
    start.extend_from_slice(MAGIC);
    start.extend_from_slice(&(text.len() as u32).to_le_bytes());
    start.extend_from_slice(&((4 * values + bytes.len()) as u64).to_le_bytes());
    start.extend_from_slice(text.as_bytes());
    to.write_all(&start)?;
    for array in arrays {
        let all: Vec<u8> = array.values.iter().flat_map(|value| value.to_le_bytes()).collect();
        to.write_all(&all)?;
    }
    to.write_all(bytes)?;
    to.flush()
}

/// Reads an answer: its header and its body. None at the end of the pipe.
pub fn read(from: &mut impl Read) -> io::Result<Option<(AnswerHeader, Vec<u8>)>> {
    let mut start = [0; 16];
    match from.read_exact(&mut start) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let [m0, m1, m2, m3, h0, h1, h2, h3, body @ ..] = start;
    let (header, body) = (u32::from_le_bytes([h0, h1, h2, h3]), u64::from_le_bytes(body));
    if [m0, m1, m2, m3] != *MAGIC || header > LONGEST_HEADER || body > LONGEST_BODY {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "the channel holds no answer"));
    }
    let mut text = vec![0; header as usize];
    from.read_exact(&mut text)?;
    let mut rest = Vec::new();
    from.take(body).read_to_end(&mut rest)?;
    if rest.len() as u64 != body {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(Some((serde_json::from_slice(&text)?, rest)))
}

/// What an answer holds.
pub fn answer(header: AnswerHeader, body: &[u8]) -> Result<Answer, String> {
    let counts: Vec<usize> = header.shapes.iter().map(|shape| shape.iter().product()).collect();
    let floats: usize = counts.iter().sum();
    if body.len() != 4 * floats + header.bytes {
        return Err(format!("an answer has {} bytes, not {}", body.len(), 4 * floats + header.bytes));
    }
    let (mut values, bytes) = body.split_at(4 * floats);
    let mut arrays = Vec::new();
    for (shape, count) in header.shapes.into_iter().zip(counts) {
        let (these, rest) = values.split_at(4 * count);
        let these = these.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        arrays.push(Array { values: these.collect(), shape });
        values = rest;
    }
    Ok(Answer { arrays, value: header.value, bytes: bytes.to_vec() })
}

/// What the header of an answer says in text, or the error that it reports; `said` receives the traceback line by line.
pub fn read_answer(
    text: &str,
    class: &str,
    method: &'static str,
    said: &dyn Fn(&str),
) -> Result<Value, GuestError> {
    let header: AnswerHeader =
        serde_json::from_str(text).map_err(|e| GuestError::Gone(format!("`{class}.{method}`: {e}")))?;
    header.checked(class, method, said).map(|header| header.value)
}

impl AnswerHeader {
    /// The header of an answer that is no error; `said` receives the traceback of an exception line by line.
    pub fn checked(self, class: &str, method: &'static str, said: &dyn Fn(&str)) -> Result<Self, GuestError> {
        let Some(ReportedError { kind, message, hint, traceback }) = self.error else { return Ok(self) };
        traceback.lines().for_each(said);
        Err(match kind.as_str() {
            "unusable" => GuestError::Unusable { message, hint },
            "answer" => GuestError::Answer { class: class.to_owned(), method, problem: message },
            _ => GuestError::Raised(message),
        })
    }
}
