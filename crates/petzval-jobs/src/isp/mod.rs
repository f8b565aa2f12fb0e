//! `isp`: image signal processors, ours and those of others.

pub mod chart;
pub mod develop;
mod frame;
pub mod show;
pub mod tune;

pub use crate::named_isp::{NEUTRAL, NamedIsp, about_frame, external, isp_by_name, preset_file};
pub use frame::{FrameOptions, Merge, RawInMemory, frame_in_memory, frames_like, read_frame};
