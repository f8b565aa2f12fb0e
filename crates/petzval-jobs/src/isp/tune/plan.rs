//! The plan of a search.

use std::path::PathBuf;

use crate::isp::NEUTRAL;
use crate::isp::frame::FrameOptions;

petzval_base::parameters! {
    /// What is tuned for what.
    pub struct Plan {
        /// Folder of raw frames with sidecars.
        raws: PathBuf = PathBuf::new();
        /// Folder of the pictures that each should become: a picture of the same name, and of the same size.
        reference: PathBuf = PathBuf::new();
        /// Name of a preset, or a file of settings or of the description of an external ISP.
        isp: String = NEUTRAL.to_owned();
        /// Further values, each `stage.key=value`.
        set: Vec<String> = Vec::new();
        /// Score to raise: `psnr_db`, `ssim` or `one_minus_lpips`; `psnr` and `lpips` mean the same.
        objective: String = "psnr".to_owned();
        /// Parameters that vary: names, stages, or `all`.
        vary: Vec<String> = crate::usual::every_parameter();
        /// What the raw files leave open.
        frame: FrameOptions = FrameOptions::default();
        /// Seed of the search.
        seed: u64 = crate::usual::seed();
    }
}
