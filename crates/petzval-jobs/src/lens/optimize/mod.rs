//! `lens optimize`: a better lens, by descent or by search, for its spots or for the restoration of its frames.

mod buildable;
mod descent;
mod figures;
mod goal;
mod history;
mod operand;
mod page;
mod progress;
mod request;
mod search;
mod trade;

use std::path::Path;

use petzval_base::simd::level;
use petzval_design::assets::Assets;
use petzval_design::error::DesignError;
use petzval_files::{LensFile, OperandFile, parse_operands};
use petzval_optics::design_space::AtBound;
use petzval_optics::lens::{Lens, validate};
use petzval_optics::optimize::{Analysis, LevenbergOptions, Problem, Search, SearchOptions, descend};
use petzval_optics::paraxial::first_order;

use self::descent::descent;
use self::history::{Config, History};
use self::progress::{Upto, at_the_start, named_violations, not_optimisable};
use self::request::{ITERATIONS, ROUNDS};
use self::search::search;
use self::trade::{check_trade, trades};
use super::focus::{NoImage, colours_out_of_best_focus, no_image, virtual_image};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::glass_range::warn_of_wavelengths;

pub use figures::{Figures, OperandFigure, Reached};
pub use goal::{Goal, Restored};
pub use petzval_optics::design_space::Vary;
pub use request::{Found, Request, Response, Start, Trade};

/// Reads an operand file.
pub fn read_operands(path: &Path) -> Result<OperandFile> {
    let text = petzval_base::read_text(path).map_err(DesignError::io(path))?;
    Ok(parse_operands(&text).map_err(DesignError::input(path))?)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    seed: Some(|request, seed| {
        if let Start::New { seed: own, .. } = &mut request.start {
            *own = seed;
        }
    }),
    place: Some(|request, folder| {
        if let Start::New { out, .. } = &mut request.start {
            *out = folder.to_owned();
        }
    }),
    going_on: Some(|request, folder| {
        History::is_in(folder).then(|| Request {
            start: Start::Resume { folder: folder.to_owned(), rewind: None },
            iterations: None,
            rounds: None,
            seconds: request.seconds,
            trade: request.trade,
        })
    }),
    out_in: Some("/start/new"),
    ..AsUnit::PLAIN
};

