//! `petzval raw mtf`: the MTF at slanted edges.

use std::path::PathBuf;

use crate::jobs::raw::convert::CfaPattern;
use crate::jobs::raw::mtf::{self, Region, Response, per_mm};

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};

/// Measure the MTF at slanted edges of a raw frame or a picture, after ISO 12233.
///
/// Of a raw frame every colour is measured by itself, in digital numbers above the black level. Gray TIFF and PNG are raw frames, unless
/// --picture says otherwise. PNG, JPEG, WebP, BMP and integer TIFF in colour are pictures: their sRGB curve is undone first; floats (TIFF, OpenEXR,
/// Radiance HDR) are linear as they are. Frequencies are cycles per pixel of the frame, whatever the mosaic.
///
/// Files in --out: mtf.csv, the curves; mtf.json, all figures; mtf.svg, a plot.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The frame or picture
    file: PathBuf,
    /// A region that one edge crosses, in pixels from 0; may be repeated [default: edges are looked for]
    #[arg(long = "region", value_name = "ROW,COL,HEIGHT,WIDTH")]
    regions: Vec<Region>,
    /// Take a gray TIFF or PNG as a picture, and undo its sRGB curve
    #[arg(long)]
    picture: bool,
    /// Colour filter array of a raw frame from its first pixel [default: that of the sidecar]
    #[arg(long, value_name = "PATTERN")]
    cfa: Option<CfaPattern>,
    /// Pixel pitch, um, for frequencies in cycles/mm [default: that of the sidecar]
    #[arg(long, visible_alias = "pitch-um", value_name = "UM")]
    pixel_um: Option<f64>,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = mtf::Request {
        file: args.file,
        regions: args.regions,
        is_picture: args.picture,
        cfa: args.cfa,
        pixel_um: args.pixel_um,
        out: args.out,
    };
    let response = mtf::run(&request, &terminal.context())?;
    print_response(args.json, &response, || out!("{}", table(&response)))
}

/// A row for every channel of every edge.
fn table(response: &Response) -> String {
    let mut text = format!(
        "{}\n  {} rows x {} columns, {}\n\n",
        shown(&response.file),
        response.height,
        response.width,
        response.light.words()
    );
    let in_mm = response.pixel_um.map(|um| (um, "  MTF50, 1/mm"));
    let head_in_mm = in_mm.map_or("", |(_, head)| head);
    text += &format!(
        "region                  channel    edge            MTF50, 1/px      {head_in_mm}  MTF at 0.25/px   overshoot %    scatter %\n"
    );
    for edge in &response.edges {
        for mtf in &edge.channels {
            let side = if mtf.is_upright { "upright" } else { "lying" };
            let lies = format!("{side} {:.1}°", mtf.angle_deg);
            let shown = |value: Option<f64>, decimals: usize| {
                value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"))
            };
            let mm = in_mm.map_or(String::new(), |(um, _)| {
                format!("  {:>11}", shown(mtf.mtf50_per_px.map(|f| per_mm(f, um)), 2))
            });
            let errors = &mtf.standard_errors;
            let mtf50 = match (mtf.mtf50_per_px, errors.mtf50_per_px) {
                (Some(value), Some(error)) => format!("{value:.4} ± {error:.4}"),
                _ => "-".to_owned(),
            };
            text += &format!(
                "{:<22}  {:<9}  {lies:<14}  {mtf50:<17}{mm}  {:<15}  {:<13}  {:>9.1}\n",
                edge.region.to_string(),
                mtf.channel,
                format!("{:.3} ± {:.3}", mtf.mtf_at_half_nyquist, errors.mtf_at_half_nyquist),
                format!("{:.1} ± {:.1}", 100.0 * mtf.overshoot, 100.0 * errors.overshoot),
                100.0 * mtf.scatter
            );
        }
    }
    if !response.files.is_empty() {
        text.push('\n');
        response.files.iter().for_each(|file| text += &format!("{}\n", shown(file)));
    }
    text
}
