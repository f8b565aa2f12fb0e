//! `1 - LPIPS`: perceived similarity.

use super::{Score, ScoreError, ScoredPair};
use crate::loss::{LossError, Lpips, image_loss::read_values};

/// `1 - LPIPS` (AlexNet, v0.1): 1 for a picture equal to its truth.
pub struct OneMinusLpips(pub Lpips);

impl Score for OneMinusLpips {
    fn name(&self) -> &'static str {
        "one_minus_lpips"
    }

    fn title(&self) -> &'static str {
        "1 − LPIPS"
    }

    fn definition(&self) -> &'static str {
        "LPIPS 0.1 with AlexNet (Zhang et al. 2018): the distance of the features of two pictures"
    }

    fn decimals(&self) -> usize {
        4
    }

    fn of(&self, pair: &ScoredPair) -> Result<f64, ScoreError> {
        let target = self.0.target(pair.truth_tensor.clone())?;
        let distances = read_values(self.0.distance_to(pair.finished_tensor.clone().detach(), &target)?)?;
        match distances.first() {
            Some(distance) if distance.is_finite() => Ok(f64::from(1.0 - distance)),
            _ => Err(LossError::NotANumber("features of the pictures").into()),
        }
    }
}
