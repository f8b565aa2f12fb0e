//! `petzval raw convert`: a raw frame in another format.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use petzval::camera::sensor::CfaPattern;
use petzval::files::raw_file::{Packing, RawFormat, RawInfo, load_raw, save_raw, sidecar_path};

use super::describe;
use crate::cli::{Failure, print_json};

/// How the numbers of a `.raw` lie in its bytes.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PackAs {
    /// MIPI CSI-2: 8, 10, 12 or 14 bits.
    Mipi,
    /// Contiguous bits, the lowest first.
    Lsb,
    /// Two bytes, the lower first.
    U16le,
    /// Two bytes, the upper first.
    U16be,
}

/// Write a raw frame in another format, told by the name of OUT: .tiff, .png, .npy, .raw (packed) or .exr.
///
/// Digital numbers stay as they are, to the bit. What is known of camera and exposure goes into the sidecar OUT.toml; the
/// options below change it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The frame
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Where to write it
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Packing of a .raw; the default is mipi where it has the bits, else lsb, u16le for 16
    #[arg(long, value_enum, value_name = "PACKING")]
    packing: Option<PackAs>,
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
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let mut frame = load_raw(&args.input)?;
    let said = RawInfo {
        bits: args.bits,
        cfa: args.cfa,
        black_level_dn: args.black_level_dn,
        white_level_dn: args.white_level_dn,
        exposure_s: args.time_s,
        linear_gain: args.gain,
        pixel_um: args.pixel_um,
        ..RawInfo::default()
    };
    said.validate().map_err(|wrong| Failure::input(wrong.to_string(), format!("give {}", wrong.meaning)))?;
    frame.info = said.or(frame.info);
    let bits = frame.info.bits.unwrap_or(16);
    if let Some((row, col, dn)) = frame.beyond(bits) {
        let message = format!(
            "{}: the value {dn} at row {row}, column {col} does not fit in {bits} bits",
            args.input.display()
        );
        return Err(Failure::input(message, "give the --bits that the numbers have"));
    }
    let packing = match args.packing {
        None => Packing::for_bits(bits),
        Some(PackAs::Mipi) => Packing::Mipi,
        Some(PackAs::Lsb) => Packing::Lsb,
        Some(PackAs::U16le) => Packing::U16le,
        Some(PackAs::U16be) => Packing::U16be,
    };
    let format = RawFormat::of_name(&args.output, packing).filter(|format| *format != RawFormat::Dng);
    let format = format.ok_or_else(|| {
        let message = format!("{}: the name does not say a format that is written", args.output.display());
        Failure::input(message, "end it with .tiff, .png, .npy, .raw or .exr")
    })?;
    if args.packing.is_some() && !matches!(format, RawFormat::Packed(_)) {
        let message = format!("--packing is for .raw files, and {} is none", args.output.display());
        return Err(Failure::input(message, "leave --packing out, or name the file .raw"));
    }
    save_raw(&frame, &args.output, format)?;
    let output = args.output.display().to_string();
    if args.json {
        return print_json(&describe(&output, &frame));
    }
    println!("{output}\n{}", sidecar_path(&args.output).display());
    Ok(ExitCode::SUCCESS)
}
