//! A network, a loss and a score of a user. Their host stands in for Python: a gain for the whole picture, and the mean square of its error.

use std::sync::{Arc, Mutex};

use petzval_design::design_loop::{DesignLoop, Ending, Observer};
use petzval_design::error::DesignError;
use petzval_design::experiment::Experiment;
use petzval_design::inputs::keep_inputs;
use petzval_design::library::Library;
use petzval_design::run::{CameraMetrics, Event, RunFolder};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_learn::Device;
use petzval_learn::guest::{Answer, Array, Call, Guest, GuestError, Host, Role};
use serde_json::{Map, Value, json};

use crate::common::{self, Silent};

const EXPERIMENT: &str = r#"
task = "python"
lens = "cooke-triplet-nominal"
[psf]
kind = "geometric"
fields = 3
scoring_fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
scoring_blend_error = 2.0
[network]
kind = "python"
[python.network]
class = "nets:Gain"
options = { gain = 0.5 }
[python.task]
class = "nets:Square"
[training]
steps = 6
batch = 1
crop = 64
learning_rate = 0.5
final_learning_rate = 0.5
[optics]
steps = 2
[checkpoint]
every = 2
[scoring]
scores = ["square", "psnr_db"]
places_per_side = 1
crop = 64
[[variant]]
name = "a"
[[variant.stage]]
moves = ["optics", "network"]
"#;

/// A host, whose networks fail on the tape after so many passes.
#[derive(Clone)]
struct Home {
    passes: usize,
}

#[derive(Default)]
struct Object {
    gain: f32,
    by_gain: f32,
    seen: Vec<f32>,
    shape: Vec<usize>,
    passes_left: usize,
}

struct Inside(Mutex<Object>);

impl Host for Home {
    fn make(
        &self,
        class: &str,
        role: Role,
        arguments: &Map<String, Value>,
    ) -> Result<(Arc<dyn Guest>, Value), GuestError> {
        if class == "nets:Missing" {
            return Err(GuestError::Unusable {
                message: "no module `nets`".to_owned(),
                hint: "h".to_owned(),
            });
        }
        let gain = arguments.get("gain").and_then(Value::as_f64).unwrap_or_default() as f32;
        let object = Object { gain, passes_left: self.passes, ..Object::default() };
        let about = match role {
            Role::Network => Value::Null,
            Role::Task => json!({"scores": {"square": {"higher_is_better": false}}}),
        };
        Ok((Arc::new(Inside(Mutex::new(object))), about))
    }
}

impl Guest for Inside {
    fn call(&self, call: &Call) -> Result<Answer, GuestError> {
        let mut object = self.0.lock().unwrap();
        let one = |values: Vec<f32>, shape: &[usize]| vec![Array { values, shape: shape.to_vec() }];
        let answer = match call.method {
            "forward" => {
                let planes = &call.arrays[0];
                assert_eq!(planes.shape[1], 8);
                let plane = planes.shape[2] * planes.shape[3];
                (object.seen, object.shape) = (planes.values.to_vec(), planes.shape.clone());
                let images = planes.values.chunks_exact(8 * plane);
                let finished = images.flat_map(|image| image[..3 * plane].iter().map(|v| object.gain * v));
                let shape = [planes.shape[0], 3, planes.shape[2], planes.shape[3]];
                Answer { arrays: one(finished.collect(), &shape), ..Answer::default() }
            }
            "backward" => {
                let Some(left) = object.passes_left.checked_sub(1) else {
                    return Err(GuestError::Raised("nets.py:7: ValueError: no way back".to_owned()));
                };
                object.passes_left = left;
                let plane = object.shape[2] * object.shape[3];
                let (mut back, mut by_gain) = (vec![0.0; object.seen.len()], 0.0);
                let cotangents = call.arrays[0].values.chunks_exact(3 * plane);
                for ((cotangent, seen), back) in
                    cotangents.zip(object.seen.chunks(8 * plane)).zip(back.chunks_mut(8 * plane))
                {
                    for (i, c) in cotangent.iter().enumerate() {
                        back[i] = object.gain * c;
                        by_gain += c * seen[i];
                    }
                }
                object.by_gain = by_gain;
                Answer { arrays: one(back, &object.shape), ..Answer::default() }
            }
            "step" => {
                object.gain -= call.number.unwrap() as f32 * object.by_gain;
                Answer::default()
            }
            "save" => Answer { bytes: object.gain.to_le_bytes().to_vec(), ..Answer::default() },
            "load" => {
                object.gain = f32::from_le_bytes(call.bytes.unwrap().try_into().unwrap());
                Answer::default()
            }
            method => {
                let [pictures, targets] = [0, 1].map(|i| call.arrays[i].values);
                let count = pictures.len() as f32;
                let error: Vec<f32> = pictures.iter().zip(targets).map(|(p, t)| p - t).collect();
                let square = f64::from(error.iter().map(|e| e * e).sum::<f32>() / count);
                if method == "score" {
                    Answer { value: json!({"square": square}), ..Answer::default() }
                } else {
                    let cotangent = error.iter().map(|e| 2.0 * e / count).collect();
                    let arrays = one(cotangent, &call.arrays[0].shape);
                    Answer { value: json!(square), arrays, ..Answer::default() }
                }
            }
        };
        Ok(answer)
    }
}

fn library(passes: usize) -> Library {
    let host = Home { passes };
    common::library().with_guests(Arc::new(move |_| -> Arc<dyn Host> { Arc::new(host.clone()) }))
}

fn setup(text: &str, library: &Library) -> Result<Setup, DesignError> {
    Setup::new(Experiment::parse(text).unwrap(), library, Device::flex().autodiff())
}

