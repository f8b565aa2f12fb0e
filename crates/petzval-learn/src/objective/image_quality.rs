//! A picture for people to look at: pixel differences and LPIPS against the photograph.

use super::{LabelKind, Labels, NamedLoss, Objective, Taken};
use crate::loss::{ImageLoss, LossError, Lpips};

/// `l1_weight * mean |finished - truth| + lpips_weight * LPIPS(finished, truth)`, see [`ImageLoss`].
pub struct ImageQuality {
    loss: ImageLoss,
    lpips: Lpips,
}

impl ImageQuality {
    /// Refuses weights that are negative or not finite.
    pub fn new(loss: ImageLoss, lpips: Lpips) -> Result<Self, LossError> {
        loss.check()?;
        Ok(Self { loss, lpips })
    }
}

impl Objective for ImageQuality {
    fn labels(&self) -> LabelKind {
        LabelKind::Pictures
    }

    fn loss(&self, taken: &Taken, labels: &Labels) -> Result<NamedLoss, LossError> {
        let Labels::Pictures(pictures) = labels else { return Err(LossError::OtherLabels) };
        let target = self.loss.target(&self.lpips, pictures.clone())?;
        let parts = self.loss.evaluate(&self.lpips, taken.frames.finished.clone(), &target)?;
        let mut named = Vec::new();
        let mut total = 0.0;
        for (name, weight, value) in
            [("l1", self.loss.l1_weight, parts.l1), ("lpips", self.loss.lpips_weight, parts.lpips)]
        {
            if let Some(value) = value {
                named.push((name, f64::from(value)));
                total += f64::from(weight) * f64::from(value);
            }
        }
        named.push(("total", total));
        Ok(NamedLoss { total: parts.total, parts: named })
    }
}
