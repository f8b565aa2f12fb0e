//! `apply`: pictures of one's own, whole, through the cameras of a finished run: lens, sensor, development and network.

use std::path::{Path, PathBuf};
use std::time::Instant;

use petzval_camera::image::LinearImage;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Noise, NoiseMode, SensorModel};
use petzval_design::camera::{Camera, Labels, Shot};
use petzval_design::error::DesignError;
use petzval_design::experiment::SCENE;
use petzval_design::run::{DigestCheck, RunFolder};
use petzval_design::setup::Setup;
use petzval_design::task::Drawn;
use petzval_files::raw_file::{RawFrame, load_raw, sidecar_path};
use petzval_files::{encoded_png_bytes, load_image};
use petzval_report::side_by_side::{View, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, make_folder, write_file};
use crate::evaluate::camera_of;
use crate::event::WarningKind;
use crate::results::{check_distinct, check_folder};
use crate::run_page::warn_of_changed_config;

pub use crate::simulate::Place;

/// Pictures, and the cameras that take them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Folder of the run.
    pub run: PathBuf,
    /// Photographs, which the cameras take; and raw frames, which they develop: DNG files, and files with a sidecar.
    pub images: Vec<PathBuf>,
    /// Names of cameras of the run; all that are finished if empty.
    pub cameras: Vec<String>,
    /// How a photograph lands on the sensor.
    pub place: Place,
    /// Seed of the noise.
    pub seed: u64,
    /// Folder for the pictures.
    pub out: PathBuf,
    /// Where tensors live.
    pub device: String,
    /// Files or folders of the run, by their path below it, that may differ from their digests.
    pub accept_changed: Vec<String>,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            run: PathBuf::new(),
            images: Vec::new(),
            cameras: Vec::new(),
            place: Place::default(),
            seed: crate::usual::seed(),
            out: PathBuf::from("applied"),
            device: crate::usual::device(),
            accept_changed: Vec::new(),
        }
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Every picture through every camera.
    pub pictures: Vec<Applied>,
    /// For each photograph or raw frame the page that shows it by every camera; none where there would be nothing beside it.
    #[serde(default)]
    pub pages: Vec<PathBuf>,
}

/// A finished picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Applied {
    /// The photograph or raw frame.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub image: PathBuf,
    /// The camera.
    pub camera: String,
    /// The picture.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub picture: PathBuf,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// How long it took, s.
    pub seconds: f64,
}

/// What a camera is given.
enum Subject {
    /// A photograph that covers the sensor.
    Photo(LinearImage),
    /// A frame that a sensor took.
    Raw(Box<RawFrame>),
}

/// Takes the photographs and develops the raw frames. The folder `out` gets `NAME-CAMERA.png` for each, and `NAME-scene.png` of each
/// photograph as it lies on the sensor, and `NAME-side-by-side.html` with all of them. A task may add files, such as
/// `NAME-CAMERA-classes.png`.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let folder = RunFolder::open(&request.run)?;
    warn_of_changed_config(&folder, context)?;
    let experiment = context.assets.experiment_of_run(&folder)?;
    let all: Vec<String> = experiment.variants().iter().map(|variant| variant.name.clone()).collect();
    let names = chosen(request, &folder, &all)?;
    let stems = stems(&request.images)?;
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    let check = DigestCheck::new(&folder, &request.accept_changed, &warn);
    check.check_cameras(names.iter().map(String::as_str))?;

    // Cameras are made before pictures are read: a run that lacks one is found at once.
    let setup = Setup::without_windows(experiment, &context.assets, context.device(&request.device)?)?;
    let read_files = setup.task.read_files();
    let files: Vec<String> = stems.iter().flat_map(|stem| files_of(stem, &names, read_files)).collect();
    check_distinct(&files)?;
    check_folder(&request.out, &files, context)?;
    let cameras = names.iter().map(|name| camera_of(&setup, &folder, name)).collect::<Result<Vec<_>, _>>()?;
    if request.images.iter().any(|image| is_raw(image)) {
        cameras.iter().try_for_each(Camera::check_sees_frames)?;
    }
    let subjects = request
        .images
        .iter()
        .map(|path| subject(path, request.place, &setup))
        .collect::<Result<Vec<_>, _>>()?;

    make_folder(&request.out)?;
    let (mut pictures, mut pages) = (Vec::new(), Vec::new());
    let total = (subjects.len() * cameras.len()) as u64;
    for (i, ((image, stem), subject)) in request.images.iter().zip(&stems).zip(&subjects).enumerate() {
        let mut views = Vec::new();
        let mut show = |name: &str, picture: &LinearImage| {
            views.push(View::new(name, &picture.data, picture.height, picture.width));
        };
        if let Subject::Photo(photo) = subject {
            let encoded = LinearImage { data: photo.to_srgb(), ..photo.clone() };
            let path = request.out.join(format!("{stem}-{SCENE}.png"));
            write_png(&path, &encoded)?;
            context.wrote(path, "picture");
            show("the scene", &encoded);
        }
        for (name, camera) in names.iter().zip(&cameras) {
            context.check(|| format!("stopped after {} of {total} pictures", pictures.len()))?;
            context.progress(pictures.len() as u64, total, format!("{stem}, {name}"));
            let start = Instant::now();
            let finished = match subject {
                Subject::Photo(photo) => taken(camera, photo, request.seed, i as u64)?,
                Subject::Raw(frame) => developed(camera, frame)?,
            };
            let picture = request.out.join(format!("{stem}-{name}.png"));
            let (height, width) = (finished.height, finished.width);
            let Drawn { shown, files } = setup.task.drawn(camera, finished)?;
            write_png(&picture, &shown)?;
            context.wrote(&picture, "picture");
            for (file, bytes) in read_files.iter().zip(files) {
                let path = request.out.join(read_name(stem, name, file));
                write_file(&path, bytes)?;
                context.wrote(&path, "what the network reads");
            }
            show(name, &shown);
            pictures.push(Applied {
                image: image.clone(),
                camera: name.clone(),
                picture,
                height,
                width,
                seconds: start.elapsed().as_secs_f64(),
            });
        }
        if views.len() > 1 {
            let path = request.out.join(page_name(stem));
            write_file(&path, page(stem, &views))?;
            context.wrote(&path, "page");
            pages.push(path);
        }
    }
    Ok(Response { pictures, pages })
}

