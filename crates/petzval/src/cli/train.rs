//! `petzval train`: networks that stand in for what has no gradient, or once had none.

mod isp_proxy;
mod optics_proxy;
mod request;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;
use crate::cli::code::Code;

/// What is trained.
#[derive(Debug, Subcommand)]
pub enum TrainVerb {
    #[command(about = "Train a network that imitates an image signal processor")]
    IspProxy(isp_proxy::Args),
    #[command(about = "Train a network that gives the PSFs of a lens in place of ray tracing")]
    OpticsProxy(optics_proxy::Args),
}

/// Runs a verb.
pub fn run(verb: TrainVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        TrainVerb::IspProxy(args) => isp_proxy::run(args, terminal),
        TrainVerb::OpticsProxy(args) => optics_proxy::run(args, terminal),
    }
}
