//! `petzval data`: converts data sets for object detection, and checks them.

mod check;
mod convert;
mod defects;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;
use crate::cli::code::Code;

/// Verbs about data sets.
#[derive(Debug, Subcommand)]
pub enum DataVerb {
    #[command(about = "Convert a data set of KITTI, BDD100K, YOLO or Pascal VOC to the format of COCO")]
    Convert(convert::Args),
    #[command(about = "Show what a data set holds and what is wrong with it")]
    Check(check::Args),
}

/// Runs a verb.
pub fn run(verb: DataVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        DataVerb::Convert(args) => convert::run(args, terminal),
        DataVerb::Check(args) => check::run(args, terminal),
    }
}
