//! Networks that improve a developed picture.

mod conv3x3;
mod conv_kernel;
mod error;
mod leaky_conv;
mod planes;
mod unet;

pub use conv3x3::conv3x3_leaky;
pub use error::NetworkError;
pub use unet::{UNet, UNetConfig};

use burn::prelude::*;

/// A network behind the development.
pub trait PictureNetwork {
    /// Finishes developed pictures `[batch, 3, height, width]`, sRGB-encoded.
    fn finish(&self, developed: Tensor<4>) -> Tensor<4>;
}
