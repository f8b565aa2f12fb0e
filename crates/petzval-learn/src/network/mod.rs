//! Networks that finish a developed picture: software image signal processors (ISP).

mod any;
mod conv3x3;
mod conv_kernel;
mod error;
mod input;
mod leaky_conv;
mod planes;
mod restoration;
mod stored;
mod unet;

pub use any::{Network, NetworkKind};
pub use conv3x3::conv3x3_leaky;
pub use error::NetworkError;
pub use input::NetworkInput;
pub use restoration::RestorationNetwork;
pub use unet::{UNet, UNetConfig};

use burn::prelude::*;

/// A network behind the development.
pub trait PictureNetwork {
    /// The finished pictures `[batch, 3, height, width]`, sRGB-encoded.
    fn finish(&self, input: &NetworkInput) -> Tensor<4>;

    /// The curves `[3, KNOTS]` of the [restoration](petzval_camera::render::Wiener::curves) in front of it, if they are trained with it.
    fn curves(&self) -> Option<Tensor<2>> {
        None
    }
}
