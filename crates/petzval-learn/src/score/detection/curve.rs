//! Precision over recall, and the area below it.

/// How the area below precision over recall is taken. Precision is first made monotone: at every recall the best precision at this or a
/// larger recall counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Mean at recalls of 0, 0.01, ..., 1 (COCO).
    Points101,
    /// Mean at recalls of 0, 0.1, ..., 1 (Pascal VOC up to 2009).
    Points11,
    /// The whole area (Pascal VOC from 2010).
    AllPoints,
}

/// Precision over recall of one class, at the detections that are right, best first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrecisionRecall {
    /// Share of the objects that are detected so far, ascending.
    pub recall: Vec<f64>,
    /// Share of the detections that are right, monotone: the best at this or a larger recall.
    pub precision: Vec<f64>,
    /// Score of the detection.
    pub score: Vec<f64>,
}

impl PrecisionRecall {
    /// Makes precision monotone.
    pub(super) fn monotone(mut self) -> Self {
        for i in (1..self.precision.len()).rev() {
            self.precision[i - 1] = self.precision[i - 1].max(self.precision[i]);
        }
        self
    }

    /// Precision at a recall, and the score of the detection that reaches it; 0 and 0 where no detection does.
    pub fn at(&self, recall: f64) -> (f64, f64) {
        let i = self.recall.partition_point(|r| *r < recall);
        self.precision.get(i).map_or((0.0, 0.0), |precision| (*precision, self.score[i]))
    }

    /// The area below the curve, 0..1.
    pub fn area(&self, interpolation: Interpolation) -> f64 {
        let mean = |intervals: u32, recall: &dyn Fn(f64) -> f64| {
            let sum: f64 = (0..=intervals).map(|i| self.at(recall(f64::from(i))).0).sum();
            sum / f64::from(intervals + 1)
        };
        match interpolation {
            // The formula of numpy's linspace, so that the same detections reach each recall.
            Interpolation::Points101 => mean(100, &|i| i * (1.0 / 100.0)),
            Interpolation::Points11 => mean(10, &|i| i / 10.0),
            Interpolation::AllPoints => {
                let mut before = 0.0;
                let steps = self.recall.iter().zip(&self.precision).map(|(recall, precision)| {
                    let step = recall - before;
                    before = *recall;
                    step * precision
                });
                steps.sum()
            }
        }
    }
}
