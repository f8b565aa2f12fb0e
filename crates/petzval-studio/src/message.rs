//! What page and server say to each other over the WebSocket.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use petzval_base::FileError;
use petzval_jobs::{ErrorReport, Event};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A message of the page.
#[derive(Debug, PartialEq)]
pub enum Incoming {
    /// Cancel a call: it ends with an error of the kind `stopped`.
    Cancel(CancelCall),
    /// Make a call.
    Call(MakeCall),
}

/// Why a message of the page is none.
#[derive(Debug)]
pub struct Unreadable {
    /// The call that it is about, if that can be read.
    pub id: Option<u64>,
    /// What is wrong, with the key.
    pub error: Box<ErrorReport>,
}

impl Incoming {
    /// Reads a message. What is wrong is said with its key and a hint.
    pub fn read(text: &str) -> Result<Self, Unreadable> {
        const FORMS: &str =
            "a message is {\"id\": NUMBER, \"job\": NAME, \"request\": {...}} or {\"cancel\": NUMBER}";
        let refused = |id, message: String, hint: Option<String>| {
            let end = |hint: &str| if hint.ends_with(['?', '.', '!']) { "" } else { ";" };
            let hint = hint.map_or_else(|| FORMS.to_owned(), |hint| format!("{hint}{} {FORMS}", end(&hint)));
            Unreadable { id, error: refusal(format!("message: {message}"), &hint) }
        };
        let value: Value = serde_json::from_str(text).map_err(|e| refused(None, e.to_string(), None))?;
        let id = value.get("id").and_then(Value::as_u64);
        if !value.is_object() {
            return Err(refused(None, "expected an object".to_owned(), None));
        }
        let read = if value.get("cancel").is_some() {
            serde_path_to_error::deserialize(value).map(Self::Cancel)
        } else {
            serde_path_to_error::deserialize(value).map(Self::Call)
        };
        read.map_err(|error| {
            let error = FileError::of_value(&error.path().to_string(), &error.inner().to_string());
            refused(id, FileError { hint: None, ..error.clone() }.to_string(), error.hint)
        })
    }
}

/// A call that is to end.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CancelCall {
    /// The call.
    pub cancel: u64,
}

/// A call of a job.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MakeCall {
    /// Number of the call, which answers repeat. No two calls at work have the same.
    pub id: u64,
    /// Name of the job.
    pub job: String,
    /// Its request.
    #[serde(default = "nothing")]
    pub request: Value,
    /// The live channel that the call belongs to: it has one call in flight.
    #[serde(default)]
    pub live: Option<String>,
    /// Overwrite results that are there already.
    #[serde(default)]
    pub overwrite: bool,
    /// Keys of the response whose texts of base64 are to come as bytes, see [`Packed`].
    #[serde(default)]
    pub bytes: Vec<String>,
    /// Make it in a process of its own, which goes on when the page or the studio ends. The answer names its log.
    #[serde(default)]
    pub process: bool,
}

fn nothing() -> Value {
    Value::Object(Map::new())
}

/// A message of the server.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Outgoing<'a> {
    /// A call says something.
    Event {
        /// The call.
        id: u64,
        /// What.
        event: &'a Event,
    },
    /// A call has ended well.
    Response {
        /// The call.
        id: u64,
        /// Its response.
        response: &'a Value,
    },
    /// A call has failed, or was not made.
    Error {
        /// The call; none if the message could not be read.
        id: Option<u64>,
        /// Why.
        error: &'a ErrorReport,
    },
}

impl Outgoing<'_> {
    /// As text.
    pub fn text(&self) -> String {
        // Numbers that JSON has not were made null by the job.
        serde_json::to_string(self).unwrap_or_else(|error| {
            let text = Value::String(error.to_string());
            format!("{{\"id\":null,\"error\":{{\"kind\":\"failed\",\"message\":{text}}}}}")
        })
    }
}

/// A response with bytes behind it, for what is large: the length of its message as a number of 32 bits, the lowest byte first; the message; and the
/// bytes. In the message, each value that came as bytes is where these begin behind it, and how many they are.
pub struct Packed {
    /// All of it, as one message of bytes.
    pub payload: Vec<u8>,
}

