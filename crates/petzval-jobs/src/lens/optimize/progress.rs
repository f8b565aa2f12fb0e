//! How far an optimisation goes and has come, and the note about each better lens.

use std::fmt;
use std::time::{Duration, Instant};

use petzval_optics::design_space::{DesignSpaceError, Focus, Solves};
use petzval_optics::lens::Lens;
use petzval_optics::merit::SpotResiduals;
use petzval_optics::optimize::{Analysis, Descent, LevenbergOptions, Limits, Problem, descend};
use petzval_optics::pupil::PupilSampling;

use super::figures::{VIOLATED_MM, is_restored, violation_in_words};
use super::history::{Config, History};
use super::request::{ITERATIONS, ROUNDS};
use crate::error::JobError;
use crate::event::{Event, figures};

/// A step of the history is better than the one before by this share at least.
pub(super) const STEP_SHARE: f64 = 1e-3;

/// The share of the merit, squared, below which another descent takes the place of the usual one: half a percent of the spot.
pub(super) const WORTH_IT: f64 = 0.99;

/// How often a search writes its state, so that it can continue from there whatever ends the process.
pub(super) const KEEP_EVERY: Duration = Duration::from_secs(1);

/// How far a call goes, with what was done before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Upto {
    /// Iterations of a descent.
    pub iterations: usize,
    /// Whether a descent that found no better lens any more begins again.
    pub again: bool,
    /// Rounds of a search.
    pub rounds: u64,
}

impl Upto {
    /// All iterations and rounds of the request.
    pub fn of(config: &Config) -> Self {
        let (iterations, rounds) = (config.iterations.unwrap_or(ITERATIONS), config.rounds.unwrap_or(ROUNDS));
        Self { iterations, again: false, rounds }
    }
}

/// Seconds of work on an optimisation, those of earlier calls included.
pub(super) struct Clock {
    pub began: Instant,
    before: f64,
}

impl Clock {
    pub fn start(history: &History) -> Self {
        Self { began: Instant::now(), before: history.best().map_or(0.0, |step| step.seconds) }
    }

    pub fn seconds(&self) -> f64 {
        self.before + self.began.elapsed().as_secs_f64()
    }
}

pub(super) fn not_optimisable(error: &DesignSpaceError) -> JobError {
    JobError::input(error.to_string(), "correct the variables or solves of the lens file, or --efl")
}

/// A lens traced with more rays than an optimisation traces, its image plane where they are best; `None` if they do not reach
/// the image.
pub(super) fn with_more_rays(problem: &Problem, lens: &Lens) -> Option<Analysis> {
    let only_image_plane = Problem { base: lens.clone(), ..only_image_plane(problem) };
    descend(&only_image_plane, &LevenbergOptions::default(), &mut |_, _, _| true).ok().map(|d| d.best)
}

/// The lens at the start with more rays, its image plane where the spots are least, or the error after restoration: an operand or a limit such as a
/// short track would only defocus it.
pub(super) fn at_the_start(problem: &Problem) -> Option<Analysis> {
    // A search begins with the variables inside their bounds, and with what pickups and solves make of the lens.
    let begin = problem.space().ok().and_then(|space| space.lens_at(&space.start()).ok());
    let problem = &Problem { base: begin.unwrap_or_else(|| problem.base.clone()), ..problem.clone() };
    let of_the_picture: Vec<_> = problem.goals.iter().filter(|goal| is_restored(goal)).cloned().collect();
    let spot_weight = if of_the_picture.is_empty() { 1.0 } else { 0.0 };
    let without_demands = Problem {
        spot_weight,
        goals: of_the_picture,
        further: Vec::new(),
        limits: Limits::default(),
        ..only_image_plane(problem)
    };
    let options = LevenbergOptions::default();
    let focused = descend(&without_demands, &options, &mut |_, _, _| true).ok()?.best.lens;
    let as_it_is = Problem { base: focused, focus: Focus::Fixed, ..only_image_plane(problem) };
    let no_step = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
    descend(&as_it_is, &no_step, &mut |_, _, _| true).ok().map(|d| d.best)
}

