//! `train`: networks that stand in for what has no gradient, or for what once had none.

mod folder;
pub mod isp_proxy;
pub mod optics_proxy;
mod request;

pub use folder::Record;

pub use self::request::Request;
