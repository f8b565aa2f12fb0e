//! `lens optimize`: a better lens, by descent or by search, for its spots or for the restoration of its frames.

mod goal;
mod history;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use petzval_design::assets::Assets;
use petzval_design::error::DesignError;
use petzval_files::{LensFile, OperandFile, parse_operands};
use petzval_optics::analysis::first_order_table;
use petzval_optics::design_space::{DesignSpaceError, Solves};
use petzval_optics::lens::Lens;
use petzval_optics::merit::SpotResiduals;
use petzval_optics::optimize::{
    Analysis, Goal as MeritGoal, LevenbergOptions, Problem, Search, SearchOptions, Stop, descend,
};
use petzval_optics::paraxial::{first_order, image_height_per_tangent, rectilinear_tangent};
use petzval_optics::pupil::{PupilSampling, chief_ray};
use serde::{Deserialize, Serialize};

use self::history::{Config, History};
use crate::context::Context;
use crate::error::JobError;
use crate::finite::finite;

pub use goal::{Goal, Restored};

/// An optimisation that begins, or one that is continued, and how far it goes in this call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Where it starts.
    pub start: Start,
    /// Iterations of a descent.
    pub iterations: usize,
    /// Rounds of a search, 1 at least: the same rounds give the same lenses on any machine.
    pub rounds: u64,
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
    /// Steps of the history.
    pub steps: usize,
    /// What further requirements cost; empty unless the request has `trade`.
    pub trades: Vec<Trade>,
    /// File of the best lens.
    pub lens: PathBuf,
}

/// Figures of a lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Root of the expected squared error after the best linear restoration, % of white; `None` unless that is the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restored_error_percent: Option<f64>,
    /// Operands: what each is, its value, its target and its unit.
    #[serde(default)]
    pub operands: Vec<OperandFigure>,
    /// Mean over the fields of the RMS spot radius, um.
    pub mean_rms_spot_um: f64,
    /// RMS spot radius by field, um.
    pub rms_spot_um: Vec<f64>,
    /// Focal length, mm.
    pub focal_length_mm: Option<f64>,
    /// From the last vertex to the rear focal point, mm.
    pub back_focal_length_mm: Option<f64>,
    /// Focal length over entrance pupil diameter.
    pub f_number: Option<f64>,
    /// Height of the image over that of the object; `None` for an object at infinity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub magnification: Option<f64>,
    /// From the first vertex to the image plane, mm.
    pub track_to_the_image_mm: f64,
    /// Largest diameter of a surface that the beams need, mm.
    pub largest_clear_diameter_mm: f64,
    /// Distortion at the outermost field; `None` without such a field, or without rotational symmetry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion_percent: Option<f64>,
    /// Limits that are violated, and by how much, mm.
    pub violations_mm: Vec<(String, f64)>,
}

/// Whether a goal is the error after restoration, and no operand.
fn is_restored(goal: &MeritGoal) -> bool {
    goal.merit.unit() == "% of white"
}

/// What a lens reaches of an operand. Of a figure that is bounded on both sides this is by how much it is beyond its bounds, and the target 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OperandFigure {
    /// The figure.
    pub of: String,
    /// Its value.
    pub value: f64,
    /// Its bound.
    pub target: f64,
    /// The unit of both.
    pub unit: String,
}

/// Reads an operand file.
pub fn read_operands(path: &Path) -> Result<OperandFile, JobError> {
    let text = petzval_base::read_text(path).map_err(DesignError::io(path))?;
    Ok(parse_operands(&text).map_err(DesignError::input(path))?)
}

/// The best lens of a search with a further requirement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// The requirement, in words.
    pub asked: String,
    /// Mean over the fields of the RMS spot radius, um.
    pub mean_rms_um: f64,
    /// How many limits are violated.
    pub violations: usize,
}

/// A step of the history is better than the one before by this share at least.
const STEP_SHARE: f64 = 1e-3;

/// A limit counts as violated from here, mm.
const VIOLATED_MM: f64 = 1e-3;

/// How often a search writes its state, so that it can continue from there whatever ends the process.
const KEEP_EVERY: Duration = Duration::from_secs(1);

