//! `petzval raw show`: shows a raw frame.

use std::path::PathBuf;

use crate::jobs::raw::{RawInfo, show};

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};

/// Show a raw frame: size, camera and exposure from its sidecar, and its digital numbers colour by colour.
///
/// Reads gray TIFF and PNG of 8 or 16 bits, NumPy arrays, packed .raw files with a sidecar FILE.toml, and DNG if the
/// command was built with the cargo feature `dng`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The frame
    file: PathBuf,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let frame = show::run(&show::Request { file: args.file }, &terminal.context())?;
    print_response(args.json, &frame, || {
        outln!("{}", shown(&frame.file));
        outln!("  {:<13} {} rows x {} columns", "size", frame.height, frame.width);
        facts(&frame.info).iter().for_each(|(name, value)| outln!("  {name:<13} {value}"));
        outln!();
        outln!("  colour    pixels  min DN  max DN    mean DN     sd DN  at zero saturated");
        for s in &frame.colours {
            let saturated = s.saturated.map_or("-".to_owned(), |n| n.to_string());
            outln!(
                "  {:<6} {:>9} {:>7} {:>7} {:>10.3} {:>9.3} {:>8} {saturated:>9}",
                s.colour.name(),
                s.pixels,
                s.min_dn,
                s.max_dn,
                s.mean_dn,
                s.sd_dn,
                s.at_zero
            );
        }
    })
}

/// Camera and exposure, a line for each known number.
fn facts(info: &RawInfo) -> Vec<(&'static str, String)> {
    let number = |value: Option<f64>, unit: &str| value.map(|v| format!("{v}{unit}"));
    let all = [
        ("sensor", info.sensor.clone()),
        ("bits", info.bits.map(|bits| bits.to_string())),
        ("mosaic", info.cfa.map(|cfa| cfa.to_string())),
        ("black level", black_level(info)),
        ("white level", number(info.white_level_dn, " DN")),
        (
            "companding",
            info.companding.as_ref().map(|c| {
                format!("{} knots, expanded to {} DN", c.linear_dn.len(), c.linear_dn.last().unwrap_or(&0))
            }),
        ),
        ("exposure time", number(info.exposure_s, " s")),
        ("linear gain", number(info.linear_gain, "")),
        ("pixel pitch", number(info.pixel_um, " um")),
        ("temperature", number(info.temperature_c, " degrees C")),
        ("orientation", info.orientation.map(|exif| format!("{exif} of EXIF"))),
    ];
    all.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// The black level: one number, or one for each pixel of the tile, row by row.
fn black_level(info: &RawInfo) -> Option<String> {
    let levels = info.black_tile_dn.clone().or_else(|| info.black_level_dn.map(|dn| vec![dn]))?;
    let levels: Vec<String> = levels.iter().map(f64::to_string).collect();
    let by_pixel = if levels.len() > 1 { ", by pixel of the tile" } else { "" };
    Some(format!("{} DN{by_pixel}", levels.join(", ")))
}
