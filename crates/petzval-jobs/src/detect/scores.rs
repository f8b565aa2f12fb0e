//! How well a detector does on pictures whose objects are known: the numbers of COCO, and of each class.

use std::collections::HashSet;

use petzval_files::coco::{self, Annotation, DataSet, LIGHT_STATES};
use petzval_learn::score::detection::{
    CocoSummary, Group, Interpolation, Protocol, Ranking, clusters_of_data_set, coco_summary,
    pictures_of_data_set, voc_average_precision,
};
use petzval_learn::score::{confusion, range_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How well the objects of a data set are found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scores {
    /// Pictures that were looked at.
    pub pictures: usize,
    /// The numbers of COCO. What is small and large is said by the areas of the data set, 32^2 and 96^2 px^2; for the detector of a run by those
    /// of the boxes.
    pub coco: CocoSummary,
    /// The same as pycocotools gives them for the file of the data set; none where they are the numbers above.
    #[serde(default)]
    pub pycocotools: Option<Pycocotools>,
    /// Where the average precision lies in 95 % of draws of the pictures with repetition, low and high; pictures of one sequence are drawn
    /// together.
    pub ap_range: Option<[f64; 2]>,
    /// The same at an overlap of 0.5.
    pub ap50_range: Option<[f64; 2]>,
    /// By class.
    pub classes: Vec<ClassScore>,
    /// Share of the lights found (overlap 0.5, score 0.5) whose state is right, 0..1; none of other objects, and where no light is found so.
    pub state_accuracy: Option<f64>,
    /// Share of the objects found (overlap 0.5, score 0.5) whose class is right, 0..1; none of lights, of a single class, and where no object is
    /// found so.
    #[serde(default)]
    pub class_accuracy: Option<f64>,
}

/// The numbers of COCO as pycocotools gives them, where its definition differs: it takes boxes that reach out of their picture whole, and judges all
/// objects that are no crowds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pycocotools {
    /// Boxes that reach out of their picture. All other scores are of the part inside.
    pub overhanging: usize,
    /// Objects that are no crowds, and that no other score judges: they have `ignore`, or the part inside their picture is thinner than a pixel.
    pub ignored: usize,
    /// The numbers.
    pub coco: CocoSummary,
}

impl Pycocotools {
    /// Scores against the objects `filed` as their file has them; `None` where these are the objects `judged` of all other scores. Both have the same
    /// objects in the same order.
    pub fn of(judged: &DataSet, filed: &DataSet, found: &[coco::Detection]) -> Option<Self> {
        let differ_in = |differ: fn(&Annotation, &Annotation) -> bool| {
            let pairs = judged.annotations.iter().zip(&filed.annotations);
            // A light of unknown state is there once for each class.
            let places: HashSet<(u64, [u64; 4])> = pairs
                .filter(|(ours, theirs)| differ(ours, theirs))
                .map(|(_, theirs)| place(theirs))
                .collect();
            places.len()
        };
        let overhanging = differ_in(|ours, theirs| ours.bounds != theirs.bounds);
        let ignored = differ_in(|ours, theirs| ours.crowd != theirs.crowd);
        if overhanging == 0 && ignored == 0 {
            return None;
        }
        let (pictures, classes) = pictures_of_data_set(filed, found);
        Some(Self { overhanging, ignored, coco: coco_summary(&pictures, classes.len()) })
    }
}

/// The picture of an object, and its bounds to the bit.
fn place(object: &Annotation) -> (u64, [u64; 4]) {
    (object.image_id, <[f64; 4]>::from(object.bounds).map(f64::to_bits))
}

/// How well the objects of a class are found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClassScore {
    /// Its name.
    pub class: String,
    /// Objects to find.
    pub objects: u64,
    /// Average precision of COCO, the mean over overlaps of 0.5 to 0.95.
    pub ap: Option<f64>,
    /// Average precision of Pascal VOC at an overlap of 0.5, the whole area below precision over recall.
    pub ap50_voc: Option<f64>,
}

impl Scores {
    /// The scores of detections, which are of the pictures and categories of the data set, whatever their scores.
    pub fn of(data: &DataSet, found: &[coco::Detection]) -> Self {
        let (pictures, classes) = pictures_of_data_set(data, found);
        let ranking = |protocol: &Protocol| Ranking::new(&pictures, classes.len(), protocol, &Group::all());
        let clusters = clusters_of_data_set(data);
        let range = |ranking: &Ranking| {
            range_of(&clusters, |counts| ranking.average_precision(Interpolation::Points101, Some(counts)))
        };
        let half = ranking(&Protocol::coco_at(0.5));
        let coco = coco_summary(&pictures, classes.len());
        let voc = voc_average_precision(&pictures, classes.len(), Interpolation::AllPoints);
        let accuracy = (classes.len() > 1).then(|| confusion(&pictures, classes.len()).accuracy()).flatten();
        let has_states = classes == LIGHT_STATES;
        let by_class = |(class, name): (usize, &String)| ClassScore {
            class: name.clone(),
            objects: half.classes[class].objects(),
            ap: coco.class_ap[class],
            ap50_voc: voc[class],
        };
        Self {
            pictures: pictures.len(),
            ap_range: range(&ranking(&Protocol::coco())),
            ap50_range: range(&half),
            classes: classes.iter().enumerate().map(by_class).collect(),
            pycocotools: None,
            state_accuracy: accuracy.filter(|_| has_states),
            class_accuracy: accuracy.filter(|_| !has_states),
            coco,
        }
    }
}