impl Request {
    fn check(&self) -> Result<(), JobError> {
        if self.rounds == 0 {
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
    let (mut history, config, problem) = match &request.start {
        Start::Resume { folder, rewind } => {
            let (history, config) = History::open(folder, *rewind, context)?;
            let problem = config.goal.problem(history.start(), assets)?;
            (history, config, problem)
        }
        Start::New { lens, out, goal, global, seed } => {
            let config = Config { goal: Goal::clone(goal), global: *global, seed: *seed };
            let file = context.assets.start(lens)?;
            let problem = new_problem(&config, &file, assets)?;
            // Everything is checked before the folder is made.
            check_trade(request, &config)?;
            (History::create(out, &file, &config)?, config, problem)
        }
    };
    check_trade(request, &config)?;
    note_held_radius(&problem, history.start(), &config.goal, context);

    let start = at_the_start(&problem);
    let best = if config.global {
        search(&problem, &mut history, config.seed, request, context)?
    } else {
        Some(descent(&problem, &mut history, request.iterations, context)?)
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
    let trades = match request.trade {
        true => trades(&config, history.start(), request, context)?,
        false => Vec::new(),
    };
    Ok(Response {
        found: Found {
            start: start.as_ref().map(|analysis| Figures::new(&problem, analysis)),
            best: Figures::new(&problem, &best),
            steps: history.steps().len(),
            trades,
            lens: history.best_lens(),
        },
        fields_deg: problem.merit.fields_rad.iter().map(|f| f.to_degrees()).collect(),
        is_cancelled: context.is_cancelled(),
    })
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

/// Refuses a lens one of whose thicknesses leads against the light and stays so where its variables begin.
fn check_directions(problem: &Problem) -> Result<(), JobError> {
    let space = problem.space().map_err(|e| not_optimisable(&e))?;
    let lens = space.lens_at(&space.start()).map_err(|e| not_optimisable(&e))?;
    match (0..lens.surfaces.len()).find(|i| lens.goes_against_the_light(*i)) {
        None => Ok(()),
        Some(i) => {
            let surface = &lens.surfaces[i];
            let (number, glass, thickness) = (i + 1, &surface.glass.name, surface.thickness_mm);
            let message = format!(
                "surface {number}: the thickness of {thickness} mm of {glass} goes against the light, and no variable corrects it"
            );
            let hint = format!("make thickness_mm of surface {number} a [[variable]], or correct it");
            Err(JobError::input(message, hint))
        }
    }
}

fn check_trade(request: &Request, config: &Config) -> Result<(), JobError> {
    match request.trade && !config.global {
        true => {
            let message = "compares searches, and this is a descent";
            Err(JobError::setting("trade", "", message, "begin a search with --global"))
        }
        false => Ok(()),
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

/// Levenberg and Marquardt's method from the best lens so far, or from the lens itself.
fn descent(
    problem: &Problem,
    history: &mut History,
    iterations: usize,
    context: &Context,
) -> Result<Analysis, JobError> {
    let clock = Clock::start(history);
    let base = match history.best() {
        None => problem.base.clone(),
        Some(_) => {
            // An import reports no warnings: those of the glasses were reported with the first lens of the history.
            let best = history.best_lens().display().to_string();
            let best = context.assets.import(&best)?.file.lens;
            Lens { entrance_pupil_mm: problem.base.entrance_pupil_mm, ..best }
        }
    };
    let problem = &Problem { base, ..problem.clone() };
    let options = LevenbergOptions { iterations, ..LevenbergOptions::default() };
    let mut add = |iteration: usize, least_share: f64, analysis: &Analysis, at: &[f64]| {
        if !history.is_better(analysis, least_share) {
            return Ok(());
        }
        let seconds = clock.seconds();
        context.note(line(&format!("iteration {iteration}"), seconds, problem, analysis));
        history.add(problem, 0, seconds, analysis, at, &[])
    };
    let mut failure = None;
    let descent = descend(problem, &options, &mut |iteration, analysis, at| {
        context.progress(iteration as u64, iterations as u64, "descent");
        failure = add(iteration, STEP_SHARE, analysis, at).err();
        failure.is_none() && !context.is_cancelled()
    })
    .map_err(|e| not_optimisable(&e))?;
    if let Some(failure) = failure {
        return Err(failure);
    }
    // The last lens counts, however little it gained.
    add(descent.iterations, 0.0, &descent.best, &descent.at)?;
    let why = match descent.stop {
        Stop::Converged => "converged",
        Stop::Stuck => "no step makes it better",
        Stop::Exhausted => "all iterations are done; --resume continues",
        Stop::Asked => "stopped; --resume continues",
    };
    context.note(format!("{} iterations: {why}", descent.iterations));
    Ok(descent.best)
}

/// A global search.
fn search(
    problem: &Problem,
    history: &mut History,
    seed: u64,
    request: &Request,
    context: &Context,
) -> Result<Option<Analysis>, JobError> {
    let options = SearchOptions { seed, ..SearchOptions::default() };
    let mut search = match history.state()? {
        Some(state) => Search::resume(problem, options, &state),
        None => Search::new(problem, options),
    }
    .map_err(|e| not_optimisable(&e))?;
    let clock = Clock::start(history);
    let (mut best, mut examined) = (None, f64::INFINITY);
    let mut kept_at = Instant::now();
    for done in 0.. {
        context.progress(done, request.rounds, "search");
        // Trace more rays through a better lens than the search did: their merit decides.
        if let Some(found) = search.best().filter(|found| found.analysis.merit < examined) {
            examined = found.analysis.merit;
            if let Some(fine) = with_more_rays(problem, &found.analysis.lens) {
                if history.is_better(&fine, STEP_SHARE) {
                    let (round, seconds) = (search.progress().0, clock.seconds());
                    context.note(line(&format!("round {round}"), seconds, problem, &fine));
                    history.add(problem, round, seconds, &fine, &found.at, &found.glasses)?;
                    history.keep_state(&search.state())?;
                }
                if best.as_ref().is_none_or(|b: &Analysis| fine.merit < b.merit) {
                    best = Some(fine);
                }
            }
        }
        let is_out_of_time = done > 0 && request.is_out_of_time(clock.began);
        if done == request.rounds || is_out_of_time || context.is_cancelled() {
            break;
        }
        search.advance();
        if kept_at.elapsed() > KEEP_EVERY {
            history.keep_state(&search.state())?;
            kept_at = Instant::now();
        }
    }
    history.keep_state(&search.state())?;
    let (rounds, descents) = search.progress();
    context.note(format!("{rounds} rounds, {descents} descents"));
    Ok(best)
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
    let without_operands = Problem { goals: of_the_picture, ..only_image_plane(problem) };
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
    let violated = match violations(analysis) {
        0 => String::new(),
        n => format!("; {n} limits violated"),
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

/// Searches again with each further requirement. What the goal demands more strictly stays.
fn trades(
    config: &Config,
    file: &LensFile,
    request: &Request,
    context: &Context,
) -> Result<Vec<Trade>, JobError> {
    let at_least = |limit: Option<f64>, value: f64| Some(limit.map_or(value, |l| l.max(value)));
    let at_most = |limit: Option<f64>, value: f64| Some(limit.map_or(value, |l| l.min(value)));
    let colours = |g: &mut Goal| g.wavelengths = file.lens.wavelengths_um.clone();
    let edges = |g: &mut Goal| g.edge = at_least(g.edge, 1.0);
    let diameters = |g: &mut Goal| g.clear_diameter = at_most(g.clear_diameter, 12.7);
    let distortion = |g: &mut Goal| g.distortion = at_most(g.distortion, 1.0);
    let all = |g: &mut Goal| {
        colours(g);
        edges(g);
        diameters(g);
        distortion(g);
    };
    type Requirement<'a> = (&'static str, &'a dyn Fn(&mut Goal));
    let requirements: [Requirement; 6] = [
        ("as asked", &|_| {}),
        ("polychromatic spots", &colours),
        ("edges of 1 mm", &edges),
        ("clear diameters of 12.7 mm", &diameters),
        ("distortion of 1 %", &distortion),
        ("all of these", &all),
    ];
    let mut trades = Vec::new();
    for (asked, require) in requirements {
        let mut goal = config.goal.clone();
        require(&mut goal);
        let problem = goal.problem(file, &context.assets)?;
        let options = SearchOptions { seed: config.seed, ..SearchOptions::default() };
        let mut search = Search::new(&problem, options).map_err(|e| not_optimisable(&e))?;
        let began = Instant::now();
        for done in 0..request.rounds {
            context.progress(done, request.rounds, asked);
            if context.is_cancelled() {
                return Ok(trades);
            }
            if done > 0 && request.is_out_of_time(began) {
                break;
            }
            search.advance();
        }
        let Some(best) = search.best() else { continue };
        let Some(best) = with_more_rays(&problem, &best.analysis.lens) else { continue };
        context.note(line(asked, began.elapsed().as_secs_f64(), &problem, &best));
        trades.push(Trade {
            asked: asked.to_owned(),
            mean_rms_um: best.mean_rms_um(),
            violations: violations(&best),
        });
    }
    Ok(trades)
}

impl Figures {
    fn new(problem: &Problem, analysis: &Analysis) -> Self {
        let lens = &analysis.lens;
        let sequence = lens.at_wavelength(lens.reference_um);
        let order = first_order(&sequence);
        let clear = analysis.fitted_lens(problem);
        let widest = clear.surfaces.iter().fold(0.0_f64, |w, s| w.max(2.0 * s.semi_diameter_mm));
        let outermost = problem.merit.outermost_field_rad();
        let chief = (outermost != 0.0 && lens.is_rotationally_symmetric())
            .then(|| chief_ray(&sequence, outermost))
            .flatten();
        let goals = || problem.goals.iter().zip(analysis.goals.iter().copied());
        let figure = |(goal, value): (&MeritGoal, f64)| OperandFigure {
            of: goal.merit.name(),
            value,
            target: goal.target,
            unit: goal.merit.unit().to_owned(),
        };
        let distortion = chief
            .map(|c| c.y_mm / (image_height_per_tangent(&sequence) * rectilinear_tangent(outermost)) - 1.0);
        Self {
            restored_error_percent: goals().find(|(goal, _)| is_restored(goal)).map(|(_, percent)| percent),
            operands: goals().filter(|(goal, _)| !is_restored(goal)).map(figure).collect(),
            mean_rms_spot_um: analysis.mean_rms_um(),
            rms_spot_um: analysis.rms_um.clone(),
            focal_length_mm: finite(order.efl_mm),
            back_focal_length_mm: finite(order.bfl_mm),
            f_number: finite(order.f_number),
            magnification: first_order_table(lens).magnification,
            track_to_the_image_mm: lens.total_track_mm(),
            largest_clear_diameter_mm: widest,
            distortion_percent: distortion.map(|share| 100.0 * share).and_then(finite),
            violations_mm: analysis.violations.iter().map(|(what, mm)| (what.to_string(), *mm)).collect(),
        }
    }
}
