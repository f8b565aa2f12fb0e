//! A job with all that it needs, as one value: a work unit, a call from another language, a request to a server.

use std::path::{Path, PathBuf};

use petzval_base::FileError;
use schemars::{JsonSchema, schema_for};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::glass::context_with;
use crate::job::{Row, joined};
use crate::keys::error_in_keys;
use crate::table::jobs;
use crate::threads::MOST_THREADS;

/// The version of [`Call`] that this program writes and reads.
pub const CALL_FORMAT: u32 = 1;

/// A job with its request and its surroundings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Call {
    /// Version of this form: 1.
    pub format: u32,
    /// Name of the job; `petzval jobs` lists them.
    pub job: String,
    /// Its request; `petzval schema job NAME` prints the schema.
    #[serde(default = "nothing", deserialize_with = "crate::distinct_keys::deserialize")]
    pub request: Value,
    /// Glass catalogues whose glasses take precedence over the built-in ones, by path.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub glasses: Vec<PathBuf>,
    /// Overwrite results that are there already.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub overwrite: bool,
    /// Threads to use; 0 means those of the process. Results do not depend on it.
    #[serde(default = "crate::usual::threads")]
    pub threads: usize,
    /// Where tensors live, for jobs whose request has the key `device`; that of the request if none is named here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
}

fn nothing() -> Value {
    Value::Object(Map::new())
}

impl Call {
    /// A call of a job by name, which takes what its surroundings are.
    pub fn new(job: &str, request: Value) -> Self {
        Self {
            format: CALL_FORMAT,
            job: job.to_owned(),
            request,
            glasses: Vec::new(),
            overwrite: false,
            threads: crate::usual::threads(),
            device: None,
        }
    }

    /// The JSON Schema of a call.
    pub fn schema() -> Value {
        schema_for!(Self).to_value()
    }

    /// Reads a call from a file. The error names the file, the line and the key.
    pub fn read(path: &Path) -> Result<Self> {
        let text = petzval_base::read_text(path).map_err(|e| {
            JobError::input(format!("{}: {e}", path.display()), "give a call in JSON, as UTF-8 text")
        })?;
        Self::parse(&text).map_err(|error| match error {
            JobError::Input { message, hint } => {
                JobError::Input { message: format!("{}: {message}", path.display()), hint }
            }
            other => other,
        })
    }

    /// Reads a call; a byte order mark is skipped. Fails on a key that is there twice. The error names the line and the key.
    pub fn parse(text: &str) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let hint =
            "a call is {\"format\": 1, \"job\": NAME, \"request\": {...}}; `petzval jobs` lists the names";
        // A list would be read as the values of the keys in their order.
        serde_json::from_str::<IgnoredAny>(text)
            .map_err(|error| JobError::input(format!("call: {error}"), hint))?;
        if !text.trim_start().starts_with('{') {
            return Err(JobError::input("call: expected an object", hint));
        }
        // A later form may have other keys: which form it is comes first.
        #[derive(Deserialize)]
        struct Form {
            format: u32,
        }
        let Form { format } = read(text, hint)?;
        if format != CALL_FORMAT {
            let hint = format!("this program reads and writes format {CALL_FORMAT}");
            return Err(JobError::input(format!("call: format {format} is not known"), hint));
        }
        read(text, hint)
    }

    /// Makes it. Its glasses take precedence over those of the context. In a context without a command line, results name the job. Events and
    /// errors name keys of the request in place of flags of the command.
    pub fn run(self, context: &Context) -> Result<Value> {
        self.made(&context.clone().in_keys()).map_err(error_in_keys)
    }

    fn made(self, context: &Context) -> Result<Value> {
        if self.threads > MOST_THREADS {
            let message = format!("call: `threads` is {}, more than {MOST_THREADS}", self.threads);
            return Err(JobError::input(message, "0 means those of the process"));
        }
        let row = row(&self.job)?;
        let request = self.request_on_device(row)?;
        let mut context = context.clone().overwriting(self.overwrite || context.overwrites());
        // A run says what made it, with or without a command line.
        if context.command().is_empty() {
            context = context.with_command(format!("petzval call # job {}", self.job));
        }
        let context = context_with(context, &self.glasses)?;
        if self.threads == 0 {
            return row.run(request, &context);
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        let pool = pool.map_err(|e| JobError::failed(format!("{} threads: {e}", self.threads)))?;
        pool.install(|| row.run(request, &context))
    }
}

