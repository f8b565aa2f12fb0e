//! What a job is, and the table of all of them.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use petzval_base::FileError;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, schema_for};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::as_unit::AsUnit;
use crate::built_in::is_built_in;
use crate::context::Context;
use crate::error::{JobError, Place, Result, Stopped};
use crate::panic_place;
use crate::results::NOWHERE;

/// A verb: a request comes in, a response goes out.
pub trait Job {
    /// Its name in a [`Call`](crate::Call): the words of the command, joined by hyphens.
    const NAME: &'static str;
    /// What it does, in one sentence.
    const ABOUT: &'static str;
    /// Keys that a request must hold; every other key has a default.
    const NEEDS: &'static [&'static str];
    /// Its request.
    type Request: Serialize + DeserializeOwned + JsonSchema;
    /// Its response.
    type Response: Serialize + JsonSchema;

    /// How it is done as a unit of work.
    const UNIT: AsUnit<Self::Request> = AsUnit::PLAIN;

    /// Runs it.
    fn run(request: &Self::Request, context: &Context) -> Result<Self::Response>;
}

/// A job whose types are JSON: a row of the [table](crate::jobs).
#[derive(Clone, Copy, Serialize)]
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// What it does.
    pub about: &'static str,
    #[serde(skip)]
    schema: fn() -> Value,
    #[serde(skip)]
    response_schema: fn() -> Value,
    #[serde(skip)]
    filled_in: fn(Value) -> Result<Value, FileError>,
    #[serde(skip)]
    run: fn(Value, &Context) -> Result<Value>,
    #[serde(skip)]
    seeded: fn(Value, u64) -> Result<Option<Value>>,
    #[serde(skip)]
    kept_in: fn(Value, &Path) -> Result<Value>,
    #[serde(skip)]
    going_on: fn(Value, &Path) -> Result<Option<Value>>,
    #[serde(skip)]
    behind: fn(Value, &Context) -> Result<Vec<PathBuf>>,
    #[serde(skip)]
    out_in: Option<&'static str>,
    #[serde(skip)]
    keeps_checkpoints: bool,
}

impl Row {
    /// The row of a job.
    pub const fn of<J: Job>() -> Self {
        Self {
            name: J::NAME,
            about: J::ABOUT,
            schema: schema::<J>,
            response_schema: response_schema::<J>,
            filled_in: filled_in::<J>,
            run: run::<J>,
            seeded: seeded::<J>,
            kept_in: kept_in::<J>,
            going_on: going_on::<J>,
            behind: behind::<J>,
            out_in: J::UNIT.out_in,
            keeps_checkpoints: J::UNIT.going_on.is_some(),
        }
    }

    /// The JSON Schema of its request.
    pub fn schema(&self) -> Value {
        (self.schema)()
    }

    /// The JSON Schema of its request, made once: units by the thousand are of one job.
    pub(crate) fn kept_schema(&self) -> Arc<Value> {
        static SCHEMAS: Mutex<BTreeMap<&str, Arc<Value>>> = Mutex::new(BTreeMap::new());
        // The map stays valid if a thread panics while it holds the lock.
        let mut known = SCHEMAS.lock().unwrap_or_else(PoisonError::into_inner);
        known.entry(self.name).or_insert_with(|| Arc::new(self.schema())).clone()
    }

    /// The JSON Schema of its response.
    pub fn response_schema(&self) -> Value {
        (self.response_schema)()
    }

    /// A request with every default filled in. A request that does not fit the schema is an error with the key that is wrong.
    pub fn filled_in(&self, request: Value) -> Result<Value> {
        (self.filled_in)(request.clone()).map_err(|wrong| refused(self.name, wrong, &request))
    }

    /// As [`Row::filled_in`], for a unit of work: a folder of results that a call must name may be left out. The error names the key path, and
    /// has a hint.
    pub fn filled_in_as_unit(&self, mut request: Value) -> Result<Value, FileError> {
        let table = self.out_in.and_then(|table| request.pointer_mut(table)).and_then(Value::as_object_mut);
        if let Some(keys) = table {
            keys.entry("out").or_insert_with(|| NOWHERE.into());
        }
        (self.filled_in)(request)
    }

    /// The error of a request that does not fit, from that of one of its keys.
    pub fn refused(&self, wrong: FileError, request: &Value) -> JobError {
        refused(self.name, wrong, request)
    }

