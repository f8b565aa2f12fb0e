//! `petzval lens optimize`: a better lens, by descent or by search.

mod goal;
mod history;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use petzval::built_in_assets;
use petzval::files::LensFile;
use petzval::optics::design_space::{DesignSpaceError, Solves};
use petzval::optics::glass::Catalog;
use petzval::optics::lens::Lens;
use petzval::optics::optimize::{Analysis, LevenbergOptions, Problem, Search, SearchOptions, Stop, descend};
use petzval::optics::paraxial::{first_order, image_height_per_tangent};
use petzval::optics::pupil::{PupilSampling, chief_ray};
use serde_json::json;

use self::goal::Goal;
use self::history::{Config, History};
use crate::cli::{EXIT_STOPPED, Failure, print_json, signals};

/// Make the spots of a lens smaller, within its bounds and whatever else is asked.
///
/// Without --global: Levenberg and Marquardt's method from the lens as it is. With --global: a search from random starts
/// within the bounds that goes on for --seconds, and can be gone on with at any time. The variables are those of the lens
/// file; a lens that names none gets its curvatures and gaps. The image plane goes where the spots are smallest.
///
/// The folder holds the best lens (best.toml), every better lens on the way (lens/step-N.toml, history.jsonl) and what a
/// search needs to go on.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    #[arg(required_unless_present = "resume")]
    lens: Option<String>,
    /// What to make small
    #[arg(long, value_enum, default_value = "spot")]
    goal: Kind,
    #[command(flatten)]
    asked: Goal,
    /// Search the whole of the bounds, not only downhill from the lens
    #[arg(long)]
    global: bool,
    /// Seed of the search
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seconds of a search
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
    /// Iterations of a descent
    #[arg(long, default_value_t = 200)]
    iterations: usize,
    /// Folder for the lenses and the history
    #[arg(long, value_name = "DIR", required_unless_present = "resume")]
    out: Option<PathBuf>,
    /// Go on with the optimisation in this folder, with what was asked then
    #[arg(long, value_name = "DIR", conflicts_with_all = ["lens", "out", "global", "seed"])]
    resume: Option<PathBuf>,
    /// Before going on, forget every step after this one
    #[arg(long, value_name = "STEP")]
    rewind: Option<usize>,
    /// Spend as much time again for each of: polychromatic spots, edges of 1 mm, clear diameters of 12.7 mm, a
    /// distortion of 1 %, and all together; say what each costs
    #[arg(long)]
    trade: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// What to make small.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// RMS spot radii.
    Spot,
}

/// An improvement below this share is no step of the history.
const STEP_SHARE: f64 = 1e-3;

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let Kind::Spot = args.goal;
    if !(args.seconds > 0.0 && args.seconds < 1e7) {
        return Err(Failure::input("--seconds: out of range", "2 is usual; a week is 604800"));
    }
    if args.resume.is_some() {
        if args.asked != Goal::default() {
            let hint = "what is asked stays as it was; begin another with --out";
            return Err(Failure::input("--resume goes on with what was asked then", hint));
        }
    } else if args.rewind.is_some() {
        return Err(Failure::input("--rewind needs --resume and a folder", "it goes back in what is there"));
    }
    let assets = built_in_assets();
    let catalog = assets.catalog()?;
    let (mut history, config) = match (&args.resume, &args.lens, &args.out) {
        (Some(root), ..) => History::open(root, args.rewind, |path| Ok(assets.lens(path)?))?,
        (None, Some(lens), Some(out)) => {
            let config = Config { goal: args.asked.clone(), global: args.global, seed: args.seed };
            let file = assets.lens(lens)?;
            if !config.global && !config.goal.glass.is_empty() {
                return Err(Failure::input("--glass: a descent leaves glasses as they are", "add --global"));
            }
            // Everything is checked before the folder is made.
            let problem = config.goal.problem(&file, &catalog)?;
            if config.global {
                Search::new(&problem, SearchOptions::default()).map_err(|e| wrong(&e))?;
            } else {
                let once = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
                descend(&problem, &once, &mut |_, _, _| true).map_err(|e| wrong(&e))?;
            }
            (History::create(out, &file, &config)?, config)
        }
        _ => return Err(Failure::input("a lens and --out are needed", "or --resume and a folder")),
    };
    if args.trade && !config.global {
        return Err(Failure::input(
            "--trade compares searches; this folder holds a descent",
            "begin a search with --global",
        ));
    }
    let problem = config.goal.problem(history.start(), &catalog)?;
    let stop = signals::stop_on_signal()?;
    // The lens as it is, if its rays reach the image at all.
    let start = with_more_rays(&problem, &problem.base);
    let found = if config.global {
        search(&problem, &mut history, config.seed, args.seconds, &stop)?
    } else {
        descent(&problem, &mut history, args.iterations, &stop)?
    };
    let Some(best) = found else {
        return Err(Failure::job(
            "no lens was found whose rays reach the image; widen the bounds, or search longer",
        ));
    };
    let trades = if args.trade && !stop.load(Ordering::Relaxed) {
        trade(&config.goal, history.start(), &catalog, config.seed, args.seconds, &stop)?
    } else {
        Vec::new()
    };
    let path = history.root().join("best.toml");
    if args.json {
        print_json(&json!({
            "start": start.as_ref().map(|s| figures(&problem, s)),
            "best": figures(&problem, &best),
            "steps": history.steps().len(),
            "trades": trades.iter().map(|t| json!({
                "asked": t.asked, "mean_rms_um": t.mean_rms_um, "violations": t.violations,
            })).collect::<Vec<_>>(),
            "lens": path,
        }))?;
    } else {
        print(&problem, start.as_ref(), &best);
        print_trades(&trades);
        println!("\nlens: {}", path.display());
    }
    Ok(if stop.load(Ordering::Relaxed) { ExitCode::from(EXIT_STOPPED) } else { ExitCode::SUCCESS })
}

