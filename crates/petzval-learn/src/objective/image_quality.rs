//! A picture for people to look at: differences of pixels, structure and features against the photograph.

use super::{LabelKind, Labels, NamedLoss, Objective, Taken};
use crate::loss::{ImageLoss, LossError, Lpips};

/// The weighted sum of L1, L2, `1 - SSIM` and LPIPS of finished picture and truth, see [`ImageLoss`].
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
        let weighted = parts.parts.iter().map(|part| f64::from(part.weight) * f64::from(part.value));
        let total = weighted.sum::<f64>();
        let mut named: Vec<(&'static str, f64)> =
            parts.parts.iter().map(|part| (part.name, f64::from(part.value))).collect();
        named.push(("total", total));
        Ok(NamedLoss { total: parts.total, parts: named })
    }
}
