//! `petzval psf`: the point-spread functions of a lens, as arrays and as a picture.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use petzval::built_in_assets;
use petzval::design::error::DesignError;
use petzval::design::optics::PsfPlan;
use petzval::optics::paraxial::first_order;
use petzval::optics::psf::{FieldPsf, PsfKind, PsfMethod, PsfOptions};
use petzval::optics::pupil::Quadrature;
use petzval::report::psf_sheet::psf_sheet;
use serde_json::json;

use super::{Failure, print_json};

/// What light is taken for.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Rays.
    Geometric,
    /// Waves.
    Diffraction,
}

/// Write the PSFs of a lens, per field and wavelength.
///
/// Files: psf.npy, float64 [field, wavelength, row, column], each of unit sum, centred on the chief ray;
/// illumination.npy, float64 [field, wavelength]; psf.png, a sheet to look at; psf.json, the axes.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of fields from the axis to the corner
    #[arg(long, default_value_t = 13)]
    fields: usize,
    /// Image radius of the last field, mm (the corner of a 1920 x 1200 sensor of 5.86 um)
    #[arg(long, default_value_t = 6.634)]
    corner_mm: f64,
    /// Wavelengths of the red, green and blue channel, um
    #[arg(long, value_name = "UM,UM,UM", value_delimiter = ',', default_value = "0.62,0.55,0.486")]
    wavelengths: Vec<f64>,
    /// Cells a side
    #[arg(long, default_value_t = 128)]
    grid: usize,
    /// Cell size, um
    #[arg(long, default_value_t = 1.0)]
    pitch_um: f64,
    /// Pupil cells a side; waves choose their own
    #[arg(long, default_value_t = 256)]
    pupil_cells: usize,
    /// Rays, right where aberrations spread light over many times the Airy disk, or waves
    #[arg(long, value_enum, default_value = "geometric")]
    kind: Kind,
    /// Print the axes as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let lens = built_in_assets().lens(&args.lens)?.lens;
    if !first_order(&lens.at_wavelength(lens.reference_um)).efl_mm.is_finite() {
        return Err(Failure::input(
            format!(
                "{}: the lens is afocal in the y-z plane, and its fields have no image radius",
                args.lens
            ),
            "`lens show` and `lens trace` take it",
        ));
    }
    let [red, green, blue] = args.wavelengths[..] else {
        return Err(Failure::input("--wavelengths needs three numbers", "for example 0.62,0.55,0.486"));
    };
    for (name, ok, hint) in [
        ("--fields", (2..=201).contains(&args.fields), "2 to 201"),
        ("--corner-mm", args.corner_mm > 0.0 && args.corner_mm < 1e3, "a length in mm"),
        ("--grid", (16..=1024).contains(&args.grid), "16 to 1024 cells"),
        ("--pitch-um", args.pitch_um > 0.0 && args.pitch_um < 1e3, "a length in um"),
        (
            "--wavelengths",
            args.wavelengths.iter().all(|w| (0.2..=20.0).contains(w)),
            "in um, 0.2 to 20; 550 nm is 0.55",
        ),
    ] {
        if !ok {
            return Err(Failure::input(format!("{name}: out of range"), hint));
        }
    }
    let quadrature = Quadrature::grid(args.pupil_cells)
        .map_err(|e| Failure::input(format!("--pupil-cells: {e}"), "256 is accurate, 64 is quick"))?;
    let kind = match args.kind {
        Kind::Geometric => PsfKind::Geometric,
        Kind::Diffraction => PsfKind::Diffraction,
    };
    let options = PsfOptions { grid: args.grid, pitch_um: args.pitch_um, kind };
    let plan = PsfPlan::new(args.fields, args.corner_mm, [red, green, blue], options, quadrature);
    let psfs = plan.psfs(&lens).map_err(|error| match error {
        DesignError::NoLight { .. } => Failure::input(
            error.to_string(),
            format!("rays may also land outside the grid of {} um: try a larger --grid", side_um(&args)),
        ),
        other => other.into(),
    })?;
    warn_of_lost_light(&args, &psfs);

    Failure::folder(&args.out)?;
    let values: Vec<f64> = psfs.iter().flat_map(|p| p.values.iter().flatten().copied()).collect();
    let illumination: Vec<f64> = psfs.iter().flat_map(|p| p.illumination.iter().copied()).collect();
    let (fields, grid) = (args.fields as u64, args.grid as u64);
    write_npy(&args.out.join("psf.npy"), &[fields, 3, grid, grid], &values)?;
    write_npy(&args.out.join("illumination.npy"), &[fields, 3], &illumination)?;
    let sheet = args.out.join("psf.png");
    psf_sheet(&psfs, args.grid)
        .save(&sheet)
        .map_err(|e| Failure::job(format!("{}: {e}", sheet.display())))?;
    let axes = json!({
        "lens": lens.name,
        "axes": ["field", "wavelength", "row", "column"],
        "field_deg": psfs.iter().map(|p| p.field_rad.to_degrees()).collect::<Vec<_>>(),
        "field_radius_mm": plan.field_radius_mm,
        "chief_ray_x_mm": psfs.iter().map(|p| p.chief_x_mm).collect::<Vec<_>>(),
        "chief_ray_y_mm": psfs.iter().map(|p| p.chief_y_mm).collect::<Vec<_>>(),
        "wavelengths_um": plan.wavelengths_um,
        "pitch_um": args.pitch_um,
        "row_axis": "y, away from the axis",
        "captured": psfs.iter().map(|p| p.captured.clone()).collect::<Vec<_>>(),
        "method": psfs.iter().map(|p| p.method.iter().map(method).collect::<Vec<_>>()).collect::<Vec<_>>(),
    });
    let path = args.out.join("psf.json");
    let text = serde_json::to_string_pretty(&axes).map_err(|e| Failure::job(e.to_string()))?;
    std::fs::write(&path, text).map_err(DesignError::io(&path))?;
    eprintln!("{} fields x 3 wavelengths written to {}", args.fields, args.out.display());
    if args.json { print_json(&axes) } else { Ok(ExitCode::SUCCESS) }
}

