//! Why a job ends without a response.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use petzval_base::{Cancelled, FileError, InFile, LONGEST_NAME, quote, reason_and_hint, write_whole};
use petzval_design::error::{DesignError, WrongSetting};
use petzval_files::raw_file::RawFileError;
use petzval_files::{ImageError, decode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

/// Where a text is that a request holds.
pub(crate) const INLINE: &str = "inline";

/// Where tables are that a request holds. They are read as a text that no user sees: errors name keys, not lines.
pub(crate) const TABLES: &str = "tables";

/// The kind of an input in a report.
const INPUT: &str = "input";

/// What to do where rights, or a file system that is read-only, keep a job from a file or folder.
const RIGHTS: &str = "this user lacks a right there: make what is read readable; for results name another place with --out, or copy the folder to \
                      where you may write and work on the copy";

/// Who has to change something before the job can succeed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The user: the request or a file is wrong.
    Input,
    /// Nobody: the request was proper, and the job failed.
    Job,
}

/// What a job gives, or why it ends without.
pub type Result<T, E = JobError> = std::result::Result<T, E>;

/// Why a job ends without a response.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// A setting of the request has a value that cannot be used.
    #[error("{key} {value}: {message}")]
    Setting {
        /// Field of the request, in snake case.
        key: &'static str,
        /// Its value as text; empty where it is not worth repeating.
        value: String,
        /// What is wrong.
        message: String,
        /// What to give instead.
        hint: String,
    },
    /// The request, or something that it names, cannot be used.
    #[error("{message}")]
    Input {
        /// What is wrong.
        message: String,
        /// What to do instead; may be empty.
        hint: String,
        /// The key of the request or the file, which the message names as well; none if it is not known.
        place: Option<Box<Place>>,
    },
    /// A place in a file is wrong.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong in it, where, and a hint.
        error: Box<FileError>,
    },
    /// The request was proper, and the job failed.
    #[error("{0}")]
    Failed(String),
    /// The job has a fault and panicked.
    #[error("{job}: a fault of this program{}: {message}", at(place.as_deref()))]
    Panic {
        /// Name of the job.
        job: String,
        /// What the panic says.
        message: String,
        /// Where, as `file:line:column` of the source.
        place: Option<String>,
    },
    /// The job was cancelled.
    #[error(transparent)]
    Stopped(Box<Stopped>),
}

/// How a cancelled job ends: where it stopped, what is kept, and how to go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, thiserror::Error)]
#[serde(deny_unknown_fields)]
#[error("{message}")]
pub struct Stopped {
    /// Where it stopped.
    pub message: String,
    /// The files and folders that it has written, each of them whole.
    #[serde(default, serialize_with = "petzval_base::lossy_path::serialize")]
    pub kept: Vec<PathBuf>,
    /// The request with which the same job goes on from there; none if it begins again.
    #[serde(default)]
    pub resume: Option<Value>,
    /// The response with what was found until then, if that is of use.
    #[serde(default)]
    pub response: Option<Value>,
}

impl Stopped {
    /// A job that stopped where the message says, and keeps nothing.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), kept: Vec::new(), resume: None, response: None }
    }

    /// A job that also keeps a file or folder.
    pub fn keeping(mut self, path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        if !self.kept.contains(&path) {
            self.kept.push(path);
        }
        self
    }

    /// A job that goes on with a request, which JSON must be able to hold.
    pub fn going_on_with(self, request: &impl Serialize) -> Self {
        Self { resume: serde_json::to_value(request).ok(), ..self }
    }

    /// A job with what it has found, which JSON must be able to hold.
    pub fn with_response(self, response: &impl Serialize) -> Self {
        Self { response: serde_json::to_value(response).ok(), ..self }
    }
}

/// A [`JobError`] as a value, for programs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrorReport {
    /// `setting`, `input`, `file`, `failed`, `panic` or `stopped`.
    pub kind: String,
    /// What is wrong.
    pub message: String,
    /// Where, if there is a place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<Place>,
    /// What to do; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub hint: String,
    /// What a cancelled job keeps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stopped: Option<Stopped>,
}

