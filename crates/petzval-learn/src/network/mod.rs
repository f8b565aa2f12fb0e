//! Networks that restore a picture, improve a developed one, read the classes of its pixels, or imitate its development or a lens.
//!
//! | network | input | output |
//! |---|---|---|
//! | [`UNet`] | developed picture | the finished picture |
//! | [`Segmenter`] | finished picture | the class of each pixel |
//! | [`Naf`] | any planes of a picture | the correction of the picture |
//! | [`IspProxy`] | raw mosaic and parameters | what a black-box image signal processor (ISP) develops |
//! | [`OpticsProxy`] | numbers of a lens and a field | its point spread functions |
//!
//! The operations below them are ours: [`conv_leaky`], [`depthwise`], [`pointwise`]. On a GPU they are kernels of our own around the
//! framework's matrix products and full convolutions.

mod any;
mod conv;
mod conv_kernel;
mod depthwise;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod device;
mod guest_network;
mod input;
mod isp_proxy;
mod leaky_conv;
mod naf;
mod optics_proxy;
mod planes;
mod pointwise;
mod pointwise_kernel;
mod resize;
mod restoration;
mod segmenter;
mod tiles;
mod trunk;
mod unet;
mod weights;

pub use crate::weight_file::NetworkError;
pub use any::{Network, NetworkKind};
pub(crate) use conv::conv_by_framework;
pub use conv::{conv_leaky, conv3x3_leaky};
pub use depthwise::depthwise;
pub(crate) use depthwise::depthwise_by_framework;
pub use guest_network::GuestNetwork;
pub use input::NetworkInput;
pub use isp_proxy::{IspProxy, IspProxyConfig};
pub use naf::{Naf, NafConfig};
pub use optics_proxy::{OpticsProxy, OpticsProxyConfig, PROXY_GRID, PredictedPsfs};
pub(crate) use pointwise::mix_by_framework;
pub use pointwise::{gated_pointwise, normalized_pointwise, pointwise};
pub(crate) use pointwise_kernel::Prologue;
pub use resize::resized;
pub use restoration::{Correction, RestorationNetwork};
pub use segmenter::Segmenter;
pub use tiles::{Reach, in_tiles, in_tiles_of};
pub use unet::{UNet, UNetConfig};
pub(crate) use weights::Initializer;

use burn::prelude::*;

use crate::guest::GuestError;

/// Pixels a side of the tiles of large pictures, a multiple of every network's unit: a network of 16 channels takes half a gigabyte for one.
pub const TILE: usize = 1024;

/// A network behind the development.
pub trait PictureNetwork: Send + Sync {
    /// The finished pictures `[batch, 3, height, width]`, sRGB-encoded.
    fn finish(&self, input: &NetworkInput) -> Tensor<4>;

    /// How far it looks; none if a pixel depends on no other.
    fn reach(&self) -> Option<Reach> {
        None
    }

    /// The finished pictures, made [in tiles](in_tiles) where they are larger than [`TILE`] a side.
    fn finish_in_tiles(&self, input: &NetworkInput) -> Tensor<4> {
        match self.reach() {
            Some(reach) => in_tiles(input, TILE, reach, |tile| self.finish(tile)),
            None => self.finish(input),
        }
    }

    /// Whether it sees all pictures of a batch in one call, as a network of a user does: it is never called from several threads at once.
    fn takes_whole_batches(&self) -> bool {
        false
    }

    /// Fails if a network of a user could not do its work since it was made: what it gave then was no result.
    fn check(&self) -> Result<(), GuestError> {
        Ok(())
    }

    /// The curves `[3, KNOTS]` of the [restoration](petzval_camera::render::Wiener::curves) in front of it, if they are trained with it.
    fn curves(&self) -> Option<Tensor<2>> {
        None
    }
}
