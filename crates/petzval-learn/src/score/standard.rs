//! The list of the scores that Petzval knows by name.

use super::Score;
use super::lpips::OneMinusLpips;
use super::psnr::Psnr;
use super::ssim::Ssim;
use crate::loss::Lpips;

/// Names of the scores of [`standard_scores`], in its order.
pub const STANDARD_SCORES: [&str; 3] = ["one_minus_lpips", "psnr_db", "ssim"];

/// The scores that Petzval knows by name.
pub fn standard_scores(lpips: &Lpips) -> Vec<Box<dyn Score>> {
    vec![Box::new(OneMinusLpips(lpips.clone())), Box::new(Psnr), Box::new(Ssim)]
}
