//! The lens of a camera in work: where it starts and may go, what it must keep, and the PSFs that are made of it.

pub(crate) mod numbers;
pub mod placed_psf;
pub mod psf_plan;
pub mod requirements;
pub mod restored;
pub mod sampler;
pub mod start;
pub mod view;
