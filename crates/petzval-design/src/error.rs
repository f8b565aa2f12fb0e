//! What can stop a design.

use std::path::{Path, PathBuf};

use petzval_base::{Cancelled, FileError, InFile, IoError};
use petzval_camera::image::ShapeError;
use petzval_camera::isp::IspError;
use petzval_camera::render::RenderError;
use petzval_camera::sensor::SensorError;
use petzval_files::psf_file::PsfFileError;
use petzval_learn::dataset::DatasetError;
use petzval_learn::guest::GuestError;
use petzval_learn::loss::LossError;
use petzval_optics::lens::Lens;
use petzval_optics::pupil::{LostRay, where_lost};
use petzval_optics::wave::NoWaves;

/// A setting that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{setting}: {message}{}", if hint.is_empty() { String::new() } else { format!("; hint: {hint}") })]
pub struct WrongSetting {
    /// The setting as `key=value`, or several of them with commas between.
    pub setting: String,
    /// What is wrong.
    pub message: String,
    /// What to write instead; may be empty.
    pub hint: String,
}

/// Why no light may lie on the grid of a PSF although the ray through the middle of the stop reaches the image.
const OFF_THE_GRID: &str = " within the PSF's grid: rays miss a surface, are vignetted, or land further from the chief ray than the grid reaches \
     (is the image in focus?); by diffraction also: rays of the stop are lost, the wavefront is too rough, or grid and spot together are too \
     wide (psf.kind = \"geometric\" takes rays)";

/// What was made, or why it could not be.
pub type Result<T, E = DesignError> = std::result::Result<T, E>;

