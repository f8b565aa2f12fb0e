//! `petzval lens analyze`: the analyses of lens design, as pictures and as data.

use std::path::PathBuf;

use crate::jobs::lens::FocusAt;
use crate::jobs::lens::analyze::{self, Analysis};
use clap::builder::PossibleValuesParser;

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::Terminal;

/// Write the analyses of lens design: pictures (SVG), a page with all of them, and their data (JSON, CSV).
///
/// Pictures: layout.svg (to scale), spots.svg, ray_fans.svg, opd_fans.svg, mtf.svg (diffraction, with the limit),
/// mtf_geometric.svg, mtf_by_field.svg, mtf_through_focus.svg, field_curvature_distortion.svg, lateral_colour.svg,
/// axial_colour.svg (with longitudinal aberration), encircled_energy.svg, relative_illumination.svg, wavefront.svg
/// (Zernike coefficients, Strehl ratios), seidel.svg. The page with all of them is analysis.html, the data analysis.json.
/// The curves are tables as well: spots.csv, fans.csv, mtf.csv, mtf_by_field.csv, mtf_through_focus.csv, field_curves.csv,
/// axial_colour.csv, longitudinal_aberration.csv, encircled_energy.csv.
///
/// Fields and wavelengths are those of the lens file unless others are named, 31 of each at most. Rays are aimed at the real stop.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name such as cooke-triplet-nominal
    lens: String,
    /// Folder for the results [default: NAME-analysis]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write only these: names of pictures, html, json, csv (several with commas)
    #[arg(long, value_name = "KIND", value_delimiter = ',', value_parser = PossibleValuesParser::new(analyze::names()))]
    only: Vec<String>,
    /// Field angles, degrees [default: those of the lens]
    #[arg(long, value_delimiter = ',', value_name = "DEG,...", allow_hyphen_values = true)]
    fields: Vec<f64>,
    /// Wavelengths, um [default: those of the lens]
    #[arg(long, value_delimiter = ',', value_name = "UM,...")]
    wavelengths: Vec<f64>,
    /// Position of the image plane
    #[arg(long, value_parser = choice::<FocusAt>(), default_value = word(analyze::Request::default().focus))]
    focus: FocusAt,
    /// Sensor file, or a built-in name: marks its Nyquist frequency in MTF curves
    #[arg(long, value_name = "NAME")]
    sensor: Option<String>,
    /// Pixel pitch in place of a sensor, um
    #[arg(long, value_name = "UM", conflicts_with = "sensor", allow_negative_numbers = true)]
    pixel_um: Option<f64>,
    /// Highest frequency of MTF curves, cycles/mm [default: 100, or about half of the cutoff if that is less; beyond Nyquist]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    max_frequency: Option<f64>,
    /// Frequency of MTF through focus, cycles/mm [default: half of the highest, or of Nyquist]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    frequency: Option<f64>,
    /// Print the data as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = analyze::Request {
        lens: args.lens.into(),
        out: args.out,
        only: args.only,
        fields: args.fields,
        wavelengths: args.wavelengths,
        focus: args.focus,
        sensor: args.sensor.map(Into::into),
        pixel_um: args.pixel_um,
        max_frequency: args.max_frequency,
        frequency: args.frequency,
    };
    let response = analyze::run(&request, &terminal.context())?;
    let files = match response.files.len() {
        1 => "1 file".to_owned(),
        several => format!("{several} files"),
    };
    let written = format!("{files} in {}", shown(&response.folder));
    if args.json {
        // On one line, in the order of analysis.json.
        let data = serde_json::to_string(&response.analysis).map_err(|e| Failure::job(e.to_string()))?;
        outln!("{data}");
        noteln!("{written}");
        return Ok(Code::SUCCESS);
    }
    out!("{}", summary(&response.analysis));
    let open = if response.page.is_some() { "; open analysis.html" } else { "" };
    outln!("\n{written}{open}");
    Ok(Code::SUCCESS)
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
    first.push(format!("NA {:.4}", order.image_na));
    if let Some(magnification) = order.magnification {
        first.push(format!("magnification {magnification:.4}"));
    }
    first.push(format!("track {:.3} mm to the image plane", order.total_track_mm));
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

/// Index of the wavelength nearest to another.
fn nearest(wavelengths_um: &[f64], um: f64) -> usize {
    let off = |i: &usize| (wavelengths_um[*i] - um).abs();
    (0..wavelengths_um.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}