/// The files of a picture by these cameras.
fn files_of(stem: &str, cameras: &[String], read_files: &[&str]) -> Vec<String> {
    let pictures = cameras.iter().map(String::as_str).chain([SCENE]).map(|name| format!("{stem}-{name}.png"));
    let read = cameras.iter().flat_map(|name| read_files.iter().map(move |file| read_name(stem, name, file)));
    pictures.chain(read).chain([page_name(stem)]).collect()
}

/// A file that says what the network of a camera reads in a picture.
fn read_name(stem: &str, camera: &str, file: &str) -> String {
    format!("{stem}-{camera}-{file}")
}

/// The page of a picture by every camera.
fn page_name(stem: &str) -> String {
    format!("{stem}-side-by-side.html")
}

/// The cameras that the request names, which must be finished.
fn chosen(request: &Request, folder: &RunFolder, all: &[String]) -> Result<Vec<String>, JobError> {
    let finished = folder.finished(all.iter().map(String::as_str));
    if finished.is_empty() {
        return Err(none_finished(&request.run));
    }
    let names = if request.cameras.is_empty() {
        finished.iter().map(|name| (*name).to_owned()).collect()
    } else {
        request.cameras.clone()
    };
    match names.iter().find(|name| !finished.contains(&name.as_str())) {
        Some(missing) => {
            let message = "there is no finished camera of this name";
            Err(JobError::setting("camera", missing, message, format!("the run has {}", finished.join(", "))))
        }
        None => Ok(names),
    }
}

/// The error where no camera of a run is finished.
pub(crate) fn none_finished(run: &Path) -> JobError {
    let run = run.display();
    JobError::input(
        format!("{run}: no camera of this run is finished"),
        format!("go on with it: design --resume {run}"),
    )
}

/// The names of the pictures without folder and ending; no two are the same.
fn stems(images: &[PathBuf]) -> Result<Vec<String>, JobError> {
    let mut stems: Vec<String> = Vec::new();
    for path in images {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if stems.contains(&stem) {
            let hint = "results are named by their picture; apply the two into different folders with --out";
            return Err(JobError::input(
                format!("{}: another picture has this name too", path.display()),
                hint,
            ));
        }
        stems.push(stem);
    }
    Ok(stems)
}

/// Reads a photograph, laid on the sensor, or a raw frame that fits the sensor.
fn subject(path: &Path, place: Place, setup: &Setup) -> Result<Subject, JobError> {
    let sensor = &setup.body.sensor;
    if is_raw(path) {
        return Ok(Subject::Raw(Box::new(raw_frame(path, sensor)?)));
    }
    let light = load_image(path).map_err(DesignError::from)?.light;
    Ok(Subject::Photo(place.lay(&light, (sensor.height, sensor.width))))
}

/// Whether a file holds a raw frame: a DNG file, or one with a sidecar.
pub(crate) fn is_raw(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("dng")) || sidecar_path(path).is_file()
}

/// Reads a raw frame that fits a sensor.
pub(crate) fn raw_frame(path: &Path, sensor: &SensorModel) -> Result<RawFrame, JobError> {
    let frame = load_raw(path)?;
    let wrong = |what: String| {
        let hint = "a camera develops frames of its own sensor; `raw show` says what a file holds";
        Err(JobError::input(format!("{}: {what}", path.display()), hint))
    };
    if frame.height > sensor.height || frame.width > sensor.width {
        let (frame, whole) = ([frame.height, frame.width], [sensor.height, sensor.width]);
        return wrong(format!(
            "{} x {} pixels, the sensor has {} x {}",
            frame[0], frame[1], whole[0], whole[1]
        ));
    }
    let Placement { row, col } = centred(sensor.height, sensor.width, &frame);
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
        None => Ok(frame),
    }
}

/// Where a frame smaller than the sensor lies on it: in the middle, from the first pixel of a tile of colour filters.
fn centred(height: usize, width: usize, frame: &RawFrame) -> Placement {
    Placement { row: (height - frame.height) / 4 * 2, col: (width - frame.width) / 4 * 2 }
}

/// A photograph through lens, sensor, development and network.
pub(crate) fn taken(
    camera: &Camera,
    photo: &LinearImage,
    seed: u64,
    frame: u64,
) -> Result<LinearImage, JobError> {
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
pub(crate) fn developed(camera: &Camera, frame: &RawFrame) -> Result<LinearImage, JobError> {
    let body = camera.body();
    let placement = centred(body.sensor.height, body.sensor.width, frame);
    let capture = Capture { exposure: body.exposure, placement, frame: 0 };
    let dn = frame.dn.iter().map(|dn| f32::from(*dn)).collect();
    Ok(camera.finished_raw(dn, [frame.height, frame.width], capture)?)
}

fn write_png(path: &Path, encoded: &LinearImage) -> Result<(), JobError> {
    write_file(path, encoded_png_bytes(encoded).map_err(DesignError::from)?)
}
