//! How well a detector does on pictures whose objects are known: the numbers of COCO, and of each class.

use petzval_files::coco::{self, DataSet, LIGHT_STATES};
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
    /// The same of boxes that reach out of their picture, as pycocotools takes them; none where no box does.
    #[serde(default)]
    pub overhanging: Option<Overhanging>,
    /// Where the average precision lies in 95 % of draws of the pictures with repetition, low and high; pictures of one sequence are drawn
    /// together.
    pub ap_range: Option<[f64; 2]>,
    /// The same at an overlap of 0.5.
    pub ap50_range: Option<[f64; 2]>,
    /// By class.
    pub classes: Vec<ClassScore>,
    /// Share of the lights found (overlap 0.5, score 0.5) whose state is right; none of other objects.
    pub state_accuracy: Option<f64>,
}

/// The numbers of COCO where boxes that reach out of their picture are whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Overhanging {
    /// Boxes that reach out of their picture. All other scores are of the part inside.
    pub boxes: usize,
    /// The numbers of COCO as pycocotools gives them for boxes that are not clipped.
    pub coco: CocoSummary,
}

impl Overhanging {
    /// Scores against the boxes as the file has them. `boxes` of them reach out of their picture.
    pub fn of(whole: &DataSet, boxes: usize, found: &[coco::Detection]) -> Self {
        let (pictures, classes) = pictures_of_data_set(whole, found);
        Self { boxes, coco: coco_summary(&pictures, classes.len()) }
    }
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
            overhanging: None,
            state_accuracy: has_states.then(|| confusion(&pictures, classes.len()).accuracy()).flatten(),
            coco,
        }
    }
}
