//! `isp`: image signal processors, ours and those of others.

pub mod chart;
pub mod develop;
pub mod external;
mod frame;
mod named;
mod pile;
pub mod show;
pub mod tune;

pub use frame::{FrameOptions, Merge};
pub(crate) use named::external_isp;
pub use named::{NEUTRAL, NamedIsp, isp_by_name};
