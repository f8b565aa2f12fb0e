//! `petzval lens show`: what a lens is, in numbers.

use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::design::glass_warnings::glass_warnings;
use petzval::files::lens_toml::special_lines;
use petzval::optics::analysis::first_order_table;
use petzval::optics::lens::{Action, Lens, ObjectDistance, Surface};
use petzval::optics::paraxial::{FirstOrder, first_order};
use petzval::optics::pupil::{Quadrature, paraxial_launch, trace_beam};
use petzval::optics::seidel::seidel_total;
use petzval::optics::spot::{FieldSpot, PrintedSpot, spot, spot_paraxial_pupil};
use petzval::optics::trace::{Fate, launch, trace_ray};
use serde_json::{Value, json};

use super::focus::{FocusAt, focused};
use crate::cli::{Failure, print_json};

/// Pupil cells a side: spot radii are then good to 0.1 %.
const PUPIL_CELLS: usize = 64;

/// A stop that is so many times as wide as the beam is pointed out.
const WIDE_STOP: f64 = 3.0;

/// Show a lens: a file, or the name of a built-in one.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name such as cooke-triplet-nominal
    lens: String,
    /// Where the image plane goes
    #[arg(long, value_enum, default_value = "file")]
    focus: FocusAt,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Everything that is shown.
struct Figures {
    order: FirstOrder,
    /// `None` where third-order theory has no formulas for a surface.
    seidel: Option<[f64; 5]>,
    /// Through the real stop, weighed by the light of each ray.
    spots: Vec<FieldSpot>,
    /// Over the paraxial entrance pupil, as tables print it.
    printed: Vec<PrintedSpot>,
    /// What a designer should know before believing the rest.
    warnings: Vec<String>,
}

/// What is odd about a lens that can be traced all the same.
fn warnings(lens: &Lens, order: &FirstOrder, quadrature: &Quadrature) -> Vec<String> {
    let mut found = Vec::new();
    let stop = &lens.surfaces[lens.stop];
    if stop.semi_diameter_mm < 0.99 * order.stop_radius_mm {
        found.push(format!(
            "an entrance pupil of {} mm needs a stop of {:.3} mm radius, the stop's clear semi-diameter is {} mm; \
             the entrance pupil counts",
            lens.entrance_pupil_mm, order.stop_radius_mm, stop.semi_diameter_mm
        ));
    }
    if stop.semi_diameter_mm > WIDE_STOP * order.stop_radius_mm.abs() {
        found.push(format!(
            "an entrance pupil of {} mm fills {:.4} mm of the stop's radius, its clear semi-diameter is {} mm; \
             the entrance pupil counts",
            lens.entrance_pupil_mm, order.stop_radius_mm, stop.semi_diameter_mm
        ));
    }
    if lens.surfaces.iter().filter(|s| s.action == Action::Reflect && s.placement.is_none()).count() > 1 {
        found.push(
            "a mirror in front of another takes no light from it: there are no obscurations".to_owned(),
        );
    }
    let last = lens.surfaces.len() - 1;
    let direction = if lens.light_goes_forwards(last) { 1.0 } else { -1.0 };
    if order.image_distance_mm * direction < 0.0 {
        found.push("the paraxial image is virtual: it lies in front of the last surface".to_owned());
    }
    if !order.efl_mm.is_finite() {
        found.push("the lens is afocal in the y-z plane: it has no focal length".to_owned());
    }
    if !lens.is_rotationally_symmetric() {
        found.push(
            "the lens is not rotationally symmetric: first-order figures and Seidel sums are those of its y-z section \
             with every surface on the axis"
                .to_owned(),
        );
    }
    let reference = lens.at_wavelength(lens.reference_um);
    for field_deg in &lens.fields_deg {
        let beam = trace_beam(&reference, field_deg.to_radians(), order.stop_radius_mm, quadrature);
        let lost = beam.fate.iter().filter(|fate| !fate.reaches_image()).count();
        if lost > 0 {
            let share = 100.0 * lost as f64 / beam.fate.len() as f64;
            found.push(format!(
                "at {field_deg} degrees {share:.1} % of the rays through the stop miss a surface or are totally \
                 reflected; spots and illumination are those of the rest"
            ));
        }
    }
    found
}

