//! Peak signal-to-noise ratio.

use petzval_camera::quality::psnr;

use super::{Score, ScoreError, ScoredPair};

/// `-10 log10(mean square difference)` of sRGB-encoded values in 0..1, dB.
pub struct Psnr;

impl Score for Psnr {
    fn name(&self) -> &'static str {
        "psnr_db"
    }

    fn title(&self) -> &'static str {
        "PSNR"
    }

    fn unit(&self) -> &'static str {
        "dB"
    }

    fn definition(&self) -> &'static str {
        "-10 log10 of the mean square difference of sRGB-encoded values in 0..1"
    }

    fn decimals(&self) -> usize {
        2
    }

    fn of(&self, pair: &ScoredPair) -> Result<f64, ScoreError> {
        Ok(psnr(&pair.truth.data, &pair.finished.data)?)
    }
}
