//! What a job says while it works, as values: a door prints, draws or passes them on.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

pub use petzval_design::pace::TimeLeft;
use petzval_learn::score::ScoreDescription;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// Something that a job says. As JSON, `event` names which it is.
///
/// [`Display`](fmt::Display) gives it in words, on one line without a full stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "event", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Event {
    /// Something to know before believing the result; the job continues.
    Warning {
        /// Which warning.
        kind: WarningKind,
        /// What is wrong, where.
        text: String,
    },
    /// Something that the job has done or found.
    Note {
        /// What.
        text: String,
        /// Figures in the text by name, with the unit in the name, such as `merit_um`; may be empty. One that is no number is null in JSON.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "numbers")]
        #[schemars(with = "BTreeMap<String, Option<f64>>")]
        figures: BTreeMap<String, f64>,
    },
    /// How far the job has come.
    Progress {
        /// Units of work done, in the unit that the job counts: steps, rounds, pictures.
        done: u64,
        /// Units of work in all; 0 if unknown.
        total: u64,
        /// What the job is doing now; may be empty.
        text: String,
        /// Figures in the text by name, with the unit in the name, such as `merit_um`; may be empty. One that is no number is null in JSON.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "numbers")]
        #[schemars(with = "BTreeMap<String, Option<f64>>")]
        figures: BTreeMap<String, f64>,
    },
    /// A step of a design.
    Step {
        /// The camera that is designed.
        camera: String,
        /// The block that moved; the goal of a lens alone, `spot` or `restored`; or `score`.
        block: String,
        /// Steps of the run that are taken, this one included.
        step: u64,
        /// Steps of the run in all.
        total: u64,
        /// Losses by name, before the step; that of a validation, after it. One that is no number is null in JSON.
        #[serde(deserialize_with = "numbers")]
        #[schemars(with = "BTreeMap<String, Option<f64>>")]
        losses: BTreeMap<String, f64>,
        /// How long the rest of the run will take, if that is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        time_left: Option<TimeLeft>,
    },
    /// A camera of a design is being scored.
    Scoring {
        /// The camera.
        camera: String,
        /// Windows that are scored.
        done: u64,
        /// Windows in all.
        total: u64,
        /// How long the rest of the run will take, if that is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        time_left: Option<TimeLeft>,
    },
    /// A camera of a design is finished and scored.
    Camera {
        /// Its name.
        camera: String,
        /// Its scores, in the order of the experiment.
        scores: Vec<CameraScore>,
        /// Mean over the field of its RMS spot radius, um.
        rms_spot_um: f64,
    },
    /// A file was written, whole. A path that is not UTF-8 is written with replacement characters.
    File {
        /// The file, or the folder if many were written into it at once.
        #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
        path: PathBuf,
        /// What it holds: `page`, `lens`, `picture`, `raw frame`, `figures`, `table`, `checkpoint`, and so on.
        what: String,
    },
}

impl Event {
    /// A note without figures.
    pub fn note(text: impl Into<String>) -> Self {
        Self::Note { text: text.into(), figures: BTreeMap::new() }
    }
}

/// Figures by name.
pub(crate) fn figures<N: Into<String>>(named: impl IntoIterator<Item = (N, f64)>) -> BTreeMap<String, f64> {
    named.into_iter().map(|(name, value)| (name.into(), value)).collect()
}

/// A score of a camera, with what is needed to print it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraScore {
    /// Its name in files, such as `psnr_db`.
    pub name: String,
    /// Its name in words.
    pub title: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// Digits after the point that are worth printing.
    pub decimals: usize,
    /// Its value, a mean over the held-out pictures.
    pub value: f64,
}

impl CameraScore {
    /// The value of a score.
    pub(crate) fn new(score: &ScoreDescription, value: f64) -> Self {
        let ScoreDescription { name, title, unit, decimals, .. } = score;
        Self { name: name.clone(), title: title.clone(), unit: unit.clone(), decimals: *decimals, value }
    }
}

/// What a warning is about. The names are stable: a program may count them, or hide some.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WarningKind {
    /// A file of a run is not what it was when the run wrote it.
    ChangedFile,
    /// Another version of this program began what is continued.
    OtherVersion,
    /// Another instruction set began what is continued: last digits differ.
    InstructionSet,
    /// One of several runs failed; the others go on.
    RunFailed,
    /// Runs that are compared differ in more than what is compared.
    Comparison,
    /// Keys of an experiment do not fit each other, the lens or the sensor.
    Experiment,
    /// A file of a lens or of glasses holds what is not understood or cannot be made.
    LensFile,
    /// A lens out of focus.
    OutOfFocus,
    /// Wavelengths that are left out, or of which a curve knows nothing.
    Spectrum,
    /// Light that falls outside the grid of the PSFs.
    LostLight,
    /// PSFs that are less accurate than wanted.
    PsfError,
    /// Pixels at their largest number.
    Saturation,
    /// A picture that does not fit its use.
    Picture,
    /// A picture that cannot be read and is left out.
    UnreadablePicture,
    /// A data set, its classes or its labels.
    DataSet,
    /// A raw frame of which something is unknown or odd.
    RawFrame,
    /// An edge whose response is uncertain.
    Edge,
    /// A measurement of captures that is uncertain or incomplete.
    Measurement,
    /// Tolerances or scores that are left out.
    LeftOut,
    /// Files of an earlier call in the folder of results.
    OldFile,
    /// Anything else.
    Other,
}