impl Call {
    /// The request, with the device of the call where the job takes one.
    fn request_on_device(&self, row: &Row) -> Result<Value> {
        let Some(device) = &self.device else { return Ok(self.request.clone()) };
        let takes_one = row.kept_schema().pointer("/properties/device").is_some();
        let (true, Some(keys)) = (takes_one, self.request.as_object()) else {
            let message =
                format!("call: `device` is \"{device}\", and the job `{}` takes no device", self.job);
            return Err(JobError::input(message, "leave it out"));
        };
        match keys.get("device") {
            Some(other) if other.as_str() != Some(device) => {
                let message =
                    format!("call: `device` is \"{device}\", and the request has `device`: {other}");
                Err(JobError::input(message, "name the device once"))
            }
            _ => {
                let mut keys = keys.clone();
                keys.insert("device".to_owned(), device.as_str().into());
                Ok(Value::Object(keys))
            }
        }
    }
}

/// Reads a part of a call. The error names the key, the line and the column.
fn read<T: DeserializeOwned>(text: &str, of_calls: &str) -> Result<T> {
    serde_path_to_error::deserialize(&mut serde_json::Deserializer::from_str(text)).map_err(|error| {
        let said = error.inner().to_string();
        let (message, place) = said.rfind(" at line ").map_or((said.as_str(), ""), |at| said.split_at(at));
        let found = FileError::of_value(&error.path().to_string(), message);
        let hint = joined(found.hint.as_deref(), of_calls);
        JobError::input(format!("call: {}{place}", FileError { hint: None, ..found }), hint)
    })
}

/// The row of a name. The error says which names come near.
pub fn row(name: &str) -> Result<&'static Row> {
    jobs().iter().find(|row| row.name == name).ok_or_else(|| {
        let names: Vec<&str> = jobs().iter().map(|row| row.name).collect();
        let near = petzval_base::nearest(name, &names);
        let hint = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("one of {}", names.join(", ")),
        };
        JobError::input(format!("call: there is no job `{name}`"), hint)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_with_a_byte_order_mark_is_read_and_one_with_a_key_twice_is_refused() {
        let text = r#"{"format": 1, "job": "lens-list", "request": {"a": {"b": 1}}}"#;
        assert_eq!(Call::parse(&format!("\u{feff}{text}")).unwrap(), Call::parse(text).unwrap());
        for (once, twice, key) in [
            (r#""b": 1"#, r#""b": 1, "b": 2"#, "duplicate key `b` at line 1"),
            (r#""job""#, r#""job": "lens-show", "job""#, "duplicate field `job`"),
        ] {
            let error = Call::parse(&text.replace(once, twice)).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
    }

    #[test]
    fn a_call_that_cannot_be_read_names_the_key_and_says_what_to_write() {
        let with = |more: &str| format!("{{\"format\": 1, \"job\": \"lens-list\", {more}}}");
        for (text, says, hints) in [
            ("[1, 2]".to_owned(), "call: expected an object", "a call is {"),
            (with("\"threads\": -2"), "call: `threads`: -2: expected a number from 0", "whole number"),
            (with("\"treads\": 2"), "call: `treads`: no such key here at line 1", "did you mean `threads`?"),
            (with("\"threads\": 1e400"), "call: `threads`: number out of range at line 1", "a call is {"),
            (with("\"request\": {\"a\": 1e400}"), "call: `request.a`: number out of range", "a call is {"),
            ("{\"format\": 1".to_owned(), "call: EOF", "a call is {"),
        ] {
            let report = Call::parse(&text).unwrap_err().report();
            assert!(report.message.starts_with(says), "{}", report.message);
            assert!(report.hint.contains(hints), "{}", report.hint);
        }
    }
}