fn figures(name: &str, lens: &Lens) -> Result<Figures, Failure> {
    let reference = lens.at_wavelength(lens.reference_um);
    let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| Failure::job(e.to_string()))?;
    let full_field = lens.fields_deg.iter().fold(0.0_f64, |a, b| a.max(b.abs())).to_radians();
    let (mut spots, mut printed) = (Vec::new(), Vec::new());
    for field_deg in &lens.fields_deg {
        let field = field_deg.to_radians();
        let (Some(through_stop), Some(through_pupil)) =
            (spot(lens, field, &quadrature), spot_paraxial_pupil(lens, field, &quadrature))
        else {
            return Err(Failure::input(
                format!("{name}: at {field_deg} degrees no ray reaches the image{}", where_lost(lens, field)),
                "a surface is missed, or a clear semi-diameter blocks the whole beam",
            ));
        };
        spots.push(through_stop);
        printed.push(through_pupil);
    }
    let order = first_order(&reference);
    Ok(Figures {
        warnings: warnings(lens, &order, &quadrature),
        order,
        seidel: seidel_total(&reference, full_field).map(|total| total.s),
        spots,
        printed,
    })
}

/// Where the ray through the centre of the paraxial pupil ends, if it does.
fn where_lost(lens: &Lens, field_rad: f64) -> String {
    let sequence = lens.at_wavelength(lens.reference_um);
    let at = paraxial_launch(&first_order(&sequence), &sequence, field_rad, [0.0; 2]);
    let path = trace_ray(&sequence, launch(&sequence, field_rad, at).ray);
    match path.fate {
        Fate::Missed(i) => format!(": the ray through the middle of the pupil misses surface {}", i + 1),
        Fate::TotalReflection(i) => {
            format!(": no light passes surface {}, by total reflection or an evanescent order", i + 1)
        }
        Fate::Clipped(i) => format!(": the middle of the pupil is clipped at surface {}", i + 1),
        Fate::Ok | Fate::NotAimed => String::new(),
    }
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let assets = built_in_assets();
    let lens = focused(assets.lens(&args.lens)?.lens, args.focus)?;
    let mut found = match figures(&args.lens, &lens) {
        Ok(found) => found,
        Err(failure) => {
            // The prescription is what tells why.
            if !args.json {
                eprintln!("{}", prescription(&lens));
            }
            return Err(failure);
        }
    };
    if args.json {
        // On stderr they have been told with the reading.
        found.warnings.extend(glass_warnings(&lens, &assets.catalog()?));
        return print_json(&to_json(&lens, &found));
    }
    print(&lens, &found);
    Ok(ExitCode::SUCCESS)
}

fn to_json(lens: &Lens, found: &Figures) -> Value {
    let o = &found.order;
    let spots = || found.spots.iter();
    json!({
        "name": lens.name,
        "source": lens.source,
        "efl_mm": o.efl_mm,
        "bfl_mm": o.bfl_mm,
        "f_number": o.f_number,
        "epd_mm": lens.entrance_pupil_mm,
        // To the paraxial focus, as lens tables print it; the image plane may be defocused from it.
        "total_track_mm": lens.total_track_mm() - lens.image_distance_mm() + o.image_distance_mm,
        "image_distance_mm": lens.image_distance_mm(),
        "defocus_mm": lens.image_distance_mm() - o.image_distance_mm,
        "entrance_pupil_from_first_vertex_mm": o.entrance_pupil_at_mm,
        "exit_pupil_from_last_vertex_mm": o.exit_pupil_at_mm,
        "exit_pupil_mm": o.exit_pupil_mm,
        "reference_um": lens.reference_um,
        "wavelengths_um": lens.wavelengths_um,
        "fields_deg": lens.fields_deg,
        // Over the paraxial entrance pupil, as lens programs print it.
        "rms_spot_um": found.printed.iter().map(|s| s.rms_um.clone()).collect::<Vec<_>>(),
        "rms_spot_poly_um": found.printed.iter().map(|s| s.rms_poly_um).collect::<Vec<_>>(),
        // Through the real stop, weighed by light: what the sensor sees.
        "rms_spot_real_stop_um": spots().map(|s| s.rms_um.clone()).collect::<Vec<_>>(),
        "rms_spot_poly_real_stop_um": spots().map(|s| s.rms_poly_um).collect::<Vec<_>>(),
        "relative_illumination": spots().map(|s| s.illumination.clone()).collect::<Vec<_>>(),
        "seidel": found.seidel.map(|[s1, s2, s3, s4, s5]| {
            json!({ "S1": s1, "S2": s2, "S3": s3, "S4": s4, "S5": s5 })
        }),
        "warnings": found.warnings,
        "surfaces": lens.surfaces.iter().enumerate().map(|(i, s)| json!({
            "surface": i + 1,
            "label": s.label,
            "radius_mm": (s.shape.curvature != 0.0).then(|| 1.0 / s.shape.curvature),
            "conic": s.shape.conic,
            "asphere_a2_to_a16": s.shape.asphere,
            "thickness_mm": s.thickness_mm,
            "glass": s.glass.name,
            "nd": s.glass.nd(),
            "vd": (!s.glass.is_air()).then(|| s.glass.abbe_vd()),
            "semi_diameter_mm": s.semi_diameter_mm,
            "stop": i == lens.stop,
            "special": special(s),
        })).collect::<Vec<_>>(),
    })
}