/// Optimises the lens.
///
/// The folder holds the best lens (`best.toml`), every better lens on the way (`lens/step-N.toml`, `history.jsonl`) and what
/// is needed to continue. Once it is cancelled it writes the best lens so far and its page, and [`JobError::Stopped`] holds the response.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    request.check()?;
    let assets = &context.assets;
    let (mut history, config, mut problem, upto) = match &request.start {
        Start::Resume { folder, rewind } => {
            let (history, config) = History::open(folder, *rewind, context)?;
            let problem = config.goal.problem(history.start(), assets)?;
            warn_of_another_level(&config, context);
            let (config, upto) = continued(config, request, &history)?;
            // Everything is checked before the folder changes.
            check_trade(&config)?;
            check_method(&config, request)?;
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
            let (name, placed) = lens.placed(context)?;
            let file = placed.assets.start(&name)?;
            // A lens without an image has beam widths in place of spots: less of them would make a telescope no telescope.
            if let (None, None, Some(NoImage { reason, hint })) =
                (&goal.efl, &goal.operands, no_image(&file.lens))
            {
                let hint = format!("--efl MM makes it a lens of that focal length; {hint}");
                return Err(JobError::input(format!("{name}: {reason}"), hint));
            }
            let problem = new_problem(&config, &file, assets)?;
            // Everything is checked before the folder is made.
            check_trade(&config)?;
            check_method(&config, request)?;
            let upto = Upto::of(&config);
            (History::create(out, &file, &config)?, config, problem, upto)
        }
    };
    warn_of_wavelengths(&history.start().lens, &config.goal.wavelengths, context);
    note_held_radius(&problem, history.start(), &config.goal, context);
    if let Some(said) = virtual_image(&history.start().lens) {
        let said = format!("{said}, and spots on a plane behind the lens are those of its beams");
        context.warning(WarningKind::OutOfFocus, said);
    }

    let mut start = at_the_start(&problem);
    let sees_the_same = sees_what_the_file_states(&config.goal, &problem, history.start());
    // A search makes lenses of other shapes, whose apertures are others.
    let is_as_stated = sees_the_same && !config.global;
    if let Some(unclipped) = &start
        && sees_the_same
    {
        let cutting = unclipped.cutting_apertures_mm(&problem);
        if cutting.iter().any(Option::is_some) {
            context.note(cut_in_words(&cutting, config.global));
            if is_as_stated {
                problem.kept_apertures_mm = cutting;
                start = at_the_start(&problem).or(start);
            }
        }
    }
    if let Some(start) = &start {
        note_violations(&problem, start, context);
    }
    let best = if config.global {
        search(&problem, start.as_ref(), &mut history, &config, upto.rounds, request, context)?
    } else {
        Some(descent(&problem, start.as_ref(), &mut history, upto, context)?)
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
    let trades = if config.trade { trades(&config, history.start(), request, context)? } else { Vec::new() };
    let found = Found {
        start: start.as_ref().map(|analysis| Figures::new(&problem, analysis)),
        best: Figures::new(&problem, &best),
        at_bounds: at_bounds(&problem, &best.lens),
        steps: history.steps().len(),
        trades,
        lens: history.best_lens(),
        page: history.page(),
    };
    if let Some(said) = found.start.as_ref().and_then(|start| found.best.cost_of_missed(start)) {
        context.warning(WarningKind::Other, said);
    }
    let before = start.as_ref().map(|analysis| {
        let fitted = analysis.fitted_lens(&problem);
        if is_as_stated { with_own_apertures(fitted, history.start()) } else { fitted }
    });
    let fitted = best.fitted_lens(&problem);
    if problem.has_image_plane_for_spots() {
        let fields_deg = problem.merit.fields_rad.iter().map(|f| f.to_degrees()).collect();
        let wavelengths_um = problem.merit.wavelengths_um.clone();
        let seen = Lens { fields_deg, wavelengths_um, ..fitted.clone() };
        if let Some(said) = colours_out_of_best_focus(&seen) {
            context.warning(WarningKind::OutOfFocus, format!("the best lens: {said}"));
        }
    }
    history.write_page(&page::page(&problem, &found, before.as_ref(), &fitted))?;
    context.wrote(history.best_lens(), "lens");
    context.wrote(history.page(), "page");
    let fields_deg = problem.merit.fields_rad.iter().map(|f| f.to_degrees()).collect();
    let response = Response { found, fields_deg };
    if context.is_cancelled() {
        let folder = history.root().to_path_buf();
        let again = Request {
            start: Start::Resume { folder: folder.clone(), rewind: None },
            iterations: None,
            rounds: None,
            seconds: request.seconds,
            trade: request.trade,
        };
        let stopped = context.stopped("stopped with the best lens so far").keeping(folder);
        return Err(stopped.going_on_with(&again).with_response(&response).into());
    }
    Ok(response)
}

/// Refuses options of a search where a descent is made, and those of a descent where a search is.
fn check_method(config: &Config, request: &Request) -> Result<()> {
    let iterations = ("iterations", request.iterations.map(|n| n.to_string()));
    let rounds = ("rounds", request.rounds.map(|n| n.to_string()));
    let seconds = ("seconds", request.seconds.map(|s| s.to_string()));
    let (foreign, message, hint) = if config.global {
        (
            vec![iterations],
            "belongs to a descent, and this is a search",
            "a search takes --rounds and --seconds",
        )
    } else {
        let message = "belongs to a search, and this is a descent";
        (vec![rounds, seconds], message, "a descent takes --iterations; a search begins with --global")
    };
    match foreign.into_iter().find_map(|(key, value)| Some((key, value?))) {
        Some((key, value)) => Err(JobError::setting(key, value, message, hint)),
        None => Ok(()),
    }
}

