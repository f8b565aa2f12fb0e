//! `petzval train isp-proxy`: trains a network that imitates an ISP.

use std::path::PathBuf;

use crate::jobs::train::isp_proxy::{self, Plan, ProxyTraining, Response};

use super::request::begun_or_resumed;
use crate::cli::code::Code;
use crate::cli::defaults::{word, words};
use crate::cli::failure::Failure;
use crate::cli::isp::inputs::IspArgs;
use crate::cli::number::six_digits;
use crate::cli::plain::shown;
use crate::cli::signals;
use crate::cli::terminal::{Terminal, print_found};

/// Parameters whose slopes the summary shows: those of the largest.
const SHOWN_SLOPES: usize = 10;

/// Train a network that imitates an image signal processor (ISP), so that lens and parameters can be optimised by gradient with it.
///
/// The ISP develops simulated raw frames: photographs and generated scenes, by lenses near that of the experiment, at several gains of its
/// sensor. Its parameters are near the given ones; in half of the pictures a tenth of them are anywhere in their ranges. Then the network
/// is compared with the ISP on photographs that it has never seen.
///
/// Files: proxy.toml, the description with the figures of the comparison, which `isp develop` and `isp tune` take as --isp; weights.bin;
/// proxy.html, pictures of ISP and proxy; training.json, the state. Ctrl-C stops after the current step and exits with 75; --resume
/// continues with the same bits.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment that gives lens, sensor, exposure and photographs: a file, or the name of a built-in one
    #[arg(default_value = word(Plan::default().experiment))]
    experiment: String,
    #[command(flatten)]
    isp: IspArgs,
    /// Change a parameter first; may be repeated
    #[arg(long, value_name = "STAGE.KEY=VALUE")]
    set: Vec<String>,
    /// Parameters that the proxy knows: names, stages, or all
    #[arg(long, value_name = "KEY,KEY", value_delimiter = ',', default_value = words(&Plan::default().vary))]
    vary: Vec<String>,
    /// Training steps
    #[arg(long, value_name = "N", default_value_t = ProxyTraining::default().steps)]
    steps: usize,
    /// Channels of the network at its finest resolution
    #[arg(long, value_name = "N", default_value_t = ProxyTraining::default().base_channels)]
    base_channels: usize,
    /// Number of times that the network halves the picture
    #[arg(long, value_name = "N", default_value_t = ProxyTraining::default().levels)]
    levels: usize,
    /// Seed of weights, scenes, noise and parameters
    #[arg(long, default_value_t = ProxyTraining::default().seed)]
    seed: u64,
    /// Continue the training in this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = [
        "experiment", "preset", "isp", "set", "vary", "steps", "base_channels", "levels", "seed", "out",
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
    let Args { steps, base_channels, levels, seed, .. } = args;
    let plan = Plan {
        isp: args.isp.name(),
        set: args.set,
        vary: args.vary,
        experiment: args.experiment,
        training: ProxyTraining { steps, seed, base_channels, levels },
    };
    let request = begun_or_resumed(plan, args.out, args.resume)?;
    print_found(isp_proxy::run(&request, &context), context, args.json, summary)
}

/// What the imitation costs.
fn summary(response: &Response) -> String {
    let Some(gap) = &response.gap else { return String::new() };
    let mut text = format!(
        "{}: {} parameters, {} steps, {:.0} s\n\n{} frames of unseen scenes; PSNR of the proxy's pictures against the ISP's:\n",
        response.isp, response.varied, response.steps, response.seconds, gap.frames
    );
    for (what, psnr) in [
        ("with the given parameters", gap.psnr_at_centre_db),
        ("with parameters near them", gap.psnr_near_db),
        ("with a tenth anywhere", gap.psnr_far_db),
    ] {
        text += &format!("  {what:<26}  {psnr:6.2} dB\n");
    }
    text += "\npictures against the ISP's own through perfect optics without noise:\n  score              ISP     proxy       gap\n";
    for s in &gap.scores {
        let decimals = s.score.decimals;
        text += &format!(
            "  {:<12}  {:>8.decimals$}  {:>8.decimals$}  {:>+8.decimals$}\n",
            s.score.heading(),
            s.isp,
            s.proxy,
            s.isp - s.proxy
        );
    }
    text += &format!(
        "\ngradient of the mean squared error, a tenth of every range beside the parameters: cosine {:.2}; the largest slopes:\n  {:<24}  \
         {:>12}  {:>12}\n",
        gap.gradient_cosine, "parameter", "ISP", "proxy"
    );
    let mut slopes: Vec<_> = gap.slopes.iter().collect();
    slopes.sort_by(|a, b| b.isp.abs().total_cmp(&a.isp.abs()));
    for slope in slopes.into_iter().take(SHOWN_SLOPES) {
        text += &format!(
            "  {:<24}  {:>12}  {:>12}\n",
            slope.name,
            six_digits(slope.isp),
            six_digits(slope.proxy)
        );
    }
    text += &format!("\n{}\n{}\n", shown(&response.proxy), shown(&response.page));
    text
}