#[cfg(test)]
mod tests {
    use petzval_files::coco::{Bounds, Category, Image};

    use super::*;

    /// Boxes and figures are those of `petzval-learn/tests/fixtures/ignored_boxes.py`.
    #[test]
    fn objects_with_ignore_have_the_figures_of_pycocotools_beside_our_own() {
        let truth: [(u64, [f64; 4], bool, bool); 5] = [
            (1, [10.0, 10.0, 40.0, 30.0], false, false),
            (1, [60.0, 20.0, 30.0, 30.0], false, true),
            (2, [5.0, 5.0, 20.0, 20.0], false, false),
            (2, [30.0, 10.0, 30.0, 40.0], false, true),
            (2, [65.0, 10.0, 30.0, 40.0], true, true),
        ];
        let found = [
            (1, [11.0, 11.0, 38.0, 28.0], 0.9),
            (1, [60.0, 20.0, 30.0, 20.0], 0.8),
            (1, [62.0, 22.0, 12.0, 12.0], 0.7),
            (2, [6.0, 5.0, 19.0, 19.0], 0.75),
            (2, [31.0, 11.0, 28.0, 38.0], 0.65),
            (2, [66.0, 12.0, 12.0, 20.0], 0.6),
            (2, [5.0, 40.0, 15.0, 15.0], 0.3),
        ];
        let found = found.map(|(image_id, bounds, score)| coco::Detection {
            image_id,
            category_id: 1,
            bounds: Bounds::from(bounds),
            score,
        });
        let data = |is_judged: bool| {
            let objects = (1..).zip(&truth).map(|(id, &(image_id, bounds, crowd, ignore))| Annotation {
                id,
                image_id,
                category_id: 1,
                bounds: Bounds::from(bounds),
                area: Bounds::from(bounds).area(),
                crowd: crowd || ignore && !is_judged,
                ignore: false,
                attributes: Default::default(),
                unclipped: None,
            });
            DataSet {
                images: [1, 2].map(|id| Image { id, ..Image::default() }).into(),
                categories: vec![Category { id: 1, name: "car".to_owned(), ..Category::default() }],
                annotations: objects.collect(),
                ..DataSet::default()
            }
        };
        let near = |found: [Option<f64>; 4], wanted: [f64; 4]| {
            let is_near = |(found, wanted): (Option<f64>, f64)| (found.unwrap() - wanted).abs() < 1e-12;
            assert!(found.into_iter().zip(wanted).all(is_near), "{found:?}, reference {wanted:?}");
        };
        let figures = |coco: &CocoSummary| [coco.ap, coco.ap50, coco.ap75, coco.ar100];
        let (ours, filed) = (data(false), data(true));
        near(figures(&Scores::of(&ours, &found).coco), [0.8252475247524752, 1.0, 1.0, 0.85]);
        let theirs = Pycocotools::of(&ours, &filed, &found).unwrap();
        assert_eq!((theirs.overhanging, theirs.ignored), (0, 2));
        near(figures(&theirs.coco), [0.6171617161716171, 0.9504950495049505, 0.5709570957095709, 0.725]);
        // Where both judge the same objects, one set of numbers is enough.
        assert!(Pycocotools::of(&ours, &ours, &found).is_none());
    }

    #[test]
    fn every_detector_of_two_classes_or_more_has_an_accuracy_of_them() {
        // Of three objects, two are found as what they are; the last is found as the first class.
        let boxes = [[10.0, 10.0, 40.0, 30.0], [60.0, 20.0, 30.0, 30.0], [10.0, 60.0, 30.0, 30.0]];
        let score = |names: &[&str], score: f64| {
            let last = names.len() as u64;
            let objects = (1..).zip(&boxes).map(|(id, &bounds)| Annotation {
                id,
                image_id: 1,
                category_id: if id == 1 { 1 } else { last },
                bounds: Bounds::from(bounds),
                area: Bounds::from(bounds).area(),
                crowd: false,
                ignore: false,
                attributes: Default::default(),
                unclipped: None,
            });
            let category =
                |(id, name): (u64, &&str)| Category { id, name: (*name).into(), ..Category::default() };
            let data = DataSet {
                images: vec![Image { id: 1, ..Image::default() }],
                categories: (1..).zip(names).map(category).collect(),
                annotations: objects.collect(),
                ..DataSet::default()
            };
            let found = boxes.iter().zip([1, last, 1]).map(|(&bounds, category_id)| coco::Detection {
                image_id: 1,
                category_id,
                bounds: Bounds::from(bounds),
                score,
            });
            let scores = Scores::of(&data, &found.collect::<Vec<_>>());
            (scores.state_accuracy, scores.class_accuracy)
        };
        assert_eq!(score(&["cyclist", "drone"], 0.9), (None, Some(2.0 / 3.0)));
        assert_eq!(score(&LIGHT_STATES, 0.9), (Some(2.0 / 3.0), None));
        assert_eq!(score(&["cyclist"], 0.9), (None, None));
        // Detections that are not sure count for neither.
        assert_eq!(score(&["cyclist", "drone"], 0.4), (None, None));
    }
}
