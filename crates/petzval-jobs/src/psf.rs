//! `psf`: the point-spread functions of a lens, as arrays and as a picture.

use std::path::{Path, PathBuf};

use petzval_base::write_whole;
use petzval_design::error::DesignError;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_files::npy_bytes;
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::{FieldPsf, PsfMethod, PsfOptions};
use petzval_optics::pupil::Quadrature;
use petzval_report::psf_sheet::psf_sheet;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, json, make_folder, write_file};
use crate::event::WarningKind;
use crate::results::{check_folder, what_is};

pub use petzval_optics::psf::PsfKind;

/// The PSFs of a lens, per field and wavelength, written to a folder.
///
/// Files: `psf.npy`, float64 `[field, wavelength, row, column]`, each of unit sum, centred on the chief ray;
/// `illumination.npy`, float64 `[field, wavelength]`; `psf.png`, a labelled sheet to look at; `psf.json`, the axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Lens file, or a built-in name.
    pub lens: String,
    /// Folder for the results.
    pub out: PathBuf,
    /// Number of fields from the axis to the corner, 2 to 201.
    pub fields: usize,
    /// Image radius of the last field, mm.
    pub corner_mm: f64,
    /// Wavelengths of the red, green and blue channel, um, 0.2 to 20.
    pub wavelengths: Vec<f64>,
    /// Cells a side, 16 to 1024.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// Least pupil cells a side; diffraction chooses its own.
    pub pupil_cells: usize,
    /// Error (L1, of PSFs of unit sum) above which the pupil cells are doubled.
    pub pupil_error: f64,
    /// Rays or waves.
    pub kind: PsfKind,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            lens: String::new(),
            out: PathBuf::new(),
            fields: 13,
            corner_mm: 6.634,
            wavelengths: vec![0.62, 0.55, 0.486],
            grid: 128,
            pitch_um: 1.0,
            pupil_cells: 256,
            pupil_error: 0.02,
            kind: PsfKind::default(),
        }
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// The files, all in the folder of the request.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
    /// The axes of the arrays, as in `psf.json`.
    pub axes: Axes,
}

/// The axes of the arrays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axes {
    /// Name of the lens.
    pub lens: String,
    /// Names of the axes of `psf.npy`.
    pub axes: [String; 4],
    /// Field angles, degrees.
    pub field_deg: Vec<f64>,
    /// Image radii of the fields, mm: where their chief rays land.
    pub field_radius_mm: Vec<f64>,
    /// Where the reference chief ray lands across the plane of the fields, mm.
    pub chief_ray_x_mm: Vec<f64>,
    /// Where the reference chief ray lands in the plane of the fields, mm.
    pub chief_ray_y_mm: Vec<f64>,
    /// Wavelengths, um.
    pub wavelengths_um: [f64; 3],
    /// Cell size, um.
    pub pitch_um: f64,
    /// Pupil cells a side; diffraction chooses its own.
    pub pupil_cells: usize,
    /// Error by the pupil cells: the sum of absolute differences of PSFs of unit sum; 0 of diffraction.
    pub pupil_error: f64,
    /// Direction of the rows.
    pub row_axis: String,
    /// Share of the light that falls inside the grid, per field and wavelength.
    pub captured: Vec<Vec<f64>>,
    /// How each PSF was computed, per field and wavelength.
    pub method: Vec<Vec<Method>>,
}

/// How a PSF was computed; see [`PsfMethod`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Method {
    /// From polynomials over the pupil through traced rays.
    Polynomial {
        /// Total degree.
        degree: usize,
        /// Largest distance between the polynomials and traced rays that they were not fitted to, um.
        residual_um: f64,
    },
    /// From one traced ray per pupil cell.
    Traced,
    /// The point of a thin lens without aberrations.
    Point,
    /// The pattern of Airy, of a thin lens without aberrations.
    Airy,
    /// By diffraction, from polynomials of this total degree.
    Wave {
        /// Total degree.
        degree: usize,
    },
}

impl From<&PsfMethod> for Method {
    fn from(method: &PsfMethod) -> Self {
        match *method {
            PsfMethod::Polynomial { degree, residual_um } => Self::Polynomial { degree, residual_um },
            PsfMethod::Traced => Self::Traced,
            PsfMethod::Point => Self::Point,
            PsfMethod::Airy => Self::Airy,
            PsfMethod::Wave { degree } => Self::Wave { degree },
        }
    }
}

impl Request {
    /// The PSFs' fields, wavelengths and grids, once every setting is in its range.
    fn plan(&self) -> Result<PsfPlan, JobError> {
        let [red, green, blue] = self.wavelengths[..] else {
            let hint = "for example 0.62,0.55,0.486";
            return Err(JobError::setting("wavelengths", "", "needs three numbers", hint));
        };
        let is_visible = self.wavelengths.iter().all(|um| (0.2..=20.0).contains(um));
        for (key, is_in_range, hint) in [
            ("fields", (2..=201).contains(&self.fields), "2 to 201"),
            ("corner_mm", self.corner_mm > 0.0 && self.corner_mm < 1e3, "a length in mm"),
            ("grid", (16..=1024).contains(&self.grid), "16 to 1024 cells"),
            ("pupil_error", self.pupil_error > 0.0, "larger than 0; 2 keeps the pupil cells"),
            ("pitch_um", self.pitch_um > 0.0 && self.pitch_um < 1e3, "a length in um"),
            ("wavelengths", is_visible, "in um, 0.2 to 20; 550 nm is 0.55"),
        ] {
            if !is_in_range {
                return Err(JobError::setting(key, "", "out of range", hint));
            }
        }
        let quadrature = Quadrature::grid(self.pupil_cells).map_err(|e| {
            JobError::setting("pupil_cells", "", e.to_string(), "256 is accurate, 64 is quick")
        })?;
        let options = PsfOptions { grid: self.grid, pitch_um: self.pitch_um, kind: self.kind };
        Ok(PsfPlan::new(self.fields, self.corner_mm, [red, green, blue], options, quadrature))
    }

