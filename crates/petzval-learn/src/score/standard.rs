//! The list of the scores that Petzval knows by name.

use super::Score;
use super::lpips::OneMinusLpips;
use super::psnr::Psnr;
use super::ssim::Ssim;
use crate::loss::Lpips;

/// Names of the scores of [`standard_scores`], in its order.
pub const STANDARD_SCORES: [&str; 3] = ["one_minus_lpips", "psnr_db", "ssim"];

/// Place of PSNR in [`STANDARD_SCORES`].
const PSNR: usize = 1;

/// The score by which cameras are compared in words, as a place in a list of scores by name: the first. All of [`STANDARD_SCORES`] in their order,
/// which an experiment on pictures has by default, are no choice of a user: of them PSNR leads, whose unit a reader knows.
pub fn leading_score<'n>(names: impl Iterator<Item = &'n str>) -> usize {
    if names.eq(STANDARD_SCORES) { PSNR } else { 0 }
}

/// The scores that Petzval knows by name.
pub fn standard_scores(lpips: &Lpips) -> Vec<Box<dyn Score>> {
    vec![Box::new(OneMinusLpips(lpips.clone())), Box::new(Psnr), Box::new(Ssim)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_score_of_a_list_leads_and_psnr_the_usual_ones() {
        let leader = |names: &[&'static str]| names[leading_score(names.iter().copied())];
        assert_eq!(leader(&STANDARD_SCORES), "psnr_db");
        assert_eq!(leader(&["edge_error", "psnr_db"]), "edge_error");
        assert_eq!(leader(&["ssim", "psnr_db", "one_minus_lpips"]), "ssim");
        assert_eq!(leader(&["one_minus_lpips", "psnr_db"]), "one_minus_lpips");
    }
}
