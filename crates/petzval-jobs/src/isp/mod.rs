//! `isp`: image signal processors, ours and those of others.

pub mod develop;
pub mod external;
mod frame;
mod named;
mod plain;
pub mod show;
pub mod tune;

pub use frame::FrameOptions;
pub use named::{AnyIsp, NEUTRAL, NamedIsp, isp_by_name};
pub use plain::PlainIsp;
