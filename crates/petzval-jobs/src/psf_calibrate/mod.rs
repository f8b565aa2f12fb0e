//! `psf-calibrate`: PSFs measured from captures of a pinhole.

mod figures;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use petzval_base::{FileError, InFile, IoError};
use petzval_camera::image::CHANNELS;
use petzval_camera::psf::PsfBank;
use petzval_camera::sensor::SensorModel;
use petzval_design::assets::Assets;
use petzval_design::error::DesignError;
use petzval_design::library::Library;
use petzval_design::path_text::path_text;
use petzval_files::psf_file::{AXES_FILE, Channel, PsfAxes, PsfFile, PsfOrigin, write_psfs};
use petzval_files::{FloatType, npy_bytes};
use petzval_lab::psf_calibration::compare::{Comparison, compare};
use petzval_lab::psf_calibration::estimate::{FieldEstimate, Place, SAME_FIELD_MM, estimate_bank};
use petzval_lab::psf_calibration::measure::check_mosaic;
use petzval_lab::psf_calibration::{
    CROP, CalibratedPosition, Manifest, PsfCalibrationError, calibrate_position, read_manifest,
};
use petzval_report::psf_calibration_sheet::{Calibration, page, sheet_png};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, json, make_folder, write_file};
use crate::event::WarningKind;
use crate::frames::Frames;
use crate::input::LensInput;
use crate::pinhole::{PinholeView, Refocus};
use crate::results::check_folder;

pub use figures::{
    AgreementFigures, BankFigures, ExposureFigures, FieldFigures, Figures, HeldOutFigures, NoiseFloor,
    PositionFigures, Simulated,
};
pub use petzval_lab::psf_calibration::held_out::HeldOutBy;

petzval_base::parameters! {
    /// Captures of a pinhole from which to measure PSFs.
    ///
    /// Files: `calibration.json`, all figures; `psf-calibration.html`, a page to look at; `psf-calibration.png`, all PSFs on a
    /// sheet; `measured.npy`, float64 `[position, channel, row, column]`; `psf.json`, `psf.npy` (float32) and `illumination.npy`, the bank of PSFs,
    /// which `simulate`, `apply`, `evaluate` and experiments take.
    pub struct Request {
        /// Folder of captures, with `captures.toml`.
        captures: PathBuf = PathBuf::new();
        /// Lens to compare with, if any: a built-in name, the path of a file, or the lens itself.
        lens: Option<LensInput> = None;
        /// Folder for the results; `psf-calibration` in the folder of captures if it is not given.
        out: Option<PathBuf> = None;
        /// Seed of the draws behind the noise floor.
        seed: u64 = crate::usual::seed();
    }
}

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Folder of the results.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub out: PathBuf,
    /// The figures, as in `calibration.json`.
    pub figures: Figures,
}

impl From<PsfCalibrationError> for JobError {
    fn from(error: PsfCalibrationError) -> Self {
        match error {
            PsfCalibrationError::File(InFile { path, error }) => Self::File { path, error },
            PsfCalibrationError::Stopped(cancelled) => cancelled.into(),
            PsfCalibrationError::Frame(error) => error.into(),
            PsfCalibrationError::Io(error) if error.source.kind() == ErrorKind::NotFound => Self::input(
                error.to_string(),
                "a folder of captures holds captures.toml and the frames it names; `petzval psf-capture` makes one",
            ),
            PsfCalibrationError::Io(IoError { path, source }) => DesignError::io(&path)(source).into(),
            other => Self::input(other.to_string(), ""),
        }
    }
}

/// PSFs that were measured, as values: what `psf-calibrate` keeps as files.
pub struct Measurement {
    /// The PSFs for the renderer, field by field from the axis.
    pub bank: PsfBank,
    /// The figures, as in `calibration.json`.
    pub figures: Figures,
    calibration: Calibration,
}

