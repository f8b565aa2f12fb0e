//! Cameras that are designed: gradients, variants, objectives, networks in place of something exact.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/line_integral.rs"]
mod line_integral;

mod blend;
mod detection;
mod distortion;
mod exposure;
mod hardware_isp;
mod joint_gradient;
mod optics_proxy;
mod variants;