/// Numbers by name, of which one that is null is no number.
fn numbers<'d, D: Deserializer<'d>>(from: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let read = BTreeMap::<String, Option<f64>>::deserialize(from)?;
    Ok(read.into_iter().map(|(name, value)| (name, value.unwrap_or(f64::NAN))).collect())
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Warning { text, .. } => write!(f, "warning: {text}"),
            Self::Note { text, .. } | Self::Progress { text, .. } => f.write_str(text),
            Self::Step { camera, block, losses, .. } => {
                let losses: Vec<String> =
                    losses.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
                write!(f, "{camera} | {block} | {}", losses.join("  "))
            }
            Self::Scoring { camera, .. } => write!(f, "{camera} | score | windows"),
            Self::Camera { camera, scores, rms_spot_um } => {
                let scores: Vec<String> = scores.iter().map(CameraScore::to_string).collect();
                write!(f, "{camera}: {}, RMS spot {rms_spot_um:.2} um", scores.join(", "))
            }
            Self::File { path, what } => write!(f, "{what}: {}", path.display()),
        }
    }
}

impl fmt::Display for CameraScore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { title, unit, decimals, value, .. } = self;
        f.write_str(format!("{title} {value:.decimals$} {unit}").trim_end())
    }
}

/// Receives what a job says while it works. The command prints it, a studio draws it.
pub trait Watcher: Send + Sync {
    /// Something happened. A job calls it from any of its threads.
    fn event(&self, event: &Event);
}

/// Keeps what a job says, in words.
#[cfg(test)]
#[derive(Default)]
pub(crate) struct Lines(pub std::sync::Mutex<Vec<String>>);

#[cfg(test)]
impl Watcher for Lines {
    fn event(&self, event: &Event) {
        self.0.lock().unwrap().push(event.to_string());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_json_with_a_stable_form_and_come_back() {
        let score = |name: &str, unit: &str, value| CameraScore {
            name: name.to_lowercase(),
            title: name.to_owned(),
            unit: unit.to_owned(),
            decimals: 2,
            value,
        };
        let losses = BTreeMap::from([("psnr".to_owned(), f64::INFINITY), ("total".to_owned(), 0.25)]);
        for (event, json, text) in [
            (
                Event::Warning { kind: WarningKind::LostLight, text: "dark".to_owned() },
                r#"{"event":"warning","kind":"lost-light","text":"dark"}"#,
                "warning: dark",
            ),
            (
                Event::Scoring { camera: "a".to_owned(), done: 3, total: 25, time_left: None },
                r#"{"event":"scoring","camera":"a","done":3,"total":25}"#,
                "a | score | windows",
            ),
            (
                Event::Progress { done: 1, total: 2, text: "fields".to_owned(), figures: BTreeMap::new() },
                r#"{"event":"progress","done":1,"total":2,"text":"fields"}"#,
                "fields",
            ),
            (
                Event::Progress {
                    done: 1,
                    total: 2,
                    text: "PSNR: inf dB".to_owned(),
                    figures: figures([("psnr_db", f64::INFINITY), ("seconds", 0.5)]),
                },
                r#"{"event":"progress","done":1,"total":2,"text":"PSNR: inf dB","figures":{"psnr_db":null,"seconds":0.5}}"#,
                "PSNR: inf dB",
            ),
            (Event::note("done"), r#"{"event":"note","text":"done"}"#, "done"),
            (
                Event::Note { text: "merit 4 um".to_owned(), figures: figures([("merit_um", 4.0)]) },
                r#"{"event":"note","text":"merit 4 um","figures":{"merit_um":4.0}}"#,
                "merit 4 um",
            ),
            (
                Event::Step {
                    camera: "a".to_owned(),
                    block: "optics".to_owned(),
                    step: 3,
                    total: 9,
                    losses,
                    time_left: None,
                },
                r#"{"event":"step","camera":"a","block":"optics","step":3,"total":9,"losses":{"psnr":null,"total":0.25}}"#,
                "a | optics | psnr inf  total 0.2500",
            ),
            (
                Event::Step {
                    camera: "a".to_owned(),
                    block: "spot".to_owned(),
                    step: 3,
                    total: 9,
                    losses: BTreeMap::new(),
                    time_left: Some(TimeLeft { seconds: 1.5, is_least: true }),
                },
                r#"{"event":"step","camera":"a","block":"spot","step":3,"total":9,"losses":{},"time_left":{"seconds":1.5,"is_least":true}}"#,
                "a | spot | ",
            ),
            (
                Event::Camera {
                    camera: "a".to_owned(),
                    scores: vec![score("PSNR", "dB", 30.126), score("SSIM", "", 0.5)],
                    rms_spot_um: 4.0,
                },
                r#"{"event":"camera","camera":"a","scores":[{"name":"psnr","title":"PSNR","unit":"dB","decimals":2,"value":30.126},{"name":"ssim","title":"SSIM","unit":"","decimals":2,"value":0.5}],"rms_spot_um":4.0}"#,
                "a: PSNR 30.13 dB, SSIM 0.50, RMS spot 4.00 um",
            ),
            (
                Event::File { path: "a/b.html".into(), what: "page".to_owned() },
                r#"{"event":"file","path":"a/b.html","what":"page"}"#,
                "page: a/b.html",
            ),
        ] {
            assert_eq!(serde_json::to_string(&event).unwrap(), json);
            assert_eq!(event.to_string(), text);
            let back: Event = serde_json::from_str(json).unwrap();
            // An infinite loss comes back as no number, which equals nothing.
            assert_eq!(serde_json::to_string(&back).unwrap(), json);
        }
        let unknown = r#"{"event":"note","text":"a","kind":"b"}"#;
        assert!(serde_json::from_str::<Event>(unknown).is_err(), "a key that is not known is refused");
    }
}
