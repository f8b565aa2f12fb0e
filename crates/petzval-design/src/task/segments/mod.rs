//! A class for every pixel: streets or pictures with label images, a network with a logit for each class, and intersection over union. Its classes
//! come from the experiment.

mod judge;
mod network;
mod overlay;
pub mod segmented_frames;
mod view;

use burn::prelude::Device;
use petzval_base::FileError;
use petzval_camera::image::LinearImage;
use petzval_camera::tape::{Frames, on_device};
use petzval_files::index_png_bytes;
use petzval_learn::dataset::{ClassMap, IGNORED_VALUES, LabelledPictures, ObjectClass, StreetThing};
use petzval_learn::loss::{NamedLoss, cross_entropy, label_weight};
use petzval_learn::network::Segmenter;
use petzval_learn::score::segmentation::segment_scores;

use super::{
    Drawn, Judge, Objective, PicturePlan, PreparedTask, SceneLabels, Scenes, Task, TaskReport, WindowPlan,
    Windows, WindowsOf,
};
use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::{Camera, Labels, Shot};
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, NetworkRole, PicturesKey, STREET, TaskFacts};
use crate::run::{Metrics, RunFolder};

pub use network::{PixelReader, Segmenting};

use judge::SegmentJudge;

/// The class of every pixel of the finished picture.
pub struct Segments;

impl Task for Segments {
    fn facts(&self) -> TaskFacts {
        TaskFacts {
            name: "segments",
            network: NetworkRole::Reads,
            network_name: "network",
            has_detector: false,
            has_python_class: false,
            pictures: PicturesKey::Data,
            has_classes: true,
            default_scores: Some(&["miou", "pixel_accuracy"]),
            class_score: Some("iou"),
            scored: "pixels",
        }
    }

    fn check(&self, experiment: &Experiment, text: &str) -> Result<(), FileError> {
        check_classes(experiment, text)
    }

    fn scores(&self, experiment: &Experiment) -> Vec<String> {
        let scores = segment_scores(&experiment.classes().counted().names());
        scores.into_iter().map(|score| score.about.name).collect()
    }

    fn prepare(&self, _: &Experiment, _: &Assets, _: &Device) -> Result<Box<dyn PreparedTask>> {
        Ok(Box::new(PreparedSegments))
    }
}

/// The largest weight of a class. Beside so large a one, pixels of classes without a weight have no say.
const MOST_WEIGHT: f64 = 1000.0;

