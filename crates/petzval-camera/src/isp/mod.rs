//! Image signal processors: from a raw frame back to a picture.

mod demosaic;
mod linear;

pub use demosaic::Demosaic;
pub(crate) use linear::highest_light;
pub use linear::{LinearIsp, SHADING_FLOOR};
