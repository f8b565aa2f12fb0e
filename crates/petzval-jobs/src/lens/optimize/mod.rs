//! `lens optimize`: a better lens, by descent or by search, for its spots or for the restoration of its frames.

mod descent;
mod figures;
mod goal;
mod history;
mod operand;
mod page;
mod search;
mod trade;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use petzval_base::simd::level;
use petzval_design::assets::Assets;
use petzval_design::error::DesignError;
use petzval_files::{LensFile, OperandFile, parse_operands};
use petzval_optics::design_space::{AtBound, DesignSpaceError, Solves};
use petzval_optics::lens::Lens;
use petzval_optics::merit::SpotResiduals;
use petzval_optics::optimize::{Analysis, LevenbergOptions, Problem, Search, SearchOptions, descend};
use petzval_optics::pupil::PupilSampling;
use serde::{Deserialize, Serialize};

use self::descent::descent;
use self::figures::{VIOLATED_MM, is_restored};
use self::history::{Config, History};
use self::search::search;
use self::trade::{check_trade, trades};
use crate::context::Context;
use crate::error::JobError;

pub use figures::{Figures, OperandFigure};
pub use goal::{Goal, Restored};
pub use petzval_optics::design_space::Vary;
pub use trade::Trade;

/// An optimisation that begins, or one that is continued, and how far it goes in this call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Where it starts.
    pub start: Start,
    /// Iterations of a descent: 200 if none are given. One that is continued goes on to those that it began with, or takes as many more as
    /// are given here.
    #[serde(default)]
    pub iterations: Option<usize>,
    /// Rounds of a search, 1 at least: 10 if none are given; the same rounds give the same lenses on any machine. One that is continued goes
    /// on to those that it began with, or takes as many more as are given here.
    #[serde(default)]
    pub rounds: Option<u64>,
    /// Stops a search after the round in which so many seconds have passed, if that is before its last round.
    pub seconds: Option<f64>,
    /// Whether to search again, for as many rounds, with each of some further requirements, to see what each costs.
    pub trade: bool,
}

/// Where an optimisation starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// At a lens.
    New {
        /// Lens file, or a built-in name. Its variables move; a lens that names none gets its curvatures and gaps.
        lens: String,
        /// Folder for the lenses and the history; it must not hold an optimisation.
        out: PathBuf,
        /// What the lens has to be.
        goal: Box<Goal>,
        /// Whether to search the whole of the bounds, not only downhill from the lens.
        global: bool,
        /// Seed of the search.
        seed: u64,
    },
    /// Where the optimisation in a folder ended, with its goal.
    Resume {
        /// The folder.
        folder: PathBuf,
        /// Forget every step after this one first.
        rewind: Option<usize>,
    },
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// The lenses.
    pub found: Found,
    /// Field angles of [`Figures::rms_spot_um`], degrees.
    pub fields_deg: Vec<f64>,
    /// Whether the job was cancelled before its budget was spent.
    pub is_cancelled: bool,
}

/// The lens at the start and the best one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The lens at the start; `None` if its rays do not reach the image.
    pub start: Option<Figures>,
    /// The best lens.
    pub best: Figures,
    /// Variables of the best lens that stand on a bound.
    #[serde(default)]
    pub at_bounds: Vec<String>,
    /// Steps of the history.
    pub steps: usize,
    /// What further requirements cost; empty unless the request has `trade`.
    pub trades: Vec<Trade>,
    /// File of the best lens.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub lens: PathBuf,
    /// The page that shows the lens before and after.
    #[serde(default)]
    pub page: PathBuf,
}

/// Reads an operand file.
pub fn read_operands(path: &Path) -> Result<OperandFile, JobError> {
    let text = petzval_base::read_text(path).map_err(DesignError::io(path))?;
    Ok(parse_operands(&text).map_err(DesignError::input(path))?)
}

/// A step of the history is better than the one before by this share at least.
const STEP_SHARE: f64 = 1e-3;

/// The share of the merit, squared, below which another descent takes the place of the usual one: half a percent of the spot.
const WORTH_IT: f64 = 0.99;