/// Starts a run, or goes on with it.
fn designed(
    run: &RunFolder,
    library: &Library,
    observer: impl FnOnce(&Setup) -> Box<dyn Observer>,
) -> Result<Ending, DesignError> {
    let setup = Arc::new(setup(EXPERIMENT, library)?);
    let mut observer = observer(&setup);
    let scorer = Scorer::new(setup)?;
    if !run.config().exists() {
        keep_inputs(&scorer, library, run, None)?;
    }
    DesignLoop::new(run.clone(), scorer)?.run(&mut *observer)
}

/// Cancels the run after so many steps.
struct Stops(petzval_base::Cancel, u64);

impl Observer for Stops {
    fn start(&mut self, _: u64, _: u64) {}
    fn step(&mut self, event: &Event) {
        if event.step == self.1 {
            self.0.set();
        }
    }
    fn camera(&mut self, _: &CameraMetrics) {}
}

#[test]
fn a_network_and_a_loss_of_a_user_are_designed_for_and_resumed_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str| RunFolder::create(&folder.path().join(name)).unwrap();
    let weights =
        |run: &RunFolder| std::fs::read(run.camera("a").join("blocks/network/weights.bin")).unwrap();

    let whole = run("whole");
    let Ending::Finished(metrics) = designed(&whole, &library(99), |_| Box::new(Silent)).unwrap() else {
        panic!("nothing stops it");
    };
    let row = &metrics.rows[0];
    assert_eq!(row.scores.keys().collect::<Vec<_>>(), ["psnr_db", "square"]);
    // The square of the error and its PSNR say the same of each picture.
    for picture in &row.pictures {
        let psnr = -10.0 * picture.scores["square"].log10();
        assert!((psnr - picture.scores["psnr_db"]).abs() < 0.05, "{psnr} {:?}", picture.scores);
    }
    let own = metrics.scores.iter().find(|score| score.name == "square").unwrap();
    assert!(!own.higher_is_better && metrics.scores[0].name == "square");
    // The gain has left its start towards 1, and no safetensors file claims to know it.
    let gain = f32::from_le_bytes(weights(&whole).try_into().unwrap());
    assert!(gain > 0.55 && gain < 1.2, "{gain}");
    assert!(!whole.camera("a").join("network.safetensors").exists());

    let stopped = run("stopped");
    let stopping = library(99).stopped_by(petzval_base::Cancel::default());
    let ending = designed(&stopped, &stopping, |setup| Box::new(Stops(setup.cancel.clone(), 3))).unwrap();
    assert_eq!(ending, Ending::Stopped(3));
    designed(&stopped, &library(99), |_| Box::new(Silent)).unwrap();
    assert_eq!(weights(&stopped), weights(&whole));
    let lens = |run: &RunFolder| std::fs::read(run.camera("a").join("lens.toml")).unwrap();
    assert_eq!(lens(&stopped), lens(&whole));
}

#[test]
fn a_failure_on_the_tape_ends_the_run_before_a_block_has_moved() {
    let folder = tempfile::tempdir().unwrap();
    for passes in 0..3 {
        let run = RunFolder::create(&folder.path().join(passes.to_string())).unwrap();
        let error = designed(&run, &library(passes), |_| Box::new(Silent)).unwrap_err();
        assert!(matches!(error, DesignError::Guest(GuestError::Raised(_))) && !error.is_input(), "{error}");
        assert_eq!(error.to_string(), "nets.py:7: ValueError: no way back");
        let steps = std::fs::read_to_string(run.events()).unwrap().lines().count();
        assert_eq!(steps, passes, "a step was counted whose gradient was none");
    }
}

#[test]
fn what_cannot_be_made_or_scored_is_refused_before_a_run() {
    let library = library(0);
    let refused = |from: &str, to: &str| {
        assert!(EXPERIMENT.contains(from));
        let setup = setup(&EXPERIMENT.replacen(from, to, 1), &library)?;
        Scorer::new(Arc::new(setup)).map(|_| ())
    };
    let missing = refused("nets:Gain", "nets:Missing").unwrap_err();
    assert!(missing.is_input() && missing.to_string().contains("no module `nets`"), "{missing}");
    let missing = refused("nets:Square", "nets:Missing").unwrap_err();
    assert!(missing.is_input(), "{missing}");
    let score = refused("\"square\"", "\"sqare\"").unwrap_err().to_string();
    assert!(
        score.contains("no score called `sqare`; there are square, one_minus_lpips, psnr_db, ssim"),
        "{score}"
    );
    let parsed =
        |from: &str, to: &str| Experiment::parse(&EXPERIMENT.replacen(from, to, 1)).unwrap_err().to_string();
    assert!(parsed("task = \"python\"", "").contains("nothing uses this class"));
    assert!(parsed("kind = \"python\"", "").contains("write \"python\" for network.kind"));
    assert!(parsed("nets:Gain", "nets.Gain").contains("is no module with a class"));
    let unnamed = parsed("[python.task]\nclass = \"nets:Square\"\n", "");
    assert!(unnamed.contains("`python.task` is missing"), "{unnamed}");
    let pulled = parsed(
        "moves = [\"optics\", \"network\"]",
        "moves = [\"network\"]\nschedule = { network = { proximal = 0.1 } }",
    );
    assert!(pulled.contains("no proximal term"), "{pulled}");
    // Without a host nothing can be called.
    let without =
        Setup::new(Experiment::parse(EXPERIMENT).unwrap(), &common::library(), Device::flex().autodiff());
    assert!(without.err().unwrap().to_string().contains("cannot be called here"));
}
