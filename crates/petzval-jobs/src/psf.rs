//! `psf`: the point-spread functions of a lens, as arrays and as a picture.

use std::path::{Path, PathBuf};

use petzval_base::reason_and_hint;
use petzval_camera::psf::PsfBank;
use petzval_design::error::DesignError;
use petzval_design::lens::psf_plan::{PsfPlan, scale_of_bank_mm};
use petzval_files::FloatType;
use petzval_files::psf_file::{AXES_FILE, ILLUMINATION_FILE, PsfFile, VALUES_FILE, write_psfs};
use petzval_optics::analysis::leaves_parallel;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::{FieldPsf, PsfOptions};
use petzval_optics::pupil::{Quadrature, chief_ray};
use petzval_report::psf_sheet::psf_sheet;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::event::WarningKind;
use crate::glass_range::warn_of_wavelengths;
use crate::input::LensInput;
use crate::lens::focus::focus_elsewhere;
use crate::range::check_ranges;
use crate::results::{check_folder, what_is};

pub use petzval_files::psf_file::{Channel, Method, PsfAxes as Axes, PsfOrigin};
pub use petzval_optics::psf::PsfKind;

petzval_base::parameters! {
    /// The PSFs of a lens, per field and wavelength, written to a folder.
    ///
    /// Files: `psf.npy`, float64 `[field, wavelength, row, column]`, each of unit sum, centred on the chief ray;
    /// `illumination.npy`, float64 `[field, wavelength]`; `psf.png`, a labelled sheet to look at; `psf.json`, the axes.
    /// `simulate`, `apply`, `evaluate` and experiments take the folder.
    pub struct Request {
        /// Number of fields from the axis to the corner, 2 to 201.
        fields: usize = 13, "", 2..201, Linear, "2 to 201 fields; 13 are usual";
        /// Image radius of the last field, mm.
        corner_mm: f64 = 6.634, "mm", 1e-6..1e3, Log, "a length in mm";
        /// Wavelengths of the red, green and blue channel, um, 0.2 to 20.
        wavelengths: Vec<f64> = vec![0.62, 0.55, 0.486], "um", 0.2..20.0, Log, "in um, 0.2 to 20; 550 nm is 0.55";
        /// Cells a side, 16 to 1024.
        grid: usize = 128, "", 16..1024, Log, "16 to 1024 cells";
        /// Cell size, um.
        pitch_um: f64 = 1.0, "um", 1e-6..1e3, Log, "a length in um";
        /// Least pupil cells a side; diffraction chooses its own.
        pupil_cells: usize = 256, "", 12..4096, Log, "256 is accurate, 64 is quick";
        /// Error (L1, of PSFs of unit sum) above which the pupil cells are doubled.
        pupil_error: f64 = 0.02, "", 1e-12..1e9, Log, "larger than 0; 2 keeps the pupil cells";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Folder for the results.
        out: PathBuf = PathBuf::new();
        /// Rays or waves.
        kind: PsfKind = PsfKind::default();
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The files, all in the folder of the request.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
    /// The axes of the arrays, as in `psf.json`.
    pub axes: Axes,
}

impl Request {
    /// The PSFs' fields, wavelengths and grids, once every setting is in its range.
    fn plan(&self) -> Result<PsfPlan> {
        let (options, quadrature) = self.options()?;
        let [red, green, blue] = self.wavelengths[..] else {
            let hint = "for example 0.62,0.55,0.486";
            return Err(JobError::setting("wavelengths", "", "needs three numbers", hint));
        };
        Ok(PsfPlan::new(self.fields, self.corner_mm, [red, green, blue], options, quadrature))
    }

    /// The grid of each PSF and that of the pupil, once every setting is in its range.
    pub fn options(&self) -> Result<(PsfOptions, Quadrature)> {
        check_ranges(self)?;
        let quadrature = Quadrature::grid(self.pupil_cells).map_err(|e| {
            JobError::setting("pupil_cells", self.pupil_cells, e.to_string(), "256 is accurate, 64 is quick")
        })?;
        Ok((PsfOptions { grid: self.grid, pitch_um: self.pitch_um, kind: self.kind }, quadrature))
    }

    fn side_um(&self) -> f64 {
        self.grid as f64 * self.pitch_um
    }
}

/// A sheet of all PSFs to look at.
const SHEET: &str = "psf.png";

/// The files of the results.
const FILES: [&str; 4] = [VALUES_FILE, ILLUMINATION_FILE, SHEET, AXES_FILE];

/// The PSFs of a lens as values: what `psf` keeps as files.
#[derive(Clone, Debug)]
pub struct Bank {
    /// The PSFs of each field, from the axis to the corner: values, illumination, landing of the chief ray.
    pub psfs: Vec<FieldPsf>,
    /// Their fields, wavelengths and grids, as they were computed.
    pub plan: PsfPlan,
    /// The axes of their arrays.
    pub axes: Axes,
}

impl Bank {
    /// Numbers of fields, of wavelengths, and of cells a side: the shape of the values.
    pub fn shape(&self) -> [usize; 4] {
        let grid = self.plan.options.grid;
        [self.psfs.len(), self.plan.wavelengths_um.len(), grid, grid]
    }

    /// Every value, row by row, in the order of [`Bank::shape`]; each PSF has unit sum.
    pub fn values(&self) -> Vec<f64> {
        self.psfs.iter().flat_map(|p| p.values.iter().flatten().copied()).collect()
    }

    /// The light of every PSF relative to the axis, by field and wavelength.
    pub fn illumination(&self) -> Vec<f64> {
        self.psfs.iter().flat_map(|p| p.illumination.iter().copied()).collect()
    }

    /// The bank as its files hold it.
    pub fn file(&self) -> PsfFile {
        PsfFile {
            axes: self.axes.clone(),
            shape: self.shape(),
            values: self.values(),
            illumination: self.illumination(),
        }
    }

    /// The PSFs in single precision, as a simulation takes them in place of a lens.
    pub fn for_renderer(&self) -> PsfBank {
        PsfBank {
            field_radius_mm: self.plan.field_radius_mm.clone(),
            grid: self.plan.options.grid,
            pitch_um: self.plan.options.pitch_um,
            values: self.values().into_iter().map(|value| value as f32).collect(),
            illumination: self.illumination().into_iter().map(|value| value as f32).collect(),
        }
    }
}

/// Computes the PSFs; writes nothing.
pub fn bank(request: &Request, context: &Context) -> Result<Bank> {
    let (lens, plan) = prepared(request, context)?;
    computed(request, &lens, &plan, context)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit { out_in: Some(""), ..AsUnit::placed(|request, folder| request.out = folder.to_owned()) };

/// Computes the PSFs, and keeps them as files.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (lens, plan) = prepared(request, context)?;
    check_folder(&request.out, FILES, context)?;
    let bank = computed(request, &lens, &plan, context)?;
    if let Some(part) = seen_part(&bank, &lens) {
        context.note(part);
    }
    context.check(|| "stopped before any file was written")?;
    let files = keep(&bank, &request.out)?;
    files.iter().for_each(|path| context.wrote(path, what_is(path)));
    Ok(Response { files, axes: bank.axes })
}

/// The lens and the plan of its PSFs, once every setting is known to be possible.
fn prepared(request: &Request, context: &Context) -> Result<(Lens, PsfPlan)> {
    let lens = request.lens.read(&context.assets)?.lens;
    if let Some(reason) = no_image(&lens) {
        let message = format!("{}: {reason}", request.lens);
        return Err(JobError::input(message, "`lens show` and `lens trace` take it"));
    }
    let plan = request.plan()?;
    warn_of_wavelengths(&lens, &request.wavelengths, context);
    Ok((lens, plan))
}

/// Why a lens has no PSFs; `None` if it has.
fn no_image(lens: &Lens) -> Option<&'static str> {
    // A near object has an image behind an afocal lens, too: that of a relay.
    let is_far = lens.object == ObjectDistance::Infinity;
    if is_far && !first_order(&lens.at_wavelength(lens.reference_um)).efl_mm.is_finite() {
        return Some("the lens is afocal in the y-z plane, and its fields have no image radius");
    }
    (leaves_parallel(lens) == [true; 2]).then_some("light leaves the lens parallel, and makes no image")
}

