//! `petzval lens show`: the numbers of a lens.

use std::sync::Arc;

use crate::jobs::lens::FocusAt;
use crate::jobs::lens::show::{self, Prescription, Response, Surface};
use crate::jobs::{Context, Silent};

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::number::figure;
use crate::cli::terminal::{Terminal, print_response};

/// Show a lens: a file, or the name of a built-in one.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name such as cooke-triplet-nominal
    lens: String,
    /// Position of the image plane
    #[arg(long, value_parser = choice::<FocusAt>(), default_value = word(show::Request::default().focus))]
    focus: FocusAt,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = show::Request { lens: args.lens.into(), focus: args.focus };
    let response = match show::run(&request, &terminal.context()) {
        Ok(response) => response,
        Err(error) => {
            // Print the prescription if it can be read: it may show the cause. The warnings were already printed.
            let silent = Context::new(crate::built_in_assets(), Arc::new(Silent));
            if !args.json
                && let Ok(Prescription { name, surfaces }) = show::prescription(&request, &silent)
            {
                noteln!("{}", prescription(&name, &surfaces));
            }
            return Err(error.into());
        }
    };
    print_response(args.json, &response.figures, || print(&response))
}

/// The surfaces of a lens, as lines.
fn prescription(name: &str, surfaces: &[Surface]) -> String {
    let columns = "  #  radius mm    conic  thickness mm  glass       nd       Vd   semi mm";
    let mut out = format!("{name}\n\n{columns}\n");
    for s in surfaces {
        let radius = s.radius_mm.map_or_else(|| "plane".to_owned(), |radius| format!("{radius:.4}"));
        let (glass, nd, vd) = if s.is_before_air() {
            Default::default()
        } else {
            (s.glass.as_str(), figure(s.nd, 5), figure(s.vd, 2))
        };
        let stop = if s.stop { "  stop" } else { "" };
        out += &format!(
            "{:>3} {radius:>10} {:>8.4} {:>13.4}  {glass:<10} {nd:>7} {vd:>7} {:>8.3}{stop}\n",
            s.surface, s.conic, s.thickness_mm, s.semi_diameter_mm
        );
        let terms: Vec<String> = (s.asphere_a2_to_a16.iter().enumerate())
            .filter(|(_, term)| **term != 0.0)
            .map(|(j, term)| format!("a{} = {term:.4e}", 2 * (j + 1)))
            .collect();
        if !terms.is_empty() {
            out += &format!("{:>14} {}\n", "asphere:", terms.join("  "));
        }
        for line in &s.special {
            out += &format!("{:>14} {line}\n", "");
        }
    }
    out
}

fn print(response: &Response) {
    let f = &response.figures;
    out!("{}", prescription(&f.name, &f.surfaces));
    let object = match f.object_distance_mm {
        None => "at infinity".to_owned(),
        Some(distance) => format!("{distance} mm before the first vertex"),
    };
    outln!("\n  object              {object}");
    match f.efl_mm {
        Some(efl) => outln!("  focal length        {efl:>9.4} mm at {} um", f.reference_um),
        None => outln!("  focal length                - (afocal at {} um)", f.reference_um),
    }
    outln!("  back focal length   {:>9} mm", figure(f.bfl_mm, 4));
    outln!("  f-number            {:>9}    entrance pupil {:.4} mm", figure(f.f_number, 4), f.epd_mm);
    outln!("  working f-number    {:>9}    NA {:.4} at the image", figure(f.working_f_number, 4), f.image_na);
    if let Some(magnification) = f.magnification {
        outln!("  magnification       {magnification:>+9.4}");
    }
    if let Some(magnification) = f.angular_magnification {
        outln!("  angular magnification {magnification:>+7.4}");
    }
    let image = if f.object_distance_mm.is_some() { "image" } else { "focus" };
    match (f.total_track_mm, f.defocus_mm) {
        (Some(track), Some(defocus)) => {
            let folded = if f.is_folded { ", straight across the folds" } else { "" };
            outln!("  total track         {track:>9.4} mm to the paraxial {image}{folded}");
            outln!("  image plane         {defocus:>+9.4} mm from the paraxial {image}");
        }
        _ => outln!(
            "  image plane         {:>9.4} mm behind the last vertex; the paraxial {image} is at infinity",
            f.image_distance_mm
        ),
    }
    match &f.seidel {
        Some(s) => outln!(
            "\n  Seidel sums, mm     S1 {:+.5}  S2 {:+.5}  S3 {:+.5}  S4 {:+.5}  S5 {:+.5}",
            s.s1,
            s.s2,
            s.s3,
            s.s4,
            s.s5
        ),
        None => outln!(
            "\n  Seidel sums         not defined for thin lenses, diffractive power and fields of 90 degrees and more"
        ),
    }
    if !f.relative_illumination.is_empty() {
        outln!("\n  RMS spot radius, um, all wavelengths");
        outln!("  field deg   paraxial pupil   real stop   illumination");
    }
    for (i, (field, illumination)) in f.fields_deg.iter().zip(&f.relative_illumination).enumerate() {
        outln!(
            "  {field:>9.2}   {:>14}   {:>9.2}   {:>12.3}",
            figure(f.rms_spot_poly_um[i], 2),
            f.rms_spot_poly_real_stop_um[i],
            illumination.iter().sum::<f64>() / illumination.len() as f64
        );
    }
    for warning in f.warnings.iter().filter(|warning| !response.reported_warnings.contains(warning)) {
        outln!("\n  warning: {warning}");
    }
}