/// Refuses classes that take nothing, or the same as another one.
fn check_classes(experiment: &Experiment, text: &str) -> Result<(), FileError> {
    let wrong = |i: usize, key: &str, message: String, hint: &str| {
        let place = i.to_string();
        let at_class = FileError::at_key(text, &["class", &place, "name"], message.clone());
        let at_key = FileError::at_key(text, &["class", &place, key], message);
        Err(if at_key.line.is_some() { at_key } else { at_class }.hint(hint.to_owned()))
    };
    let classes = experiment.classes();
    let is_street = experiment.data == STREET;
    for (i, class) in classes.iter().enumerate() {
        let ObjectClass { name, street, values, weight, .. } = class;
        if let Some(object) = street.iter().find(|thing| thing.surface().is_none()) {
            let surfaces = StreetThing::ALL.into_iter().filter(|thing| thing.surface().is_some());
            let hint = surfaces.map(StreetThing::name).collect::<Vec<_>>().join(", ");
            let message = format!("`{}` is an object, which has no surface of its own", object.name());
            return wrong(i, "street", message, &format!("surfaces are {hint}"));
        }
        if let Some(value) = values.iter().find(|value| IGNORED_VALUES.contains(value)) {
            let hint = "leave it out: 255, and 65535 in files of 16 bits, are never judged";
            return wrong(i, "values", format!("{value} is always ignored"), hint);
        }
        if let Some(weight) = weight.filter(|weight| !(*weight > 0.0 && *weight <= MOST_WEIGHT)) {
            let message = format!("a weight of {weight} is not above 0 and at most {MOST_WEIGHT}");
            return wrong(
                i,
                "weight",
                message,
                "ignored = true leaves a class out; without a weight a class counts 1",
            );
        }
        if weight.is_some() && class.ignored {
            let message = format!("the class `{name}` is ignored, and has no weight in the loss");
            return wrong(i, "weight", message, "leave one of the two out");
        }
        if is_street && street.is_empty() {
            let hint = "name surfaces in `street`, such as [\"road\"], or a folder of pictures in `data`";
            return wrong(i, "street", format!("the class `{name}` takes no surface of streets"), hint);
        }
        if !is_street && values.is_empty() {
            let hint = "give the indices that it has in the label images: values = [7, 8]";
            return wrong(i, "values", format!("the class `{name}` takes no value of label images"), hint);
        }
        for (k, other) in classes[..i].iter().enumerate() {
            let surface =
                street.iter().find(|thing| other.street.contains(thing)).map(|t| t.name().to_owned());
            let value = values.iter().find(|value| other.values.contains(value)).map(u16::to_string);
            let both = [("street", surface), ("values", value)];
            if let Some((key, what)) = both.into_iter().find_map(|(key, what)| Some((key, what?))) {
                let message = format!("`{what}` is of the class `{}`, too", classes[k].name);
                return wrong(i, key, message, "every pixel has one class: leave it out of one of them");
            }
        }
        // Misspelt keys are refused by the file; keys of detectors would be silently without effect.
        let of_detectors = [
            ("state", class.state.is_some()),
            ("from", !class.from.is_empty()),
            ("categories", !class.categories.is_empty()),
        ];
        if let Some((key, _)) = of_detectors.into_iter().find(|(_, is_there)| *is_there) {
            let message = "is for objects with boxes, and pixels have none".to_owned();
            return wrong(i, key, message, "leave it out, or write \"objects\" for the task");
        }
    }
    let counted = classes.counted().len();
    if !(2..=Segmenter::MOST_CLASSES).contains(&counted) {
        let most = Segmenter::MOST_CLASSES;
        let (message, hint) = if counted < 2 {
            let message = format!("at least two classes must count; here it is {counted}");
            (message, "add a [[class]] that is not ignored, for the other pixels".to_owned())
        } else {
            let message = format!("at most {most} classes can count; here it is {counted}");
            (message, "join some of them, or write ignored = true".to_owned())
        };
        return wrong(0, "name", message, &hint);
    }
    Ok(())
}

/// The task at work on an experiment.
struct PreparedSegments;

impl PreparedTask for PreparedSegments {
    fn windows(&self, plan: &WindowPlan) -> Result<Box<dyn Windows>> {
        let classes = plan.experiment.classes();
        let labels = SceneLabels {
            surfaces: Some(classes.of_surfaces()),
            classes: classes.counted(),
            pictures: |plan| {
                let PicturePlan { folder, classes, crop, purpose, cancel, .. } = *plan;
                LabelledPictures::load_with_label_images(folder, classes, crop, purpose, cancel)
            },
            of_window: |window| window.classes.clone().map_or_else(Labels::default, Labels::new),
        };
        Ok(Box::new(Scenes::new(plan, labels)?))
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock> {
        network::block(&cameras.experiment, &cameras.body.device)
    }

    fn objective(&self, cameras: &Cameras) -> Result<Box<dyn Objective>> {
        Ok(Box::new(NameClasses { weights: cameras.experiment.classes().counted().weights() }))
    }

    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>> {
        Ok(Box::new(SegmentJudge::new(cameras)?))
    }

    fn drawn(&self, camera: &Camera, picture: LinearImage) -> Result<Drawn> {
        let reader = camera.reader::<PixelReader>().ok_or(DesignError::OtherTask)?;
        let map = reader.read(on_device(&picture, &camera.body().device))?;
        let png = index_png_bytes(&map.classes, map.height, map.width)?;
        Ok(Drawn { shown: overlay::with_classes(&picture, &map), files: vec![png] })
    }

    /// The class map: the number of the class of each pixel, in the order of `[[class]]`.
    fn read_files(&self) -> &'static [&'static str] {
        &["classes.png"]
    }

    fn report(&self, cameras: &Cameras, run: &RunFolder, metrics: &Metrics) -> Result<TaskReport> {
        view::report(cameras, run, metrics)
    }
}

/// The loss of the camera's own network. Whatever moves, the lens, the ISP or the network, moves so that more pixels get their class.
struct NameClasses {
    /// How much a pixel of each class counts.
    weights: Vec<f64>,
}

