//! `petzval isp tune`: finds the parameters of an ISP.

use std::path::PathBuf;

use crate::base::counted;

use crate::jobs::isp::tune::{self, Plan, Response, Start};

use super::inputs::{FrameArgs, IspArgs};
use crate::cli::code::Code;
use crate::cli::defaults::{word, words};
use crate::cli::failure::Failure;
use crate::cli::number::six_digits;
use crate::cli::plain::shown;
use crate::cli::signals;
use crate::cli::terminal::{Terminal, print_found};

/// Find the parameters of an ISP that bring developed frames nearest to references.
///
/// RAWDIR holds raw frames with sidecars, --reference the picture that each should become, of the same name and size. The search is
/// CMA-ES: it needs no gradient, so that hardware is tuned like the built-in ISP. It starts at the given settings.
///
/// Files: tuned.toml, the best settings so far, for --isp; history.json, every generation; search.json, the state. All are written after
/// every generation. Ctrl-C stops the current one and exits with 75; --resume makes it again and continues with the same bits.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of raw frames
    #[arg(value_name = "RAWDIR", required_unless_present = "resume")]
    raws: Option<PathBuf>,
    /// Folder of the pictures that the frames should become
    #[arg(long, value_name = "DIR", required_unless_present = "resume")]
    reference: Option<PathBuf>,
    /// Score to raise: psnr, ssim or lpips (1 - LPIPS)
    #[arg(long, default_value = word(Plan::default().objective))]
    objective: String,
    /// Parameters that vary: names, stages, or all
    #[arg(long, value_name = "KEY,KEY", value_delimiter = ',', default_value = words(&Plan::default().vary))]
    vary: Vec<String>,
    #[command(flatten)]
    isp: IspArgs,
    /// Change a parameter before the search; may be repeated
    #[arg(long, value_name = "STAGE.KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    frame: FrameArgs,
    /// Settings to try in all [default: 500; with --resume as many as the search began with]
    #[arg(long, value_name = "N")]
    evaluations: Option<usize>,
    /// Seed of the search
    #[arg(long, default_value_t = Plan::default().seed)]
    seed: u64,
    /// Continue the search in this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = [
        "raws", "reference", "objective", "vary", "preset", "isp", "set", "sensor", "white_dn", "auto_balance", "auto_exposure", "seed",
        "out",
    ])]
    resume: Option<PathBuf>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", required_unless_present = "resume")]
    out: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let context = terminal.context().with_cancellation(signals::stop_on_signal()?);
    let start = match (args.resume, args.raws, args.reference, args.out) {
        (Some(folder), ..) => Start::Resume { folder },
        (None, Some(raws), Some(reference), Some(out)) => Start::New {
            plan: Box::new(Plan {
                raws,
                reference,
                isp: args.isp.name(),
                set: args.set,
                objective: args.objective,
                vary: args.vary,
                frame: args.frame.options(),
                seed: args.seed,
            }),
            out,
        },
        _ => {
            return Err(Failure::input(
                "RAWDIR, --reference or --out is missing",
                "give all three, or --resume",
            ));
        }
    };
    let request = tune::Request { start, evaluations: args.evaluations };
    print_found(tune::run(&request, &context), context, args.json, summary)
}

/// The score before and after, every varied parameter, and the cost.
fn summary(found: &Response) -> String {
    let decimals = found.objective.decimals;
    let mut text = format!(
        "{}: {:.decimals$} -> {:.decimals$}, mean over {} frames\n\n",
        found.objective.heading(),
        found.start,
        found.best,
        found.frames
    );
    let width = found.parameters.iter().map(|p| p.name.len()).max().unwrap_or(0).max(9);
    text += &format!("  {:<width$}  {:>12}  {:>12}  unit\n", "parameter", "start", "tuned");
    for p in &found.parameters {
        text += &format!(
            "  {:<width$}  {:>12}  {:>12}  {}\n",
            p.name,
            six_digits(p.start),
            six_digits(p.best),
            p.unit
        );
    }
    text += &format!(
        "\n{} in {}, {}, {:.1} s\n{}\n",
        counted(found.evaluations, "setting"),
        counted(found.generations as usize, "generation"),
        counted(found.restarts, "restart"),
        found.seconds,
        shown(&found.tuned)
    );
    text
}