    /// A request with another seed; none if the job draws nothing at random.
    pub fn seeded(&self, request: Value, seed: u64) -> Result<Option<Value>> {
        (self.seeded)(request, seed)
    }

    /// A request whose results are written into a folder, or below it; the request itself if the job writes nothing.
    pub fn kept_in(&self, request: Value, folder: &Path) -> Result<Value> {
        (self.kept_in)(request, folder)
    }

    /// The request that goes on from what a folder of [`Row::kept_in`] holds; none if the job has to begin again.
    pub fn going_on(&self, request: Value, folder: &Path) -> Result<Option<Value>> {
        (self.going_on)(request, folder)
    }

    /// Whether the job keeps checkpoints, from which a later one goes on.
    pub fn keeps_checkpoints(&self) -> bool {
        self.keeps_checkpoints
    }

    /// Files and folders on which the result of a request depends, but which only a file that it names refers to.
    pub fn behind(&self, request: Value, context: &Context) -> Result<Vec<PathBuf>> {
        (self.behind)(request, context)
    }

    /// Runs it. A request that does not fit the schema is an error with the key that is wrong; a panic is a failure of this job alone.
    pub fn run(&self, request: Value, context: &Context) -> Result<Value> {
        let context = context.for_a_job();
        let mut texts = Vec::new();
        collect_texts(&request, "", &mut texts);
        let result = guarded(self.name, || (self.run)(request, &context));
        // Work that does not know of the context does not know what the job has written before.
        result.map_err(|error| match error {
            JobError::Stopped(stopped) if stopped.kept.is_empty() => {
                Stopped { kept: context.written(), ..*stopped }.into()
            }
            other => at_named(other, &texts),
        })
    }
}

/// Does work of a job. A panic is an error that names the job.
pub fn guarded<T>(job: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    panic_place::keep();
    // What a job leaves half done is dropped with it: its context is lent, and holds nothing that a panic could break.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let (message, place) = panic_place::of(panic.as_ref());
        Err(JobError::Panic { job: job.to_owned(), message, place })
    })
}

fn schema<J: Job>() -> Value {
    let mut schema = schema_for!(J::Request).to_value();
    if let (Some(keys), false) = (schema.as_object_mut(), J::NEEDS.is_empty()) {
        keys.insert("required".to_owned(), J::NEEDS.into());
        // What a request must hold has no default, whatever the type has.
        for key in J::NEEDS {
            let property = keys.get_mut("properties").and_then(|all| all.get_mut(*key));
            if let Some(property) = property.and_then(Value::as_object_mut) {
                property.remove("default");
            }
        }
    }
    schema
}

fn response_schema<J: Job>() -> Value {
    // What is written, which may differ from what is read: a default need not be written, and is there all the same.
    SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator()
        .into_root_schema_for::<J::Response>()
        .to_value()
}

/// A hint about a key, and where to read more.
pub(crate) fn joined(hint: Option<&str>, more: &str) -> String {
    let Some(hint) = hint else { return more.to_owned() };
    let end = if hint.ends_with(['?', '.', '!']) { "" } else { ";" };
    format!("{hint}{end} {more}")
}

/// Where to read what a request of a job may hold.
pub(crate) fn schema_hint(job: &str) -> String {
    format!("`petzval schema job {job}` prints what a request may hold")
}

/// The error of a request of a job, from that of one of its keys.
fn refused(job: &str, wrong: FileError, request: &Value) -> JobError {
    let (hint, place) = (wrong.hint.clone().unwrap_or_default(), Place::of_key(&wrong.key, request));
    let error = JobError::input(format!("request of {job}: {}", FileError { hint: None, ..wrong }), hint);
    if let Some(place) = place { error.at_place(place) } else { error }
}

/// Longest text that may name an input, bytes; longer ones are inputs themselves.
const LONGEST_PATH: usize = 4096;

/// An error of an input with the key under which a request with these texts names that input. The message begins with its path, or says how it is
/// called.
fn at_named(error: JobError, texts: &[(String, String)]) -> JobError {
    let JobError::Input { message, place, .. } = &error else { return error };
    let known = place.as_deref().cloned().unwrap_or_default();
    let begins = |text: &str| message.strip_prefix(text).is_some_and(|rest| rest.starts_with(": "));
    let is_named = |text: &str| begins(text) || message.contains(&format!("called `{text}`"));
    let found = texts.iter().find(|(_, text)| known.key.is_empty() && is_named(text));
    let Some((key, value)) = found.cloned() else { return error };
    let is_path = |text: &str| !is_built_in(text) || Path::new(text).exists();
    let path = known.path.clone().or_else(|| (begins(&value) && is_path(&value)).then(|| (&value).into()));
    error.at_place(Place { path, key, value, ..known })
}