/// The outermost field that a lens file states.
struct StatedField {
    /// Field angle, degrees.
    field_deg: f64,
    /// Where its chief ray lands, mm from the axis.
    image_mm: f64,
}

impl StatedField {
    /// `None` if the file states none off the axis, or if no chief ray of it reaches the image. Also where all fields lie on one side of the axis
    /// of the lens: their angles to it say nothing of the part that PSFs cover.
    fn of(lens: &Lens) -> Option<Self> {
        let field_deg = lens.outermost_field_deg();
        if field_deg == 0.0 || lens.reference_field_deg() != 0.0 {
            return None;
        }
        let chief = chief_ray(&lens.at_wavelength(lens.reference_um), field_deg.to_radians())?;
        Some(Self { field_deg, image_mm: chief.y_mm.abs() })
    }
}

/// Share of the outermost field of a lens file up to which PSFs cover a part of the lens.
const PART: f64 = 0.95;

/// What to say of PSFs that end far inside the fields of the lens file.
fn seen_part(bank: &Bank, lens: &Lens) -> Option<String> {
    let stated = StatedField::of(lens)?;
    let last_deg = bank.psfs.last()?.field_rad.to_degrees().abs();
    let corner_mm = bank.plan.field_radius_mm.last()?;
    (last_deg < PART * stated.field_deg).then(|| {
        format!(
            "the PSFs go to {last_deg:.2} of the {} degrees of the lens file, {corner_mm} mm from the axis; --corner-mm {:.3} takes all of them",
            stated.field_deg, stated.image_mm
        )
    })
}