fn wrong(error: &DesignSpaceError) -> Failure {
    Failure::input(error.to_string(), "correct the variables or solves of the lens file, or --efl")
}

/// Levenberg and Marquardt from the best lens so far, or from the lens itself.
fn descent(
    problem: &Problem,
    history: &mut History,
    iterations: usize,
    stop: &AtomicBool,
) -> Result<Option<Analysis>, Failure> {
    let began = Instant::now();
    let before = history.steps().last().map_or(0.0, |s| s.seconds);
    let options = LevenbergOptions { iterations, ..LevenbergOptions::default() };
    let base = match history.best() {
        None => problem.base.clone(),
        Some(_) => {
            // Its glasses have been told of with those of the lens that the history began with.
            let best = history.root().join("best.toml").display().to_string();
            let best = built_in_assets().import(&best)?.file.lens;
            Lens { entrance_pupil_mm: problem.base.entrance_pupil_mm, ..best }
        }
    };
    let problem = &Problem { base, ..problem.clone() };
    let mut failure = None;
    let mut note = |history: &mut History, what: String, share: f64, analysis: &Analysis, at: &[f64]| {
        let known = history.best().map_or(f64::INFINITY, |s| s.merit_um);
        if analysis.merit.sqrt() >= known * (1.0 - share) {
            return true;
        }
        let seconds = before + began.elapsed().as_secs_f64();
        line(&what, seconds, analysis);
        history.add(problem, 0, seconds, analysis, at, &[]).map_err(|e| failure = Some(e)).is_ok()
    };
    let descent = descend(problem, &options, &mut |iteration, analysis, at| {
        note(history, format!("iteration {iteration}"), STEP_SHARE, analysis, at)
            && !stop.load(Ordering::Relaxed)
    })
    .map_err(|e| wrong(&e))?;
    // The last lens counts, however little it gained.
    note(history, format!("iteration {}", descent.iterations), 0.0, &descent.best, &descent.at);
    if let Some(failure) = failure {
        return Err(failure);
    }
    let why = match descent.stop {
        Stop::Converged => "converged",
        Stop::Stuck => "no step makes it better",
        Stop::Exhausted => "all iterations are done; --resume goes on",
        Stop::Asked => "stopped; --resume goes on",
    };
    eprintln!("{} iterations: {why}", descent.iterations);
    Ok(Some(descent.best))
}

