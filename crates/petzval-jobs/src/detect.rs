//! `detect`: what a detector finds in pictures.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use petzval_camera::image::LinearImage;
use petzval_design::block::NetworkBlock;
use petzval_design::boxes::with_boxes;
use petzval_design::camera::Camera;
use petzval_design::design_loop::zoom_of;
use petzval_design::error::DesignError;
use petzval_design::experiment::DetectorConfig;
use petzval_design::run::{Kept, RunFolder, load_blocks};
use petzval_design::run_report::camera_lens;
use petzval_design::setup::Setup;
use petzval_files::coco::{self, Bounds, Category, DataSet, Image, save_coco, save_results};
use petzval_files::{encoded_png_bytes, load_image};
use petzval_learn::Device;
use petzval_learn::detection::{AnyDetector, Detection, Zoom, detect_in};
use petzval_learn::network::{Network, PictureNetwork};
use serde::{Deserialize, Serialize};

pub use petzval_learn::detection::BackboneKind;

use crate::apply::{developed, is_raw, raw_frame};
use crate::context::Context;
use crate::error::{JobError, make_folder, write_file};
use crate::evaluate::camera_of;
use crate::results::check_folder;

/// Pictures to look at, and the detector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Pictures, and folders of pictures; for the camera of a run also raw frames, which it develops: DNG files, and files with a sidecar.
    pub images: Vec<PathBuf>,
    /// Where the detector comes from.
    pub detector: Source,
    /// Least score of a detection, 0..1.
    pub least_score: f32,
    /// Folder for results and drawn pictures.
    pub out: Option<PathBuf>,
    /// Device of the tensors.
    pub device: String,
}

/// Where a detector comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Source {
    /// A finished camera of a run; the last one if none is named.
    Run {
        /// Folder of the run.
        run: PathBuf,
        /// The camera.
        camera: Option<String>,
    },
    /// Weights of a Faster R-CNN under the names of torchvision.
    Weights {
        /// The safetensors file.
        file: PathBuf,
        /// Its backbone.
        backbone: BackboneKind,
        /// Its classes, without the background.
        classes: usize,
        /// Pixels that the shorter side of a picture gets before the detector looks, at least 1.
        shorter: usize,
        /// Most pixels that the longer side gets, at least 1.
        longer: usize,
    },
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// The pictures in the order of the request.
    pub pictures: Vec<Seen>,
    /// Folder with `detections.json` (COCO results), `annotations.json` (pictures and classes) and the drawn pictures.
    pub out: Option<PathBuf>,
}

/// A picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Its file.
    pub file: PathBuf,
    /// What was found in it, best first.
    pub found: Vec<Found>,
}

/// An object that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Name of its class; for weights of torchvision the number that torchvision gives it.
    pub class: String,
    /// How sure the detector is, 0..1.
    pub score: f32,
    /// Left edge, upper edge, width and height, pixels.
    pub bbox: [f32; 4],
}

/// Endings of the files that are taken from a folder.
const PICTURES: [&str; 5] = ["png", "jpg", "jpeg", "tif", "tiff"];

