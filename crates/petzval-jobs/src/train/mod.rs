//! `train`: networks that stand in for what has no gradient.

pub mod isp_proxy;