/// The PSFs, on as many pupil cells as they need.
fn computed(request: &Request, lens: &Lens, plan: &PsfPlan, context: &Context) -> Result<Bank> {
    let beyond = |field_deg: f64| {
        // A thousandth beyond the outermost field is the same field.
        let stated = StatedField::of(lens).filter(|stated| field_deg.abs() > 1.001 * stated.field_deg)?;
        Some(format!(
            "the lens file states fields to {} degrees, {:.3} mm from the axis: try a smaller --corner-mm",
            stated.field_deg, stated.image_mm
        ))
    };
    let of_grid = match request.kind {
        PsfKind::Geometric => {
            format!("rays may land outside the grid of {} um: try a larger --grid", request.side_um())
        }
        PsfKind::Diffraction => format!(
            "waves may need a smaller grid than {} um (--grid, --pitch-um); rays do not: --kind geometric",
            request.side_um()
        ),
    };
    let no_light = |error: DesignError| match error {
        DesignError::NoLight { field_deg, lost } => {
            let of_corner = || lost.map(|_| "try a smaller --corner-mm".to_owned());
            let hint = beyond(field_deg).or_else(of_corner).unwrap_or_else(|| of_grid.clone());
            JobError::input(error.to_string(), hint)
        }
        DesignError::NoWaves(_) => {
            JobError::input(format!("{}: {error}", request.lens), "take rays: --kind geometric")
        }
        // Here the corner is an option, and the hint of the error is for sensors.
        DesignError::OutsideTheImage { .. } => {
            let said = error.to_string();
            let (reason, of_sensor) = reason_and_hint(&said);
            JobError::input(reason, beyond(f64::INFINITY).unwrap_or_else(|| of_sensor.to_owned()))
        }
        other => other.into(),
    };
    let (plan, error) = plan.converged(lens, request.pupil_error, context.cancel()).map_err(no_light)?;
    if error > request.pupil_error {
        context.warning(WarningKind::PsfError, format!(
            "PSFs on {} pupil cells a side have an error of {error:.3} (L1); larger cells of the PSF have less",
            plan.quadrature.cells
        ));
    }
    let psfs = plan.psfs(lens, context.cancel()).map_err(no_light)?;
    warn_of_lost_light(request, lens, &psfs, context);
    let axes = Axes {
        lens: lens.name.clone(),
        kind: Some(request.kind.into()),
        chief_ray_x_mm: psfs.iter().map(|p| p.chief_x_mm).collect(),
        chief_ray_y_mm: psfs.iter().map(|p| p.chief_y_mm).collect(),
        field_deg: psfs.iter().map(|p| p.field_rad.to_degrees()).collect(),
        image_scale_mm: psfs.last().and_then(|p| scale_of_bank_mm(lens, p.field_rad)),
        channels: Channel::RGB.to_vec(),
        wavelengths_um: plan.wavelengths_um.to_vec(),
        captured: psfs.iter().map(|p| p.captured.clone()).collect(),
        pupil_cells: Some(plan.quadrature.cells),
        pupil_error: Some(error),
        method: psfs.iter().map(|p| p.method.clone()).collect(),
        ..Axes::new(request.pitch_um, plan.landing_radii_mm(lens, &psfs))
            .symmetric(lens.is_rotationally_symmetric())
    };
    Ok(Bank { psfs, plan, axes })
}

/// Keeps a bank as the files of `psf` in a folder; returns their paths.
pub fn keep(bank: &Bank, folder: &Path) -> Result<Vec<PathBuf>> {
    make_folder(folder)?;
    let sheet = folder.join(SHEET);
    write_file(&sheet, psf_sheet(&bank.psfs, &bank.plan.options, bank.plan.wavelengths_um))?;
    let [psf, light, text] = write_psfs(&bank.file(), folder, FloatType::Float64)?;
    Ok(vec![psf, light, sheet, text])
}

/// Each PSF has unit sum, however much of its light the grid holds: warns where the grid does not hold nearly all.
fn warn_of_lost_light(request: &Request, lens: &Lens, psfs: &[FieldPsf], context: &Context) {
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
        let name = request.lens.to_string();
        if let Some(elsewhere) = focus_elsewhere(&name, lens) {
            context.warning(WarningKind::OutOfFocus, format!("{name}: {elsewhere}"));
        }
    }
}