/// Looks for objects in pictures, for a camera of a run at their own size. Drawn pictures are written one by one, the results when all pictures
/// have been read.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    if !(0.0..=1.0).contains(&request.least_score) {
        let hint = "0 shows everything that the detector keeps, 0.5 what is more likely there than not";
        return Err(JobError::setting("least_score", request.least_score, "is not between 0 and 1", hint));
    }
    let device = context.device(&request.device)?;
    let files = files(&request.images)?;
    if let Some(out) = &request.out {
        check_folder(out, ["detections.json", "annotations.json"], context)?;
    }
    let raw = files.iter().find(|file| is_raw(file));
    let Finder { network, classes, camera } = finder(&request.detector, raw, &device, context)?;
    let detector = network.detector().ok_or_else(|| JobError::failed("the network is no detector"))?;
    let mut pictures = Vec::new();
    let mut sizes = Vec::new();
    for (i, file) in files.iter().enumerate() {
        if context.is_cancelled() {
            return Err(JobError::Stopped(format!("stopped after {i} of {} pictures", files.len())));
        }
        let encoded = match camera.as_ref().filter(|_| is_raw(file)) {
            Some(camera) => developed(camera, &raw_frame(file, &camera.body().sensor)?)?,
            None => {
                let light = load_image(file).map_err(DesignError::from)?.light;
                LinearImage { data: light.to_srgb(), ..light }
            }
        };
        let found = detect_in(detector, &encoded, &device).map_err(DesignError::from)?;
        let sure: Vec<Detection> = found.into_iter().filter(|d| d.score >= request.least_score).collect();
        let in_words = |d: &Detection| Found {
            class: classes[d.class].clone(),
            score: d.score,
            bbox: [d.bbox.x1, d.bbox.y1, d.bbox.width(), d.bbox.height()],
        };
        pictures.push(Seen { file: file.clone(), found: sure.iter().map(in_words).collect() });
        if let Some(out) = &request.out {
            let boxes: Vec<_> = sure.iter().map(|d| (d.bbox, d.class)).collect();
            let png = encoded_png_bytes(&with_boxes(&encoded, &boxes)).map_err(DesignError::from)?;
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            make_folder(out)?;
            write_file(&out.join(format!("{:04}-{stem}.png", i + 1)), &png)?;
            sizes.push([encoded.height, encoded.width]);
        }
        context.progress(i as u64 + 1, files.len() as u64, "pictures");
    }
    if let Some(out) = &request.out {
        write(out, &pictures, &classes, &sizes)?;
    }
    Ok(Response { pictures, out: request.out.clone() })
}

/// Writes the results, and which pictures, of these rows and columns, and classes they are of.
fn write(out: &Path, pictures: &[Seen], classes: &[String], sizes: &[[usize; 2]]) -> Result<(), JobError> {
    let id = |i: usize| i as u64 + 1;
    let category = |class: &str| classes.iter().position(|c| c == class).map_or(0, id);
    let results: Vec<coco::Detection> = (pictures.iter().enumerate())
        .flat_map(|(i, seen)| seen.found.iter().map(move |found| (i, found)))
        .map(|(i, found)| {
            let [x, y, width, height] = found.bbox.map(f64::from);
            coco::Detection {
                image_id: id(i),
                category_id: category(&found.class),
                bounds: Bounds { x, y, width, height },
                score: f64::from(found.score),
            }
        })
        .collect();
    save_results(&results, &out.join("detections.json"))?;
    let image = |(i, (seen, [rows, columns])): (usize, (&Seen, &[usize; 2]))| Image {
        id: id(i),
        file_name: seen.file.display().to_string(),
        width: *columns as u32,
        height: *rows as u32,
        ..Image::default()
    };
    let data = DataSet {
        images: pictures.iter().zip(sizes).enumerate().map(image).collect(),
        categories: (classes.iter().enumerate())
            .map(|(i, name)| Category { id: id(i), name: name.clone(), ..Category::default() })
            .collect(),
        ..DataSet::default()
    };
    save_coco(&data, &out.join("annotations.json"))?;
    Ok(())
}

/// The pictures that are named, and those of the folders that are named, sorted by name.
fn files(images: &[PathBuf]) -> Result<Vec<PathBuf>, JobError> {
    let mut files = Vec::new();
    for path in images {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(DesignError::io(path))?;
        let mut found = Vec::new();
        for entry in entries {
            let file = entry.map_err(DesignError::io(path))?.path();
            let ending = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if PICTURES.contains(&ending.as_str()) && file.is_file() {
                found.push(file);
            }
        }
        found.sort();
        if found.is_empty() {
            let message = format!("{}: no picture in this folder", path.display());
            return Err(JobError::input(
                message,
                "PNG, JPEG and TIFF files in the folder itself are looked at, not those in folders below it",
            ));
        }
        files.extend(found);
    }
    Ok(files)
}