    fn side_um(&self) -> f64 {
        self.grid as f64 * self.pitch_um
    }
}

/// The files of the results.
const FILES: [&str; 4] = ["psf.npy", "illumination.npy", "psf.png", "psf.json"];

/// Computes and writes the PSFs.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let lens = context.assets.lens(&request.lens)?.lens;
    if !first_order(&lens.at_wavelength(lens.reference_um)).efl_mm.is_finite() {
        return Err(JobError::input(
            format!(
                "{}: the lens is afocal in the y-z plane, and its fields have no image radius",
                request.lens
            ),
            "`lens show` and `lens trace` take it",
        ));
    }
    let plan = request.plan()?;
    check_folder(&request.out, FILES, context)?;
    let no_light = |error: DesignError| match error {
        DesignError::NoLight { .. } => JobError::input(
            error.to_string(),
            match request.kind {
                PsfKind::Geometric => {
                    format!("rays may land outside the grid of {} um: try a larger --grid", request.side_um())
                }
                PsfKind::Diffraction => format!(
                    "waves may need a smaller grid than {} um (--grid, --pitch-um); rays do not: --kind geometric",
                    request.side_um()
                ),
            },
        ),
        other => other.into(),
    };
    let (plan, error) = plan.converged(&lens, request.pupil_error).map_err(no_light)?;
    if error > request.pupil_error {
        context.warning(WarningKind::PsfError, format!(
            "PSFs on {} pupil cells a side have an error of {error:.3} (L1); larger cells of the PSF have less",
            plan.quadrature.cells
        ));
    }
    let psfs = plan.psfs(&lens).map_err(no_light)?;
    warn_of_lost_light(request, &psfs, context);

    make_folder(&request.out)?;
    let values: Vec<f64> = psfs.iter().flat_map(|p| p.values.iter().flatten().copied()).collect();
    let illumination: Vec<f64> = psfs.iter().flat_map(|p| p.illumination.iter().copied()).collect();
    let axes = Axes {
        lens: lens.name.clone(),
        axes: ["field", "wavelength", "row", "column"].map(str::to_owned),
        field_deg: psfs.iter().map(|p| p.field_rad.to_degrees()).collect(),
        field_radius_mm: plan.field_radius_mm.clone(),
        chief_ray_x_mm: psfs.iter().map(|p| p.chief_x_mm).collect(),
        chief_ray_y_mm: psfs.iter().map(|p| p.chief_y_mm).collect(),
        wavelengths_um: plan.wavelengths_um,
        pitch_um: request.pitch_um,
        pupil_cells: plan.quadrature.cells,
        pupil_error: error,
        row_axis: "y, away from the axis".to_owned(),
        captured: psfs.iter().map(|p| p.captured.clone()).collect(),
        method: psfs.iter().map(|p| p.method.iter().map(Method::from).collect()).collect(),
    };
    let (fields, grid) = (request.fields as u64, request.grid as u64);
    let [psf, light, sheet, text] = FILES.map(|name| request.out.join(name));
    write_npy(&psf, &[fields, 3, grid, grid], &values)?;
    write_npy(&light, &[fields, 3], &illumination)?;
    write_file(&sheet, psf_sheet(&psfs, &plan.options, plan.wavelengths_um))?;
    write_whole(&text, json(&axes)?.as_bytes()).map_err(DesignError::io(&text))?;
    let files = vec![psf, light, sheet, text];
    files.iter().for_each(|path| context.wrote(path, what_is(path)));
    Ok(Response { files, axes })
}

/// Each PSF has unit sum, however much of its light the grid holds: warns where the grid does not hold nearly all.
fn warn_of_lost_light(request: &Request, psfs: &[FieldPsf], context: &Context) {
    const LOST: f64 = 0.01;
    let captured = |p: &FieldPsf| p.captured.iter().copied().fold(f64::INFINITY, f64::min);
    if let Some(worst) = psfs.iter().min_by(|a, b| captured(a).total_cmp(&captured(b)))
        && captured(worst) < 1.0 - LOST
    {
        context.warning(
            WarningKind::LostLight,
            format!(
                "at {:.2} degrees the grid of {} um holds {:.0} % of the light; try a larger --grid",
                worst.field_rad.to_degrees(),
                request.side_um(),
                100.0 * captured(worst)
            ),
        );
    }
}

fn write_npy(path: &Path, shape: &[u64], values: &[f64]) -> Result<(), JobError> {
    let write = || write_whole(path, &npy_bytes(shape, values)?);
    Ok(write().map_err(DesignError::io(path))?)
}
