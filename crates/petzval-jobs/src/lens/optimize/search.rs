//! The global search of `lens optimize`: rounds, what is kept of them, and the lens at the start as the one to beat.

use std::time::Instant;

use petzval_design::path_text::path_text;
use petzval_optics::design_space::DesignSpaceError;
use petzval_optics::optimize::{Analysis, Found, Kept, Problem, Search, SearchOptions, SearchState};

use super::buildable::newly_broken;
use super::history::{Config, History, KeptSearch};
use super::progress::{Clock, KEEP_EVERY, Origin, STEP_SHARE, better, not_optimisable, with_more_rays};
use super::request::Request;
use crate::context::Context;
use crate::error::Result;

/// A global search. No lens counts that breaks an edge or a gap which the lens at the start keeps.
pub(super) fn search(
    problem: &Problem,
    start: Option<&Analysis>,
    history: &mut History,
    config: &Config,
    rounds: u64,
    request: &Request,
    context: &Context,
) -> Result<Option<Analysis>> {
    let options = SearchOptions { seed: config.seed, ..SearchOptions::default() };
    let kept = history.search()?;
    let mut search = match &kept {
        Some(kept) => Search::resume(problem, options, &kept.state),
        None => Search::new(problem, options),
    }
    .map_err(|e| not_optimisable(&e))?;
    let clock = Clock::start(history);
    let mut examined = f64::INFINITY;
    let mut best = match kept.and_then(|kept| kept.best) {
        Some(known) => restored(problem, options, known)?,
        None if history.steps().is_empty() => enter_start(problem, &search, history, context)?,
        None => None,
    };
    let mut kept_at = Instant::now();
    for done in 0.. {
        context.progress(search.progress().0, rounds, "search");
        // Trace more rays through a better lens than the search did: their merit decides.
        if let Some(found) = search.best().filter(|found| found.analysis.merit < examined) {
            examined = found.analysis.merit;
            let fine = with_more_rays(problem, &found.analysis.lens);
            if let Some(fine) = fine.filter(|fine| newly_broken(start, fine).is_none()) {
                if history.is_better(&fine, STEP_SHARE) {
                    let (round, seconds) = (search.progress().0, clock.seconds());
                    context.event(&better(Origin::Round(round), seconds, problem, &fine));
                    let lens = history.add(problem, round, seconds, &fine, &found.at, &found.glasses)?;
                    lens.into_iter().for_each(|lens| context.wrote(lens, "lens"));
                }
                let is_built = history.defect(problem, &fine).is_none();
                if is_built && best.as_ref().is_none_or(|(b, _)| fine.merit < b.merit) {
                    let Found { at, glasses, round, .. } = found;
                    let names = problem.glasses.iter().zip(glasses);
                    let glasses = names.map(|(choice, i)| choice.candidates[*i].name.clone()).collect();
                    best = Some((fine, Kept { at: at.clone(), glasses, round: *round }));
                }
                keep(&search, best.as_ref(), history)?;
            }
        }
        let is_out_of_time = done > 0 && request.is_out_of_time(clock.began);
        if search.progress().0 >= rounds || is_out_of_time || context.is_cancelled() {
            break;
        }
        search.advance();
        if kept_at.elapsed() > KEEP_EVERY {
            keep(&search, best.as_ref(), history)?;
            kept_at = Instant::now();
        }
    }
    keep(&search, best.as_ref(), history)?;
    let mut best = best.map(|(fine, _)| fine);
    let (rounds, descents) = search.progress();
    let dropped = match search.dropped() {
        0 => String::new(),
        dropped => format!("; {dropped} candidates were dropped, for their rays do not reach the image"),
    };
    context.note(format!("{rounds} rounds, {descents} descents{dropped}"));
    // What earlier calls found still counts.
    if let Some(step) = history.best()
        && best.as_ref().is_none_or(|b| step.merit_um < b.merit.sqrt() * (1.0 - 1e-9))
    {
        let known = context.assets.import(&path_text(&history.best_lens())?)?.file.lens;
        best = with_more_rays(problem, &known).or(best);
    }
    Ok(best)
}

/// Keeps what a search needs to continue.
fn keep(search: &Search, best: Option<&(Analysis, Kept)>, history: &History) -> Result<()> {
    history.keep_search(&KeptSearch { state: search.state(), best: best.map(|(_, known)| known.clone()) })
}

/// The best lens of an earlier call with more rays.
fn restored(problem: &Problem, options: SearchOptions, known: Kept) -> Result<Option<(Analysis, Kept)>> {
    let alone = SearchState { round: known.round, kept: vec![known.clone()] };
    let search = Search::resume(problem, options, &alone).map_err(|e| not_optimisable(&e))?;
    let fine = search.best().and_then(|found| with_more_rays(problem, &found.analysis.lens));
    Ok(fine.map(|fine| (fine, known)))
}

/// Makes the lens at the start the first step of a search, which nothing but a better lens replaces. Where it cannot compete a line says why.
fn enter_start(
    problem: &Problem,
    search: &Search,
    history: &mut History,
    context: &Context,
) -> Result<Option<(Analysis, Kept)>> {
    let own = search.own_lens().map_err(|why| why.to_string());
    let fine = own.and_then(|own| {
        let fine = with_more_rays(problem, &own.analysis.lens);
        Ok((fine.ok_or_else(|| DesignSpaceError::NoRays.to_string())?, own))
    });
    let (fine, own) = match fine {
        Ok((fine, own)) => match history.defect(problem, &fine) {
            None => (fine, own),
            Some(defect) => return without_start(&format!("it cannot be built: {defect}"), context),
        },
        Err(why) => return without_start(&why, context),
    };
    context.event(&better(Origin::Start, 0.0, problem, &fine));
    let lens = history.add(problem, 0, 0.0, &fine, &own.at, &own.glasses)?;
    lens.into_iter().for_each(|lens| context.wrote(lens, "lens"));
    let names = problem.glasses.iter().zip(&own.glasses);
    let glasses = names.map(|(choice, i)| choice.candidates[*i].name.clone()).collect();
    Ok(Some((fine, Kept { at: own.at, glasses, round: own.round })))
}

/// Says why a search goes without the lens at its start.
fn without_start(why: &str, context: &Context) -> Result<Option<(Analysis, Kept)>> {
    context.note(format!("the lens at the start does not compete: {why}"));
    Ok(None)
}
