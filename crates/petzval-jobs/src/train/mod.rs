//! `train`: networks that replace a stage without a gradient: an ISP, or, as in the paper, ray tracing.

mod folder;
pub mod isp_proxy;
pub mod optics_proxy;
mod request;

pub use folder::Record;

pub use self::request::Request;
