//! What page and server say to each other over the WebSocket.

use petzval_jobs::{ErrorReport, Event};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A message of the page.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Incoming {
    /// Cancel a call: it ends with an error of the kind `stopped`.
    Cancel(CancelCall),
    /// Make a call.
    Call(MakeCall),
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
    fn a_message_is_a_call_or_its_end() {
        let read = |text: &str| serde_json::from_str::<Incoming>(text);
        assert_eq!(read(r#"{"cancel": 3}"#).unwrap(), Incoming::Cancel(CancelCall { cancel: 3 }));
        let Incoming::Call(call) = read(r#"{"id": 1, "job": "lens-list"}"#).unwrap() else { panic!() };
        assert_eq!((call.id, call.job.as_str(), call.live), (1, "lens-list", None));
        for wrong in [
            "",
            "[]",
            "{}",
            r#"{"id": 1}"#,
            r#"{"id": 1, "job": "x", "more": 1}"#,
            r#"{"id": -1, "job": "x"}"#,
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
