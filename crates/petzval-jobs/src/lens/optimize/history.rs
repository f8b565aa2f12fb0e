//! The folder of an optimisation: the lens at its start, every step that made the lens better, the best lens, and the state
//! from which a search continues.

use std::fs;
use std::path::{Path, PathBuf};

use petzval_base::WorkLock;
use petzval_design::path_text::path_text;
use petzval_files::{LensFile, write_lens};
use petzval_optics::design_space::{EflSolve, MagnificationSolve, Variable};
use petzval_optics::lens::{LensDefect, validate};
use petzval_optics::optimize::{Analysis, DescentState, Kept, Problem, SearchState};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::goal::Goal;
use crate::context::Context;
use crate::error::{JobError, Result, json, make_folder, write_file};
use crate::state_file::{CHANGED_STATE, lock_folder, with_digest, without_digest};

/// The lens of the last step.
const BEST: &str = "best.toml";

/// The page that shows the lens before and after.
const PAGE: &str = "optimize.html";

/// The state of a search.
const SEARCH: &str = "search.json";

/// The state of a descent.
const DESCENT: &str = "descent.json";

/// The work, in errors.
const WHAT: &str = "optimisation";

/// The folder, locked while it is open.
pub struct History {
    root: PathBuf,
    steps: Vec<Step>,
    file: LensFile,
    _lock: WorkLock,
}

/// What an optimisation does; kept in its folder, so that it continues with the same.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Config {
    /// What the lens has to be.
    pub goal: Goal,
    /// Whether the search is global.
    pub global: bool,
    /// Its seed.
    pub seed: u64,
    /// Iterations of a descent in all; none where an earlier version did not keep them.
    #[serde(default)]
    pub iterations: Option<usize>,
    /// Rounds of a search in all; none where an earlier version did not keep them.
    #[serde(default)]
    pub rounds: Option<u64>,
    /// Whether further requirements are searched with.
    #[serde(default)]
    pub trade: bool,
    /// Instruction set that it began with; empty where an earlier version did not keep it.
    #[serde(default)]
    pub simd: String,
}

/// The state from which a descent continues.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct KeptDescent {
    /// The descent itself.
    pub state: DescentState,
    /// Whether other ways than straight down have been tried, as the one along a soft penalty.
    pub went_softly: bool,
}

/// The state from which a search continues.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct KeptSearch {
    /// The search itself.
    #[serde(flatten)]
    pub state: SearchState,
    /// The best lens once more rays are traced, which need not be the best of the search; none before there is one.
    #[serde(default)]
    pub best: Option<Kept>,
}

/// A step that made the lens better: a line of history.jsonl.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Step {
    /// From 0.
    pub step: usize,
    /// Seconds of work until then, those of earlier calls included.
    pub seconds: f64,
    /// Root of the merit, um.
    pub merit_um: f64,
    /// Mean RMS spot over the fields, um.
    pub mean_rms_um: f64,
    /// RMS spot of each field, um.
    pub rms_um: Vec<f64>,
    /// Limits that are violated, and by how much, mm: edges at the clear semi-diameters of its file.
    pub violations: Vec<(String, f64)>,
    /// Coordinates of the lens.
    pub at: Vec<f64>,
    /// Names of the glasses that may be exchanged.
    pub glasses: Vec<String>,
    /// The round of the search that found it.
    pub round: u64,
}

impl History {
    /// Begins a new folder.
    pub fn create(root: &Path, file: &LensFile, config: &Config) -> Result<Self> {
        let check = || {
            let ours = ["history.jsonl", BEST, "start.toml", "config.json", SEARCH, DESCENT];
            if ours.iter().any(|name| root.join(name).exists()) {
                let hint = format!(
                    "continue it with --resume {}, or choose another folder with --out",
                    root.display()
                );
                return Err(JobError::input(
                    format!("{}: holds an optimisation already", root.display()),
                    hint,
                ));
            }
            Ok(())
        };
        check()?;
        // What is kept is found again by this text.
        path_text(root)?;
        make_folder(root)?;
        let lock = lock_folder(root, WHAT)?;
        // Another process may have worked here since the first look.
        check()?;
        make_folder(&root.join("lens"))?;
        let history = Self { root: root.to_path_buf(), steps: Vec::new(), file: file.clone(), _lock: lock };
        history.write("start.toml", &write_lens(file))?;
        history.write("config.json", &json(config)?)?;
        Ok(history)
    }

    /// Whether a folder holds an optimisation with which one can go on: the configuration is written after the lens at the start.
    pub fn is_in(root: &Path) -> bool {
        root.join("config.json").is_file()
    }

