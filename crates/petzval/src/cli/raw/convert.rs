//! `petzval raw convert`: writes a raw frame in another format.

use std::path::PathBuf;

use crate::jobs::raw::convert::{self, CfaPattern, Packing};

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};

/// Write a raw frame in another format. The name of OUT chooses it: .tiff, .png, .npy, .raw (packed) or .exr.
///
/// Digital numbers do not change. Camera and exposure go into the sidecar OUT.toml: those of IN and its sidecar, except where
/// the options below give others.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The frame
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// File to write
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Packing of a .raw file [default: mipi if it supports the bits, else lsb; u16le for 16 bits]
    #[arg(long, value_parser = choice::<Packing>(), value_name = "PACKING")]
    packing: Option<Packing>,
    /// Bits of the converter
    #[arg(long, value_name = "N")]
    bits: Option<u32>,
    /// Colour filter array from the first pixel: RGGB, GRBG, RG/GB, mono, ...
    #[arg(long, value_name = "PATTERN")]
    cfa: Option<CfaPattern>,
    /// Black level, DN
    #[arg(long, value_name = "DN")]
    black_level_dn: Option<f64>,
    /// White level, DN
    #[arg(long, value_name = "DN")]
    white_level_dn: Option<f64>,
    /// Exposure time, s
    #[arg(long, value_name = "S")]
    time_s: Option<f64>,
    /// Linear analogue gain
    #[arg(long)]
    gain: Option<f64>,
    /// Pixel pitch, um
    #[arg(long, value_name = "UM")]
    pixel_um: Option<f64>,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = convert::Request {
        input: args.input,
        output: args.output,
        packing: args.packing,
        bits: args.bits,
        cfa: args.cfa,
        black_level_dn: args.black_level_dn,
        white_level_dn: args.white_level_dn,
        time_s: args.time_s,
        gain: args.gain,
        pixel_um: args.pixel_um,
    };
    let response = convert::run(&request, &terminal.context())?;
    print_response(args.json, &response.frame, || {
        outln!("{}\n{}", shown(&response.frame.file), shown(&response.sidecar))
    })
}