impl Measurement {
    /// The bank as its files hold it.
    pub fn file(&self) -> PsfFile {
        let PsfBank { field_radius_mm, grid, pitch_um, values, illumination } = &self.bank;
        PsfFile {
            axes: PsfAxes {
                source: format!("measured: {}", self.calibration.captures),
                kind: Some(PsfOrigin::Measured),
                channels: Channel::RGB.to_vec(),
                ..PsfAxes::new(*pitch_um, field_radius_mm.clone())
            },
            shape: [field_radius_mm.len(), CHANNELS, *grid, *grid],
            values: values.iter().map(|value| f64::from(*value)).collect(),
            illumination: illumination.iter().map(|light| f64::from(*light)).collect(),
        }
    }

    /// Pixels a side of a measured PSF.
    pub const CROP: usize = CROP;

    /// The measured positions, in the order of the manifest.
    pub fn positions(&self) -> impl Iterator<Item = &CalibratedPosition> {
        self.calibration.positions.iter().map(|(position, _)| position)
    }

    /// The measured PSFs, `[position, channel, row, column]` with [`Self::CROP`] rows and columns, each of unit sum.
    pub fn values(&self) -> Vec<f64> {
        self.positions().flat_map(|position| position.measured.psf.values.iter().flatten().copied()).collect()
    }
}

/// Measures every position and fits the bank; writes nothing.
pub fn measurement(request: &Request, context: &Context) -> Result<Measurement> {
    Captured::read(request)?.measured(request, context)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit::seeded(
    |request, seed| request.seed = seed,
    |request, folder| request.out = Some(folder.to_owned()),
);

/// Measures every position, fits the bank, and writes the results.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let captured = Captured::read(request)?;
    let out = request.out.clone().unwrap_or_else(|| request.captures.join("psf-calibration"));
    check_folder(
        &out,
        ["calibration.json", "psf-calibration.png", "psf-calibration.html", AXES_FILE],
        context,
    )?;
    let measurement = captured.measured(request, context)?;
    keep(&measurement, &out, context)?;
    Ok(Response { out, figures: measurement.figures })
}

/// The list of captures of a folder.
struct Captured {
    manifest: Manifest,
    /// Its text, for the places of errors.
    text: String,
    path: PathBuf,
}

impl Captured {
    fn read(request: &Request) -> Result<Self> {
        let folder = &request.captures;
        let (manifest, text, path) = read_manifest(folder).map_err(described_in(folder))?;
        Ok(Self { manifest, text, path })
    }

    fn measured(&self, request: &Request, context: &Context) -> Result<Measurement> {
        let Self { manifest, text, path } = self;
        let folder = &request.captures;
        let sensor = sensor(manifest, text, path, &context.assets)?;
        check_mosaic(sensor.cfa).map_err(described_in(folder))?;
        let view =
            request.lens.as_ref().map(|lens| view(lens, manifest, &sensor, &context.assets)).transpose()?;
        let (positions, bank, fields) = measure(request, (manifest, text), &sensor, view.as_ref(), context)?;
        if manifest.source.camera_turned && manifest.source.image_scale_mm.is_none() {
            context.warning(WarningKind::Measurement, format!(
                "{}: the camera was turned, but `image_scale_mm` is not given: relative illumination lacks a factor cos^3",
                path.display()
            ));
        }
        let calibration = Calibration {
            captures: folder.display().to_string(),
            sensor: sensor.name.clone(),
            lens: request.lens.as_ref().map(LensInput::to_string),
            positions,
            fields,
        };
        let innermost_mm = calibration.fields.first().map(|field| field.field_radius_mm);
        if let Some(text) = innermost_mm.and_then(axis_note) {
            context.note(text);
        }
        warn(&calibration, context);
        let figures = Figures::new(&calibration, &bank, &sensor);
        Ok(Measurement { bank, figures, calibration })
    }
}

type Compared = (CalibratedPosition, Option<Comparison>);

