//! `petzval lens analyze`: everything that a designer looks at, as pictures and as data.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::PossibleValuesParser;
use petzval::built_in_assets;
use petzval::design::error::DesignError;
use petzval::optics::analysis::{Analysis, AnalysisOptions, analyze, first_order_table};
use petzval::report::lens_sheet::{PictureKind, page, picture};

use super::focus::{FocusAt, focused};
use crate::cli::Failure;

/// Files beside the pictures.
const PAGE: &str = "html";
const DATA: &str = "json";

/// A lens with less power over its length is afocal but for rounding.
const LEAST_POWER: f64 = 1e-9;

/// Highest frequency that can be asked for, cycles/mm: beyond the cutoff of any lens for light.
const MOST_PER_MM: f64 = 2e4;

/// Write everything that a designer looks at: pictures (SVG), a page that shows them all, and the data behind them.
///
/// Files: layout.svg (to scale), spots.svg, ray_fans.svg, opd_fans.svg, mtf.svg (by waves, with the limit),
/// mtf_geometric.svg, mtf_by_field.svg, mtf_through_focus.svg, field_curvature_distortion.svg, lateral_colour.svg,
/// axial_colour.svg (with longitudinal aberration), encircled_energy.svg, relative_illumination.svg, wavefront.svg
/// (Zernike coefficients, Strehl ratios), seidel.svg; analysis.html, all of it on one page; analysis.json, the data.
/// Fields and wavelengths are those of the lens file; rays are aimed at the real stop.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name such as cooke-triplet-nominal
    lens: String,
    /// Folder for the results [default: NAME-analysis]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write only these: names of pictures, html, json (several with commas)
    #[arg(long, value_name = "KIND", value_delimiter = ',', value_parser = PossibleValuesParser::new(names()))]
    only: Vec<String>,
    /// Where the image plane goes
    #[arg(long, value_enum, default_value = "file")]
    focus: FocusAt,
    /// Highest frequency of MTF curves, cycles/mm [default: 100, or about half of the cutoff if that is less]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    max_frequency: Option<f64>,
    /// Frequency of MTF through focus, cycles/mm [default: half of the highest]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    frequency: Option<f64>,
    /// Print the data as JSON
    #[arg(long)]
    json: bool,
}

/// All that `--only` knows.
fn names() -> Vec<&'static str> {
    PictureKind::ALL.iter().map(|kind| kind.name()).chain([PAGE, DATA]).collect()
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    for (name, value) in [("--max-frequency", args.max_frequency), ("--frequency", args.frequency)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && *v <= MOST_PER_MM)) {
            return Err(Failure::input(
                format!("{name} {value}: not a frequency between 0 and {MOST_PER_MM} cycles/mm"),
                "a pixel of 5.86 um resolves 85.32 cycles/mm",
            ));
        }
    }
    let lens = focused(built_in_assets().lens(&args.lens)?.lens, args.focus)?;
    // Rounding leaves an afocal lens some power.
    let table = first_order_table(&lens);
    let power = table.efl_mm.map_or(0.0, |efl| (lens.total_track_mm() / efl).abs());
    if power < LEAST_POWER || !table.cutoff_per_mm.is_normal() {
        return Err(Failure::input(
            format!(
                "{}: the lens is afocal in the y-z plane, or telecentric on the side of its object",
                args.lens
            ),
            "neither has an entrance pupil and a focus to start from; a thin lens of known focal length behind an afocal lens makes an \
             image",
        ));
    }
    let options = AnalysisOptions {
        max_frequency_per_mm: args.max_frequency,
        focus_frequency_per_mm: args.frequency,
        ..AnalysisOptions::default()
    };
    let analysis = analyze(&lens, &options).map_err(|error| {
        Failure::input(
            format!("{}: {error}", args.lens),
            format!("`petzval lens show {}` says where light is lost; or leave that field out", args.lens),
        )
    })?;
    let data = serde_json::to_string(&analysis).map_err(|e| Failure::job(e.to_string()))?;

    let out = args.out.clone().unwrap_or_else(|| default_folder(&args.lens));
    Failure::folder(&out)?;
    let is_wanted = |name: &str| args.only.is_empty() || args.only.iter().any(|n| n == name);
    let kinds: Vec<PictureKind> = PictureKind::ALL.into_iter().filter(|k| is_wanted(k.name())).collect();
    let mut written = 0;
    let mut write = |name: String, text: &str| -> Result<(), Failure> {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(DesignError::io(&path))?;
        written += 1;
        Ok(())
    };
    for kind in &kinds {
        write(format!("{}.svg", kind.name()), &picture(&analysis, *kind))?;
    }
    if is_wanted(PAGE) {
        // The page by itself holds all pictures.
        let shown = if kinds.is_empty() { &PictureKind::ALL[..] } else { &kinds };
        write("analysis.html".into(), &page(&analysis, shown))?;
    }
    if is_wanted(DATA) {
        write("analysis.json".into(), &data)?;
    }
    if args.json {
        println!("{data}");
        eprintln!("{written} files in {}", out.display());
    } else {
        print!("{}", summary(&analysis));
        let open = if is_wanted(PAGE) { "; open analysis.html" } else { "" };
        println!("\n{written} files in {}{open}", out.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// `NAME-analysis` for a built-in name or the name of a file.
fn default_folder(lens: &str) -> PathBuf {
    let stem = Path::new(lens).file_stem().map_or_else(|| "lens".into(), |s| s.to_string_lossy());
    PathBuf::from(format!("{stem}-analysis"))
}

/// A few lines for people.
fn summary(analysis: &Analysis) -> String {
    let order = &analysis.first_order;
    let mut first = Vec::new();
    if let Some(efl) = order.efl_mm {
        first.push(format!("focal length {efl:.3} mm"));
    }
    if let Some(f_number) = order.f_number {
        first.push(format!("f/{f_number:.3}"));
    }
    if let Some(magnification) = order.magnification {
        first.push(format!("magnification {magnification:.4}"));
    }
    first.push(format!("track {:.3} mm", order.total_track_mm));
    if let Some(defocus) = order.defocus_mm {
        first.push(format!("image plane {defocus:+.4} mm from the paraxial image"));
    }
    let reference = nearest(&analysis.wavelengths_um, analysis.reference_um);
    let highest = analysis.mtf.first().and_then(|m| m.frequency_per_mm.last()).copied().unwrap_or(0.0);
    let mut out = format!("{}\n  {}\n\n", analysis.name, first.join(", "));
    out += "  field deg   RMS spot um    MTF T    MTF S   Strehl\n";
    for (i, field) in analysis.fields_deg.iter().enumerate() {
        let mtf = &analysis.mtf[i];
        let curve = mtf.diffraction.as_ref().unwrap_or(&mtf.geometric);
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        let strehl = analysis.wavefronts[i].strehl[reference].map_or("-".into(), |s| format!("{s:.3}"));
        out += &format!(
            "  {field:>9.2}   {:>11.2}   {:>6.3}   {:>6.3}   {strehl:>6}{}\n",
            analysis.spots[i].rms_um,
            last(&curve.tangential),
            last(&curve.sagittal),
            if mtf.diffraction.is_none() { "   MTF by rays" } else { "" },
        );
    }
    out += &format!(
        "  spots and MTF of all wavelengths, MTF at {highest} cycles/mm; Strehl at {} um\n",
        analysis.wavelengths_um[reference]
    );
    out
}

/// Index of the wavelength next to another.
fn nearest(wavelengths_um: &[f64], um: f64) -> usize {
    let off = |i: &usize| (wavelengths_um[*i] - um).abs();
    (0..wavelengths_um.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}