/// A key of a request, a place in a file, or one in the source of this program. What is not known is left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Place {
    /// The file.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "petzval_base::lossy_path::serialize")]
    pub path: Option<PathBuf>,
    /// Its line, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u32>,
    /// The column in the line, in characters from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<u32>,
    /// The key of the file; where no file is wrong, of the request, or of the call around it.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub key: String,
    /// Its value as text.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub value: String,
    /// `file:line:column` in the source of this program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

impl ErrorReport {
    /// Place and message on one line, as the command prints errors: ``lens.toml:3:9: `radius_mm = 0`: out of range``. The hint is left out.
    pub fn in_words(&self) -> String {
        // The message of an input names its key or file itself.
        let place = self.place.as_ref().filter(|_| self.kind != INPUT);
        format!("{}{}", place.map_or_else(String::new, Place::in_words), self.message)
    }
}

impl Place {
    /// The place of a file or folder that cannot be used as a whole.
    pub fn of_path(path: impl Into<PathBuf>) -> Self {
        Self { path: Some(path.into()), ..Self::default() }
    }

    /// The place of a key path such as `run.new.changes[0]` in a request or a call, with what stands there as text. None if the path is empty.
    pub fn of_key(key: &str, of: &Value) -> Option<Self> {
        let value = value_at(of, key).map_or_else(String::new, text_of);
        (!key.is_empty()).then(|| Self { key: key.to_owned(), value, ..Self::default() })
    }

    /// The place in a file that an error is about.
    pub fn of_file(path: &Path, error: &FileError) -> Self {
        Self {
            path: Some(path.to_owned()),
            line: error.line,
            column: error.column,
            key: error.key.clone(),
            value: error.value.clone(),
            source: None,
        }
    }

    /// The beginning of a message about this place: ``path:line:column: `key = value`: ``. What is not known is left out; the text is empty if
    /// nothing is known.
    pub fn in_words(&self) -> String {
        let in_file = |path: &Path| match (self.line, self.column) {
            (Some(line), Some(column)) => format!("{}:{line}:{column}: ", path.display()),
            (Some(line), None) => format!("{}:{line}: ", path.display()),
            _ => format!("{}: ", path.display()),
        };
        let file = self.path.as_deref().map_or_else(String::new, in_file);
        let setting = match (self.key.is_empty(), self.value.is_empty()) {
            (false, false) => format!("`{} = {}`: ", self.key, self.value),
            (false, true) => format!("`{}`: ", self.key),
            (true, false) => format!("`{}`: ", self.value),
            (true, true) => String::new(),
        };
        let source = self
            .source
            .as_ref()
            .map_or_else(String::new, |source| format!("a fault of this program at {source}: "));
        format!("{file}{setting}{source}")
    }
}

impl Serialize for JobError {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.report().serialize(serializer)
    }
}

/// The value at a key path, in which places of lists stand in brackets or behind a point.
fn value_at<'v>(of: &'v Value, key: &str) -> Option<&'v Value> {
    let path = key.replace('[', ".").replace(']', "");
    path.split('.').try_fold(of, |value, part| match value {
        Value::Array(items) => items.get(part.parse::<usize>().ok()?),
        other => other.get(part),
    })
}

/// A value on one line: a text as it is, anything else as JSON; cut to a length that fits in a message.
fn text_of(value: &Value) -> String {
    quote(&value.as_str().map_or_else(|| value.to_string(), str::to_owned))
}

/// ` at PLACE`, or nothing.
fn at(place: Option<&str>) -> String {
    place.map_or_else(String::new, |place| format!(" at {place}"))
}

impl JobError {
    /// A setting with a value that cannot be used; the value may be empty.
    pub fn setting(
        key: &'static str,
        value: impl std::fmt::Display,
        message: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self::Setting { key, value: value.to_string(), message: message.into(), hint: hint.into() }
    }

