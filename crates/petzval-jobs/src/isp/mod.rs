//! `isp`: image signal processors, ours and those of others.

pub mod chart;
pub mod develop;
mod frame;
mod pile;
pub mod show;
pub mod tune;

pub use crate::named_isp::{NEUTRAL, NamedIsp, external, isp_by_name};
pub use frame::{FrameOptions, Merge};
