//! Image signal processors: from a raw frame back to a picture.

mod demosaic;
mod interpolation;
mod linear;
mod noise_level;
mod stabilise;

pub use demosaic::Demosaic;
pub use interpolation::{Domain, Interpolation};
pub(crate) use linear::highest_light;
pub use linear::{LinearIsp, SHADING_FLOOR};
pub use noise_level::stabilised_noise;
pub use stabilise::Stabiliser;
