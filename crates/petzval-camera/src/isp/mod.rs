//! Image signal processors: from a raw frame back to a picture.

mod auto_balance;
mod auto_exposure;
mod clipped;
mod dewarp_map;
mod error;
mod fine_mesh;
mod fixed;
mod hardware;
mod input;
mod interface;
mod merge;
mod mesh;
mod notes;
mod settings;
mod smooth;
mod stage;
mod statistics;
mod tape_grid;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod width_tests;
mod ycbcr_output;

pub use auto_balance::{BalanceGains, BalanceMethod, BalanceOptions, auto_balance};
pub use auto_exposure::{ExposureOptions, finished_exposure_ev};
pub use clipped::Clipped;
pub use dewarp_map::DewarpMap;
pub use error::IspError;
pub use hardware::HardwareIsp;
pub use input::{Companding, FrameData, Mesh, NoiseProfile, RawInput};
pub use interface::{
    DifferentiableIsp, Isp, IspParameter, RgbPicture, check_values, developed_without_gradient,
    smooth_picture, smooth_pull_back,
};
pub use merge::{MergeOptions, Merged, Motion, merge_exposures};
pub use notes::Watch;
pub use settings::{GainKnot, IspPreset, IspSettings};
pub use smooth::SmoothIsp;
pub use stage::output::{BT601, BT709, ycbcr};
pub use stage::shading::Shading;
pub use statistics::{BINS, Statistics, ZONES, Zone};
pub use ycbcr_output::{Chroma, Range, Standard, YcbcrFormat, YcbcrPicture};
