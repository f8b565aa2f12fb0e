//! Whether the state of a detected object is right, such as the colour of a traffic light.

use serde::{Deserialize, Serialize};

use super::overlap::overlap;
use super::picture::{FoundObject, Picture, TrueObject};

/// Overlap from which a detection is of an object.
const OVERLAP: f64 = 0.5;

/// Which states objects have, and which were found. Data sets keep the state as an attribute, or as part of the class.
pub struct StateOf<'a> {
    /// State of an object, from 0, given the picture and the place of the object in it; `None` if it is unknown, which counts nowhere.
    pub object: &'a dyn Fn(usize, usize) -> Option<usize>,
    /// The same of a detection.
    pub detection: &'a dyn Fn(usize, usize) -> Option<usize>,
}

/// States that objects have against those that were found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateConfusion {
    /// Objects by their state (row) and the found one (column).
    pub counts: Vec<Vec<u64>>,
    /// Objects by their state that no detection overlaps enough.
    pub missed: Vec<u64>,
    /// Detections by their state that are of no object.
    pub spurious: Vec<u64>,
}

impl StateConfusion {
    /// Matches detections with a score of `least_score` or more with objects, best first and whatever their classes, at an overlap of 0.5 or
    /// more, and counts the states.
    pub fn new(pictures: &[Picture], states: usize, least_score: f64, of: &StateOf) -> Self {
        let counts = vec![vec![0; states]; states];
        let mut confusion = Self { counts, missed: vec![0; states], spurious: vec![0; states] };
        for (p, picture) in pictures.iter().enumerate() {
            confusion.add(p, picture, states, least_score, of);
        }
        confusion
    }

    fn add(&mut self, p: usize, picture: &Picture, states: usize, least_score: f64, of: &StateOf) {
        let state = |state: Option<usize>| state.filter(|s| *s < states);
        let is_sure = |(_, found): &(usize, &FoundObject)| found.score >= least_score;
        let mut detections: Vec<(usize, &FoundObject)> =
            picture.detections.iter().enumerate().filter(is_sure).collect();
        detections.sort_by(|(_, a), (_, b)| b.score.total_cmp(&a.score));
        let mut is_taken = vec![false; picture.objects.len()];
        for (d, found) in detections {
            let overlap_of = |object: &TrueObject| overlap(found.bounds, object.bounds, object.crowd);
            let free = picture.objects.iter().enumerate().filter(|(i, object)| object.crowd || !is_taken[*i]);
            let near =
                free.map(|(i, object)| (i, object, overlap_of(object))).filter(|(.., v)| *v >= OVERLAP);
            // An object that counts comes before one that is ignored.
            let best = near.max_by(|(_, a, va), (_, b, vb)| {
                let counts = |object: &TrueObject| !(object.crowd || object.ignore);
                counts(a).cmp(&counts(b)).then(va.total_cmp(vb))
            });
            let found = state((of.detection)(p, d));
            let Some((i, object, _)) = best else {
                found.into_iter().for_each(|found| self.spurious[found] += 1);
                continue;
            };
            is_taken[i] = true;
            if let (false, Some(is), Some(found)) =
                (object.crowd || object.ignore, state((of.object)(p, i)), found)
            {
                self.counts[is][found] += 1;
            }
        }
        for (i, object) in picture.objects.iter().enumerate() {
            if let (false, Some(is)) =
                (is_taken[i] || object.crowd || object.ignore, state((of.object)(p, i)))
            {
                self.missed[is] += 1;
            }
        }
    }

    /// Detected objects whose state is known and found.
    pub fn detected(&self) -> u64 {
        self.counts.iter().flatten().sum()
    }

    /// Those of them whose state is right.
    pub fn right(&self) -> u64 {
        self.counts.iter().enumerate().map(|(s, row)| row[s]).sum()
    }

    /// Share of the detected objects whose state is right; `None` if none was detected.
    pub fn accuracy(&self) -> Option<f64> {
        let all = self.detected();
        (all > 0).then(|| self.right() as f64 / all as f64)
    }

    /// Share of all objects of a state that are detected with this state; `None` if there are none.
    pub fn recall(&self, state: usize) -> Option<f64> {
        let row = self.counts.get(state)?;
        let all = row.iter().sum::<u64>() + self.missed[state];
        (all > 0).then(|| row[state] as f64 / all as f64)
    }
}