/// Measures every position, compares it with the lens if there is one, and fits the bank to all.
fn measure(
    request: &Request,
    (manifest, text): (&Manifest, &str),
    sensor: &SensorModel,
    view: Option<&PinholeView>,
    context: &Context,
) -> Result<(Vec<Compared>, PsfBank, Vec<FieldEstimate>)> {
    let folder = &request.captures;
    let exposures = manifest.position.iter().flat_map(|p| &p.exposure);
    let progress =
        Frames::new(context, exposures.map(|e| e.frames.get_ref().len() + e.dark_frames.len()).sum());
    let mut positions: Vec<Compared> = Vec::new();
    for index in 0..manifest.position.len() {
        let name = manifest.position[index].name.get_ref();
        progress.now(name);
        let seed = request.seed.wrapping_add(index as u64);
        let position =
            calibrate_position((manifest, text), folder, index, sensor, seed, || progress.add(name))
                .map_err(described_in(folder))?;
        let comparison = match view {
            Some(view) => {
                let simulated = view.psf(position.field_radius_mm)?.psf;
                let compared = compare(
                    &position.measured,
                    &position.frame,
                    &simulated,
                    sensor.pixel_um,
                    position.azimuth_rad,
                    position.expected_px,
                    &position.name,
                );
                Some(compared.map_err(described_in(folder))?)
            }
            None => None,
        };
        positions.push((position, comparison));
    }
    // A turned camera lacks three of the four cosines in the illumination of a flat scene.
    let scale_mm = manifest.source.image_scale_mm.as_ref().map(|mm| *mm.get_ref());
    let light_factor = |radius_mm: f64| match (manifest.source.camera_turned, scale_mm) {
        (true, Some(scale)) => (radius_mm / scale).atan().cos().powi(3),
        _ => 1.0,
    };
    let places: Vec<Place> = positions
        .iter()
        .map(|(p, _)| Place {
            field_radius_mm: p.field_radius_mm,
            azimuth_rad: p.azimuth_rad,
            light_factor: light_factor(p.field_radius_mm),
            frame: &p.frame,
            merged: &p.merged,
            measured: &p.measured,
        })
        .collect();
    // Fitting the bank takes longer than reading the frames: it is a phase of its own.
    let fitted = |done: usize, fields: usize| {
        context.progress(done as u64, fields as u64, format!("fitting the bank: {done} of {fields} fields"));
        context.cancel().check()
    };
    let (bank, fields) = estimate_bank(&places, sensor.pixel_um, &fitted).map_err(described_in(folder))?;
    Ok((positions, bank, fields))
}

/// The sensor that the manifest names: a file beside it, or a built-in one.
fn sensor(manifest: &Manifest, text: &str, path: &Path, assets: &Assets) -> Result<SensorModel> {
    let beside = path.parent().unwrap_or(Path::new("")).join(&manifest.sensor);
    let name = if beside.is_file() { path_text(&beside)? } else { manifest.sensor.clone() };
    assets.sensor(&name).map_err(|error| match error {
        DesignError::Unknown { .. } => {
            let at = FileError::at_key(text, &["sensor"], error.to_string());
            let error = Box::new(at.hint("a built-in sensor, or a sensor file beside this one"));
            JobError::File { path: path.to_owned(), error }
        }
        other => other.into(),
    })
}

/// The lens, focused on the source according to the manifest.
fn view(
    lens: &LensInput,
    manifest: &Manifest,
    sensor: &SensorModel,
    assets: &Library,
) -> Result<PinholeView> {
    let lens = lens.read(assets)?.lens;
    let source = &manifest.source;
    let distance_mm = source.distance_mm.as_ref().map(|mm| *mm.get_ref());
    let refocus = source.refocus_mm.as_ref().map_or(Refocus::OnSource, |mm| Refocus::Mm(*mm.get_ref()));
    Ok(PinholeView::new(&lens, sensor, distance_mm, source.pinhole_um, source.camera_turned, refocus)?)
}