    /// A request that cannot be used. If the hint is empty, the message may be an error that writes its own as one text.
    pub fn input(message: impl Into<String>, hint: impl Into<String>) -> Self {
        let (message, hint) = (message.into(), hint.into());
        if !hint.is_empty() {
            return Self::Input { message, hint, place: None };
        }
        let (reason, hint) = reason_and_hint(&message);
        Self::Input { message: reason.to_owned(), hint: hint.to_owned(), place: None }
    }

    /// The same error with its place, if it is an input of which only the message is known. Other errors have a place of their own.
    pub fn at_place(self, place: Place) -> Self {
        match self {
            Self::Input { message, hint, .. } => Self::Input { message, hint, place: Some(Box::new(place)) },
            other => other,
        }
    }

    /// A job that failed though the request was proper.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::Failed(message.into())
    }

    /// A file that could not be read or written. A full disk is nobody's mistake; everything else is one of the request. Where rights are missing, the
    /// hint says so in place of `hint`.
    pub fn system(message: impl Into<String>, error: &std::io::Error, hint: &str) -> Self {
        match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::failed(message),
            _ if is_forbidden(error) => Self::input(message, RIGHTS),
            _ => Self::input(message, hint),
        }
    }

    /// An error of a run that has begun, which goes on from its last checkpoint once a full disk has room again.
    pub(crate) fn of_run(error: DesignError) -> Self {
        if is_full_disk(&error) {
            return Self::failed(format!(
                "{error}; make room: the run goes on from its last checkpoint with --resume"
            ));
        }
        error.into()
    }

    /// Who has to change something.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Failed(_) | Self::Panic { .. } | Self::Stopped(_) => Fault::Job,
            Self::Setting { .. } | Self::Input { .. } | Self::File { .. } => Fault::Input,
        }
    }

    /// The error as a value.
    pub fn report(&self) -> ErrorReport {
        let report = |kind: &str, message: &str| ErrorReport {
            kind: kind.to_owned(),
            message: message.to_owned(),
            place: None,
            hint: String::new(),
            stopped: None,
        };
        match self {
            Self::Setting { key, value, message, hint } => ErrorReport {
                place: Some(Place { key: (*key).to_owned(), value: value.clone(), ..Place::default() }),
                hint: hint.clone(),
                ..report("setting", message)
            },
            Self::Input { message, hint, place } => {
                ErrorReport { place: place.as_deref().cloned(), hint: hint.clone(), ..report(INPUT, message) }
            }
            Self::File { path, error } => ErrorReport {
                place: Some(Place::of_file(path, error)),
                hint: error.hint.clone().unwrap_or_default(),
                ..report("file", &error.message)
            },
            Self::Failed(message) => {
                let (reason, hint) = reason_and_hint(message);
                ErrorReport { hint: hint.to_owned(), ..report("failed", reason) }
            }
            Self::Panic { message, place, .. } => ErrorReport {
                place: Some(Place { source: place.clone(), ..Place::default() }),
                ..report("panic", message)
            },
            Self::Stopped(stopped) => {
                ErrorReport { stopped: Some(Stopped::clone(stopped)), ..report("stopped", &stopped.message) }
            }
        }
    }
}

impl From<Stopped> for JobError {
    fn from(stopped: Stopped) -> Self {
        Self::Stopped(Box::new(stopped))
    }
}

impl From<Cancelled> for JobError {
    fn from(_: Cancelled) -> Self {
        Stopped::new("stopped before its end").into()
    }
}

impl From<DesignError> for JobError {
    fn from(error: DesignError) -> Self {
        let place = match &error {
            DesignError::Run { path, .. } | DesignError::Io { path, .. } => Some(Place::of_path(path)),
            _ => None,
        };
        let made = Self::without_place(error);
        if let Some(place) = place { made.at_place(place) } else { made }
    }
}

