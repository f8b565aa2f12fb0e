//! Networks that improve a developed picture.

mod conv;
mod conv_kernel;
mod cpu_op;
mod error;
mod leaky_conv;
mod planes;
mod unet;

pub use conv::{conv_leaky, conv3x3_leaky};
pub use error::NetworkError;
pub use unet::{UNet, UNetConfig};

use burn::prelude::*;

/// A network behind the development.
pub trait PictureNetwork {
    /// Finishes developed pictures `[batch, 3, height, width]`, sRGB-encoded.
    fn finish(&self, developed: Tensor<4>) -> Tensor<4>;
}