/// How often a search writes its state, so that it can continue from there whatever ends the process.
const KEEP_EVERY: Duration = Duration::from_secs(1);

/// Iterations of a descent, if nobody says how many.
const ITERATIONS: usize = 200;

/// Rounds of a search, if nobody says how many.
const ROUNDS: u64 = 10;

impl Request {
    fn check(&self) -> Result<(), JobError> {
        if self.rounds == Some(0) {
            return Err(JobError::setting("rounds", 0, "out of range", "1 or more; 10 is usual"));
        }
        match self.seconds.filter(|s| !(*s > 0.0 && *s < 1e7)) {
            Some(s) => Err(JobError::setting("seconds", s, "out of range", "a week is 604800")),
            None => Ok(()),
        }
    }

    fn is_out_of_time(&self, began: Instant) -> bool {
        self.seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds)
    }
}

/// Optimises the lens.
///
/// The folder holds the best lens (`best.toml`), every better lens on the way (`lens/step-N.toml`, `history.jsonl`) and what
/// is needed to continue.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    request.check()?;
    let assets = &context.assets;
    let (mut history, config, problem, upto) = match &request.start {
        Start::Resume { folder, rewind } => {
            let (history, config) = History::open(folder, *rewind, context)?;
            let problem = config.goal.problem(history.start(), assets)?;
            warn_of_another_level(&config, context);
            let (config, upto) = continued(config, request, &history)?;
            // Everything is checked before the folder changes.
            check_trade(&config)?;
            history.keep_config(&config)?;
            (history, config, problem, upto)
        }
        Start::New { lens, out, goal, global, seed } => {
            let config = Config {
                goal: Goal::clone(goal),
                global: *global,
                seed: *seed,
                iterations: Some(request.iterations.unwrap_or(ITERATIONS)),
                rounds: Some(request.rounds.unwrap_or(ROUNDS)),
                trade: request.trade,
                simd: level().to_owned(),
            };
            let file = context.assets.start(lens)?;
            let problem = new_problem(&config, &file, assets)?;
            // Everything is checked before the folder is made.
            check_trade(&config)?;
            let upto = Upto::of(&config);
            (History::create(out, &file, &config)?, config, problem, upto)
        }
    };
    note_held_radius(&problem, history.start(), &config.goal, context);

    let start = at_the_start(&problem);
    if let Some(start) = &start {
        note_violations(start, context);
    }
    let best = if config.global {
        search(&problem, &mut history, &config, upto.rounds, request, context)?
    } else {
        Some(descent(&problem, &mut history, upto, context)?)
    };
    let Some(best) = best else {
        return Err(JobError::failed(
            "no lens was found whose rays reach the image; widen the bounds, or search longer",
        ));
    };
    if history.steps().is_empty() {
        let why = history.defect(&problem, &best).map_or_else(String::new, |defect| format!(": {defect}"));
        return Err(JobError::failed(format!(
            "no lens was found that can be built{why}; let more numbers of the lens vary, widen their bounds, or search longer"
        )));
    }
    let trades = match config.trade {
        true => trades(&config, history.start(), request, context)?,
        false => Vec::new(),
    };
    let found = Found {
        start: start.as_ref().map(|analysis| Figures::new(&problem, analysis)),
        best: Figures::new(&problem, &best),
        at_bounds: at_bounds(&problem, &best.lens),
        steps: history.steps().len(),
        trades,
        lens: history.best_lens(),
        page: history.page(),
    };
    let lenses = start.as_ref().map(|analysis| analysis.fitted_lens(&problem));
    history.write_page(&page::page(&problem, &found, lenses.as_ref(), &best.fitted_lens(&problem)))?;
    Ok(Response {
        found,
        fields_deg: problem.merit.fields_rad.iter().map(|f| f.to_degrees()).collect(),
        is_cancelled: context.is_cancelled(),
    })
}

/// How far a call goes, with what was done before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Upto {
    /// Iterations of a descent.
    iterations: usize,
    /// Whether a descent that found no better lens any more begins again.
    again: bool,
    /// Rounds of a search.
    rounds: u64,
}