    /// Opens a folder, back to step `rewind` if given: later steps are forgotten.
    pub fn open(root: &Path, rewind: Option<usize>, context: &Context) -> Result<(Self, Config)> {
        let read = |name: &str| {
            petzval_base::read_text(root.join(name)).map_err(|e| {
                let what = format!("{}: {e}", root.join(name).display());
                JobError::input(what, "give the folder of an optimisation, as --out named it")
            })
        };
        let bad = |name: &str, e: serde_json::Error| {
            JobError::input(
                format!("{}: {e}", root.join(name).display()),
                "it was changed since it was written",
            )
        };
        // Nothing is made in a folder that holds no optimisation.
        read("config.json")?;
        let lock = lock_folder(root, WHAT)?;
        let config: Config =
            serde_json::from_str(&read("config.json")?).map_err(|e| bad("config.json", e))?;
        read("start.toml")?;
        let file = context.assets.start(&path_text(&root.join("start.toml"))?)?;
        // A search that was cut off before it found a lens has no step yet.
        let mut steps: Vec<Step> = text_if_there(&root.join("history.jsonl"))?
            .unwrap_or_default()
            .lines()
            .map(|line| serde_json::from_str(line).map_err(|e| bad("history.jsonl", e)))
            .collect::<Result<_, _>>()?;
        if let Some(step) = rewind
            && step >= steps.len()
        {
            let hint = format!("the last is {}", steps.len().saturating_sub(1));
            return Err(JobError::setting("rewind", step, "there is no such step", hint));
        }
        petzval_base::sweep_parts(root);
        let gone = rewind.map_or_else(Vec::new, |step| steps.split_off(step + 1));
        let history = Self { root: root.to_path_buf(), steps, file, _lock: lock };
        if let (Some(_), Some(last)) = (rewind, history.steps.last()) {
            let path = root.join(lens_name(last.step));
            let lens = petzval_base::read_text(&path)
                .map_err(|e| JobError::input(format!("{}: {e}", path.display()), "rewind to another step"))?;
            let kept = Kept { at: last.at.clone(), glasses: last.glasses.clone(), round: last.round };
            let state = SearchState { round: last.round, kept: vec![kept] };
            history.keep_search(&KeptSearch { state, best: None })?;
            // A descent begins again at the lens of the step.
            let descent = root.join(DESCENT);
            if descent.exists() {
                fs::remove_file(&descent)
                    .map_err(|e| JobError::failed(format!("{}: {e}", descent.display())))?;
            }
            history.write(BEST, &lens)?;
            history.write_steps()?;
            for step in gone {
                // A lens that is not there needs no removal.
                let _ = fs::remove_file(root.join(lens_name(step.step)));
            }
        }
        Ok((history, config))
    }

    /// The lens that the optimisation began with.
    pub fn start(&self) -> &LensFile {
        &self.file
    }

    /// Steps so far.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The last step, which is the best.
    pub fn best(&self) -> Option<&Step> {
        self.steps.last()
    }

