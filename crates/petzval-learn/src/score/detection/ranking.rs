//! The detections of all pictures in the order of their scores, with what became of each.

use super::curve::{Interpolation, PrecisionRecall};
use super::group::Group;
use super::matching::{Fate, match_picture};
use super::picture::{FoundObject, Picture, TrueObject};
use super::protocol::Protocol;

/// The detections of all pictures, class by class. Matching is done; everything else follows from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// One for each class.
    pub classes: Vec<ClassRanking>,
    thresholds: Vec<f64>,
}

/// The detections of one class, best first.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassRanking {
    entries: Vec<Entry>,
    /// Objects to detect in each picture.
    objects: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    picture: u32,
    /// Place among the detections of this class in the picture, from 0.
    place: u32,
    score: f64,
    fate: Fate,
}

impl Ranking {
    /// Matches the detections of pictures with their objects. Classes are numbered from 0 to `classes`; objects and detections of others are
    /// left out.
    pub fn new(pictures: &[Picture], classes: usize, protocol: &Protocol, group: &Group) -> Self {
        let mut rankings =
            vec![ClassRanking { entries: Vec::new(), objects: vec![0; pictures.len()] }; classes];
        for (p, picture) in pictures.iter().enumerate() {
            // Sort objects and detections by class, so that pictures with very many of both cost no more than their sum.
            let mut objects: Vec<Vec<(&TrueObject, bool)>> = vec![Vec::new(); classes];
            for object in picture.objects.iter().filter(|o| o.class < classes) {
                let is_ignored = object.crowd || object.ignore || !(group.has_object)(picture, object);
                objects[object.class].push((object, is_ignored));
            }
            let mut detections: Vec<Vec<&FoundObject>> = vec![Vec::new(); classes];
            picture.detections.iter().filter(|d| d.class < classes).for_each(|d| detections[d.class].push(d));
            for (class, ranking) in rankings.iter_mut().enumerate() {
                let found = &mut detections[class];
                found.sort_by(|a, b| descending(a.score, b.score));
                found.truncate(protocol.most_detections);
                ranking.objects[p] =
                    objects[class].iter().filter(|(_, is_ignored)| !is_ignored).count() as u32;
                let fates = match_picture(&objects[class], found, protocol);
                for (place, (found, mut fate)) in found.iter().zip(fates).enumerate() {
                    if !(group.has_detection)(picture, found) {
                        fate.ignored |= !fate.matched;
                    }
                    let entry = Entry { picture: p as u32, place: place as u32, score: found.score, fate };
                    ranking.entries.push(entry);
                }
            }
        }
        for ranking in &mut rankings {
            ranking.entries.sort_by(|a, b| descending(a.score, b.score));
        }
        Self { classes: rankings, thresholds: protocol.thresholds.clone() }
    }

    /// The overlaps at which detection and object match.
    pub fn thresholds(&self) -> &[f64] {
        &self.thresholds
    }

    /// Average precision: the mean over thresholds and over the classes that have objects; `None` if none has.
    ///
    /// `counts` is how often each picture counts; `None` is once. `None` too where a class with objects has none in the pictures that count: the
    /// mean of the other classes would be another figure.
    pub fn average_precision(&self, interpolation: Interpolation, counts: Option<&[u32]>) -> Option<f64> {
        mean_of_all((0..self.thresholds.len()).flat_map(|t| self.class_areas(t, interpolation, counts)))
    }

    /// Average precision at one threshold: the mean over the classes that have objects; `None` as in [`Self::average_precision`].
    pub fn average_precision_at(
        &self,
        threshold: usize,
        interpolation: Interpolation,
        counts: Option<&[u32]>,
    ) -> Option<f64> {
        mean_of_all(self.class_areas(threshold, interpolation, counts))
    }

    /// The area of each class that has objects, none where it has none in the pictures that count.
    fn class_areas(
        &self,
        threshold: usize,
        interpolation: Interpolation,
        counts: Option<&[u32]>,
    ) -> impl Iterator<Item = Option<f64>> {
        let classes = self.classes.iter().filter(|class| class.objects() > 0);
        classes.map(move |class| Some(class.curve(threshold, counts)?.area(interpolation)))
    }

    /// Average precision of one class, the mean over thresholds, with `counts` as in [`Self::average_precision`]; `None` if it has no objects.
    pub fn class_average_precision(
        &self,
        class: usize,
        interpolation: Interpolation,
        counts: Option<&[u32]>,
    ) -> Option<f64> {
        let ranking = self.classes.get(class)?;
        mean((0..self.thresholds.len()).filter_map(|t| Some(ranking.curve(t, counts)?.area(interpolation))))
    }

    /// Average recall with at most so many detections of a class in a picture: the mean over thresholds and classes with objects.
    pub fn average_recall(&self, most_detections: usize) -> Option<f64> {
        let recalls = self.classes.iter().flat_map(|class| {
            (0..self.thresholds.len()).filter_map(move |t| class.recall(t, most_detections))
        });
        mean(recalls)
    }
}

impl ClassRanking {
    /// Objects to detect.
    pub fn objects(&self) -> u64 {
        self.objects.iter().map(|n| u64::from(*n)).sum()
    }

    /// Precision over recall at a threshold; `None` if the class has no objects. `counts` is how often each picture counts.
    pub fn curve(&self, threshold: usize, counts: Option<&[u32]>) -> Option<PrecisionRecall> {
        let count = |picture: u32| counts.map_or(1, |counts| u64::from(counts[picture as usize]));
        let objects: u64 = (0..).zip(&self.objects).map(|(p, n)| count(p) * u64::from(*n)).sum();
        if objects == 0 {
            return None;
        }
        let bit = 1 << threshold;
        let (mut right, mut wrong) = (0, 0);
        let mut curve = PrecisionRecall::default();
        for entry in self.entries.iter().filter(|entry| entry.fate.ignored & bit == 0) {
            let n = count(entry.picture);
            if entry.fate.matched & bit == 0 {
                wrong += n;
            } else if n > 0 {
                // Precision is largest, and recall grows, at right detections only.
                right += n;
                curve.recall.push(right as f64 / objects as f64);
                // pycocotools adds the spacing of floating-point numbers at 1.
                curve.precision.push(right as f64 / ((wrong + right) as f64 + f64::EPSILON));
                curve.score.push(entry.score);
            }
        }
        Some(curve.monotone())
    }

    /// Share of the objects that are detected, with at most so many detections of this class in a picture; `None` if there are no objects.
    pub fn recall(&self, threshold: usize, most_detections: usize) -> Option<f64> {
        let bit = 1 << threshold;
        let is_right = |e: &&Entry| {
            (e.place as usize) < most_detections && e.fate.matched & bit != 0 && e.fate.ignored & bit == 0
        };
        match self.objects() {
            0 => None,
            objects => Some(self.entries.iter().filter(is_right).count() as f64 / objects as f64),
        }
    }
}

/// Larger scores first; equal ones keep their order.
fn descending(a: f64, b: f64) -> std::cmp::Ordering {
    // Adding zero makes the two zeros equal.
    (b + 0.0).total_cmp(&(a + 0.0))
}

/// The mean, if there are values and none is missing.
fn mean_of_all(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    mean(values.collect::<Option<Vec<f64>>>()?.into_iter())
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0_u32), |(sum, n), v| (sum + v, n + 1));
    (n > 0).then(|| sum / f64::from(n))
}
