//! Objects to be found, such as people and cars: the loss of the detector that looks at the finished pictures.

use super::{LabelKind, Labels, NamedLoss, Objective, Taken};
use crate::loss::LossError;

/// The loss of the camera's own detector. Whatever moves, the lens, the ISP or the detector, moves so that the detector finds more.
pub struct FindObjects;

impl Objective for FindObjects {
    fn labels(&self) -> LabelKind {
        LabelKind::Objects
    }

    fn loss(&self, taken: &Taken, labels: &Labels) -> Result<NamedLoss, LossError> {
        let Labels::Objects(truths) = labels else { return Err(LossError::OtherLabels) };
        let detector = taken.detector.ok_or(LossError::NoDetector)?;
        detector.loss(taken.frames.finished.clone(), truths, taken.seed)
    }
}
