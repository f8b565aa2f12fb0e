//! `petzval psf-calibrate`: measures PSFs from captures of a pinhole.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::psf_calibrate::{self, Figures, HeldOutBy};

use super::failure::Failure;
use super::plain::shown;
use super::terminal::{Terminal, print_response};

/// Measure point-spread functions from captures of a pinhole.
///
/// DIR holds captures.toml, which names sensor, positions, exposures and frames (`petzval psf-capture` writes an
/// example). For each position the frames of each exposure are averaged, the dark signal is subtracted, exposures are
/// merged by their variance, the mosaic is demosaiced bilinearly, and 23x23 pixels around the centroid are kept. With
/// --lens every PSF is compared with the traced one, and errors are printed with the predicted noise floor. Fields of
/// the bank are tested on positions that were left out of their fit; a single position can only be tested on parts of
/// its own pixels.
///
/// The sensor has a Bayer mosaic or is monochrome: the single PSF of a monochrome sensor fills all three channels.
/// Other mosaics are refused.
///
/// Files: calibration.json, all figures; psf-calibration.html, a page with tables and pictures; psf-calibration.png,
/// all PSFs; measured.npy, float64 [position, channel, row, column]; psf.json, psf.npy and illumination.npy, for
/// `simulate --psfs` in place of a traced lens.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of captures, with captures.toml
    #[arg(value_name = "DIR")]
    captures: PathBuf,
    /// Lens to compare with: a file, or a built-in name
    #[arg(long)]
    lens: Option<String>,
    /// Folder for the results [default: DIR/psf-calibration]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of the noise draws for the noise floor
    #[arg(long, default_value_t = psf_calibrate::Request::default().seed)]
    seed: u64,
    /// Print all figures as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = psf_calibrate::Request {
        captures: args.captures,
        lens: args.lens.map(Into::into),
        out: args.out,
        seed: args.seed,
    };
    let response = psf_calibrate::run(&request, &terminal.context())?;
    print_response(args.json, &response.figures, || {
        out!("{}", summary(&response.figures));
        outln!("\nresults in {}; open psf-calibration.html", shown(&response.out));
    })
}

/// One line for each position, and one for each field of the bank.
fn summary(figures: &Figures) -> String {
    let mut out = format!("{}: {} positions\n\n", figures.captures, figures.positions.len());
    out += "  position             centroid px       +-      L1 floor G";
    if figures.lens.is_some() {
        out += "   L1 G   of demosaicing   centroid error px: same mosaic, ideal pixels";
    }
    out += "\n";
    for p in &figures.positions {
        let [row, col] = p.centroid_px[1];
        let error = p.centroid_standard_error_px[0].hypot(p.centroid_standard_error_px[1]);
        let floor = p.noise_floor.l1[1];
        out += &format!("  {:<16} {row:>8.2} {col:>8.2}   {error:.4}     {floor:.4}", p.name);
        if let Some(s) = &p.simulated {
            let off = |error: [f64; 2]| {
                if s.place_is_known { format!("{:.4}", error[0].hypot(error[1])) } else { "-".into() }
            };
            out += &format!(
                "     {:.4}     {:.4}           {:<12} {}",
                s.l1[1],
                s.l1_of_demosaicing[1],
                off(s.centroid_error_same_mosaic_px[1]),
                off(s.centroid_error_ideal_pixels_px[1])
            );
        }
        out += "\n";
    }
    out += "\n  bank       positions   chi2 R, G, B         held-out L1 R, G, B      of noise\n";
    for f in &figures.bank.fit {
        let three = |of: [f64; 3], digits: usize| of.map(|v| format!("{v:.digits$}")).join(" ");
        let by = if f.held_out.by == HeldOutBy::Pixels { "  (parts of the only position)" } else { "" };
        out += &format!(
            "  {:>5.2} mm   {:>9}   {:<18}   {:<22}   {}{by}\n",
            f.field_radius_mm,
            f.positions,
            three(f.chi2, 2),
            three(f.held_out.l1, 3),
            three(f.held_out.l1_of_noise, 3),
        );
    }
    out
}
