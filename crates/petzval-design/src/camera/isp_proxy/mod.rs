//! Training of networks that imitate an image signal processor (ISP) which has no gradient, and what the imitation costs.
//!
//! ```text
//! raw frames -> the ISP, seen only through its interface -> pictures -> ProxyTrainer -> ProxyIsp -> Gap
//! ```
//!
//! Source of the method: E. Tseng et al., "Hyperparameter optimization in black-box image processing using differentiable proxies", ACM
//! TOG 2019.

mod frame;
mod gap;
mod sampling;
mod trainer;

pub use frame::{Frame, take};
pub use gap::{Gap, Judge, ParameterSlope, ScoreGap};
pub(crate) use trainer::PAIRS;
pub use trainer::{ProxyTrainer, ProxyTraining, StepLosses};