impl Objective for NameClasses {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
        let reader = camera.reader::<PixelReader>().ok_or(DesignError::OtherTask)?;
        let mut labels = Vec::new();
        for shot in shots {
            labels.extend(&shot.labels.of::<ClassMap>().ok_or(DesignError::OtherTask)?.classes);
        }
        let logits = reader.logits(frames.finished.clone());
        Ok(NamedLoss::sum(vec![("cross_entropy", cross_entropy(logits, &labels, &self.weights)?)])?)
    }

    /// The loss is a weighted mean over labelled pixels.
    fn windows(&self) -> WindowsOf {
        WindowsOf::Apart
    }

    fn shares(&self, shots: &[Shot]) -> Result<Vec<f64>> {
        let counted = |shot: &Shot| {
            let map = shot.labels.of::<ClassMap>().ok_or(DesignError::OtherTask)?;
            Ok::<f64, DesignError>(label_weight(&map.classes, &self.weights))
        };
        let counted = shots.iter().map(counted).collect::<Result<Vec<f64>>>()?;
        let all: f64 = counted.iter().sum();
        Ok(counted.into_iter().map(|weight| if all > 0.0 { weight / all } else { 0.0 }).collect())
    }
}

#[cfg(test)]
mod tests {
    use crate::experiment::Experiment;

    fn refused(text: &str) -> String {
        Experiment::parse(&format!("task = \"segments\"\n{text}")).unwrap_err().to_string()
    }

    #[test]
    fn classes_that_cannot_be_are_refused_with_their_place() {
        let two = |one: &str, other: &str| {
            format!("[[class]]\nname = \"a\"\n{one}\n[[class]]\nname = \"b\"\n{other}\n")
        };
        let [road, sky] = ["street = [\"road\"]", "street = [\"sky\"]"];
        let streets = Experiment::parse(&format!("task = \"segments\"\n{}", two(road, sky))).unwrap();
        assert_eq!(streets.scoring.scores, ["miou", "pixel_accuracy", "iou_a", "iou_b"]);
        let object = refused(&two(road, "street = [\"traffic-light\"]"));
        assert!(object.contains("line 7") && object.contains("`traffic-light` is an object"), "{object}");
        assert!(object.contains("surfaces are pedestrian, vehicle, signal, road"), "{object}");
        assert!(refused(&two(road, road)).contains("`road` is of the class `a`, too"));
        assert!(refused(&two(road, "")).contains("the class `b` takes no surface of streets"));
        assert!(
            refused(&two(road, &format!("{sky}\nignored = true")))
                .contains("at least two classes must count; here it is 1")
        );
        assert!(refused(&two(road, &format!("{sky}\nvalues = [255]"))).contains("255 is always ignored"));
        assert!(
            refused(&two(road, &format!("{sky}\nstate = \"red\""))).contains("is for objects with boxes")
        );
        for weight in ["0", "-1", "1001", "nan"] {
            let weighted = refused(&two(road, &format!("{sky}\nweight = {weight}")));
            assert!(
                weighted.contains("is not above 0 and at most 1000") && weighted.contains("line"),
                "{weighted}"
            );
        }
        assert!(
            refused(&two(road, &format!("{sky}\nignored = true\nweight = 2")))
                .contains("is ignored, and has no weight")
        );
        let weighted = format!("task = \"segments\"\n{}", two(road, &format!("{sky}\nweight = 2.5")));
        assert_eq!(Experiment::parse(&weighted).unwrap().classes().weights(), [1.0, 2.5]);
        let own = |one: &str, other: &str| refused(&format!("data = \"folder\"\n{}", two(one, other)));
        assert!(own("values = [1]", road).contains("the class `b` takes no value of label images"));
        assert!(own("values = [1, 2]", "values = [3, 2]").contains("`2` is of the class `a`, too"));
        // A detector finds no surfaces.
        let boxes = Experiment::parse("task = \"objects\"\n[[class]]\nname = \"a\"\nstreet = [\"road\"]\n");
        assert!(boxes.unwrap_err().to_string().contains("`road` is a surface, which has no box"));
    }

    #[test]
    fn the_preset_takes_every_surface_once() {
        let preset = Experiment::parse("task = \"street-segmentation\"\n").unwrap();
        assert_eq!(preset.scoring.scores, ["miou", "pixel_accuracy"]);
        let surfaces = preset.classes().of_surfaces();
        assert!(surfaces.iter().all(|class| usize::from(*class) < preset.class.len()), "{surfaces:?}");
    }
}
