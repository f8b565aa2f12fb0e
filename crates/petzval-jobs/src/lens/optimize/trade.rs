//! What further requirements cost: searches with each of them.

use std::time::Instant;

use petzval_files::LensFile;
use petzval_optics::lens::validate;
use petzval_optics::optimize::{Analysis, Problem, Search, SearchOptions};

use super::buildable::newly_broken;
use super::figures::Figures;
use super::goal::Goal;
use super::history::Config;
use super::progress::{Origin, at_the_start, better, not_optimisable, violations, with_more_rays};
use super::request::{ROUNDS, Request, Trade};
use crate::context::Context;
use crate::error::{JobError, Result};

/// Refuses to compare searches where none is made.
pub(super) fn check_trade(config: &Config) -> Result<()> {
    if config.trade && !config.global {
        let message = "compares searches, and this is a descent";
        Err(JobError::setting("trade", "", message, "begin a search with --global"))
    } else {
        Ok(())
    }
}

/// A found lens with more rays; `None` if it cannot be built, or breaks an edge or a gap which the lens at the start keeps.
fn buildable(problem: &Problem, start: Option<&Analysis>, found: &Analysis) -> Option<Analysis> {
    let fine = with_more_rays(problem, &found.lens)?;
    let is_built = newly_broken(start, &fine).is_none() && validate(&fine.fitted_lens(problem)).is_ok();
    is_built.then_some(fine)
}

/// Searches again with each further requirement. What the goal demands more strictly stays. As in the search itself the lens at the start competes.
pub(super) fn trades(
    config: &Config,
    file: &LensFile,
    request: &Request,
    context: &Context,
) -> Result<Vec<Trade>> {
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
        ("no further one", &|_| {}),
        ("polychromatic spots", &colours),
        ("edges of 1 mm", &edges),
        ("clear diameters of 12.7 mm", &diameters),
        ("distortion of 1 %", &distortion),
        ("all of these", &all),
    ];
    let rounds = config.rounds.unwrap_or(ROUNDS);
    let mut trades = Vec::new();
    for (requirement, require) in requirements {
        let mut goal = config.goal.clone();
        require(&mut goal);
        let problem = goal.problem(file, &context.assets)?;
        let options = SearchOptions { seed: config.seed, ..SearchOptions::default() };
        let mut search = Search::new(&problem, options).map_err(|e| not_optimisable(&e))?;
        let began = Instant::now();
        let start = at_the_start(&problem);
        let own = search.own_lens().ok();
        let mut best = own.and_then(|own| buildable(&problem, start.as_ref(), &own.analysis));
        let mut examined = f64::INFINITY;
        for done in 0..rounds {
            context.progress(done, rounds, requirement);
            if context.is_cancelled() {
                return Ok(trades);
            }
            if done > 0 && request.is_out_of_time(began) {
                break;
            }
            search.advance();
            let found = search.best().map(|found| &found.analysis).filter(|found| found.merit < examined);
            let Some(found) = found else { continue };
            examined = found.merit;
            let fine = buildable(&problem, start.as_ref(), found);
            best = [best, fine].into_iter().flatten().min_by(|a, b| a.merit.total_cmp(&b.merit));
        }
        let Some(best) = best else { continue };
        let seconds = began.elapsed().as_secs_f64();
        context.event(&better(Origin::Requirement(requirement), seconds, &problem, &best));
        trades.push(Trade {
            requirement: requirement.to_owned(),
            mean_rms_um: Figures::new(&problem, &best).mean_rms_spot_um,
            violations: violations(&best),
        });
    }
    Ok(trades)
}