/// What a surface has beyond a conic with an even polynomial, a glass and a place on the axis, as its file says it.
fn special(surface: &Surface) -> Vec<String> {
    special_lines(surface).lines().map(str::to_owned).collect()
}

/// The surfaces of a lens, as lines.
fn prescription(lens: &Lens) -> String {
    let columns = "  #  radius mm    conic  thickness mm  glass       nd       Vd   semi mm";
    let mut out = format!("{}\n\n{columns}\n", lens.name);
    for (i, s) in lens.surfaces.iter().enumerate() {
        let radius = match s.shape.curvature {
            0.0 => "plane".to_owned(),
            c => format!("{:.4}", 1.0 / c),
        };
        let glass = if s.glass.is_air() {
            format!("{:<10} {:>7} {:>7}", "", "", "")
        } else {
            format!("{:<10} {:>7.5} {:>7.2}", s.glass.name, s.glass.nd(), s.glass.abbe_vd())
        };
        let stop = if i == lens.stop { "  stop" } else { "" };
        out += &format!(
            "{:>3} {radius:>10} {:>8.4} {:>13.4}  {glass} {:>8.3}{stop}\n",
            i + 1,
            s.shape.conic,
            s.thickness_mm,
            s.semi_diameter_mm
        );
        let terms: Vec<String> = (0..s.shape.asphere.len())
            .filter(|j| s.shape.asphere[*j] != 0.0)
            .map(|j| format!("a{} = {:.4e}", 2 * (j + 1), s.shape.asphere[j]))
            .collect();
        if !terms.is_empty() {
            out += &format!("{:>14} {}\n", "asphere:", terms.join("  "));
        }
        for line in special(s) {
            out += &format!("{:>14} {line}\n", "");
        }
    }
    out
}

fn print(lens: &Lens, found: &Figures) {
    print!("{}", prescription(lens));
    let o = &found.order;
    let object = match lens.object {
        ObjectDistance::Infinity => "at infinity".to_owned(),
        ObjectDistance::Finite(d) => format!("{d} mm before the first vertex"),
    };
    println!("\n  object              {object}");
    println!("  focal length        {:>9.4} mm at {} um", o.efl_mm, lens.reference_um);
    println!("  back focal length   {:>9.4} mm", o.bfl_mm);
    println!("  f-number            {:>9.4}    entrance pupil {:.4} mm", o.f_number, lens.entrance_pupil_mm);
    let table = first_order_table(lens);
    if let Some(magnification) = table.magnification {
        println!(
            "  magnification       {magnification:>+9.4}    working f-number {:.4}",
            table.working_f_number
        );
    }
    let image = if table.magnification.is_some() { "image" } else { "focus" };
    let track = lens.total_track_mm() - lens.image_distance_mm() + o.image_distance_mm;
    println!("  total track         {track:>9.4} mm to the paraxial {image}");
    let defocus = lens.image_distance_mm() - o.image_distance_mm;
    println!("  image plane         {defocus:>+9.4} mm from the paraxial {image}");
    match found.seidel {
        Some([s1, s2, s3, s4, s5]) => println!(
            "\n  Seidel sums, mm     S1 {s1:+.5}  S2 {s2:+.5}  S3 {s3:+.5}  S4 {s4:+.5}  S5 {s5:+.5}"
        ),
        None => println!("\n  Seidel sums         not defined for thin lenses and diffractive power"),
    }
    println!("\n  RMS spot radius, um, all wavelengths");
    println!("  field deg   paraxial pupil   real stop   illumination");
    for (s, printed) in found.spots.iter().zip(&found.printed) {
        let light = s.illumination.iter().sum::<f64>() / s.illumination.len() as f64;
        let (field, real) = (s.field_rad.to_degrees(), s.rms_poly_um);
        println!("  {field:>9.2}   {:>14.2}   {real:>9.2}   {light:>12.3}", printed.rms_poly_um);
    }
    for warning in &found.warnings {
        println!("\n  warning: {warning}");
    }
}
