//! Structural similarity.

use petzval_camera::image::LinearImage;
use petzval_camera::quality::ssim_gaussian_wang;

use super::{Score, ScoreError, ScoredPair};

/// SSIM with a Gaussian window of 11x11, sigma 1.5, population covariance, mean over the channels.
pub struct Ssim;

impl Score for Ssim {
    fn name(&self) -> &'static str {
        "ssim"
    }

    fn title(&self) -> &'static str {
        "SSIM"
    }

    fn definition(&self) -> &'static str {
        "Gaussian window of 11x11, sigma 1.5, population covariance, mean over the channels"
    }

    fn decimals(&self) -> usize {
        4
    }

    fn of(&self, pair: &ScoredPair) -> Result<f64, ScoreError> {
        let LinearImage { channels, height, width, .. } = pair.finished;
        Ok(ssim_gaussian_wang(&pair.truth.data, &pair.finished.data, channels, height, width)?)
    }
}