/// What finds objects.
struct Finder {
    /// The detector with its weights held, so that no picture leaves anything in memory for a gradient.
    network: Rc<dyn PictureNetwork>,
    /// Names of its classes.
    classes: Vec<String>,
    /// The camera that develops raw frames, if there are any.
    camera: Option<Camera>,
}

/// The detector of a request, and a camera for its first raw frame and all others.
fn finder(
    source: &Source,
    raw: Option<&PathBuf>,
    device: &Device,
    context: &Context,
) -> Result<Finder, JobError> {
    match source {
        Source::Run { run, camera } => {
            let folder = RunFolder::open(run)?;
            let experiment = context.assets.experiment_of_run(&folder)?;
            if !experiment.task.finds_objects() {
                let message = format!("{}: the cameras of this run make pictures", run.display());
                return Err(JobError::input(
                    message,
                    "name a run that looks for objects, such as pedestrian-vehicle",
                ));
            }
            let names: Vec<&str> = experiment.variant.iter().map(|v| v.name.as_str()).collect();
            let name = camera.as_deref().or(names.last().copied()).unwrap_or_default();
            if !names.contains(&name) || !folder.camera(name).is_dir() {
                let message = "there is no finished camera of this name";
                return Err(JobError::setting(
                    "camera",
                    name,
                    message,
                    format!("the run has {}", names.join(", ")),
                ));
            }
            let DetectorConfig { kind, backbone, .. } = experiment.detector;
            let classes = experiment.task.classes();
            let detector = kind.init(backbone, classes.len(), 1, device).map_err(DesignError::from)?;
            let mut block = NetworkBlock::new(Network::Detector(detector));
            load_blocks(&folder.camera(name), [&mut block as _], Kept::Numbers)?;
            if let Some(variant) = experiment.variants().iter().find(|variant| variant.name == name) {
                let lens = camera_lens(&folder, name)?.lens;
                block.set_zoom(Zoom::Times(zoom_of(&folder, variant, &lens)?));
            }
            let classes = classes.iter().map(|class| (*class).to_owned()).collect();
            let camera = match raw {
                Some(_) => {
                    let name = name.to_owned();
                    let setup = Setup::without_photos(experiment, &context.assets, device.clone())?;
                    Some(camera_of(&setup, &folder, &name)?)
                }
                None => None,
            };
            Ok(Finder { network: block.held(), classes, camera })
        }
        Source::Weights { file, backbone, classes, shorter, longer } => {
            if let Some(raw) = raw {
                let message = format!("{}: a raw frame, which only a camera develops", raw.display());
                let hint = "look with the camera of a run (--run), or make a picture first: `isp develop`";
                return Err(JobError::input(message, hint));
            }
            for (key, side) in [("shorter_side", *shorter), ("longer_side", *longer)] {
                if side == 0 {
                    let hint = "torchvision's detectors have 800 and 1333";
                    return Err(JobError::setting(key, side, "a picture needs pixels", hint));
                }
            }
            let bytes = petzval_base::read_whole(file).map_err(DesignError::io(file))?;
            let detector = AnyDetector::from_torchvision(*backbone, *classes, &bytes, device).map_err(|e| {
                let hint = "a file of `fasterrcnn_resnet50_fpn` in the format safetensors; --backbone and --classes say what it holds";
                JobError::input(format!("{}: {e}", file.display()), hint)
            })?;
            let mut block = NetworkBlock::new(Network::Detector(detector));
            block.set_zoom(Zoom::ToSides { shorter: *shorter, longer: *longer });
            let classes = (1..=*classes).map(|class| class.to_string()).collect();
            Ok(Finder { network: block.held(), classes, camera: None })
        }
    }
}
