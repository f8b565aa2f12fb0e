//! The descent of `lens optimize`, which goes on where it was interrupted.

use std::time::Instant;

use petzval_design::path_text::path_text;
use petzval_optics::constraint::Constraint;
use petzval_optics::design_space::DesignSpaceError;
use petzval_optics::lens::Lens;
use petzval_optics::optimize::{
    Analysis, Descent, DescentProgress, LevenbergOptions, Problem, Stop, descend, descend_by_spots,
    descend_in_focus, descend_on, descend_softly, descend_watched,
};

use super::buildable::{OnTheWay, ending_kept, newly_broken};
use super::figures::is_restored;
use super::history::{History, KeptDescent};
use super::progress::{
    Clock, KEEP_EVERY, Origin, STEP_SHARE, Upto, WORTH_IT, better, not_optimisable, with_fine_rays,
};
use crate::context::Context;
use crate::error::{JobError, Result};

/// A method of descent.
type Method = fn(
    &Problem,
    &LevenbergOptions,
    &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Result<Descent, DesignSpaceError>;

/// The lens that a further descent begins with.
enum From {
    /// That of the problem.
    Start,
    /// The best one so far.
    Best,
}

/// Other ways than straight down, each with the lens that it begins with and its name. They lead further where limits are penalties, and where the
/// image plane follows all other numbers. Spots cost little; figures do not, so for them the spots alone lead the way, and pictures have none.
fn other_ways(problem: &Problem) -> &'static [(Method, From, &'static str)] {
    const FOR_SPOTS: &[(Method, From, &str)] = &[
        (descend_softly, From::Start, "descent with softer limits"),
        (descend_in_focus, From::Start, "descent in focus"),
        (descend_in_focus, From::Best, "descent in focus, from the best lens"),
    ];
    const FOR_FIGURES: &[(Method, From, &str)] = &[(descend_by_spots, From::Start, "descent by the spots")];
    if problem.goals.iter().any(is_restored) {
        &[]
    } else if problem.goals.iter().all(|goal| goal.weight_um == 0.0) {
        FOR_SPOTS
    } else {
        FOR_FIGURES
    }
}

/// The problem with the image plane of its lens where that at the start has it, if all that is minimised is less there.
fn in_plane_of(problem: &Problem, start: &Lens) -> Option<Problem> {
    let base = problem.base.with_image_distance(start.image_distance_mm());
    let there = Problem { base, ..problem.clone() };
    let merit = |problem: &Problem| {
        let as_it_is = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
        Some(descend(&with_fine_rays(problem), &as_it_is, &mut |_, _, _| true).ok()?.best.merit)
    };
    let own = merit(problem).unwrap_or(f64::INFINITY);
    merit(&there).is_some_and(|merit| merit < own).then_some(there)
}