/// Collects the texts in a request that may name an input, with their key paths. Numbers are passed over: a picture may be among them.
fn collect_texts(value: &Value, key: &str, texts: &mut Vec<(String, String)>) {
    let below = |part: &str| if key.is_empty() { part.to_owned() } else { format!("{key}.{part}") };
    match value {
        Value::String(text) if (1..=LONGEST_PATH).contains(&text.len()) => {
            texts.push((key.to_owned(), text.clone()));
        }
        Value::Object(keys) => {
            keys.iter().for_each(|(name, value)| collect_texts(value, &below(name), texts))
        }
        Value::Array(items) => {
            let others = items.iter().enumerate().filter(|(_, item)| !item.is_number());
            others.for_each(|(i, item)| collect_texts(item, &below(&i.to_string()), texts));
        }
        _ => {}
    }
}

fn request<J: Job>(request: Value) -> Result<J::Request> {
    read::<J>(&request).map_err(|wrong| refused(J::NAME, wrong, &request))
}

/// A request as the job reads it. The error names the key path of what does not fit, and has a hint.
fn read<J: Job>(request: &Value) -> Result<J::Request, FileError> {
    let hinted = |error: FileError| FileError {
        hint: Some(joined(error.hint.as_deref(), &schema_hint(J::NAME))),
        ..error
    };
    if !J::NEEDS.is_empty() && !request.is_object() {
        return Err(hinted(FileError::of_value(".", "expected an object")));
    }
    if let Some(missing) = J::NEEDS.iter().find(|key| request.get(key).is_none()) {
        let error = FileError::of_value(missing, "the key is missing");
        return Err(hinted(match misspelt::<J>(request, missing) {
            Some(key) => error.hint(format!("`{key}` is no key here; did you mean `{missing}`?")),
            None => error,
        }));
    }
    serde_path_to_error::deserialize(request)
        .map_err(|error| hinted(FileError::of_value(&error.path().to_string(), &error.inner().to_string())))
}

/// The key of a request that the job does not know, and that comes near a missing one.
fn misspelt<J: Job>(request: &Value, missing: &str) -> Option<String> {
    let schema = schema::<J>();
    let known = schema.get("properties").and_then(Value::as_object);
    let unknown: Vec<&str> = (request.as_object()?.keys())
        .map(String::as_str)
        .filter(|key| known.is_none_or(|known| !known.contains_key(*key)))
        .collect();
    petzval_base::nearest(missing, &unknown).map(str::to_owned)
}

/// A request as the job reads it, with every default filled in.
fn filled_in<J: Job>(of: Value) -> Result<Value, FileError> {
    serde_json::to_value(read::<J>(&of)?).map_err(|e| FileError::of_value(".", &e.to_string()))
}

fn to_json(of: &impl Serialize) -> Result<Value> {
    serde_json::to_value(of).map_err(|e| JobError::failed(e.to_string()))
}

fn seeded<J: Job>(of: Value, seed: u64) -> Result<Option<Value>> {
    let mut request = request::<J>(of)?;
    let Some(set) = J::UNIT.seed else { return Ok(None) };
    set(&mut request, seed);
    to_json(&request).map(Some)
}

fn kept_in<J: Job>(of: Value, folder: &Path) -> Result<Value> {
    let mut request = request::<J>(of)?;
    if let Some(place) = J::UNIT.place {
        place(&mut request, folder);
    }
    to_json(&request)
}

fn going_on<J: Job>(of: Value, folder: &Path) -> Result<Option<Value>> {
    let request = request::<J>(of)?;
    let again = J::UNIT.going_on.and_then(|going_on| going_on(&request, folder));
    again.as_ref().map(to_json).transpose()
}

fn behind<J: Job>(of: Value, context: &Context) -> Result<Vec<PathBuf>> {
    let request = request::<J>(of)?;
    J::UNIT.behind.map_or_else(|| Ok(Vec::new()), |behind| behind(&request, context))
}

