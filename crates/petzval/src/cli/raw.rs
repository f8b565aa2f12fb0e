//! `petzval raw`: look at raw frames, or write them in another format.

mod convert;
mod show;

use std::process::ExitCode;

use clap::Subcommand;
use petzval::files::raw_file::{ColourStatistics, RawFrame, colour_statistics};
use serde_json::{Value, json};

use super::Failure;

/// Verbs about raw frames.
#[derive(Debug, Subcommand)]
pub enum RawVerb {
    /// What a frame and its sidecar say, and its digital numbers colour by colour
    Show(show::Args),
    /// Write a frame in another format, with its sidecar
    Convert(convert::Args),
}

/// Runs a verb.
pub fn run(verb: RawVerb) -> Result<ExitCode, Failure> {
    match verb {
        RawVerb::Show(args) => show::run(&args),
        RawVerb::Convert(args) => convert::run(&args),
    }
}

/// All that is known of a frame, for machines.
fn describe(file: &str, frame: &RawFrame) -> Value {
    let channel = |s: &ColourStatistics| {
        json!({
            "colour": s.colour.name(),
            "pixels": s.pixels,
            "min_dn": s.min_dn,
            "max_dn": s.max_dn,
            "mean_dn": s.mean_dn,
            "sd_dn": s.sd_dn,
            "at_zero": s.at_zero,
            "saturated": s.saturated,
        })
    };
    json!({
        "file": file,
        "height": frame.height,
        "width": frame.width,
        "info": frame.info,
        "colours": colour_statistics(frame).iter().map(channel).collect::<Vec<_>>(),
    })
}
