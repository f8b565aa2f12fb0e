//! The detector of a request: that of a finished camera, or weights of torchvision.

use std::path::PathBuf;

use petzval_base::Cancel;
use petzval_camera::image::LinearImage;
use petzval_design::camera::Camera;
use petzval_design::design_loop::set_sight;
use petzval_design::error::DesignError;
use petzval_design::experiment::STREET;
use petzval_design::inputs::{SetupFor, check_parts_or_accepted, setup_of_run};
use petzval_design::report::run_report::camera_lens;
use petzval_design::run::input_list::{InputList, Pictures};
use petzval_design::run::{DigestCheck, Kept, RunFolder, load_blocks};
use petzval_design::task::objects::{detector_of, untrained};
use petzval_design::trained_pictures::TrainedPictures;
use petzval_learn::Device;
use petzval_learn::dataset::Classes;
use petzval_learn::detection::{AnyDetector, BackboneKind, Detection, Detector, Zoom, Zoomed, detect_in};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::apply::none_finished;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::evaluate::camera_of;
use crate::event::WarningKind;
use crate::pixels::check_picture;
use crate::range::check_ranges;

/// Where a detector comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    Weights(Weights),
}

/// The detector of the run in this folder, until one is named.
impl Default for Source {
    fn default() -> Self {
        Self::Run { run: PathBuf::new(), camera: None }
    }
}

petzval_base::parameters! {
    /// Weights of a Faster R-CNN under the names of torchvision, and the size in which it looks.
    pub struct Weights {
        /// Classes of the weights, without the background.
        classes: usize = 90, "", 1..100_000, Linear, "weights of COCO have 90";
        /// Pixels to which the shorter side of a picture is scaled before the detector looks.
        shorter_side: usize = 800, "pixels", 1..65_536, Linear, "torchvision's detectors have 800 and 1333";
        /// Most pixels that the longer side may have after that.
        longer_side: usize = 1333, "pixels", 1..65_536, Linear, "torchvision's detectors have 800 and 1333";
    }
    also {
        /// The safetensors file.
        file: PathBuf = PathBuf::new();
        /// Their backbone.
        backbone: BackboneKind = BackboneKind::Resnet50;
    }
}

/// An object that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Found {
    /// Name of its class; for weights of torchvision its number, or with `--data` the name that the data set has for this number.
    pub class: String,
    /// How sure the detector is, 0..1.
    pub score: f32,
    /// Left edge, upper edge, width and height, pixels.
    pub bbox: [f32; 4],
}

/// What finds objects.
pub struct Finder {
    /// The detector with its weights held, so that no picture leaves anything in memory for a gradient.
    pub detector: Box<dyn Detector>,
    /// Names of its classes.
    pub classes: Vec<String>,
    /// The camera that develops raw frames, if there are any.
    pub camera: Option<Camera>,
    /// What of a data set its classes take; none of weights of torchvision, whose classes have the numbers of COCO.
    pub taken: Option<Classes>,
    /// The pictures of its run as the run has listed them; none where it sees streets.
    pub own_pictures: Option<OwnPictures>,
}

/// The labelled pictures of a run.
pub struct OwnPictures {
    /// Where the run finds them now.
    pub place: PathBuf,
    /// What the run has listed when it began.
    pub listed: Pictures,
    /// Those on which it was trained, by their content.
    pub trained: TrainedPictures,
}

impl Finder {
    /// A detection in words: its class by name.
    pub fn in_words(&self, detection: &Detection) -> Found {
        let Detection { bbox, score, class, .. } = detection;
        Found {
            class: self.classes[*class].clone(),
            score: *score,
            bbox: [bbox.x1, bbox.y1, bbox.width(), bbox.height()],
        }
    }
}

/// A detector that is opened once and looks at pictures in memory.
pub struct ObjectFinder {
    finder: Finder,
    device: Device,
}

impl ObjectFinder {
    /// Opens the detector of a finished camera, or weights. `device` is where tensors live. `accept_changed` names files or folders of the
    /// run, by their path below it, that may differ from their digests.
    pub fn open(source: &Source, device: &str, accept_changed: &[String], context: &Context) -> Result<Self> {
        let device = context.device(device)?;
        let finder = finder(source, None, &device, accept_changed, context)?;
        Ok(Self { finder, device })
    }

    /// Names of its classes; of weights of torchvision the numbers that torchvision gives them.
    pub fn classes(&self) -> &[String] {
        &self.finder.classes
    }

