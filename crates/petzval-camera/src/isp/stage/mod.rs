//! The stages of the automotive ISP, one file each, in two versions: `fixed` in whole numbers, as a chip does it, and `smooth` on the tape.

pub mod bayer_denoise;
pub mod black_level;
pub mod colour;
pub mod colour_denoise;
pub mod defects;
pub mod demosaic;
pub mod dewarp;
pub mod gain;
pub mod gamma;
pub mod green_balance;
pub mod output;
pub mod purple_fringe;
pub mod shading;
pub mod sharpen;
pub mod stabilise;
pub mod tone_map;
pub mod white_balance;