    /// The file of the best lens.
    pub fn best_lens(&self) -> PathBuf {
        self.root.join(BEST)
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The page that shows the lens before and after.
    pub fn page(&self) -> PathBuf {
        self.root.join(PAGE)
    }

    /// Writes that page.
    pub fn write_page(&self, html: &str) -> Result<()> {
        self.write(PAGE, html)
    }

    /// Whether a lens is better than the best so far by this share of the root of the merit.
    pub fn is_better(&self, analysis: &Analysis, share: f64) -> bool {
        let known = self.best().map_or(f64::INFINITY, |step| step.merit_um);
        analysis.merit.sqrt() < known * (1.0 - share)
    }

    /// Keeps what the optimisation does.
    pub fn keep_config(&self, config: &Config) -> Result<()> {
        self.write("config.json", &json(config)?)
    }

    /// The state from which a search continues, if one was kept.
    pub fn search(&self) -> Result<Option<KeptSearch>> {
        self.kept(SEARCH)
    }

    /// Keeps the state from which a search continues.
    pub fn keep_search(&self, kept: &KeptSearch) -> Result<()> {
        self.write(SEARCH, &with_digest(&json(kept)?))
    }

    /// The state from which a descent continues, if one was kept.
    pub fn descent(&self) -> Result<Option<KeptDescent>> {
        self.kept(DESCENT)
    }

    /// Keeps the state from which a descent continues.
    pub fn keep_descent(&self, kept: &KeptDescent) -> Result<()> {
        self.write(DESCENT, &with_digest(&json(kept)?))
    }

    fn kept<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>> {
        let path = self.root.join(name);
        let Some(text) = text_if_there(&path)? else { return Ok(None) };
        let wrong =
            |message: String| JobError::input(format!("{}: {message}", path.display()), CHANGED_STATE);
        let text = without_digest(&text).ok_or_else(|| wrong("is not as it was written".to_owned()))?;
        let kept = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
        Ok(Some(kept))
    }

    /// Writes the best lens without a step of the history, if it can be built.
    pub fn keep_best(&self, problem: &Problem, analysis: &Analysis) -> Result<()> {
        let found = self.found(problem, analysis);
        if validate(&found.lens).is_err() {
            return Ok(());
        }
        self.write(BEST, &write_lens(&found))
    }

    /// Adds a step with its lens, if it can be built: no other verb reads the file of a lens that cannot. Returns the file of the lens.
    pub fn add(
        &mut self,
        problem: &Problem,
        round: u64,
        seconds: f64,
        analysis: &Analysis,
        at: &[f64],
        glasses: &[usize],
    ) -> Result<Option<PathBuf>> {
        let found = self.found(problem, analysis);
        if validate(&found.lens).is_err() {
            return Ok(None);
        }
        let step = self.steps.len();
        let named = problem.glasses.iter().zip(glasses);
        let names = named.map(|(choice, i)| choice.candidates[*i].name.clone());
        let violations = analysis.violations_at_written_edges(&found.lens);
        let lens = write_lens(&found);
        self.write(&lens_name(step), &lens)?;
        self.write(BEST, &lens)?;
        self.steps.push(Step {
            step,
            seconds,
            merit_um: analysis.merit.sqrt(),
            mean_rms_um: analysis.mean_rms_um(),
            rms_um: analysis.rms_um.clone(),
            violations: violations.into_iter().map(|(what, mm)| (what.to_string(), mm)).collect(),
            at: at.to_vec(),
            glasses: names.collect(),
            round,
        });
        self.write_steps()?;
        Ok(Some(self.root.join(lens_name(step))))
    }

    /// Why a found lens cannot be built.
    pub fn defect(&self, problem: &Problem, analysis: &Analysis) -> Option<LensDefect> {
        validate(&self.found(problem, analysis).lens).err()
    }

    /// A found lens as a file of its own: with the variables and solves of the problem, clear semi-diameters as its beams need
    /// them, and without the expected figures of the lens at the start.
    fn found(&self, problem: &Problem, analysis: &Analysis) -> LensFile {
        let mut lens = analysis.fitted_lens(problem);
        lens.source = format!("petzval lens optimize, from {}", self.file.lens.name);
        // Widen the bounds of the solved radius to where it ended: a file must hold its own lens, also while a limit is violated.
        let radius = |surface: usize| 1.0 / lens.surfaces[surface].shape.curvature;
        let around = |[min, max]: [f64; 2], to: f64| [min.min(to), max.max(to)];
        let efl_solve = problem.solves.efl.map(|solve| {
            let radius_mm = solve.radius_mm.map(|bounds| around(bounds, radius(solve.surface)));
            EflSolve { radius_mm, ..solve }
        });
        let magnification_solve = problem.solves.magnification.map(|solve| {
            let radius_mm = solve.radius_mm.map(|bounds| around(bounds, radius(solve.surface)));
            MagnificationSolve { radius_mm, ..solve }
        });
        let (mut variables, pickups) = (problem.variables.clone(), problem.pickups.clone());
        // Leave out variables that the file did not name, which stand behind its own: they were a guess for this optimisation.
        let is_named = |v: &Variable| {
            self.file.variables.iter().any(|own| (own.surface, own.number) == (v.surface, v.number))
        };
        variables.retain(is_named);
        let pickups = if variables.is_empty() { Vec::new() } else { pickups };
        let (length_solve, field_weights) = (problem.solves.length, self.file.field_weights.clone());
        LensFile {
            lens,
            expect: None,
            field_weights,
            variables,
            pickups,
            efl_solve,
            magnification_solve,
            length_solve,
        }
    }

    fn write_steps(&self) -> Result<()> {
        let mut text = String::new();
        for step in &self.steps {
            text += &serde_json::to_string(step).map_err(|e| JobError::failed(e.to_string()))?;
            text.push('\n');
        }
        self.write("history.jsonl", &text)
    }

    fn write(&self, name: &str, text: &str) -> Result<()> {
        write_file(&self.root.join(name), text)
    }
}

/// The text of a file; none if there is no such file.
fn text_if_there(path: &Path) -> Result<Option<String>> {
    match petzval_base::read_text(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(JobError::failed(format!("{}: {error}", path.display()))),
    }
}

fn lens_name(step: usize) -> String {
    format!("lens/step-{step:05}.toml")
}
