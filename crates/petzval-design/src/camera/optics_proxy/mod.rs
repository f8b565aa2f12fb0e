//! A network in place of ray tracing: the optics meta-network of the paper, and what it costs.
//!
//! ```text
//! LensSampler -> lenses -> exact PSFs -> ProxyOpticsTrainer -> ProxyOptics -> OpticsGap
//! ```
//!
//! Exact tracing needs no stand-in. This one exists to measure the cost of the network that the paper needed. A camera may take its PSFs
//! from it while its lens moves. Scores always use exact tracing.
//!
//! Source: E. Tseng et al., "Differentiable Compound Optics and Processing Pipeline Optimization for End-to-end Camera Design", ACM TOG
//! 2021, supplement, sections 4 and 5.

mod file;
mod gap;
mod proxy;
mod trainer;

pub use file::{FILES, read_proxy_optics};
pub use gap::{OpticsFieldGap, OpticsGap, OpticsJudge, Seconds};
pub use proxy::{ProxyDomain, ProxyOptics, ProxyPsfs, Scale};
pub use trainer::{OpticsLosses, OpticsTraining, ProxyOpticsTrainer};