/// Turns an error about captures into one of the job; where the error has no hint, the hint names the folder.
fn described_in(folder: &Path) -> impl Fn(PsfCalibrationError) -> JobError {
    move |error| match JobError::from(error) {
        JobError::Input { message, hint, .. } if hint.is_empty() => {
            JobError::input(message, format!("the captures are described in {}", folder.display()))
        }
        other => other,
    }
}

/// What the bank has on the axis if no position lies there; `None` if one does. `innermost_mm`: radius of the innermost field, mm.
fn axis_note(innermost_mm: f64) -> Option<String> {
    (innermost_mm >= SAME_FIELD_MM).then(|| {
        format!(
            "no position lies on the axis: the bank has a copy of the innermost field, at {innermost_mm:.2} mm, for radius 0, and relative \
             illumination is 1 at that field; capture a position on the axis to have its own"
        )
    })
}

/// Reports the warnings of the positions, then those of the bank, field by field.
fn warn(calibration: &Calibration, context: &Context) {
    for (position, _) in &calibration.positions {
        for warning in position.warnings.iter().filter(|w| !w.starts_with("no dark frames")) {
            context.warning(WarningKind::Measurement, format!("{}: {warning}", position.name));
        }
    }
    let mut is_confirmed = true;
    for field in &calibration.fields {
        for warning in field.warnings() {
            context.warning(
                WarningKind::Measurement,
                format!("bank, {:.2} mm: {warning}", field.field_radius_mm),
            );
            is_confirmed = false;
        }
    }
    if !is_confirmed {
        context.warning(WarningKind::Measurement, limits(&calibration.fields));
    }
}

/// What the held-out figures of a bank say, and what they do not.
fn limits(fields: &[FieldEstimate]) -> String {
    let of = |by: HeldOutBy| fields.iter().filter(move |field| field.held_out.by == by);
    let worst = of(HeldOutBy::Positions)
        .flat_map(|field| field.held_out.score.map(|score| score.l1()))
        .fold(0.0, f64::max);
    let mut text = "the bank is a smooth estimate, not the PSF below a pixel. ".to_owned();
    let (several, single) = (of(HeldOutBy::Positions).count(), of(HeldOutBy::Pixels).count());
    if several > 0 {
        text += &format!(
            "Radii with several positions ({several}): each was predicted from the others with an L1 of {worst:.2} at most. "
        );
    }
    if single > 0 {
        text += &format!(
            "Radii with one position ({single}): the held-out L1 is that of its own pixels. It says nothing of other azimuths and sub-pixel \
             phases, where simulated captures were missed by ten times as much. "
        );
    }
    text + "hint: more positions of a radius, at other azimuths and phases, improve the bank and show its error"
}

/// Writes every file of the results into a folder.
pub fn keep(measurement: &Measurement, out: &Path, context: &Context) -> Result<()> {
    make_folder(out)?;
    let write = |name: &str, what: &str, bytes: &[u8]| -> Result<()> {
        let path = out.join(name);
        write_file(&path, bytes)?;
        context.wrote(path, what);
        Ok(())
    };
    let Measurement { figures, calibration, .. } = measurement;
    let shape = [calibration.positions.len() as u64, 3, CROP as u64, CROP as u64];
    let npy = npy_bytes(&shape, &measurement.values())
        .map_err(|e| JobError::failed(format!("measured.npy: {e}")))?;
    write("measured.npy", "PSFs", &npy)?;
    write("psf-calibration.png", "picture", &sheet_png(calibration))?;
    write("psf-calibration.html", "page", page(calibration).as_bytes())?;
    for path in write_psfs(&measurement.file(), out, FloatType::Float32)? {
        context.wrote(path, "PSFs");
    }
    write("calibration.json", "figures", json(figures)?.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bank_without_a_position_on_the_axis_is_noted() {
        assert_eq!(axis_note(0.0), None);
        assert_eq!(axis_note(0.049), None);
        let note = axis_note(1.25).unwrap();
        assert!(note.contains("copy of the innermost field, at 1.25 mm"), "{note}");
    }
}
