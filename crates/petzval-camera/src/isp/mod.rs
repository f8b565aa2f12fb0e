//! Image signal processors: from a raw frame back to a picture.

mod linear;

pub(crate) use linear::highest_light;
pub use linear::{LinearIsp, SHADING_FLOOR};