/// A global search for some seconds.
fn search(
    problem: &Problem,
    history: &mut History,
    seed: u64,
    seconds: f64,
    stop: &AtomicBool,
) -> Result<Option<Analysis>, Failure> {
    let options = SearchOptions { seed, ..SearchOptions::default() };
    let mut search = match history.state()? {
        Some(state) => Search::resume(problem, options, &state),
        None => Search::new(problem, options),
    }
    .map_err(|e| wrong(&e))?;
    let before = history.steps().last().map_or(0.0, |s| s.seconds);
    let began = Instant::now();
    let (mut best, mut looked_at) = (None, f64::INFINITY);
    let mut kept_at = Instant::now();
    while began.elapsed().as_secs_f64() < seconds && !stop.load(Ordering::Relaxed) {
        search.advance();
        let round = search.progress().0;
        // Whatever ends this process, the search goes on from here.
        if kept_at.elapsed() > KEEP_EVERY {
            history.keep_state(&search.state())?;
            kept_at = Instant::now();
        }
        let Some(found) = search.best() else { continue };
        if found.analysis.merit >= looked_at {
            continue;
        }
        looked_at = found.analysis.merit;
        // What counts is what more rays say than the search traces.
        let Some(fine) = with_more_rays(problem, &found.analysis.lens) else { continue };
        let known = history.best().map_or(f64::INFINITY, |s| s.merit_um);
        if fine.merit.sqrt() < known * (1.0 - STEP_SHARE) {
            let seconds = before + began.elapsed().as_secs_f64();
            line(&format!("round {round}"), seconds, &fine);
            history.add(problem, round, seconds, &fine, &found.at, &found.glasses)?;
            history.keep_state(&search.state())?;
        }
        if best.as_ref().is_none_or(|b: &Analysis| fine.merit < b.merit) {
            best = Some(fine);
        }
    }
    history.keep_state(&search.state())?;
    let (rounds, descents) = search.progress();
    eprintln!("{rounds} rounds, {descents} descents");
    Ok(best)
}

/// How often a search writes down where it is.
const KEEP_EVERY: Duration = Duration::from_secs(1);

/// A lens of a search as more rays see it, its image plane where they are best.
fn with_more_rays(problem: &Problem, lens: &Lens) -> Option<Analysis> {
    let mut fine = Problem { base: lens.clone(), ..still(problem) };
    fine.merit.sampling = PupilSampling::Degree(10);
    descend(&fine, &LevenbergOptions::default(), &mut |_, _, _| true).ok().map(|d| d.best)
}

/// A problem in which nothing moves but the image plane.
fn still(problem: &Problem) -> Problem {
    Problem {
        variables: Vec::new(),
        pickups: Vec::new(),
        glasses: Vec::new(),
        solves: Solves { efl: None, length: None },
        ..problem.clone()
    }
}

fn line(what: &str, seconds: f64, analysis: &Analysis) {
    let fields: Vec<String> = analysis.rms_um.iter().map(|r| format!("{r:.2}")).collect();
    let violated = match analysis.violations.iter().filter(|(_, v)| *v > 1e-3).count() {
        0 => String::new(),
        n => format!("; {n} limits violated"),
    };
    eprintln!(
        "{seconds:8.2} s  {what:<14} merit {:8.3} um  spots {:.3} um ({}){violated}",
        analysis.merit.sqrt(),
        analysis.mean_rms_um(),
        fields.join(" ")
    );
}

/// What one more requirement costs.
struct Trade {
    asked: &'static str,
    mean_rms_um: f64,
    violations: usize,
}

/// Searches again, for as long, with each further requirement.
fn trade(
    goal: &Goal,
    file: &LensFile,
    catalog: &Catalog,
    seed: u64,
    seconds: f64,
    stop: &AtomicBool,
) -> Result<Vec<Trade>, Failure> {
    let colours = |g: &mut Goal| g.wavelengths = file.lens.wavelengths_um.clone();
    // What was asked more strictly stays.
    let least = |asked: Option<f64>, value: f64| Some(asked.map_or(value, |a| a.max(value)));
    let most = |asked: Option<f64>, value: f64| Some(asked.map_or(value, |a| a.min(value)));
    let edges = |g: &mut Goal| g.edge = least(g.edge, 1.0);
    let diameters = |g: &mut Goal| g.clear_diameter = most(g.clear_diameter, 12.7);
    let distortion = |g: &mut Goal| g.distortion = most(g.distortion, 1.0);
    let all = |g: &mut Goal| {
        colours(g);
        edges(g);
        diameters(g);
        distortion(g);
    };
    type Wish<'a> = (&'static str, &'a dyn Fn(&mut Goal));
    let wishes: [Wish; 6] = [
        ("as asked", &|_| {}),
        ("polychromatic spots", &colours),
        ("edges of 1 mm", &edges),
        ("clear diameters of 12.7 mm", &diameters),
        ("distortion of 1 %", &distortion),
        ("all of these", &all),
    ];
    let mut trades = Vec::new();
    for (asked, change) in wishes {
        let mut goal = goal.clone();
        change(&mut goal);
        let problem = goal.problem(file, catalog)?;
        let options = SearchOptions { seed, ..SearchOptions::default() };
        let mut search = Search::new(&problem, options).map_err(|e| wrong(&e))?;
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < seconds && !stop.load(Ordering::Relaxed) {
            search.advance();
        }
        let Some(best) = search.best() else { continue };
        let Some(best) = with_more_rays(&problem, &best.analysis.lens) else { continue };
        let violations = best.violations.iter().filter(|(_, v)| *v > 1e-3).count();
        line(asked, began.elapsed().as_secs_f64(), &best);
        trades.push(Trade { asked, mean_rms_um: best.mean_rms_um(), violations });
    }
    Ok(trades)
}

