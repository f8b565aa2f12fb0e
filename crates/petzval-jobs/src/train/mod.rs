//! `train`: networks that stand in for what has no gradient, or for what once had none.

mod folder;
pub mod isp_proxy;
pub mod optics_proxy;

pub use folder::Record;
