//! The finished cameras of a run, for pictures and raw frames in memory.

use std::path::Path;

use petzval_camera::image::LinearImage;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Noise, NoiseMode, SensorModel};
use petzval_design::camera::{Camera, Labels, Shot};
use petzval_design::inputs::{SetupFor, check_parts_or_accepted, setup_of_run};
use petzval_design::run::{DigestCheck, RunFolder, RunRecord};
use petzval_design::setup::Setup;
use petzval_design::task::Drawn;
use petzval_files::raw_file::{RawFrame, load_raw, sidecar_path};

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::evaluate::camera_of;
use crate::event::WarningKind;
use crate::given_psfs;
use crate::noted_pictures::NotedPictures;
use crate::pixels::{check_numbers, check_picture};
use crate::run_page::warn_of_changed_config;
use crate::simulate::Place;

/// Finished cameras of a run. They take photographs and develop raw frames in memory, and write nothing.
pub struct Cameras {
    names: Vec<String>,
    cameras: Vec<Camera>,
    setup: Setup,
}

/// How a photograph is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taking {
    /// How it lands on the sensor.
    pub place: Place,
    /// Seed of the noise.
    pub seed: u64,
    /// Number of the frame: frames of one seed and other numbers have other noise.
    pub frame: u64,
}

impl Default for Taking {
    fn default() -> Self {
        Self { place: Place::default(), seed: crate::usual::seed(), frame: 0 }
    }
}

/// A finished picture as values: what `apply` keeps as files.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// The picture, three planes, sRGB-encoded, 0 to 1.
    pub picture: LinearImage,
    /// The picture with what the network reads in it, such as boxes or classes, in the same form. A task without such a network shows the
    /// picture alone.
    pub shown: LinearImage,
    /// Files that say what the network reads: the name, such as `classes.png`, and the content.
    pub read: Vec<(&'static str, Vec<u8>)>,
}

/// Cameras of a run by name, which are known to be finished and not yet made.
pub(super) struct Chosen {
    /// The names, in the order of the request or of the experiment.
    pub names: Vec<String>,
    /// What they are made with.
    pub setup: Setup,
    folder: RunFolder,
}

impl Cameras {
    /// Opens cameras of the run in a folder, all that are finished if `names` is empty. `device` is where tensors live. `accept_changed`
    /// names files or folders of the run, by their path below it, that may differ from their digests.
    pub fn open(
        run: &Path,
        names: &[String],
        device: &str,
        accept_changed: &[String],
        context: &Context,
    ) -> Result<Self> {
        Chosen::new(run, names, device, accept_changed, context)?.cameras()
    }

    /// Names of the cameras, in the order in which they were named or designed.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The sensor of all cameras: a photograph covers it, a raw frame has its colour filters, bits and black level.
    pub fn sensor(&self) -> &SensorModel {
        &self.setup.body.sensor
    }

    /// A photograph as it lies on the sensor, in linear light.
    pub fn laid(&self, photo: &LinearImage, place: Place) -> Result<LinearImage> {
        check_picture(photo, "the photograph")?;
        let sensor = self.sensor();
        Ok(place.lay(photo, (sensor.height, sensor.width)))
    }

    /// A photograph, three planes of linear light where 1 is white, through lens, sensor, development and network of a camera.
    pub fn take(&self, camera: &str, photo: &LinearImage, taking: Taking) -> Result<Finished> {
        let camera = self.camera(camera)?;
        self.take_laid(camera, &self.laid(photo, taking.place)?, taking)
    }

    /// A photograph that lies on the sensor already.
    pub(super) fn take_laid(&self, camera: &Camera, photo: &LinearImage, taking: Taking) -> Result<Finished> {
        self.read(camera, taken(camera, photo, taking.seed, taking.frame)?)
    }

    /// A raw frame of the sensor, or a smaller one from its middle, through development and network of a camera. What the frame states of
    /// filters, bits and black level must be that of the sensor.
    pub fn develop(&self, camera: &str, frame: &RawFrame) -> Result<Finished> {
        let camera = self.camera(camera)?;
        camera.check_sees_frames()?;
        check_raw(frame, self.sensor(), "the raw frame")?;
        self.develop_checked(camera, frame)
    }