/// Figures of a lens: name, value, unit.
fn rows(problem: &Problem, analysis: &Analysis) -> Vec<(String, f64, &'static str)> {
    let lens = &analysis.lens;
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let mut rows = vec![("mean RMS spot".to_owned(), analysis.mean_rms_um(), "um")];
    for (field, rms) in problem.merit.fields_rad.iter().zip(&analysis.rms_um) {
        rows.push((format!("RMS spot at {:.1} deg", field.to_degrees()), *rms, "um"));
    }
    rows.push(("focal length".to_owned(), order.efl_mm, "mm"));
    rows.push(("back focal length".to_owned(), order.bfl_mm, "mm"));
    rows.push(("f-number".to_owned(), order.f_number, ""));
    rows.push(("track to the image".to_owned(), lens.total_track_mm(), "mm"));
    let clear = analysis.fitted_lens(problem);
    let widest = clear.surfaces.iter().fold(0.0_f64, |w, s| w.max(2.0 * s.semi_diameter_mm));
    rows.push(("largest clear diameter".to_owned(), widest, "mm"));
    let outermost = problem.outermost_field_rad();
    if outermost != 0.0
        && lens.is_rotationally_symmetric()
        && let Some(chief) = chief_ray(&sequence, outermost)
    {
        let share = chief.y_mm / (image_height_per_tangent(&sequence) * outermost.tan()) - 1.0;
        rows.push(("distortion".to_owned(), 100.0 * share, "%"));
    }
    rows
}

fn figures(problem: &Problem, analysis: &Analysis) -> serde_json::Value {
    let mut all = serde_json::Map::new();
    // The spots of the fields are a list of their own.
    for (name, value, unit) in
        rows(problem, analysis).into_iter().filter(|(name, ..)| !name.starts_with("RMS"))
    {
        let unit = if unit == "%" { "percent" } else { unit };
        let key = format!("{name} {unit}").trim().replace([' ', '-', '.'], "_").to_lowercase();
        all.insert(key, json!(value));
    }
    all.insert("rms_spot_um".to_owned(), json!(analysis.rms_um));
    let violations: Vec<_> =
        analysis.violations.iter().map(|(what, v)| json!([what.to_string(), v])).collect();
    all.insert("violations_mm".to_owned(), json!(violations));
    all.into()
}

fn print(problem: &Problem, start: Option<&Analysis>, best: &Analysis) {
    let before = start.map(|start| rows(problem, start));
    println!("\n{:<26} {:>12} {:>12}", "", if before.is_some() { "start" } else { "" }, "best");
    for (i, (name, after, unit)) in rows(problem, best).into_iter().enumerate() {
        let before = before.as_ref().map_or(String::new(), |rows| format!("{:.4}", rows[i].1));
        println!("{name:<26} {before:>12} {after:>12.4} {unit}");
    }
    for (what, amount) in best.violations.iter().filter(|(_, v)| *v > 1e-4) {
        println!("not met: {what}, by {amount:.4} mm");
    }
}

fn print_trades(trades: &[Trade]) {
    let Some(first) = trades.first() else { return };
    println!("\n{:<28} {:>10} {:>10}", "what it costs to ask for", "spot um", "more um");
    for t in trades {
        let note = if t.violations > 0 { "  (limits not met)" } else { "" };
        println!(
            "{:<28} {:>10.3} {:>+10.3}{note}",
            t.asked,
            t.mean_rms_um,
            t.mean_rms_um - first.mean_rms_um
        );
    }
}
