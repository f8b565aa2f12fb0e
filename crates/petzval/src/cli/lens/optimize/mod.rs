//! `petzval lens optimize`: makes spots smaller, by descent or by search.

mod goal;

use std::path::PathBuf;

use crate::jobs::lens::optimize::{self, Figures, Goal, Response, Restored, Start, Trade};
use crate::jobs::usual;
use clap::ValueEnum;

use self::goal::GoalArgs;
use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::figure;
use crate::cli::plain::shown;
use crate::cli::signals;
use crate::cli::terminal::{RESUME, Terminal, ending, found, print_json};

/// Make the spots of a lens smaller, within its bounds and the limits below.
///
/// With --goal restored: the error that the best linear restoration of raw frames leaves is made smaller in place of the
/// spots. It follows from PSFs, sensor, exposure and the spectrum of natural scenes, without training.
///
/// Without --global: Levenberg and Marquardt's method from the lens of the file. With --global: a search from random
/// starts within the bounds, for a number of rounds; --resume continues it at any time. The variables are those of the
/// lens file and of --vary; a lens without variables gets its curvatures and gaps. The image plane goes where the spots are smallest.
///
/// The folder holds the best lens (best.toml), a page with the lens before and after (optimize.html), every better lens on the way
/// (lens/step-N.toml, history.jsonl) and the state for --resume.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    #[arg(required_unless_present = "resume")]
    lens: Option<String>,
    /// Quantity to minimise
    #[arg(long, value_enum, default_value_t = Kind::of(&Goal::default()))]
    goal: Kind,
    /// Sensor of the goal restored, by file or built-in name [default: imx249-fitted]
    #[arg(long, value_name = "SENSOR")]
    sensor: Option<String>,
    /// File of operands: figures such as the MTF at a frequency, the focal length or the distortion, each with a bound and a weight; the book
    /// says what it may hold
    #[arg(long, value_name = "FILE")]
    operands: Option<PathBuf>,
    /// Photoelectrons of white in a green pixel, for the goal restored [default: 16000]
    #[arg(long, value_name = "E")]
    white_e: Option<f32>,
    #[command(flatten)]
    limits: GoalArgs,
    /// Search the whole range between the bounds, not only downhill from the lens
    #[arg(long)]
    global: bool,
    /// Seed of the search [default: 1]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Rounds of a search, of up to 16 descents each: the same rounds find the same lenses on any machine; with --resume as many more
    /// [default: 10; with --resume those that are left]
    #[arg(long, value_name = "N")]
    rounds: Option<u64>,
    /// Additional stop of a search after this time, s, if its rounds are not done by then
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Iterations of a descent; with --resume as many more [default: 200; with --resume those that are left]
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// Folder for the lenses and the history
    #[arg(long, value_name = "DIR", required_unless_present = "resume")]
    out: Option<PathBuf>,
    /// Continue the optimisation in this folder, with its goal
    #[arg(long, value_name = "DIR", conflicts_with_all = ["lens", "out", "global", "seed"])]
    resume: Option<PathBuf>,
    /// Before continuing, go back to this step and discard the later ones
    #[arg(long, value_name = "STEP")]
    rewind: Option<usize>,
    /// Repeat the search, with as many rounds, for each of these requirements: polychromatic spots, edges of 1 mm, clear
    /// diameters of 12.7 mm, a distortion of 1 %, and all together; print the cost of each
    #[arg(long)]
    trade: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Quantity to minimise.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// RMS spot radii.
    Spot,
    /// Error after the best linear restoration of raw frames.
    Restored,
}

impl Kind {
    /// The quantity that a goal minimises.
    fn of(goal: &Goal) -> Self {
        if goal.restored.is_some() { Self::Restored } else { Self::Spot }
    }
}

