//! Networks that restore a picture, improve a developed one, or imitate its development.
//!
//! | network | input | output |
//! |---|---|---|
//! | [`UNet`] | developed picture | the finished picture |
//! | [`Naf`] | any planes of a picture | the correction of the picture |
//! | [`IspProxy`] | raw mosaic and parameters | what a black-box image signal processor (ISP) develops |
//!
//! The operations below them are ours on the CPU and the framework's on other devices: [`conv_leaky`], [`depthwise`],
//! [`pointwise`].

mod conv;
mod conv_kernel;
mod cpu_op;
mod depthwise;
mod error;
mod isp_proxy;
mod leaky_conv;
mod naf;
mod planes;
mod pointwise;
mod pointwise_kernel;
mod trunk;
mod unet;
mod weights;

pub use conv::{conv_leaky, conv3x3_leaky};
pub use depthwise::depthwise;
pub use error::NetworkError;
pub use isp_proxy::{IspProxy, IspProxyConfig};
pub use naf::{Naf, NafConfig};
pub use pointwise::{gated_pointwise, normalized_pointwise, pointwise};
pub use unet::{UNet, UNetConfig};

use burn::prelude::*;

/// A network behind the development.
pub trait PictureNetwork {
    /// Finishes developed pictures `[batch, 3, height, width]`, sRGB-encoded.
    fn finish(&self, developed: Tensor<4>) -> Tensor<4>;
}