    /// A raw frame that fits the sensor.
    pub(super) fn develop_checked(&self, camera: &Camera, frame: &RawFrame) -> Result<Finished> {
        self.read(camera, developed(camera, frame)?)
    }

    /// The cameras with their names.
    pub(super) fn each(&self) -> impl Iterator<Item = (&str, &Camera)> {
        self.names.iter().map(String::as_str).zip(&self.cameras)
    }

    /// Refuses cameras whose network sees the truth, which a raw frame does not contain.
    pub(super) fn check_see_frames(&self) -> Result<()> {
        Ok(self.cameras.iter().try_for_each(Camera::check_sees_frames)?)
    }

    fn camera(&self, name: &str) -> Result<&Camera> {
        let at = self.names.iter().position(|own| own == name);
        let camera = at.and_then(|at| self.cameras.get(at));
        camera.ok_or_else(|| {
            let hint = format!("the opened cameras are {}", self.names.join(", "));
            JobError::setting("camera", name, "no camera of this name was opened", hint)
        })
    }

    /// A finished picture with what the network of its camera reads in it.
    fn read(&self, camera: &Camera, picture: LinearImage) -> Result<Finished> {
        let Drawn { shown, files } = self.setup.task.drawn(camera, picture.clone())?;
        let read = self.setup.task.read_files().iter().copied().zip(files).collect();
        Ok(Finished { picture, shown, read })
    }
}

impl Chosen {
    /// Chooses finished cameras of a run, all of them if none are named, and checks that their files and the inputs are those of the run.
    pub(super) fn new(
        run: &Path,
        names: &[String],
        device: &str,
        accept_changed: &[String],
        context: &Context,
    ) -> Result<Self> {
        let folder = RunFolder::open(run)?;
        warn_of_changed_config(&folder, context)?;
        let experiment = context.assets.experiment_of_run(&folder)?;
        let all: Vec<String> = experiment.variants().iter().map(|variant| variant.name.clone()).collect();
        let names = chosen(names, &folder, &all)?;
        let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
        let check = DigestCheck::of_request(&folder, accept_changed, &warn)?;
        check.check_cameras(names.iter().map(String::as_str))?;
        let device = context.device(device)?;
        let setup = setup_of_run(&folder, experiment, &context.assets, device, SetupFor::Cameras)?;
        check_parts_or_accepted(&setup, &folder, &check)?;
        Ok(Self { names, setup, folder })
    }

    /// The same cameras with the PSFs of a file in place of those of their lenses.
    pub(super) fn with_psfs(self, path: &Path) -> Result<Self> {
        Ok(Self { setup: self.setup.having_psfs(given_psfs::bank(path)?)?, ..self })
    }

    /// Makes the cameras from the files of the run.
    pub(super) fn cameras(self) -> Result<Cameras> {
        let Self { names, setup, folder } = self;
        let made = |name: &String| {
            setup.cancel.check()?;
            camera_of(&setup, &folder, name)
        };
        let cameras = names.iter().map(made).collect::<Result<Vec<_>, _>>()?;
        Ok(Cameras { names, cameras, setup })
    }
}

/// The cameras of these names, which must be finished; all finished ones if none is named.
fn chosen(names: &[String], folder: &RunFolder, all: &[String]) -> Result<Vec<String>> {
    let finished = folder.finished(all.iter().map(String::as_str));
    if finished.is_empty() {
        return Err(none_finished(folder));
    }
    if names.is_empty() {
        return Ok(finished.iter().map(|name| (*name).to_owned()).collect());
    }
    match names.iter().find(|name| !finished.contains(&name.as_str())) {
        Some(missing) => {
            let message = "there is no finished camera of this name";
            Err(JobError::setting("camera", missing, message, format!("the run has {}", finished.join(", "))))
        }
        None => Ok(names.to_vec()),
    }
}

/// The error where a run has no camera: because none is finished, or because the folders of a finished run are missing.
pub(crate) fn none_finished(folder: &RunFolder) -> JobError {
    let run = folder.root().display();
    let record = RunRecord::read(folder).ok().flatten();
    if folder.metrics().is_file() || record.is_some_and(|record| record.finished.is_some()) {
        return JobError::input(
            format!("{run}: the run is finished, and the folders of its cameras are missing"),
            "put the folder `cameras` back from a copy of the run, or make the run again",
        );
    }
    JobError::input(
        format!("{run}: no camera of this run is finished"),
        format!("go on with it: `petzval design --resume {run}`"),
    )
}