impl Args {
    fn request(self) -> Result<optimize::Request, Failure> {
        let restored = match self.goal {
            Kind::Spot if self.sensor.is_some() || self.white_e.is_some() => {
                return Err(Failure::input(
                    "--sensor and --white-e belong to the goal restored",
                    "add --goal restored, or leave them out; --resume has those of its folder",
                ));
            }
            Kind::Spot => None,
            Kind::Restored => {
                let usual = Restored::default();
                Some(Restored {
                    sensor: self.sensor.unwrap_or(usual.sensor),
                    white_e: self.white_e.unwrap_or(usual.white_e),
                })
            }
        };
        let operands = self.operands.as_deref().map(optimize::read_operands).transpose()?;
        let goal = Goal { restored, operands, ..Goal::from(self.limits) };
        let start = match (self.resume, self.lens, self.out) {
            (Some(_), ..) if goal != Goal::default() => {
                return Err(Failure::input(
                    "--resume continues with the goal that is written in its folder",
                    "to change the goal, begin another optimisation with --out",
                ));
            }
            (Some(folder), ..) => Start::Resume { folder, rewind: self.rewind },
            (None, ..) if self.rewind.is_some() => {
                return Err(Failure::input(
                    "--rewind needs --resume",
                    "only an optimisation that is continued has steps to forget",
                ));
            }
            (None, Some(_), Some(_)) if self.seed.is_some() && !self.global => {
                return Err(Failure::input(
                    "--seed belongs to a search, and this is a descent",
                    "add --global for a search, or leave it out",
                ));
            }
            (None, Some(lens), Some(out)) => Start::New {
                lens: lens.into(),
                out,
                goal: Box::new(goal),
                global: self.global,
                seed: self.seed.unwrap_or_else(usual::seed),
            },
            _ => return Err(Failure::input("a lens and --out are needed", "or --resume and a folder")),
        };
        Ok(optimize::Request {
            start,
            iterations: self.iterations,
            rounds: self.rounds,
            seconds: self.seconds,
            trade: self.trade,
        })
    }
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let is_json = args.json;
    let request = args.request()?;
    let context = terminal.context().with_cancellation(signals::stop_on_signal()?);
    let (response, stopped) = found::<Response>(optimize::run(&request, &context))?;
    drop(context);
    if is_json {
        print_json(&response.found)?;
    } else {
        print(&response);
        print_trades(&response.found.trades);
        outln!("\nlens: {}\npage: {}", shown(&response.found.lens), shown(&response.found.page));
    }
    Ok(ending(stopped.as_ref(), RESUME))
}

fn print(response: &Response) {
    let found = &response.found;
    let start = found.start.as_ref().map(|start| start.rows(&response.fields_deg));
    outln!("\n{:<26} {:>12} {:>12}", "", if start.is_some() { "start" } else { "" }, "best");
    for (i, (name, best, unit)) in found.best.rows(&response.fields_deg).into_iter().enumerate() {
        let start = start.as_ref().map_or_else(String::new, |rows| figure(rows[i].1, 4));
        outln!("{name:<26} {start:>12} {:>12} {unit}", figure(best, 4));
    }
    outln!(
        "RMS spots: all wavelengths together, through the real stop, each ray with its light, as `lens show` has them; the start is on the image plane \
         where its spots are least, or its error after restoration, and the best lens on that of its file; the mean is that of the fields; distortion is against the image of \
         the paraxial focal length or, of a near object, of the paraxial magnification"
    );
    for missed in found.start.iter().flat_map(Figures::missed) {
        outln!("not met at the start: {missed}");
    }
    let missed = found.best.missed();
    if !missed.is_empty() {
        outln!("no lens was found that keeps every limit");
    }
    for missed in missed {
        outln!("not met: {missed}");
    }
    for limit in found.best.reached() {
        outln!("at its limit: {limit}");
    }
    for bound in &found.at_bounds {
        outln!("on a bound: {bound}");
    }
}

fn print_trades(trades: &[Trade]) {
    let Some(first) = trades.first() else { return };
    outln!("\n{:<28} {:>10} {:>10}", "with the requirement", "spot um", "more um");
    for t in trades {
        let note = if t.violations > 0 { "  (limits not met)" } else { "" };
        outln!(
            "{:<28} {:>10.3} {:>+10.3}{note}",
            t.requirement,
            t.mean_rms_um,
            t.mean_rms_um - first.mean_rms_um
        );
    }
}
