//! What the detector of a camera finds in every held-out window, and at which stage of the camera it loses what: `objects.json`.

use std::path::{Path, PathBuf};

use petzval_learn::detection::{Detection, Ignored, Object, Truth};
use petzval_learn::score::detection::{Picture, clusters_of};
use petzval_learn::score::judged;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::run::{RunFolder, read_json_if_there, write_file};

/// A state of a picture in which the detector of a camera looks for objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// What the camera would make of the scene with perfect optics and without noise.
    Scene,
    /// The light on the pixels, sRGB-encoded: what the lens leaves.
    Light,
    /// The raw frame in a plain development, sRGB-encoded: what the sensor leaves.
    Raw,
    /// The finished picture.
    Finished,
}

impl Stage {
    /// All, in the order of the light.
    pub const ALL: [Self; 4] = [Self::Scene, Self::Light, Self::Raw, Self::Finished];
}

/// A held-out window, its objects, and what is found of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenWindow {
    /// First row and column on the sensor.
    pub at: [usize; 2],
    /// The film that the window is of; none of a street, or where an earlier version did not write it.
    #[serde(default)]
    pub sequence: Option<String>,
    /// The objects, in pixels of the window.
    pub truth: Truth,
    /// What is found at each of [`Stage::ALL`], best first.
    pub found: [Vec<Detection>; 4],
}

/// Detections below this score do not count as found, and are not drawn.
pub(crate) const LEAST_SCORE: f32 = 0.5;

/// Overlap from which a detection is of an object.
pub(crate) const OVERLAP: f32 = 0.5;

impl SeenWindow {
    /// What is found in the finished picture, best first.
    pub fn finished(&self) -> &[Detection] {
        &self.found[Stage::Finished as usize]
    }

    /// Objects and detections of the finished picture for scores, in pixels of the sensor.
    pub fn judged(&self, classes: usize) -> Picture {
        self.judged_at(Stage::Finished, classes)
    }

    /// The same of the picture at a stage.
    pub fn judged_at(&self, stage: Stage, classes: usize) -> Picture {
        judged(&self.truth, &self.found[stage as usize], self.at, classes)
    }

    /// Whether an object is surely found at a stage, as what it is.
    pub fn is_found(&self, object: &Object, stage: Stage) -> bool {
        let is_it = |d: &&Detection| d.class == object.class && d.bbox.iou(&object.bbox) >= OVERLAP;
        self.found[stage as usize].iter().filter(is_it).any(|d| d.score >= LEAST_SCORE)
    }

    /// The stage at which an object is lost: the first in whose picture it is not found. None if it is found in the finished picture.
    pub fn lost_at(&self, object: &Object) -> Option<Stage> {
        let is_lost = !self.is_found(object, Stage::Finished);
        is_lost.then(|| Stage::ALL.into_iter().find(|stage| !self.is_found(object, *stage)))?
    }

    /// Sure detections in the finished picture where nothing of their class is, and nothing that is not judged.
    pub fn false_alarms(&self) -> impl Iterator<Item = &Detection> {
        let is_of = |d: &Detection, o: &Object| o.class == d.class && o.bbox.iou(&d.bbox) >= OVERLAP;
        self.finished().iter().filter(move |d| {
            d.score >= LEAST_SCORE
                && !self.truth.objects.iter().any(|o| is_of(d, o))
                && !is_unjudged(&self.truth, d)
        })
    }
}

/// Whether a detection lies in a region where its class is not judged.
pub(crate) fn is_unjudged(truth: &Truth, found: &Detection) -> bool {
    let bbox = &found.bbox;
    let holds = |region: &Ignored| {
        region.is_of(found.class) && bbox.intersection(&region.bbox) >= OVERLAP * bbox.area()
    };
    truth.ignored.iter().any(holds)
}

/// The cluster of each window for a bootstrap: windows of one film are drawn together.
pub(crate) fn clusters<'a>(windows: impl IntoIterator<Item = &'a SeenWindow>) -> Vec<usize> {
    clusters_of(windows.into_iter().map(|window| window.sequence.as_deref()))
}

/// Writes the windows of a finished camera.
pub fn save(folder: &Path, windows: &[SeenWindow]) -> Result<()> {
    if windows.is_empty() {
        return Ok(());
    }
    write_file(&path(folder), DesignError::json("the objects of the run", &windows)?.as_bytes())
}

/// The windows of a finished camera; none where an earlier version did not write them, or no objects are looked for.
pub fn read(run: &RunFolder, camera: &str) -> Result<Option<Vec<SeenWindow>>> {
    read_json_if_there(&path(&run.camera(camera)))
}

fn path(folder: &Path) -> PathBuf {
    folder.join("objects.json")
}

#[cfg(test)]
mod tests {
    use petzval_learn::detection::BBox;

    use super::*;

    #[test]
    fn an_object_is_lost_where_it_is_first_not_found() {
        let object = |x: f32, class| Object { bbox: BBox::new(x, 0.0, x + 10.0, 20.0), class };
        let found =
            |x: f32, class, score| Detection { bbox: BBox::new(x, 1.0, x + 10.0, 21.0), class, score };
        let window = SeenWindow {
            at: [0, 0],
            sequence: None,
            truth: Truth {
                objects: vec![object(0.0, 0), object(20.0, 1), object(40.0, 0), object(60.0, 1)],
                ignored: vec![Ignored { bbox: BBox::new(100.0, 0.0, 200.0, 100.0), class: Some(0) }],
                ..Truth::default()
            },
            found: [
                vec![found(0.0, 0, 0.9), found(20.0, 1, 0.9), found(40.0, 0, 0.9)],
                vec![found(0.0, 0, 0.9), found(20.0, 1, 0.9)],
                // Neither unsure detections nor those of another class count.
                vec![found(20.0, 0, 0.9), found(20.0, 1, 0.4), found(40.0, 0, 0.9)],
                vec![
                    found(0.0, 0, 0.9),
                    found(60.0, 1, 0.3),
                    found(80.0, 0, 0.8),
                    found(120.0, 0, 0.9),
                    found(140.0, 1, 0.9),
                ],
            ],
        };
        let lost: Vec<Option<Stage>> = window.truth.objects.iter().map(|o| window.lost_at(o)).collect();
        assert_eq!(lost, [None, Some(Stage::Raw), Some(Stage::Light), Some(Stage::Scene)]);
        let alarms: Vec<f32> = window.false_alarms().map(|d| d.bbox.x1).collect();
        assert_eq!(
            alarms,
            [80.0, 140.0],
            "what is found in a region that is not judged is no false alarm of its class"
        );
    }
}