/// Whether a file holds a raw frame: a DNG file, or one with a sidecar.
pub(crate) fn is_raw(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("dng")) || sidecar_path(path).is_file()
}

/// Reads a raw frame that fits a sensor, and notes an orientation: cameras take pictures as they are stored.
pub(crate) fn raw_frame(path: &Path, sensor: &SensorModel, pictures: &NotedPictures<'_>) -> Result<RawFrame> {
    let frame = load_raw(path)?;
    check_raw(&frame, sensor, &path.display().to_string())?;
    if let Some(exif) = frame.info.orientation.filter(|exif| *exif > 1) {
        pictures.note(path, format!("its orientation is {exif}, and its picture is as the frame is stored"));
    }
    Ok(frame)
}

/// Refuses a raw frame that a sensor did not take. `name` is what errors call it.
fn check_raw(frame: &RawFrame, sensor: &SensorModel, name: &str) -> Result<()> {
    let wrong = |what: String| {
        let hint = "a camera develops frames of its own sensor; `raw show` says what a file holds";
        Err(JobError::input(format!("{name}: {what}"), hint))
    };
    if frame.height > sensor.height || frame.width > sensor.width {
        let (frame, whole) = ([frame.width, frame.height], [sensor.width, sensor.height]);
        return wrong(format!(
            "{} x {} pixels, the sensor has {} x {}",
            frame[0], frame[1], whole[0], whole[1]
        ));
    }
    check_numbers(frame, name)?;
    let Placement { row, col } = centred(sensor.height, sensor.width, frame);
    let cfa = sensor.cfa.starting_at(row, col);
    if frame.info.cfa.is_some_and(|found| found != cfa) {
        return wrong(format!("its colour filters are not {cfa}, those of the sensor {}", sensor.name));
    }
    if frame.info.bits.is_some_and(|bits| bits != sensor.bits) {
        return wrong(format!("it does not have the {} bits of the sensor {}", sensor.bits, sensor.name));
    }
    match frame.info.black_level_dn.filter(|black| (black - sensor.black_level_dn).abs() > 0.5) {
        Some(black) => {
            wrong(format!("black level {black} DN, the sensor {} has {}", sensor.name, sensor.black_level_dn))
        }
        None => Ok(()),
    }
}

/// Where a frame smaller than the sensor lies on it: in the middle, from the first pixel of a tile of colour filters.
fn centred(height: usize, width: usize, frame: &RawFrame) -> Placement {
    Placement { row: (height - frame.height) / 4 * 2, col: (width - frame.width) / 4 * 2 }
}

/// A photograph of the size of the sensor through lens, sensor, development and network.
pub(crate) fn taken(camera: &Camera, photo: &LinearImage, seed: u64, frame: u64) -> Result<LinearImage> {
    let mut scene = photo.pad_replicate(camera.border());
    // A photograph is exposed for as long behind every lens; where cameras of streets have the same time, a brighter lens shows.
    if camera.body().same_time.is_some_and(|same| !same.is_normalised) {
        scene.data.iter_mut().for_each(|v| *v *= camera.light() as f32);
    }
    let shot = Shot {
        scene,
        placement: Placement { row: 0, col: 0 },
        kept: None,
        frame,
        labels: Labels::default(),
        follows_light: true,
    };
    Ok(camera.finished(shot, &Noise { mode: NoiseMode::Exact, seed })?)
}

/// A raw frame through development and network.
pub(crate) fn developed(camera: &Camera, frame: &RawFrame) -> Result<LinearImage> {
    let body = camera.body();
    let placement = centred(body.sensor.height, body.sensor.width, frame);
    let capture = Capture { exposure: body.exposure, placement, frame: 0 };
    let dn = frame.dn.iter().map(|dn| f32::from(*dn)).collect();
    Ok(camera.finished_raw(dn, [frame.height, frame.width], capture)?)
}