impl JobError {
    /// An error of a design; of one about a file or folder as a whole, the place is only in the message.
    fn without_place(error: DesignError) -> Self {
        match error {
            DesignError::Input { path, error } => {
                error_in_request(&path, &error).unwrap_or(Self::File { path, error })
            }
            DesignError::Setting(WrongSetting { setting, message, hint }) => {
                Self::Setting { key: "set", value: setting, message, hint }
            }
            DesignError::NoLight { lost: Some(_), .. } => {
                Self::input(error.to_string(), "let the light through there, or take a smaller sensor")
            }
            DesignError::NoWaves(_) => Self::input(error.to_string(), "take rays: psf.kind = \"geometric\""),
            _ if error.is_stopped() => Stopped::new(error.to_string()).into(),
            DesignError::Image(ImageError::Io { ref source, .. }) => Self::system(
                error.to_string(),
                source,
                "give a PNG, JPEG, TIFF, WebP or BMP file that exists",
            ),
            // What has no end, or is far too large to be read, was named by the request. What the system says of a file too large is about
            // one that was being written.
            DesignError::Io { error: ref why, .. }
                if why.raw_os_error().is_none()
                    && matches!(why.kind(), ErrorKind::InvalidInput | ErrorKind::FileTooLarge) =>
            {
                Self::input(error.to_string(), "")
            }
            DesignError::Io { error: ref why, .. } if is_forbidden(why) => {
                Self::system(error.to_string(), why, RIGHTS)
            }
            _ if is_full_disk(&error) => Self::failed(format!("{error}; make room and try again")),
            _ if error.is_input() => Self::input(error.to_string(), ""),
            _ => Self::failed(error.to_string()),
        }
    }
}

/// Whether a file could not be written because there is no room for it. What is far too large to be read is no such file, and has no number of
/// the system.
fn is_full_disk(error: &DesignError) -> bool {
    let DesignError::Io { error, .. } = error else { return false };
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => true,
        ErrorKind::FileTooLarge => error.raw_os_error().is_some(),
        _ => false,
    }
}

/// Whether the system refuses a file or folder to this process.
fn is_forbidden(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

/// An error in a text that a request holds, with its line and key; none for one in a file.
fn error_in_request(path: &Path, error: &FileError) -> Option<JobError> {
    let name = path.to_str()?;
    let bare = match () {
        () if name.contains(&format!("({INLINE})")) => FileError { hint: None, ..error.clone() },
        () if name.contains(&format!("({TABLES})")) => {
            FileError { hint: None, line: None, column: None, ..error.clone() }
        }
        () => return None,
    };
    let separator = if bare.line.is_some() { "," } else { ":" };
    Some(JobError::input(format!("{name}{separator} {bare}"), error.hint.clone().unwrap_or_default()))
}

impl From<RawFileError> for JobError {
    fn from(error: RawFileError) -> Self {
        match error {
            RawFileError::Sidecar(InFile { path, error }) => Self::File { path, error },
            RawFileError::Content { path, reason, hint } => {
                Self::input(format!("{}: {reason}", path.display()), hint)
            }
            RawFileError::Io { ref source, .. } => {
                let hint = "give a file that can be read, or a place that can be written";
                Self::system(error.to_string(), source, hint)
            }
        }
    }
}

/// Bytes of the largest file of which an error shows a line.
const LARGEST_SHOWN: u64 = 64 << 20;

/// The text of a file that an error names, to show the line; `None` if it cannot be read, or is very large.
pub fn text_of_file(path: &Path) -> Option<String> {
    petzval_base::read_at_most(path, LARGEST_SHOWN).ok().map(|bytes| decode(&bytes).into_owned())
}

/// Writes a file wholly or not at all.
pub(crate) fn write_file(path: &Path, contents: impl AsRef<[u8]>) -> Result<()> {
    Ok(write_whole(path, contents.as_ref()).map_err(DesignError::io(path))?)
}

/// Makes the folder for results, with its parents. A name at which none can be made is a mistake of the request.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    let wrong = |message: String, hint: &str| JobError::setting("out", path.display(), message, hint);
    let usual = "give a folder; it is made if it does not exist";
    if path.exists() && !path.is_dir() {
        return Err(wrong("this is a file".to_owned(), usual));
    }
    check_length(path)?;
    std::fs::create_dir_all(path)
        .map_err(|error| wrong(error.to_string(), if is_forbidden(&error) { RIGHTS } else { usual }))
}