fn side_um(args: &Args) -> f64 {
    args.grid as f64 * args.pitch_um
}

/// PSFs have unit sum whatever the grid holds of them; say so where it does not hold all.
fn warn_of_lost_light(args: &Args, psfs: &[FieldPsf]) {
    const LOST: f64 = 0.01;
    let captured = |p: &FieldPsf| p.captured.iter().copied().fold(f64::INFINITY, f64::min);
    if let Some(worst) = psfs.iter().min_by(|a, b| captured(a).total_cmp(&captured(b)))
        && captured(worst) < 1.0 - LOST
    {
        eprintln!(
            "warning: at {:.2} degrees the grid of {} um holds {:.0} % of the light; try a larger --grid",
            worst.field_rad.to_degrees(),
            side_um(args),
            100.0 * captured(worst)
        );
    }
}

fn write_npy(path: &Path, shape: &[u64], values: &[f64]) -> Result<(), Failure> {
    use npyz::WriterBuilder;
    let write = || -> std::io::Result<()> {
        let file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(file).begin_nd()?;
        writer.extend(values.iter().copied())?;
        writer.finish()
    };
    write().map_err(DesignError::io(path)).map_err(Failure::from)
}

fn method(method: &PsfMethod) -> serde_json::Value {
    match method {
        PsfMethod::Polynomial { degree, residual_um } => {
            json!({ "kind": "polynomial", "degree": degree, "residual_um": residual_um })
        }
        PsfMethod::Traced => json!({ "kind": "traced" }),
        PsfMethod::Wave { degree } => json!({ "kind": "wave", "degree": degree }),
    }
}
