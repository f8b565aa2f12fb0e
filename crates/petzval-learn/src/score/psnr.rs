//! Peak signal-to-noise ratio.

use petzval_camera::quality::psnr;

use super::{Score, ScoreError, ScoredPair};

/// `-10 log10(mean square difference)` of sRGB-encoded values in 0..1, dB.
pub struct Psnr;

/// The PSNR of a picture that equals its truth, which the formula makes infinite: a mean over pictures has to be a number.
const MOST_DB: f64 = 100.0;

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
        "-10 log10 of the mean square difference of sRGB-encoded values in 0..1, at most 100 dB"
    }

    fn decimals(&self) -> usize {
        2
    }

    fn of(&self, pair: &ScoredPair) -> Result<f64, ScoreError> {
        // Pictures of finite numbers have a PSNR, or equal their truth: no NaN is hidden by the limit.
        Ok(psnr(&pair.truth.data, &pair.finished.data)?.min(MOST_DB))
    }
}