/// Levenberg and Marquardt's method from where an earlier call left off, or from the lens itself, whose image plane is that of `start` if it is
/// better there. The best lens breaks no edge or gap that `start` keeps, if any lens on the way keeps them all.
pub(super) fn descent(
    problem: &Problem,
    start: Option<&Analysis>,
    history: &mut History,
    Upto { iterations, again, .. }: Upto,
    context: &Context,
) -> Result<Analysis> {
    let clock = Clock::start(history);
    let kept = history.descent()?;
    let mut own = problem.clone();
    // The folder of an earlier version, or one that was taken back to a step: the best lens is where it begins again.
    if kept.is_none() && history.best().is_some() {
        // An import reports no warnings: those of the glasses were reported with the first lens of the history.
        let best = context.assets.import(&path_text(&history.best_lens())?)?.file.lens;
        own.base = Lens { entrance_pupil_mm: problem.base.entrance_pupil_mm, ..best };
    } else if let Some(there) = start.and_then(|start| in_plane_of(problem, &start.lens)) {
        own = there;
    }
    let problem = &own;
    let options = LevenbergOptions { iterations, ..LevenbergOptions::default() };
    let mut went_softly = kept.as_ref().is_some_and(|kept| kept.went_softly);
    let (mut failure, mut kept_at) = (None::<JobError>, Instant::now());
    let mut buildable = None;
    let mut watch = |progress: &DescentProgress| {
        context.progress(progress.iterations as u64, iterations as u64, "descent");
        let mut step = || {
            let is_buildable = newly_broken(start, &progress.best).is_none();
            if is_buildable {
                let (best, at) = (progress.best.clone(), progress.at.clone());
                buildable = Some(OnTheWay { best, at, iteration: progress.iterations });
            }
            let is_step = is_buildable && history.is_better(&progress.best, STEP_SHARE);
            if is_step {
                add(problem, history, &clock, progress.iterations, &progress.best, &progress.at, context)?;
            }
            if is_step || kept_at.elapsed() > KEEP_EVERY {
                history.keep_descent(&KeptDescent { state: progress.state(), went_softly })?;
                kept_at = Instant::now();
            }
            Ok(())
        };
        failure = step().err();
        failure.is_none() && !context.is_cancelled()
    };
    let descent = match kept {
        Some(KeptDescent { state, .. })
            if again && matches!(state.stop, Some(Stop::Converged | Stop::Stuck)) =>
        {
            descend_on(problem, &options, &state.going_on(), &mut watch)
        }
        Some(KeptDescent { state, .. }) => descend_on(problem, &options, &state, &mut watch),
        None => descend_watched(problem, &options, &mut watch),
    };
    let mut descent = descent.map_err(|e| not_optimisable(&e))?;
    if let Some(failure) = failure {
        return Err(failure);
    }
    history.keep_descent(&KeptDescent { state: descent.state.clone(), went_softly })?;
    let mut went_beyond = false;
    if let Some(what) = newly_broken(start, &descent.best).map(Constraint::to_string) {
        // In a call that goes on, no lens of this call may keep them; the best of the history does.
        let known = match buildable {
            None if history.best().is_some() => of_history(problem, history, context)?,
            known => known,
        };
        match known {
            Some(OnTheWay { best, at, iteration }) => {
                context.note(format!(
                    "the descent goes on to lenses that break a limit of edges and gaps which the start keeps ({what}): they do not count"
                ));
                if descent.stop != Stop::Interrupted && history.is_better(&best, 0.0) {
                    add(problem, history, &clock, iteration, &best, &at, context)?;
                }
                (descent, went_beyond) = (Descent { best, at, ..descent }, true);
            }
            None => context.note(format!(
                "no lens on the way keeps all limits of edges and gaps that the start keeps: the best lens breaks one of them ({what})"
            )),
        }
    }
    if descent.stop == Stop::Interrupted {
        // No step of the history: without the interruption there would be none.
        history.keep_best(problem, &descent.best)?;
        return Ok(noted(descent, went_beyond, context));
    }
    let ways = other_ways(problem);
    let goes_softly = !ways.is_empty() && !went_softly;
    if goes_softly {
        for (way, from, name) in ways {
            let on = match from {
                From::Start => problem.clone(),
                From::Best => Problem { base: descent.best.lens.clone(), ..problem.clone() },
            };
            let mut last = None;
            let mut watch = |iteration: usize, lens: &Analysis, _: &[f64]| {
                context.progress(iteration as u64, iterations as u64, *name);
                if newly_broken(start, lens).is_none() {
                    last = Some(lens.lens.clone());
                }
                !context.is_cancelled()
            };
            let other = way(&on, &options, &mut watch).ok().filter(|d| d.stop != Stop::Interrupted);
            let other = other.and_then(|d| ending_kept(problem, start, d, last));
            if let Some(better) = other.filter(|(d, _)| d.best.merit < WORTH_IT * descent.best.merit) {
                (descent, went_beyond) = better;
            }
        }
    }
    // The last lens counts, however little it gained.
    if history.is_better(&descent.best, 0.0) {
        add(problem, history, &clock, descent.iterations, &descent.best, &descent.at, context)?;
    }
    went_softly |= goes_softly && !context.is_cancelled();
    history.keep_descent(&KeptDescent { state: descent.state.clone(), went_softly })?;
    Ok(noted(descent, went_beyond, context))
}

/// The best lens of the history under the problem; `None` if its rays are lost.
fn of_history(problem: &Problem, history: &History, context: &Context) -> Result<Option<OnTheWay>> {
    let best = context.assets.import(&path_text(&history.best_lens())?)?.file.lens;
    let lens = Lens { entrance_pupil_mm: problem.base.entrance_pupil_mm, ..best };
    Ok(OnTheWay::as_it_is(problem, lens))
}

/// Adds a step to the history, and says so.
fn add(
    problem: &Problem,
    history: &mut History,
    clock: &Clock,
    iteration: usize,
    analysis: &Analysis,
    at: &[f64],
    context: &Context,
) -> Result<()> {
    let seconds = clock.seconds();
    context.event(&better(Origin::Iteration(iteration), seconds, problem, analysis));
    let lens = history.add(problem, 0, seconds, analysis, at, &[])?;
    lens.into_iter().for_each(|lens| context.wrote(lens, "lens"));
    Ok(())
}

/// Says why a descent ended; returns its lens. It may have gone on beyond this lens to some that do not count.
fn noted(descent: Descent, went_beyond: bool, context: &Context) -> Analysis {
    let why = match descent.stop {
        Stop::Converged | Stop::Stuck | Stop::Exhausted if went_beyond => {
            "the last ones break edges or gaps that the start keeps; the best lens is an earlier one"
        }
        Stop::Converged => "converged",
        Stop::Stuck => "no step makes it better",
        Stop::Exhausted => "all iterations are done; --resume with --iterations takes more",
        Stop::Interrupted => "stopped; --resume continues",
    };
    context.note(format!("{} iterations: {why}", descent.iterations));
    descent.best
}