/// A lens as it is, under a problem; `None` if its rays are lost.
pub(super) fn with_this_lens(problem: &Problem, lens: Lens) -> Option<Descent> {
    let there = Problem { base: lens, ..problem.clone() };
    let as_it_is = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
    descend(&there, &as_it_is, &mut |_, _, _| true).ok()
}

/// The problem with more rays, in which the image plane alone moves.
pub(super) fn only_image_plane(problem: &Problem) -> Problem {
    Problem {
        variables: Vec::new(),
        pickups: Vec::new(),
        glasses: Vec::new(),
        solves: Solves::default(),
        ..with_fine_rays(problem)
    }
}

/// The problem with more rays.
pub(super) fn with_fine_rays(problem: &Problem) -> Problem {
    let merit = SpotResiduals { sampling: PupilSampling::Degree(10), ..problem.merit.clone() };
    Problem { merit, ..problem.clone() }
}

/// The limits that a lens does not keep, each with the figure and its bound.
pub(super) fn named_violations(problem: &Problem, analysis: &Analysis) -> Vec<String> {
    if violations(analysis) == 0 {
        return Vec::new();
    }
    let fitted = analysis.fitted_lens(problem);
    let broken = analysis.violations.iter().filter(|(_, mm)| *mm > VIOLATED_MM);
    broken.map(|(what, mm)| violation_in_words(problem, what, &fitted, *mm)).collect()
}

pub(super) fn violations(analysis: &Analysis) -> usize {
    analysis.violations.iter().filter(|(_, mm)| *mm > VIOLATED_MM).count()
}

/// What led to a better lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// A search began with it.
    Start,
    /// An iteration of a descent.
    Iteration(usize),
    /// A round of a search.
    Round(u64),
    /// A search with a further requirement.
    Requirement(&'static str),
}

impl Origin {
    /// The name and the number of what is counted.
    fn count(self) -> Option<(&'static str, f64)> {
        match self {
            Self::Iteration(iteration) => Some(("iteration", iteration as f64)),
            Self::Round(round) => Some(("round", round as f64)),
            Self::Start | Self::Requirement(_) => None,
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str("start"),
            Self::Iteration(iteration) => write!(f, "iteration {iteration}"),
            Self::Round(round) => write!(f, "round {round}"),
            Self::Requirement(requirement) => f.write_str(requirement),
        }
    }
}

/// The note about a better lens after some seconds of work. Its figures are named as in `history.jsonl`; `rms_um_1` is that of the first field.
pub(super) fn better(origin: Origin, seconds: f64, problem: &Problem, analysis: &Analysis) -> Event {
    let fields: Vec<String> = analysis.rms_um.iter().map(|r| format!("{r:.2}")).collect();
    let not_kept = named_violations(problem, analysis);
    let violated = match &not_kept[..] {
        [] => String::new(),
        [one] => format!("; not kept: {one}"),
        [first, more @ ..] => format!("; not kept: {first}; and {} more", more.len()),
    };
    let is_restored = problem.goals.first().is_some_and(is_restored);
    let merit_um = analysis.merit.sqrt();
    let (merit, merit_in_words) = match (is_restored, analysis.goals.first()) {
        (true, Some(percent)) => (("restored_error_percent", *percent), format!("error {percent:8.4} %")),
        _ => (("merit_um", merit_um), format!("merit {merit_um:8.3} um")),
    };
    let mean_rms_um = analysis.mean_rms_um();
    let what = origin.to_string();
    let text = format!(
        "{seconds:8.2} s  {what:<14} {merit_in_words}  spots {mean_rms_um:.3} um ({}){violated}",
        fields.join(" ")
    );
    let whole =
        [("seconds", seconds), merit, ("mean_rms_um", mean_rms_um), ("violations", not_kept.len() as f64)];
    let mut figures = figures(origin.count().into_iter().chain(whole));
    figures.extend((1..).zip(&analysis.rms_um).map(|(field, rms)| (format!("rms_um_{field}"), *rms)));
    Event::Note { text, figures }
}