impl Packed {
    /// The response of a call. The texts of these keys in it are base64. Keys that hold something else stay as they are; none where no key holds
    /// such a text.
    pub fn new(id: u64, response: &mut Value, keys: &[String]) -> Option<Self> {
        let mut behind = Vec::new();
        for key in keys {
            let Some(value) = response.get_mut(key) else { continue };
            let Some(bytes) = value.as_str().and_then(|text| STANDARD.decode(text).ok()) else { continue };
            *value = serde_json::json!([behind.len(), bytes.len()]);
            behind.extend(bytes);
        }
        if behind.is_empty() {
            return None;
        }
        let text = Outgoing::Response { id, response }.text();
        let mut payload = Vec::with_capacity(4 + text.len() + behind.len());
        payload.extend((text.len() as u32).to_le_bytes());
        payload.extend(text.as_bytes());
        payload.extend(behind);
        Some(Self { payload })
    }
}

/// The report of a call that was not made.
pub fn refusal(message: impl Into<String>, hint: &str) -> Box<ErrorReport> {
    Box::new(ErrorReport {
        kind: "input".to_owned(),
        message: message.into(),
        place: None,
        hint: hint.to_owned(),
        stopped: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_base64_travel_as_bytes_behind_the_message() {
        let mut response = serde_json::json!({"rgb": "AAEC/w==", "raw": null, "width": 2, "more": "Bwg="});
        let keys = ["rgb", "raw", "none", "width", "more"].map(str::to_owned);
        let Packed { payload } = Packed::new(7, &mut response, &keys).unwrap();
        let length = u32::from_le_bytes(payload[..4].try_into().unwrap()) as usize;
        let (message, behind) = payload[4..].split_at(length);
        let message: Value = serde_json::from_slice(message).unwrap();
        let expected = serde_json::json!({"rgb": [0, 4], "raw": null, "width": 2, "more": [4, 2]});
        assert_eq!(message, serde_json::json!({"id": 7, "response": expected}));
        assert_eq!(behind, [0, 1, 2, 255, 7, 8]);
        // Nothing of it is base64.
        let mut response = serde_json::json!({"rgb": "no base64", "raw": null});
        assert!(Packed::new(7, &mut response, &keys).is_none());
        assert_eq!(response, serde_json::json!({"rgb": "no base64", "raw": null}));
    }

    #[test]
    fn a_message_is_a_call_or_its_end() {
        let read = Incoming::read;
        assert_eq!(read(r#"{"cancel": 3}"#).unwrap(), Incoming::Cancel(CancelCall { cancel: 3 }));
        let Incoming::Call(call) = read(r#"{"id": 1, "job": "lens-list"}"#).unwrap() else { panic!() };
        assert_eq!((call.id, call.job.as_str(), call.live), (1, "lens-list", None));
        for (wrong, id, says, hint) in [
            ("", None, "message: EOF", "a message is {"),
            ("[]", None, "message: expected an object", "a message is {"),
            ("{}", None, "message: the key `id` is missing", "a message is {"),
            (r#"{"id": 1}"#, Some(1), "message: the key `job` is missing", "a message is {"),
            (
                r#"{"id": 1, "job": "x", "requst": {}}"#,
                Some(1),
                "`requst`: no such key here",
                "did you mean `request`?",
            ),
            (r#"{"id": -1, "job": "x"}"#, None, "`id`", "a message is {"),
            (r#"{"id": 7, "job": 3}"#, Some(7), "`job`", "put the value in quotes; a message is {"),
            (r#"{"cancel": "x"}"#, None, "`cancel`", "a message is {"),
            (r#"{"cancel": 3, "id": 4}"#, Some(4), "`id`: no such key here", "a message is {"),
        ] {
            let refused = read(wrong).unwrap_err();
            assert_eq!(refused.id, id, "{wrong}");
            assert!(refused.error.message.contains(says), "{wrong}: {}", refused.error.message);
            assert!(refused.error.hint.contains(hint), "{wrong}: {}", refused.error.hint);
        }
    }
}
