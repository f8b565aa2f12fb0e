//! What the network of a camera finds in every held-out window: the confusion of its classes in `segments.json`, and a few windows as pictures.

use std::path::{Path, PathBuf};

use petzval_camera::image::LinearImage;
use petzval_files::{encoded_png_bytes, index_png_bytes, load_label_image};
use petzval_learn::dataset::ClassMap;
use petzval_learn::score::detection::clusters_of;
use petzval_learn::score::segmentation::PixelConfusion;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::run::{RunFolder, read_json_if_there, write_file};

/// Windows of which pictures are kept.
pub const SHOWN: usize = 4;

/// A held-out window and what is found in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentedFrame {
    /// Name of its scene.
    pub name: String,
    /// The film that the window is of; none of a street.
    pub sequence: Option<String>,
    /// The classes of its pixels, in the truth and as they were found.
    pub confusion: PixelConfusion,
}

/// A window as pictures.
#[derive(Clone, Debug)]
pub struct ShownFrame {
    /// The finished picture, as the bytes of a PNG file.
    pub photo_png: Vec<u8>,
    /// The classes of its pixels.
    pub truth: ClassMap,
    /// The classes that were found.
    pub found: ClassMap,
}

impl ShownFrame {
    /// A finished picture, sRGB-encoded, with its classes.
    pub fn new(photo: &LinearImage, truth: ClassMap, found: ClassMap) -> Result<Self> {
        Ok(Self { photo_png: encoded_png_bytes(photo)?, truth, found })
    }
}

/// The frames of a finished camera.
pub struct SegmentedFrames {
    /// Every held-out window.
    pub all: Vec<SegmentedFrame>,
    /// The first of them as pictures.
    pub shown: Vec<ShownFrame>,
}

/// The cluster of each frame for a bootstrap: frames of one film are drawn together.
pub(super) fn clusters(frames: &[SegmentedFrame]) -> Vec<usize> {
    clusters_of(frames.iter().map(|frame| frame.sequence.as_deref()))
}

/// The confusion of each frame.
pub(super) fn confusions(frames: &[SegmentedFrame]) -> Vec<PixelConfusion> {
    frames.iter().map(|frame| frame.confusion.clone()).collect()
}

/// Writes the frames of a finished camera.
pub(super) fn save(folder: &Path, frames: &[SegmentedFrame], shown: &[ShownFrame]) -> Result<()> {
    let pictures = folder.join(PICTURES);
    std::fs::create_dir_all(&pictures).map_err(DesignError::io(&pictures))?;
    for (number, frame) in shown.iter().enumerate() {
        let path = |what: &str| pictures.join(format!("{number}-{what}.png"));
        write_file(&path("photo"), &frame.photo_png)?;
        for (what, map) in [("truth", &frame.truth), ("found", &frame.found)] {
            write_file(&path(what), &index_png_bytes(&map.classes, map.height, map.width)?)?;
        }
    }
    write_file(&list(folder), DesignError::json("the segments of the run", &frames)?.as_bytes())
}

/// The frames of a finished camera, and those that are shown; none of a camera without them. Fails if one has not this number of classes.
pub fn read(run: &RunFolder, camera: &str, classes: usize) -> Result<Option<SegmentedFrames>> {
    let folder = run.camera(camera);
    let path = list(&folder);
    let Some(frames) = read_json_if_there::<Vec<SegmentedFrame>>(&path)? else { return Ok(None) };
    let damaged = |problem: String| DesignError::Run { path: path.clone(), problem };
    if frames.iter().any(|frame| !frame.confusion.is_of(classes)) {
        return Err(damaged(format!("a confusion that is not of the {classes} classes of the experiment")));
    }
    let mut shown = Vec::new();
    for number in 0..frames.len().min(SHOWN) {
        let path = |what: &str| folder.join(PICTURES).join(format!("{number}-{what}.png"));
        let map = |what: &str| -> Result<ClassMap> {
            let image = load_label_image(&path(what))?;
            let classes = image.values.into_iter().map(|value| value as u8).collect();
            Ok(ClassMap::new(image.height, image.width, classes))
        };
        let photo = path("photo");
        let photo_png = petzval_base::read_whole(&photo).map_err(DesignError::io(&photo))?;
        let (truth, found) = (map("truth")?, map("found")?);
        if [truth.height, truth.width] != [found.height, found.width] {
            return Err(damaged(format!("the two maps of window {number} differ in size")));
        }
        shown.push(ShownFrame { photo_png, truth, found });
    }
    Ok(Some(SegmentedFrames { all: frames, shown }))
}

/// The folder of the pictures of a camera.
const PICTURES: &str = "segments";

fn list(folder: &Path) -> PathBuf {
    folder.join("segments.json")
}
