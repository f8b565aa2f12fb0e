//! A job with all that it needs, as one value: a work unit, a call from another language, a request to a server.

use std::path::{Path, PathBuf};

use petzval_base::FileError;
use schemars::{JsonSchema, schema_for};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::context::Context;
use crate::error::{JobError, Place, Result};
use crate::glass::context_with;
use crate::job::{Row, joined};
use crate::keys::error_in_keys;
use crate::table::Table;
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
        let in_file = |error: JobError| match error {
            JobError::Input { message, hint, place } => {
                let place = Place {
                    path: Some(path.to_owned()),
                    ..place.map_or_else(Place::default, |place| *place)
                };
                JobError::input(format!("{}: {message}", path.display()), hint).at_place(place)
            }
            other => other,
        };
        let text = petzval_base::read_text(path)
            .map_err(|e| in_file(JobError::input(e.to_string(), "give a call in JSON, as UTF-8 text")))?;
        Self::parse(&text).map_err(in_file)
    }

    /// Reads a call; a byte order mark is skipped. Fails on a key that is there twice. The error names the line and the key.
    pub fn parse(text: &str) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let hint =
            "a call is {\"format\": 1, \"job\": NAME, \"request\": {...}}; `petzval jobs` lists the names";
        // A list would be read as the values of the keys in their order.
        serde_json::from_str::<IgnoredAny>(text).map_err(|error| {
            JobError::input(format!("call: {error}"), hint).at_place(line_of(&error, text))
        })?;
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
            let error = JobError::input(format!("call: format {format} is not known"), hint);
            return Err(error.at_place(key("format", format)));
        }
        read(text, hint)
    }

    /// Makes it by the jobs of this crate, as [`Call::run_by`] does.
    pub fn run(self, context: &Context) -> Result<Value> {
        self.run_by(&Table::built_in(), context)
    }

    /// Makes it by the jobs of a table. Its glasses take precedence over those of the context. In a context without a command line, results name the
    /// job. Events and errors name keys of the request in place of flags of the command.
    pub fn run_by(self, table: &Table, context: &Context) -> Result<Value> {
        self.made(table, &context.clone().in_keys()).map_err(error_in_keys)
    }

    fn made(self, table: &Table, context: &Context) -> Result<Value> {
        if self.threads > MOST_THREADS {
            let message = format!("call: `threads` is {}, more than {MOST_THREADS}", self.threads);
            let error = JobError::input(message, "0 means those of the process");
            return Err(error.at_place(key("threads", self.threads)));
        }
        let row = table.row(&self.job)?;
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
            return Err(JobError::input(message, "leave it out").at_place(key("device", device)));
        };
        match keys.get("device") {
            Some(other) if other.as_str() != Some(device) => {
                let message =
                    format!("call: `device` is \"{device}\", and the request has `device`: {other}");
                Err(JobError::input(message, "name the device once").at_place(key("device", device)))
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
        let written = serde_json::from_str(text).unwrap_or(Value::Null);
        let of_key = Place::of_key(&found.key, &written).unwrap_or_default();
        let Place { line, column, .. } = line_of(error.inner(), text);
        JobError::input(format!("call: {}{place}", FileError { hint: None, ..found }), hint).at_place(Place {
            line,
            column,
            ..of_key
        })
    })
}

/// The place of a key of a call with its value.
fn key(key: &str, value: impl std::fmt::Display) -> Place {
    Place { key: key.to_owned(), value: value.to_string(), ..Place::default() }
}

/// Line and column at which the text of a call is wrong. The reader counts columns in bytes.
fn line_of(error: &serde_json::Error, text: &str) -> Place {
    let line = text.lines().nth(error.line().saturating_sub(1)).unwrap_or_default();
    let column = error.column().checked_sub(1).map(|before| {
        let before = line.get(..before.min(line.len())).unwrap_or(line);
        before.chars().count() as u32 + 1
    });
    let line = (error.line() > 0).then_some(error.line() as u32);
    Place { line, column, ..Place::default() }
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

    #[test]
    fn the_error_of_a_call_has_its_place() {
        let with = |more: &str| format!("{{\"format\": 1,\n \"job\": \"lens-list\", {more}}}");
        let of_key = |line: Option<u32>, key: &str, value: &str| (line, key.to_owned(), value.to_owned());
        for (text, place) in [
            (with("\"threads\": -2"), of_key(Some(2), "threads", "-2")),
            (with("\"treads\": [2]"), of_key(Some(2), "treads", "[2]")),
            ("{\n".to_owned(), of_key(Some(2), "", "")),
            (with("").replace("1,", "7,"), of_key(None, "format", "7")),
        ] {
            let text = text.replace(", }", "}");
            let found = Call::parse(&text).unwrap_err().report().place.unwrap();
            assert_eq!((found.line, found.key, found.value), place, "{text}");
        }
        // Columns count characters.
        let error = Call::parse("{\"é\": x}").unwrap_err().report();
        assert_eq!(error.place.unwrap().column, Some(7), "{}", error.message);
        assert_eq!(crate::row("lens-lst").err().unwrap().report().place, Some(key("job", "lens-lst")));

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("call.json");
        let place = || Call::read(&path).unwrap_err().report().place.unwrap();
        assert_eq!(place(), Place::of_path(&path));
        std::fs::write(&path, "{").unwrap();
        assert_eq!((place().path, place().line), (Some(path.clone()), Some(1)));
    }
}
