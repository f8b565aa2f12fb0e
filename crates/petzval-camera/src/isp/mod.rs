//! Image signal processors: from a raw frame back to a picture.

mod demosaic;
mod input;
mod interface;
mod interpolation;
mod linear;
mod stabilise;

pub use demosaic::Demosaic;
pub use input::{Companding, FrameData, Mesh, NoiseProfile, RawInput};
pub use interface::{DifferentiableIsp, Isp, IspError, IspParameter, RgbPicture, check_values};
pub use interpolation::{Domain, Interpolation};
pub(crate) use linear::highest_light;
pub use linear::{LinearIsp, SHADING_FLOOR};
pub use stabilise::Stabiliser;
