//! When a detection counts as right: the protocols of COCO and Pascal VOC.

/// When a detection counts as right.
#[derive(Clone, Debug, PartialEq)]
pub struct Protocol {
    /// Overlaps at which detection and object match, ascending.
    pub(super) thresholds: Vec<f64>,
    /// Detections of one class that count in a picture, best first.
    pub(super) most_detections: usize,
    pub(super) rule: Rule,
}

/// How detections choose among objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// The best free object that is not ignored, else the best ignored one.
    BestFree,
    /// The best object; if another detection has it already, this one is wrong.
    Best,
}

impl Protocol {
    /// COCO: overlaps of 0.5, 0.55, ..., 0.95, and 100 detections of each class in a picture.
    pub fn coco() -> Self {
        // The formula of numpy's linspace; 0.5 + 0.05 i misses 0.9 by rounding.
        let step = (0.95 - 0.5) / 9.0;
        let thresholds = (0..10).map(|i| 0.5 + f64::from(i) * step).collect();
        Self { thresholds, most_detections: 100, rule: Rule::BestFree }
    }

    /// As COCO at a single overlap, such as 0.5.
    pub fn coco_at(overlap: f64) -> Self {
        Self { thresholds: vec![overlap], ..Self::coco() }
    }

    /// Pascal VOC: all detections count, and each stands for the object that it overlaps most. VOC itself takes 0.5.
    pub fn voc_at(overlap: f64) -> Self {
        Self { thresholds: vec![overlap], most_detections: usize::MAX, rule: Rule::Best }
    }

    /// The overlaps at which detection and object match.
    pub fn thresholds(&self) -> &[f64] {
        &self.thresholds
    }
}