    /// The objects of at least this score, 0..1, in a picture of three planes in linear light where 1 is white; best first. Boxes are in
    /// pixels of the picture.
    pub fn find(&self, picture: &LinearImage, least_score: f32) -> Result<Vec<Found>> {
        check_picture(picture, "the picture")?;
        let encoded = LinearImage { data: picture.to_srgb(), ..*picture };
        let found = detect_in(self.finder.detector.as_ref(), &encoded, &self.device, &Cancel::default());
        let found = found.map_err(DesignError::from)?;
        let sure = found.iter().filter(|detection| detection.score >= least_score);
        Ok(sure.map(|detection| self.finder.in_words(detection)).collect())
    }
}

/// The detector of a request, and a camera for its first raw frame and all others. `accepted`: files of the run that may differ from their
/// digests.
pub fn finder(
    source: &Source,
    raw: Option<&PathBuf>,
    device: &Device,
    accepted: &[String],
    context: &Context,
) -> Result<Finder> {
    match source {
        Source::Run { run, camera } => {
            let folder = RunFolder::open(run)?;
            let experiment = context.assets.experiment_of_run(&folder)?;
            let makes_pictures = || {
                let message = format!("{}: the cameras of this run have no detector", run.display());
                JobError::input(message, "name a run that looks for objects, such as pedestrian-vehicle")
            };
            // A network that names the classes of pixels finds no boxes.
            if !context.assets.facts_of(&experiment)?.has_detector {
                return Err(makes_pictures());
            }
            let finished = folder.finished(experiment.variant.iter().map(|v| v.name.as_str()));
            let Some(last) = finished.last() else {
                return Err(none_finished(&folder));
            };
            let name = camera.as_deref().unwrap_or(last);
            if !finished.contains(&name) {
                let message = "there is no finished camera of this name";
                let hint = format!("finished are {}", finished.join(", "));
                return Err(JobError::setting("camera", name, message, hint));
            }
            let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
            let check = DigestCheck::of_request(&folder, accepted, &warn)?;
            check.check_cameras([name])?;
            let taken = experiment.classes();
            let own_pictures = match experiment.data.as_str() {
                STREET => None,
                place => InputList::read(&folder)?.and_then(|list| list.pictures).map(|listed| {
                    // Detections do not depend on them.
                    let trained = TrainedPictures::listed(&listed, &folder).unwrap_or_else(|error| {
                        warn(&error.to_string());
                        TrainedPictures::default()
                    });
                    OwnPictures { place: PathBuf::from(place), listed, trained }
                }),
            };
            let mut block = untrained(&experiment, device)?;
            load_blocks(&folder.camera(name), [&mut block as _], Kept::Numbers)?;
            if let Some(variant) = experiment.variants().iter().find(|variant| variant.name == name) {
                let lens = camera_lens(&folder, name)?.lens;
                set_sight(&mut block, &folder, variant, &lens)?;
            }
            let classes = taken.names().into_iter().map(str::to_owned).collect();
            let detector = detector_of(&block).ok_or_else(makes_pictures)?;
            let camera = match raw {
                Some(_) => {
                    let name = name.to_owned();
                    let needed = SetupFor::Cameras;
                    let setup = setup_of_run(&folder, experiment, &context.assets, device.clone(), needed)?;
                    check_parts_or_accepted(&setup, &folder, &check)?;
                    let camera = camera_of(&setup, &folder, &name)?;
                    camera.check_sees_frames()?;
                    Some(camera)
                }
                None => None,
            };
            Ok(Finder { detector, classes, camera, taken: Some(taken), own_pictures })
        }
        Source::Weights(weights) => {
            check_ranges(weights)?;
            let Weights { classes, shorter_side, longer_side, file, backbone } = weights;
            if let Some(raw) = raw {
                let message = format!("{}: a raw frame, which only a camera develops", raw.display());
                let hint = "look with the camera of a run (--run), or make a picture first: `isp develop`";
                return Err(JobError::input(message, hint));
            }
            let bytes = petzval_base::read_whole(file).map_err(|e| {
                let message = format!("{}: {e}", file.display());
                JobError::system(message, &e, "give a file of weights in the format safetensors")
            })?;
            let detector = AnyDetector::from_torchvision(*backbone, *classes, &bytes, device).map_err(|e| {
                let hint = "a file of `fasterrcnn_resnet50_fpn` in the format safetensors; --backbone and --classes say what it holds; the detector \
                            of a camera looks with --run and --camera";
                JobError::input(format!("{}: {e}", file.display()), hint)
            })?;
            let zoom = Zoom::ToSides { shorter: *shorter_side, longer: *longer_side };
            let detector = Box::new(Zoomed::new(detector.held(), zoom));
            let classes = (1..=*classes).map(|class| class.to_string()).collect();
            Ok(Finder { detector, classes, camera: None, taken: None, own_pictures: None })
        }
    }
}