fn run<J: Job>(of: Value, context: &Context) -> Result<Value> {
    let request = request::<J>(of)?;
    to_json(&J::run(&request, context)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Silent;

    struct Broken;

    impl Job for Broken {
        const NAME: &'static str = "broken";
        const ABOUT: &'static str = "Panics.";
        const NEEDS: &'static [&'static str] = &[];
        type Request = u32;
        type Response = u32;

        fn run(request: &u32, _: &Context) -> Result<u32> {
            assert!(*request != 0, "zero is nothing");
            // In a thread of the pool, whose panic goes on in the caller's.
            rayon::join(|| assert!(*request != 1, "one is too few: {request}"), || ());
            Ok(*request)
        }
    }

    #[test]
    fn a_panic_is_an_error_of_its_job_alone() {
        let context = Context::new(crate::built_in_assets(), Arc::new(Silent));
        let row = Row::of::<Broken>();
        let error = row.run(0.into(), &context).unwrap_err();
        let JobError::Panic { job, message, place } = &error else { panic!("{error}") };
        assert_eq!((job.as_str(), message.as_str()), ("broken", "zero is nothing"));
        let place = place.as_deref().unwrap();
        assert!(place.contains("job.rs:"), "{place}");
        assert_eq!(error.to_string(), format!("broken: a fault of this program at {place}: zero is nothing"));
        let report = error.report();
        assert_eq!((report.kind.as_str(), report.place.unwrap().source.as_deref()), ("panic", Some(place)));
        let error = row.run(1.into(), &context).unwrap_err();
        assert!(matches!(&error, JobError::Panic { place: Some(_), .. }), "{error}");
        assert!(error.to_string().ends_with(": one is too few: 1"), "{error}");
        assert_eq!(row.run(2.into(), &context).unwrap(), 2);
    }

    #[test]
    fn the_error_of_a_request_has_the_key_and_the_value() {
        let context = Context::new(crate::built_in_assets(), Arc::new(Silent));
        let place = |path: Option<&str>, key: &str, value: &str| Place {
            path: path.map(PathBuf::from),
            key: key.to_owned(),
            value: value.to_owned(),
            ..Place::default()
        };
        let lens = "cooke-triplet-nominal";
        for (job, request, expected) in [
            ("data-check", serde_json::json!({"data": 5}), place(None, "data", "5")),
            ("lens-trace", serde_json::json!({"field": "a"}), place(None, "lens", "")),
            ("lens-show", serde_json::json!({"lens": lens, "lenss": "x"}), place(None, "lenss", "x")),
            // What is named, and is not there.
            (
                "data-check",
                serde_json::json!({"data": "no/where"}),
                place(Some("no/where"), "data", "no/where"),
            ),
            ("report", serde_json::json!({"run": "no/where"}), place(Some("no/where"), "run", "no/where")),
            ("lens-show", serde_json::json!({"lens": "nowhere"}), place(None, "lens", "nowhere")),
        ] {
            let report = crate::row(job).unwrap().run(request, &context).unwrap_err().report();
            assert_eq!((report.kind.as_str(), report.place), ("input", Some(expected)), "{job}");
        }
    }

    #[test]
    fn the_schema_of_one_job_is_made_once() {
        let row = crate::row("lens-trace").unwrap();
        assert!(Arc::ptr_eq(&row.kept_schema(), &row.kept_schema()));
        assert_eq!(*row.kept_schema(), row.schema());
    }

    #[test]
    fn a_unit_may_leave_out_a_folder_of_results_that_a_call_must_name() {
        let psf = crate::row("psf").unwrap();
        let request = serde_json::json!({"lens": "cooke-triplet-nominal"});
        assert!(
            psf.filled_in(request.clone()).unwrap_err().to_string().contains("`out`: the key is missing")
        );
        assert_eq!(psf.filled_in_as_unit(request).unwrap()["out"], NOWHERE);
        let own = serde_json::json!({"lens": "cooke-triplet-nominal", "out": "own"});
        assert_eq!(psf.filled_in_as_unit(own).unwrap()["out"], "own");
        let search = serde_json::json!({"start": {"new": {"lens": "cooke-triplet-nominal"}}});
        let search = crate::row("lens-optimize").unwrap().filled_in_as_unit(search).unwrap();
        assert_eq!(search["start"]["new"]["out"], NOWHERE);
        let wrong = psf.filled_in_as_unit(serde_json::json!({"out": "own"})).unwrap_err();
        assert_eq!((wrong.key.as_str(), wrong.message.as_str()), ("lens", "the key is missing"));
        assert_eq!(wrong.hint, Some(schema_hint("psf")));
    }
}
