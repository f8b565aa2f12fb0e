//! `detect`: what a detector finds in pictures.

mod finder;
mod scores;

use std::path::{Path, PathBuf};

use petzval_camera::image::LinearImage;
use petzval_design::boxes::with_boxes;
use petzval_design::error::DesignError;
use petzval_design::scenes::wanted;
use petzval_files::coco::{
    self, Bounds, Category, DataSet, Image, check_pictures, load_coco, save_coco, save_results,
};
use petzval_files::{encoded_png_bytes, load_image};
use petzval_learn::dataset::{in_classes, taken_as};
use petzval_learn::detection::{Detection, detect_in};
use serde::{Deserialize, Serialize};

pub use petzval_learn::detection::BackboneKind;
pub use petzval_learn::score::detection::CocoSummary;
pub use scores::{ClassScore, Scores};

use finder::{Finder, finder};

use crate::apply::{developed, is_raw, raw_frame};
use crate::context::Context;
use crate::error::{JobError, make_folder, write_file};
use crate::results::check_folder;

/// Pictures to look at, and the detector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Pictures, and folders of pictures; for the camera of a run also raw frames, which it develops: DNG files, and files with a sidecar.
    #[serde(default)]
    pub images: Vec<PathBuf>,
    /// In place of `images`: a data set in COCO format, in all of whose pictures is looked, and with whose objects is compared.
    #[serde(default)]
    pub data: Option<PathBuf>,
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
    /// Folder with `detections.json` (COCO results), `annotations.json` (pictures, classes, and the objects of a data set) and the drawn
    /// pictures.
    pub out: Option<PathBuf>,
    /// How well the objects of the data set are found; none without one.
    pub scores: Option<Scores>,
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

/// A picture that is looked at.
struct Looked {
    file: PathBuf,
    /// What a data set says of it.
    image: Image,
}

/// Looks for objects in pictures, for a camera of a run at their own size. Drawn pictures are written one by one, the results when all pictures
/// have been read. With a data set, scores and results are of everything that the detector reports, not only of what reaches the least score.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    if !(0.0..=1.0).contains(&request.least_score) {
        let hint = "0 shows everything that the detector keeps, 0.5 what is more likely there than not";
        return Err(JobError::setting("least_score", request.least_score, "is not between 0 and 1", hint));
    }
    let device = context.device(&request.device)?;
    let (mut looked, labelled) = match &request.data {
        Some(place) => labelled(place, context)?,
        None => (unlabelled(files(&request.images)?), None),
    };
    if let Some(out) = &request.out {
        check_folder(out, ["detections.json", "annotations.json"], context)?;
    }
    let raw = looked.iter().map(|l| &l.file).find(|file| is_raw(file));
    let Finder { network, classes, camera, task } = finder(&request.detector, raw, &device, context)?;
    let detector = network.detector().ok_or_else(|| JobError::failed("the network is no detector"))?;
    let labelled = match (labelled, task) {
        (Some(data), Some(task)) => {
            let (names, wanted) = (task.classes(), wanted(task));
            taken_as(&data, wanted, names).iter().for_each(|note| context.warning(note));
            Some(in_classes(&data, wanted, names))
        }
        (labelled, _) => labelled,
    };
    let (mut pictures, mut results) = (Vec::new(), Vec::new());
    let count = looked.len();
    for (i, Looked { file, image }) in looked.iter_mut().enumerate() {
        if context.is_cancelled() {
            return Err(JobError::Stopped(format!("stopped after {i} of {count} pictures")));
        }
        let encoded = match camera.as_ref().filter(|_| is_raw(file)) {
            Some(camera) => developed(camera, &raw_frame(file, &camera.body().sensor)?)?,
            None => {
                let light = load_image(file).map_err(DesignError::from)?.light;
                LinearImage { data: light.to_srgb(), ..light }
            }
        };
        (image.height, image.width) = (encoded.height as u32, encoded.width as u32);
        let found = detect_in(detector, &encoded, &device).map_err(DesignError::from)?;
        let is_sure = |d: &&Detection| d.score >= request.least_score;
        results
            .extend(found.iter().filter(|d| labelled.is_some() || is_sure(d)).map(|d| result(image.id, d)));
        let sure: Vec<Detection> = found.iter().filter(is_sure).copied().collect();
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
        }
        context.progress(i as u64 + 1, count as u64, "pictures");
    }
    let scores = labelled.as_ref().map(|data| Scores::of(data, &results));
    if let Some(out) = &request.out {
        let data = labelled.unwrap_or_else(|| DataSet {
            images: looked.into_iter().map(|looked| looked.image).collect(),
            categories: (classes.into_iter().enumerate())
                .map(|(i, name)| Category { id: i as u64 + 1, name, ..Category::default() })
                .collect(),
            ..DataSet::default()
        });
        save_results(&results, &out.join("detections.json"))?;
        save_coco(&data, &out.join("annotations.json"))?;
    }
    Ok(Response { pictures, out: request.out.clone(), scores })
}

/// A detection as COCO writes it.
fn result(image_id: u64, found: &Detection) -> coco::Detection {
    let [x, y, width, height] =
        [found.bbox.x1, found.bbox.y1, found.bbox.width(), found.bbox.height()].map(f64::from);
    coco::Detection {
        image_id,
        category_id: found.class as u64 + 1,
        bounds: Bounds { x, y, width, height },
        score: f64::from(found.score),
    }
}

/// Pictures of which nothing is known, numbered from 1.
fn unlabelled(files: Vec<PathBuf>) -> Vec<Looked> {
    let looked = |(i, file): (usize, PathBuf)| {
        let file_name = file.display().to_string();
        Looked { file, image: Image { id: i as u64 + 1, file_name, ..Image::default() } }
    };
    files.into_iter().enumerate().map(looked).collect()
}

/// The pictures of a data set, and the data set. What of it cannot be used is a warning.
fn labelled(place: &Path, context: &Context) -> Result<(Vec<Looked>, Option<DataSet>), JobError> {
    let mut loaded = load_coco(place)?;
    check_pictures(&mut loaded);
    for defect in loaded.defects.iter() {
        context.warning(format!("{}: {} {}", place.display(), defect.count, defect.kind.sentence()));
    }
    let picture =
        |image: &Image| Some(Looked { file: loaded.picture(&image.file_name)?, image: image.clone() });
    let looked: Vec<Looked> = loaded.data.images.iter().filter_map(picture).collect();
    if looked.is_empty() {
        let message = format!("{}: no picture of this data set can be used", place.display());
        return Err(JobError::input(message, "`data check` says what is wrong with it"));
    }
    Ok((looked, Some(loaded.data)))
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
