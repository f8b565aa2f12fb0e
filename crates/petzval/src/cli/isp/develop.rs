//! `petzval isp develop`: raw frames to pictures.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::isp::develop;

use super::inputs::{FrameArgs, IspArgs};
use crate::cli::failure::Failure;
use crate::cli::terminal::{Terminal, print_json};

/// Develop raw frames to pictures, NAME.* to NAME.png.
///
/// A frame is a raw file with its sidecar, as `petzval simulate` and `petzval raw convert` write them. The sidecar gives bits, mosaic and
/// levels; the sensor, which it names or --sensor does, gives noise and the answer to white light.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Raw frames
    #[arg(value_name = "RAW", required = true)]
    raws: Vec<PathBuf>,
    #[command(flatten)]
    isp: IspArgs,
    /// Change a parameter; may be repeated
    #[arg(long, value_name = "STAGE.KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    frame: FrameArgs,
    /// Bits of the pictures: 8 or 16
    #[arg(long, default_value_t = 8)]
    bits: u32,
    /// Write NAME-strip.html: the picture after every stage, with the parameters of the stage
    #[arg(long)]
    strip: bool,
    /// Folder for the pictures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<ExitCode, Failure> {
    let request = develop::Request {
        raws: args.raws,
        isp: args.isp.name(),
        set: args.set,
        frame: args.frame.options(),
        bits: args.bits,
        strip: args.strip,
        out: args.out,
    };
    let response = develop::run(&request, &terminal.context())?;
    if args.json {
        return print_json(&response.pictures);
    }
    for developed in &response.pictures {
        println!("{}", developed.picture.display());
        if let Some(strip) = &developed.strip {
            println!("{}", strip.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}
