//! The list of the scores that Petzval knows by name.

use super::Score;
use super::lpips::OneMinusLpips;
use super::psnr::Psnr;
use super::ssim::Ssim;
use crate::loss::Lpips;

/// The scores that Petzval knows by name.
pub fn standard_scores(lpips: &Lpips) -> Vec<Box<dyn Score>> {
    vec![Box::new(OneMinusLpips(lpips.clone())), Box::new(Psnr), Box::new(Ssim)]
}