/// Bytes of the longest path that systems take, with room for the names of files in a folder of results.
const LONGEST_PATH: usize = 3900;

/// Fails if a name or a path is longer than file systems hold. A folder that does not exist yet would fail only when it is made.
pub(crate) fn check_length(path: &Path) -> Result<()> {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let bytes = whole.as_os_str().len();
    let longest = whole.components().map(|part| part.as_os_str().len()).max().unwrap_or(0);
    let (message, hint) = if longest > LONGEST_NAME {
        let message = format!("a name of {longest} bytes is too long: file systems hold {LONGEST_NAME}");
        (message, "give a shorter name")
    } else if bytes > LONGEST_PATH {
        (format!("the path of {bytes} bytes is too long"), "give a place with a shorter path")
    } else {
        return Ok(());
    };
    Err(JobError::input(format!("{}: {message}", path.display()), hint))
}

/// A value as indented JSON, with the keys of its objects in alphabetical order.
pub fn json(value: &impl serde::Serialize) -> Result<String> {
    let text = || serde_json::to_string_pretty(&serde_json::to_value(value)?);
    text().map_err(|e: serde_json::Error| JobError::failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_full_disk_names_resume_where_a_run_can_go_on() {
        let full = || DesignError::io(Path::new("a.png"))(std::io::Error::from(ErrorKind::StorageFull));
        let of_any_verb = JobError::from(full()).to_string();
        assert!(
            of_any_verb.contains("a.png") && of_any_verb.ends_with("; make room and try again"),
            "{of_any_verb}"
        );
        let of_run = JobError::of_run(full()).to_string();
        assert!(of_run.ends_with("the run goes on from its last checkpoint with --resume"), "{of_run}");
        assert_eq!([JobError::from(full()), JobError::of_run(full())].map(|e| e.fault()), [Fault::Job; 2]);
    }

    #[test]
    fn a_folder_that_is_read_only_has_a_hint_from_any_verb() {
        for kind in [ErrorKind::PermissionDenied, ErrorKind::ReadOnlyFilesystem] {
            let source = || std::io::Error::from(kind);
            let path = PathBuf::from("run/lock");
            let of_verb = || JobError::from(DesignError::io(&path)(source()));
            let of_image = DesignError::from(ImageError::Io { path: path.clone(), source: source() });
            let of_raw = RawFileError::Io { path: path.clone(), source: source() };
            let of_run = JobError::of_run(DesignError::io(&path)(source()));
            for error in [of_verb(), of_run, of_image.into(), of_raw.into()] {
                assert_eq!(error.fault(), Fault::Input);
                let report = error.report();
                assert!(report.message.contains("run/lock"), "{report:?}");
                assert!(
                    report.hint.contains("--out") && report.hint.contains("copy the folder"),
                    "{report:?}"
                );
            }
        }
    }

    #[test]
    fn an_error_is_a_value_with_kind_message_place_and_hint() {
        let text = "a = 1\nb = 2\n";
        let error = Box::new(FileError::at(text, 10..11, "b", "too large").hint("1 or less"));
        let stopped =
            Stopped::new("stopped after 1 of 2").keeping("a.png").going_on_with(&json!({"out": "x"}));
        for (error, json) in [
            (
                JobError::setting("trials", 7, "out of range", "1 to 5"),
                json!({"kind": "setting", "message": "out of range", "place": {"key": "trials", "value": "7"}, "hint": "1 to 5"}),
            ),
            (
                JobError::input("no lens", "name one"),
                json!({"kind": "input", "message": "no lens", "hint": "name one"}),
            ),
            (
                JobError::input("`lens`: none", "name one").at_place(Place::of_path("a")),
                json!({"kind": "input", "message": "`lens`: none", "hint": "name one", "place": {"path": "a"}}),
            ),
            (
                JobError::File { path: "x.toml".into(), error },
                json!({"kind": "file", "message": "too large", "hint": "1 or less",
                    "place": {"path": "x.toml", "line": 2, "column": 5, "key": "b", "value": "2"}}),
            ),
            (JobError::failed("no light"), json!({"kind": "failed", "message": "no light"})),
            // Errors of other crates have both in one text.
            (
                JobError::input("no light; hint: open the stop", ""),
                json!({"kind": "input", "message": "no light", "hint": "open the stop"}),
            ),
            (
                JobError::failed("no light; hint: open the stop"),
                json!({"kind": "failed", "message": "no light", "hint": "open the stop"}),
            ),
            (
                stopped.into(),
                json!({"kind": "stopped", "message": "stopped after 1 of 2", "stopped": {
                    "message": "stopped after 1 of 2", "kept": ["a.png"], "resume": {"out": "x"}, "response": null}}),
            ),
        ] {
            assert_eq!(serde_json::to_value(&error).unwrap(), json);
            let back: ErrorReport = serde_json::from_value(json).unwrap();
            assert_eq!(back, error.report());
        }
    }

    #[test]
    fn a_key_path_has_its_value_as_text() {
        let request = json!({"run": {"seeds": [1, 2.5], "name": "x"}, "set": {"a.b": 1}});
        for (key, value) in [
            ("run.seeds[1]", "2.5"),
            ("run.seeds.0", "1"),
            ("run.name", "x"),
            ("run.seeds", "[1,2.5]"),
            ("run.none", ""),
            ("set.a.b", ""),
        ] {
            let place = Place::of_key(key, &request).unwrap();
            assert_eq!((place.key.as_str(), place.value.as_str()), (key, value));
        }
        assert_eq!(Place::of_key("", &request), None);
        // A message that names the key does not name it twice.
        let error =
            JobError::input("`run.name`: none", "").at_place(Place::of_key("run.name", &request).unwrap());
        assert_eq!(error.report().in_words(), "`run.name`: none");
        let of_run = JobError::from(DesignError::Run { path: "nope".into(), problem: "no run".to_owned() });
        assert_eq!(of_run.report().place, Some(Place::of_path("nope")));
    }

    #[test]
    fn an_error_in_words_begins_with_its_place() {
        let place = |path: Option<&str>, line, key: &str, value: &str| Place {
            path: path.map(PathBuf::from),
            line,
            column: line.map(|_| 9),
            key: key.to_owned(),
            value: value.to_owned(),
            source: None,
        };
        for (place, words) in [
            (Some(place(Some("a.toml"), Some(3), "b", "0")), "a.toml:3:9: `b = 0`: wrong"),
            (Some(place(Some("a.toml"), None, "", "")), "a.toml: wrong"),
            (Some(place(None, None, "trials", "7")), "`trials = 7`: wrong"),
            (Some(place(None, None, "lens", "")), "`lens`: wrong"),
            (
                Some(Place { source: Some("job.rs:1:2".to_owned()), ..Place::default() }),
                "a fault of this program at job.rs:1:2: wrong",
            ),
            (None, "wrong"),
        ] {
            let report = ErrorReport { place, ..JobError::failed("wrong").report() };
            assert_eq!(report.in_words(), words);
        }
    }

    #[test]
    fn names_that_no_file_system_holds_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(check_length(&folder.path().join("a".repeat(LONGEST_NAME))).is_ok());
        let long = check_length(&folder.path().join("ä".repeat(128))).unwrap_err().to_string();
        assert!(long.contains("256 bytes"), "{long}");
        let deep = ["a"; 2000].join("/");
        assert!(check_length(Path::new(&deep)).unwrap_err().to_string().contains("path"));
    }
}
