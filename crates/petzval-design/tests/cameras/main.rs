//! Cameras that are designed: gradients, variants, objectives, networks in place of something exact.

mod blend;
mod common;
mod detection;
mod distortion;
mod exposure;
mod guest_class;
mod hardware_isp;
mod joint_gradient;
mod line_integral;
mod optics_proxy;
mod toy_task;
mod variants;
