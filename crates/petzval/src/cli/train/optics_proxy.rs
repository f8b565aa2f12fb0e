//! `petzval train optics-proxy`: trains a network in place of ray tracing.

use std::path::PathBuf;

use crate::jobs::train::optics_proxy::{self, OpticsTraining, Plan, Response};

use super::request::begun_or_resumed;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::signals;
use crate::cli::terminal::{Terminal, print_found};

/// Train a network that gives the point spread functions of a lens in place of ray tracing, as the paper did.
///
/// Petzval needs no such network: it traces rays exactly, with gradients, in less time. The network is for comparison. It learns from
/// lenses that are drawn at random within the bounds of the experiment's lens, each traced at a random field. Then its PSFs, their
/// gradients and its time are compared with those of exact tracing on 50 lenses that it has never seen.
///
/// Files: proxy.toml, the description with the figures of the comparison, which a variant of an experiment takes as optics_proxy;
/// lens.toml and weights.bin; proxy.html, PSFs of network and tracing; training.json, the state. Ctrl-C stops after the current step and
/// exits with 75; --resume continues with the same bits.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment that gives lens, sensor and PSFs: a file, or the name of a built-in one
    #[arg(default_value = word(Plan::default().experiment))]
    experiment: String,
    /// Training steps
    #[arg(long, value_name = "N", default_value_t = OpticsTraining::default().steps)]
    steps: usize,
    /// Lenses of a step, each at a field of its own
    #[arg(long, value_name = "N", default_value_t = OpticsTraining::default().batch)]
    batch: usize,
    /// Width of the two hidden layers
    #[arg(long, value_name = "N", default_value_t = OpticsTraining::default().hidden)]
    hidden: usize,
    /// Channels of the decoder
    #[arg(long, value_name = "N", default_value_t = OpticsTraining::default().channels)]
    channels: usize,
    /// Seed of weights and lenses
    #[arg(long, default_value_t = OpticsTraining::default().seed)]
    seed: u64,
    /// Continue the training in this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["experiment", "steps", "batch", "hidden", "channels", "seed", "out"])]
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
    let Args { steps, batch, seed, hidden, channels, .. } = args;
    let training = OpticsTraining { steps, batch, seed, hidden, channels };
    let plan = Plan { experiment: args.experiment, training };
    let request = begun_or_resumed(plan, args.out, args.resume)?;
    print_found(optics_proxy::run(&request, &context), context, args.json, summary)
}

/// What the network costs.
fn summary(response: &Response) -> String {
    let Some(gap) = &response.gap else { return String::new() };
    let mut text = format!(
        "{}: {} numbers and the field, {} steps, {:.0} s\n\nPSFs of {} unseen lenses, network against exact tracing:\n  field mm        L1  centroid um  RMS spot um  its error um  illumination\n",
        response.lens, response.numbers, response.steps, response.seconds, gap.lenses
    );
    for f in &gap.fields {
        text += &format!(
            "  {:>8.2}  {:>8.3}  {:>11.2}  {:>11.2}  {:>12.2}  {:>12.4}\n",
            f.radius_mm, f.l1, f.centroid_um, f.exact_rms_um, f.rms_um, f.illumination
        );
    }
    text += &format!(
        "  {:>8}  {:>8.3}  {:>11.2}  {:>11.2}  {:>12.2}  {:>12.4}\n",
        "mean", gap.l1, gap.centroid_um, gap.exact_rms_um, gap.rms_um, gap.illumination
    );
    text += &format!(
        "\ngradient of the error after restoration by the lens: cosine to the exact one {:.2} in the median, below {:.2} for a tenth of the \
         lenses\n",
        gap.gradient_cosine, gap.low_gradient_cosine
    );
    let per_psf = |seconds: f64| 1e3 * seconds / gap.fields.len().max(1) as f64;
    text += &format!(
        "CPU time of a PSF in three colours: network {:.2} ms, exact {:.2} ms; of its gradient: network {:.2} ms, exact {:.2} ms\n",
        per_psf(gap.psfs.proxy),
        per_psf(gap.psfs.exact),
        per_psf(gap.gradient.proxy),
        per_psf(gap.gradient.exact)
    );
    text += &format!("\n{}\n{}\n", shown(&response.proxy), shown(&response.page));
    text
}