/// Whether an optimisation has the pupil and no wider fields than the lens file, so that the clear apertures of the file hold for it.
fn sees_what_the_file_states(goal: &Goal, problem: &Problem, file: &LensFile) -> bool {
    // A thousandth beyond the outermost field is the same field.
    let stated_deg = file.lens.outermost_field_deg();
    goal.f_number.is_none() && problem.merit.outermost_field_rad().abs().to_degrees() <= 1.001 * stated_deg
}

/// What to say of clear apertures that cut the beams of the lens at the start.
fn cut_in_words(cutting: &[Option<f64>], is_search: bool) -> String {
    let surfaces = cutting.iter().enumerate().filter(|(_, own_mm)| own_mm.is_some());
    let numbers: Vec<String> = surfaces.map(|(i, _)| (i + 1).to_string()).collect();
    let (s, numbers) = (if numbers.len() > 1 { "s" } else { "" }, numbers.join(", "));
    if is_search {
        return format!(
            "the clear apertures of surface{s} {numbers} cut the beams of the lens at the start; a search makes apertures anew for the whole beams, and \
             compares lenses by all rays of the stop"
        );
    }
    format!(
        "the clear apertures of surface{s} {numbers} cut the beams and do not grow, but shrink to beams that need less; the descent follows all rays of the \
         stop, start and best are measured by the light that passes"
    )
}

/// A lens with the clear semi-diameters of a file, if it can be built with them.
fn with_own_apertures(fitted: Lens, file: &LensFile) -> Lens {
    let mut own = fitted.clone();
    for (surface, stated) in own.surfaces.iter_mut().zip(&file.lens.surfaces) {
        if !stated.is_open {
            surface.semi_diameter_mm = stated.semi_diameter_mm;
        }
    }
    if validate(&own).is_ok() { own } else { fitted }
}

/// The configuration with which an optimisation continues, and where it ends. It ends where it would have ended at first, or after as many
/// further steps as the request says. The kept totals never shrink.
fn continued(config: Config, request: &Request, history: &History) -> Result<(Config, Upto)> {
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
        context.warning(WarningKind::InstructionSet, format!(
            "the optimisation was begun with the instruction set {}, and goes on with {}: it may end at another lens than without interruption",
            config.simd,
            level()
        ));
    }
}

/// The problem of a new optimisation, once the lens, its variables and the goal are known to fit together.
fn new_problem(config: &Config, file: &LensFile, assets: &Assets) -> Result<Problem> {
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
fn note_violations(problem: &Problem, start: &Analysis, context: &Context) {
    let named = named_violations(problem, start);
    if !named.is_empty() {
        context.note(format!("the lens at the start does not keep: {}", named.join("; ")));
    }
}

/// The variables of a lens that stand on a bound.
fn at_bounds(problem: &Problem, lens: &Lens) -> Vec<String> {
    let Ok(space) = problem.space() else { return Vec::new() };
    space.at_bounds(&space.coordinates(lens)).iter().map(AtBound::to_string).collect()
}

/// Refuses a lens one of whose thicknesses leads against the light and stays so where its variables begin.
fn check_directions(problem: &Problem) -> Result<()> {
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
        (_, Some(solve)) if file.magnification_solve.is_none() => {
            held(solve.surface, format!("the magnification of {:.4}", solve.magnification));
        }
        (None, None) if goal.efl.is_none() => {
            context.note(format!("the focal length is not held: {}", why_not_held(problem, file)));
        }
        _ => {}
    }
}

/// Why no radius holds the focal length.
fn why_not_held(problem: &Problem, file: &LensFile) -> String {
    // The optimisation begins with what pickups and solves make of the lens of the file.
    let begin = problem.space().ok().and_then(|space| space.lens_at(&space.start()).ok());
    let lens = begin.as_ref().unwrap_or(&file.lens);
    let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
    if !efl_mm.is_finite() {
        return "the lens is afocal".to_owned();
    }
    if file.variables.is_empty() {
        return "no radius is free to hold it".to_owned();
    }
    format!(
        "of the radii that the file lets vary, none is free to hold it; {}",
        goal::how_to_hold(file, efl_mm)
    )
}