/// Why a design, a score or a report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// A file has content that cannot be used.
    #[error("{}: {error}", path.display())]
    Input {
        /// The file, or the name of the built-in one.
        path: PathBuf,
        /// What is wrong, where, and what to write instead.
        error: Box<FileError>,
    },
    /// A setting that takes the place of a value of the experiment cannot be used.
    #[error(transparent)]
    Setting(#[from] WrongSetting),
    /// A name that is neither built in nor a file.
    #[error("no {kind} called `{name}`: neither a file nor one of the built-in ones ({known}){}",
        near.as_ref().map(|n| format!("; did you mean `{n}`?")).unwrap_or_default())]
    Unknown {
        /// What was looked for: lens, sensor, experiment.
        kind: &'static str,
        /// The name or path given.
        name: String,
        /// The built-in name that is most like it.
        near: Option<String>,
        /// Built-in names.
        known: String,
    },
    /// A file could not be read or written.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        error: std::io::Error,
    },
    /// A street that cannot be seen.
    #[error("the streets: {0}")]
    Street(#[from] petzval_street::StreetError),
    /// A lens whose light does not reach the PSF's grid.
    #[error(
        "no light reaches the image at {field_deg:.2} degrees{}",
        lost.map_or_else(|| OFF_THE_GRID.to_owned(), |lost| format!(": {lost}"))
    )]
    NoLight {
        /// Field angle, degrees.
        field_deg: f64,
        /// Where its ray through the middle of the stop is lost, if it is.
        lost: Option<LostRay>,
    },
    /// PSFs by waves of a lens that has none.
    #[error("{0}")]
    NoWaves(NoWaves),
    /// A place of the sensor on which no chief ray lands.
    #[error(
        "no chief ray lands {radius_mm:.3} mm from the axis: the image of this lens ends before, the lens is out of focus, or it is afocal; hint: \
         take a smaller sensor or another lens"
    )]
    OutsideTheImage {
        /// Distance from the axis, mm.
        radius_mm: f64,
    },
    /// The lens sees further than a picture without distortion reaches.
    #[error(
        "the lens images fields to {field_deg:.1} degrees, and a rectilinear picture of a scene ends before 90 degrees; hint: leave \
         distortion out, so that the picture lies on the image as it is"
    )]
    TooWideForAPicture {
        /// The widest field, degrees.
        field_deg: f64,
    },
    /// What is wrong in some bands of the spectrum only.
    #[error("in the bands at {} um: {error}", um.iter().map(f64::to_string).collect::<Vec<_>>().join(", "))]
    InBands {
        /// Wavelengths of the bands, um.
        um: Vec<f64>,
        /// What is wrong.
        error: Box<DesignError>,
    },
    /// The lens is not rotationally symmetric.
    #[error(
        "the lens `{0}` is not rotationally symmetric: the renderer turns the PSFs of one azimuth about the axis, and so cannot \
         take it (`petzval simulate` takes photographs in three colours through it; `petzval psf` shows the PSFs of its y-z plane)"
    )]
    NotSymmetric(String),
    /// A design space in which hardly a lens has light.
    #[error(
        "none of {draws} random lenses within the bounds keeps {percent} % of its light on the PSF's grid; hint: raise psf.pitch_um, or narrow \
         the bounds of the variables"
    )]
    NoLensInBounds {
        /// Lenses that were drawn.
        draws: usize,
        /// The required share, %.
        percent: f64,
    },
    /// The lens file has no variables, and the lens no curved surface.
    #[error(
        "the lens `{0}` has no variables, and no curved surface that could be one: add [[variable]] entries with bounds to its file"
    )]
    NothingToMove(String),
    /// Variables or solves that do not fit the lens.
    #[error(transparent)]
    Space(#[from] petzval_optics::design_space::DesignSpaceError),
    /// A pupil that cannot be sampled.
    #[error(transparent)]
    Pupil(#[from] petzval_optics::pupil::QuadratureError),
    /// Rendering failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Exposure failed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] petzval_files::ImageError),
    /// A spectral image could not be read or written.
    #[error(transparent)]
    SpectralFile(#[from] petzval_files::spectral_file::SpectralFileError),
    /// There is no such light.
    #[error(transparent)]
    Illuminant(#[from] petzval_camera::spectral::IlluminantError),
    /// Light and sensor give no number of electrons.
    #[error(transparent)]
    Electrons(#[from] petzval_camera::spectral::ElectronsError),
    /// The pictures do not make a data set.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The loss could not be computed.
    #[error(transparent)]
    Loss(#[from] LossError),
    /// A score could not be computed.
    #[error(transparent)]
    Score(#[from] petzval_learn::score::ScoreError),
    /// The network could not be made.
    #[error(transparent)]
    Network(#[from] petzval_learn::network::NetworkError),
    /// A network or a loss of a user could not be made, or did not do its work.
    #[error(transparent)]
    Guest(#[from] GuestError),
    /// A raw frame could not be developed.
    #[error(transparent)]
    Isp(#[from] IspError),
    /// The experiment names a score that does not exist.
    #[error("scoring.scores: there is no score called `{name}`; there are {known}")]
    UnknownScore {
        /// The name.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A tensor could not be brought back from the device.
    #[error("reading a result back from the device failed: {0}")]
    Device(String),
    /// A window that does not lie within its picture.
    #[error(transparent)]
    Window(#[from] ShapeError),
    /// A camera whose lens is not known cannot be scored or moved.
    #[error(
        "the camera's PSFs come from a file: there is no lens that could move; hint: name a lens in place of the file"
    )]
    NoLens,
    /// The detector of the camera sees the scene itself.
    #[error(
        "the detector of this camera sees the scene without blur and noise, which a raw frame does not contain; hint: name another camera"
    )]
    NoTruth,
    /// Windows are needed where none were loaded.
    #[error("no pictures were loaded for this experiment; this is a defect of the program")]
    NoWindows,
    /// The labels of a window, or what reads a picture, are those of another task.
    #[error("the camera and its windows are of another task; this is a defect of the task")]
    OtherTask,
    /// The tape has no gradient where a block needs one.
    #[error("{0} have no gradient; this is a defect of the program or of the device")]
    NoGradient(&'static str),
    /// What a camera gives is no finite number.
    #[error(
        "{0} is no number everywhere, and so has no score; hint: its network or its lens is damaged, or went astray in training"
    )]
    NotFinite(String),
    /// A loss that is no number, or has grown beyond all that training can bring back.
    #[error("{camera}, {block}, step {step}: the loss diverges, it is {value:.4}{}{hint}",
        first.map(|first| format!(" after {first:.4} at the first step of the stage")).unwrap_or_default())]
    Diverged {
        /// Camera.
        camera: String,
        /// Block.
        block: &'static str,
        /// Step of the run.
        step: u64,
        /// The loss.
        value: f64,
        /// That of the first step of the block in this stage, where the loss is a number.
        first: Option<f64>,
        /// What to try.
        hint: &'static str,
    },
    /// A run that went astray.
    #[error("{error}; {}; hint: {}", last_good_in_words(*last_good), what_to_try(*rate, config))]
    Astray {
        /// What happened.
        error: Box<DesignError>,
        /// Step of the last checkpoint; none before the first.
        last_good: Option<u64>,
        /// The block that moved, and its first learning rate in the stage.
        rate: Option<(&'static str, f64)>,
        /// The experiment of the run.
        config: PathBuf,
    },
    /// A lens that moved to where it cannot be made.
    #[error("{camera}: {defect}; hint: raise the weight of the constraints")]
    Unmakeable {
        /// Camera.
        camera: String,
        /// Which surface, which quantity.
        defect: petzval_optics::lens::LensDefect,
    },
    /// A lens that moved to where no light comes through.
    #[error(
        "{camera}, step {step}: the lens lost its light at {field_deg:.2} degrees{}",
        lost.map_or_else(String::new, |lost| format!(": {lost}"))
    )]
    LostLight {
        /// Camera.
        camera: String,
        /// Step of the run.
        step: u64,
        /// Field angle, degrees.
        field_deg: f64,
        /// Where its ray through the middle of the stop is lost, if it is.
        lost: Option<LostRay>,
    },
    /// A lens that moved to where its image no longer fills the sensor.
    #[error("{camera}, step {step}: no chief ray of the lens lands {radius_mm:.3} mm from the axis any more")]
    LostImage {
        /// Camera.
        camera: String,
        /// Step of the run.
        step: u64,
        /// Distance from the axis, mm.
        radius_mm: f64,
    },
    /// A step, or the scoring of a camera, was stopped before its end, because the job was cancelled; it is lost.
    #[error("stopped before its end")]
    Stopped(#[from] Cancelled),
    /// A value that cannot be written as text.
    #[error("{what} cannot be written: {problem}")]
    Unwritable {
        /// What was to be written.
        what: &'static str,
        /// Why not.
        problem: String,
    },
    /// A run folder that cannot be resumed or reported.
    #[error("{}: {problem}", path.display())]
    Run {
        /// The folder or file in it.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

/// From where a run that went astray was still good.
fn last_good_in_words(step: Option<u64>) -> String {
    match step {
        Some(step) => format!("the last good checkpoint is that of step {step}"),
        None => "there was no checkpoint yet".to_owned(),
    }
}

/// What may keep a run from going astray again.
fn what_to_try(rate: Option<(&'static str, f64)>, config: &Path) -> String {
    let config = config.display();
    let lower = match rate {
        Some((block, rate)) => format!(
            "lower the learning rate of the {block} in a copy of {config}, now {rate} at its start, to a third of it, or raise training.batch"
        ),
        None => format!("narrow the bounds of the lens in a copy of {config}"),
    };
    format!("{lower}, and begin another run; resumed, this one would take the same steps again")
}

impl From<PsfFileError> for DesignError {
    fn from(error: PsfFileError) -> Self {
        match error {
            PsfFileError::File(InFile { path, error }) => Self::Input { path, error },
            PsfFileError::Io(IoError { path, source: error }) => Self::Io { path, error },
        }
    }
}

impl DesignError {
    /// Whether a file of a run is unreadable, changed, or does not fit the rest of the run.
    pub fn is_damage(&self) -> bool {
        matches!(self, Self::Run { .. } | Self::Input { .. } | Self::Io { .. } | Self::Network(_))
    }

    /// Whether the work was cancelled, which is nobody's fault.
    pub fn is_stopped(&self) -> bool {
        match self {
            Self::InBands { error, .. } => error.is_stopped(),
            other => matches!(
                other,
                Self::Stopped(_)
                    | Self::Isp(IspError::Stopped(_))
                    | Self::Guest(GuestError::Stopped(_))
                    | Self::Dataset(DatasetError::Stopped(_))
                    | Self::Loss(LossError::Stopped(_))
                    | Self::Render(RenderError::Stopped(_))
            ),
        }
    }

    /// Whether the user's input is at fault, rather than the job.
    pub fn is_input(&self) -> bool {
        if let Self::InBands { error, .. } = self {
            return error.is_input();
        }
        if self.is_stopped() {
            return false;
        }
        matches!(
            self,
            Self::Input { .. }
                | Self::Setting(_)
                | Self::Unknown { .. }
                | Self::UnknownScore { .. }
                | Self::NothingToMove(_)
                | Self::Guest(GuestError::Unusable { .. })
                | Self::NotSymmetric(_)
                | Self::Space(_)
                | Self::Pupil(_)
                | Self::Sensor(
                    SensorError::GainStep { .. }
                        | SensorError::Exposure { .. }
                        | SensorError::UnseenColour { .. }
                )
                | Self::Dataset(_)
                | Self::Image(_)
                | Self::SpectralFile(_)
                | Self::Illuminant(_)
                | Self::Electrons(_)
                | Self::NoLight { .. }
                | Self::NoWaves(_)
                | Self::TooWideForAPicture { .. }
                | Self::OutsideTheImage { .. }
                | Self::NoTruth
                | Self::Run { .. }
        )
    }

    /// No light of a field, rad, reaches the image of a lens. Light was looked for at `wavelengths_um`, um; chief rays alone have the reference
    /// wavelength, and need none.
    pub fn no_light(lens: &Lens, field_rad: f64, wavelengths_um: &[f64]) -> Self {
        Self::NoLight { field_deg: field_rad.to_degrees(), lost: where_lost(lens, field_rad, wavelengths_um) }
    }

    /// A value as JSON text.
    pub(crate) fn json(what: &'static str, value: &impl serde::Serialize) -> Result<String, Self> {
        serde_json::to_string_pretty(value).map_err(|e| Self::Unwritable { what, problem: e.to_string() })
    }

    /// Input that is well-formed and does not fit the rest.
    pub fn misfit(path: &Path, message: &dyn std::fmt::Display, hint: &str) -> Self {
        Self::input(path)(FileError {
            line: None,
            column: None,
            key: String::new(),
            value: String::new(),
            message: message.to_string(),
            hint: Some(hint.to_owned()),
        })
    }

    /// An error in a file.
    pub fn input(path: &Path) -> impl FnOnce(FileError) -> Self {
        let path = path.to_path_buf();
        move |error| Self::Input { path, error: Box::new(error) }
    }

    /// An I/O error about a path.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_path_buf();
        move |error| Self::Io { path, error }
    }
}