impl Upto {
    /// To the end of what was asked for.
    fn of(config: &Config) -> Self {
        let (iterations, rounds) = (config.iterations.unwrap_or(ITERATIONS), config.rounds.unwrap_or(ROUNDS));
        Self { iterations, again: false, rounds }
    }
}

/// An optimisation that is continued: to the end of what it began with, or by as much as the request says. What is kept grows only.
fn continued(config: Config, request: &Request, history: &History) -> Result<(Config, Upto), JobError> {
    let all = Upto::of(&config);
    let done = history.descent()?.map_or(0, |kept| kept.state.iterations);
    let rounds_done = history.search()?.map_or(0, |kept| kept.state.round);
    let upto = Upto {
        iterations: request.iterations.map_or(all.iterations, |more| done + more),
        again: request.iterations.is_some_and(|more| more > 0),
        rounds: request.rounds.map_or(all.rounds, |more| rounds_done + more),
    };
    let config = Config {
        iterations: Some(all.iterations.max(upto.iterations)),
        rounds: Some(all.rounds.max(upto.rounds)),
        trade: request.trade || config.trade,
        ..config
    };
    Ok((config, upto))
}

/// Warns where another instruction set goes on with an optimisation: its rounding differs in the last digits.
fn warn_of_another_level(config: &Config, context: &Context) {
    if !config.simd.is_empty() && config.simd != level() {
        context.warning(format!(
            "the optimisation was begun with the instruction set {}, and goes on with {}: it may end at another lens than without interruption",
            config.simd,
            level()
        ));
    }
}

/// The problem of a new optimisation, once the lens, its variables and the goal are known to fit together.
fn new_problem(config: &Config, file: &LensFile, assets: &Assets) -> Result<Problem, JobError> {
    if !config.global && !config.goal.glass.is_empty() {
        return Err(JobError::setting("glass", "", "a descent leaves glasses as they are", "add --global"));
    }
    let problem = config.goal.problem(file, assets)?;
    check_directions(&problem)?;
    if config.global {
        Search::new(&problem, SearchOptions::default()).map_err(|e| not_optimisable(&e))?;
    } else {
        let once = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
        descend(&problem, &once, &mut |_, _, _| true).map_err(|e| not_optimisable(&e))?;
    }
    Ok(problem)
}

/// Names the limits that the lens at the start does not keep: they explain spots that grow.
fn note_violations(start: &Analysis, context: &Context) {
    let named = named_violations(start);
    if !named.is_empty() {
        context.note(format!("the lens at the start does not keep: {}", named.join("; ")));
    }
}

/// The limits that a lens does not keep, each with by how much.
fn named_violations(analysis: &Analysis) -> Vec<String> {
    let broken = analysis.violations.iter().filter(|(_, mm)| *mm > VIOLATED_MM);
    broken.map(|(what, mm)| format!("{what}, by {mm:.4} mm")).collect()
}

/// The variables of a lens that stand on a bound.
fn at_bounds(problem: &Problem, lens: &Lens) -> Vec<String> {
    let Ok(space) = problem.space() else { return Vec::new() };
    space.at_bounds(&space.coordinates(lens)).iter().map(AtBound::to_string).collect()
}

/// Refuses a lens one of whose thicknesses leads against the light and stays so where its variables begin.
fn check_directions(problem: &Problem) -> Result<(), JobError> {
    let space = problem.space().map_err(|e| not_optimisable(&e))?;
    let lens = space.lens_at(&space.start()).map_err(|e| not_optimisable(&e))?;
    match (0..lens.surfaces.len()).find(|i| lens.goes_against_the_light(*i)) {
        None => Ok(()),
        Some(i) => {
            let surface = &lens.surfaces[i];
            let (number, glass, thickness) = (i + 1, &surface.glass.name, lens.gap_behind_mm(i));
            let message = format!(
                "surface {number}: the thickness of {thickness} mm of {glass} goes against the light, and no variable corrects it"
            );
            let hint = format!("make thickness_mm of surface {number} a [[variable]], or correct it");
            Err(JobError::input(message, hint))
        }
    }
}

