//! What further requirements cost: searches with each of them.

use std::time::Instant;

use petzval_files::LensFile;
use petzval_optics::optimize::{Search, SearchOptions};

use super::goal::Goal;
use super::history::Config;
use super::progress::{line, not_optimisable, violations, with_more_rays};
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

/// Searches again with each further requirement. What the goal demands more strictly stays.
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
        for done in 0..rounds {
            context.progress(done, rounds, requirement);
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
        context.note(line(requirement, began.elapsed().as_secs_f64(), &problem, &best));
        trades.push(Trade {
            requirement: requirement.to_owned(),
            mean_rms_um: best.mean_rms_um(),
            violations: violations(&best),
        });
    }
    Ok(trades)
}
