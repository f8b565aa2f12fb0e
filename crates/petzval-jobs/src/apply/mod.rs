//! `apply`: pictures of one's own, whole, through the cameras of a finished run: lens, sensor, development and network.

mod cameras;

use std::path::{Path, PathBuf};
use std::time::Instant;

use petzval_camera::image::LinearImage;
use petzval_design::error::DesignError;
use petzval_design::experiment::SCENE;
use petzval_files::raw_file::RawFrame;
use petzval_files::{ImageError, encoded_png_bytes};
use petzval_report::side_by_side::{View, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::cameras::Chosen;
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::noted_pictures::NotedPictures;
use crate::results::{check_distinct, check_folder};

pub use self::cameras::{Cameras, Finished, Taking};
pub(crate) use self::cameras::{developed, is_raw, none_finished, raw_frame, taken};
pub use crate::simulate::Place;

petzval_base::parameters! {
    /// Pictures, and the cameras that take them.
    pub struct Request {
        /// Folder of the run.
        run: PathBuf = PathBuf::new();
        /// Photographs, which the cameras take; and raw frames, which they develop: DNG files, and files with a sidecar.
        images: Vec<PathBuf> = Vec::new();
        /// Names of cameras of the run; all that are finished if empty.
        cameras: Vec<String> = Vec::new();
        /// PSFs in place of those of each camera's lens: the folder of results of `psf` or `psf-calibrate`, or its `psf.json`. They form the images of
        /// photographs. Development and restoration know them, also those of raw frames; the network stays as it was trained.
        psfs: Option<PathBuf> = None;
        /// How a photograph lands on the sensor.
        place: Place = Place::default();
        /// Seed of the noise.
        seed: u64 = crate::usual::seed();
        /// Folder for the pictures.
        out: PathBuf = PathBuf::from("applied");
        /// Where tensors live.
        device: String = crate::usual::device();
        /// Files or folders of the run, by their path below it, that may differ from their digests.
        accept_changed: Vec<String> = Vec::new();
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Every picture through every camera.
    pub pictures: Vec<Applied>,
    /// For each photograph or raw frame the page that shows it by every camera; none where there would be nothing beside it.
    #[serde(default, serialize_with = "petzval_base::lossy_path::serialize")]
    pub pages: Vec<PathBuf>,
    /// Every other file: each photograph as it lies on the sensor, and what networks read in pictures.
    #[serde(default, serialize_with = "petzval_base::lossy_path::serialize")]
    pub others: Vec<PathBuf>,
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

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::seeded(|request, seed| request.seed = seed, |request, folder| request.out = folder.to_owned());

/// Takes the photographs and develops the raw frames. The folder `out` gets `NAME-CAMERA.png` for each, and `NAME-scene.png` of each
/// photograph as it lies on the sensor, and `NAME-side-by-side.html` with all of them. A task may add files, such as
/// `NAME-CAMERA-classes.png`. [`Cameras`] gives the same pictures as values.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let stems = stems(&request.images)?;
    let chosen =
        Chosen::new(&request.run, &request.cameras, &request.device, &request.accept_changed, context)?;
    let chosen = match &request.psfs {
        Some(path) => chosen.with_psfs(path)?,
        None => chosen,
    };
    let read_files = chosen.setup.task.read_files();
    let files: Vec<String> =
        stems.iter().flat_map(|stem| files_of(stem, &chosen.names, read_files)).collect();
    check_distinct(&files)?;
    check_folder(&request.out, &files, context)?;
    check_there(&request.images)?;
    // Cameras are made before pictures are read: a run that lacks one is found at once.
    let cameras = chosen.cameras()?;
    if request.images.iter().any(|image| is_raw(image)) {
        cameras.check_see_frames()?;
    }
    let reader = NotedPictures::new(context);
    let subjects = request
        .images
        .iter()
        .map(|path| subject(path, request.place, &cameras, &reader))
        .collect::<Result<Vec<_>, _>>()?;
    drop(reader);

    make_folder(&request.out)?;
    let (mut pictures, mut pages, mut others) = (Vec::new(), Vec::new(), Vec::new());
    let total = (subjects.len() * cameras.names().len()) as u64;
    for (i, ((image, stem), subject)) in request.images.iter().zip(&stems).zip(&subjects).enumerate() {
        let mut views = Vec::new();
        let mut show = |name: &str, picture: &LinearImage| {
            views.push(View::new(name, &picture.data, picture.height, picture.width));
        };
        if let Subject::Photo(photo) = subject {
            let encoded = LinearImage { data: photo.to_srgb(), ..photo.clone() };
            let path = request.out.join(format!("{stem}-{SCENE}.png"));
            write_png(&path, &encoded)?;
            context.wrote(&path, "picture");
            others.push(path);
            show("the scene", &encoded);
        }
        for (name, camera) in cameras.each() {
            context.check(|| format!("stopped after {} of {total} pictures", pictures.len()))?;
            context.progress(pictures.len() as u64, total, format!("{stem}, {name}"));
            let start = Instant::now();
            let taking = Taking { place: request.place, seed: request.seed, frame: i as u64 };
            let Finished { picture, shown, read } = match subject {
                Subject::Photo(photo) => cameras.take_laid(camera, photo, taking)?,
                Subject::Raw(frame) => cameras.develop_checked(camera, frame)?,
            };
            let path = request.out.join(format!("{stem}-{name}.png"));
            write_png(&path, &shown)?;
            context.wrote(&path, "picture");
            for (file, bytes) in read {
                let path = request.out.join(read_name(stem, name, file));
                write_file(&path, bytes)?;
                context.wrote(&path, "what the network reads");
                others.push(path);
            }
            show(name, &shown);
            pictures.push(Applied {
                image: image.clone(),
                camera: name.to_owned(),
                picture: path,
                height: picture.height,
                width: picture.width,
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
    Ok(Response { pictures, pages, others })
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

/// The names of the pictures without folder and ending; no two are the same.
fn stems(images: &[PathBuf]) -> Result<Vec<String>> {
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

/// Names the first picture that is not there, before cameras are made.
fn check_there(images: &[PathBuf]) -> Result<()> {
    for path in images {
        let there = std::fs::metadata(path);
        there.map_err(|source| DesignError::from(ImageError::Io { path: path.clone(), source }))?;
    }
    Ok(())
}

/// Reads a photograph, laid on the sensor, or a raw frame that fits the sensor.
fn subject(path: &Path, place: Place, cameras: &Cameras, pictures: &NotedPictures<'_>) -> Result<Subject> {
    if is_raw(path) {
        return Ok(Subject::Raw(Box::new(raw_frame(path, cameras.sensor(), pictures)?)));
    }
    let light = pictures.light(path).map_err(DesignError::from)?;
    let frame = (cameras.sensor().height, cameras.sensor().width);
    if let Some(note) = place.note(&light, frame) {
        pictures.note(path, note);
    }
    Ok(Subject::Photo(place.lay(&light, frame)))
}

fn write_png(path: &Path, encoded: &LinearImage) -> Result<()> {
    write_file(path, encoded_png_bytes(encoded).map_err(DesignError::from)?)
}