/// Says which radius holds the focal length or the magnification where the lens file does not, or that nothing does.
fn note_held_radius(problem: &Problem, file: &LensFile, goal: &Goal, context: &Context) {
    let solves = &problem.solves;
    let bounds = match solves.curvature() {
        Some((_, Some(_))) => "; its bounds still count",
        _ => "",
    };
    let held = |surface: usize, what: String| {
        let radius = format!("the radius of surface {}", surface + 1);
        context.note(format!("{radius} holds {what} and does not vary{bounds}; --efl free lets it vary"));
    };
    match (&solves.efl, &solves.magnification) {
        (Some(solve), _) if file.efl_solve.is_none() => {
            held(solve.surface, format!("the focal length of {:.4} mm", solve.efl_mm));
        }
        (_, Some(solve)) => held(solve.surface, format!("the magnification of {:.4}", solve.magnification)),
        (None, None) if goal.efl.is_none() => {
            context.note("the focal length is not held: the lens is afocal, or no radius can hold it");
        }
        _ => {}
    }
}

fn not_optimisable(error: &DesignSpaceError) -> JobError {
    JobError::input(error.to_string(), "correct the variables or solves of the lens file, or --efl")
}

/// Seconds of work on an optimisation, those of earlier calls included.
struct Clock {
    began: Instant,
    before: f64,
}

impl Clock {
    fn start(history: &History) -> Self {
        Self { began: Instant::now(), before: history.best().map_or(0.0, |step| step.seconds) }
    }

    fn seconds(&self) -> f64 {
        self.before + self.began.elapsed().as_secs_f64()
    }
}

/// A lens traced with more rays than an optimisation traces, its image plane where they are best; `None` if they do not reach
/// the image.
fn with_more_rays(problem: &Problem, lens: &Lens) -> Option<Analysis> {
    let only_image_plane = Problem { base: lens.clone(), ..only_image_plane(problem) };
    descend(&only_image_plane, &LevenbergOptions::default(), &mut |_, _, _| true).ok().map(|d| d.best)
}

/// The problem with more rays, in which the image plane alone moves.
fn only_image_plane(problem: &Problem) -> Problem {
    Problem {
        merit: SpotResiduals { sampling: PupilSampling::Degree(10), ..problem.merit.clone() },
        variables: Vec::new(),
        pickups: Vec::new(),
        glasses: Vec::new(),
        solves: Solves::default(),
        ..problem.clone()
    }
}

/// The lens at the start with more rays, its image plane where the spots are least, or the error after restoration: an operand such as a short
/// track would only defocus it.
fn at_the_start(problem: &Problem) -> Option<Analysis> {
    let of_the_picture = problem.goals.iter().filter(|goal| is_restored(goal)).cloned().collect();
    let without_operands =
        Problem { goals: of_the_picture, further: Vec::new(), ..only_image_plane(problem) };
    let options = LevenbergOptions::default();
    let focused = descend(&without_operands, &options, &mut |_, _, _| true).ok()?.best.lens;
    let as_it_is = Problem { base: focused, merit: without_operands.merit, ..only_image_plane(problem) };
    let no_step = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
    descend(&as_it_is, &no_step, &mut |_, _, _| true).ok().map(|d| d.best)
}

fn violations(analysis: &Analysis) -> usize {
    analysis.violations.iter().filter(|(_, mm)| *mm > VIOLATED_MM).count()
}

/// A line about a better lens.
fn line(what: &str, seconds: f64, problem: &Problem, analysis: &Analysis) -> String {
    let fields: Vec<String> = analysis.rms_um.iter().map(|r| format!("{r:.2}")).collect();
    let violated = match &named_violations(analysis)[..] {
        [] => String::new(),
        [one] => format!("; not kept: {one}"),
        [first, more @ ..] => format!("; not kept: {first}; and {} more", more.len()),
    };
    let is_restored = problem.goals.first().is_some_and(is_restored);
    let merit = match (is_restored, analysis.goals.first()) {
        (true, Some(percent)) => format!("error {percent:8.4} %"),
        _ => format!("merit {:8.3} um", analysis.merit.sqrt()),
    };
    format!(
        "{seconds:8.2} s  {what:<14} {merit}  spots {:.3} um ({}){violated}",
        analysis.mean_rms_um(),
        fields.join(" ")
    )
}
