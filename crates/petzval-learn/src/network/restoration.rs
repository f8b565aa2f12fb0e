//! A network behind a restoration whose regularisation is trained with it.

use burn::{
    module::{Module, Param},
    prelude::*,
};
use petzval_camera::image::CHANNELS;
use petzval_camera::render::KNOTS;

use super::{NetworkError, NetworkInput, PictureNetwork, UNet, UNetConfig, leaky_conv::Initializer};

/// Channels of the input: restored 3, developed 3, field 1, noise 1.
const IN_CHANNELS: usize = 2 * CHANNELS + 2;

/// The noise of 400 electrons of white, 0.025 roots of white, becomes 1.
const NOISE_SCALE: f32 = 40.0;

/// The curves bend by this times their parameter, so that the learning rate of the weights suits them.
const CURVE_SCALE: f32 = 4.0;

/// Adds what it finds missing to the restored picture: `output = restored + U(restored, developed, field, noise)`.
///
/// The restoration in front of it has divided out the blur with the PSFs of the place; its regularisation, a curve over frequency for each
/// colour, is trained with the weights. The network sees both pictures, so that it can fall back on the developed one where the
/// restoration rings, its place in the field and the noise.
#[derive(Module, Debug)]
pub struct RestorationNetwork {
    curves: Param<Tensor<2>>,
    correction: UNet,
}

impl RestorationNetwork {
    /// A network of these sizes, with weights drawn from `seed` alone, that starts with the restored picture and straight curves.
    pub fn init(
        base_channels: usize,
        levels: usize,
        seed: u64,
        device: &Device,
    ) -> Result<Self, NetworkError> {
        let config = UNetConfig { base_channels, levels, in_channels: IN_CHANNELS, out_channels: CHANNELS };
        // Another seed than the weights': their numbers under which an optimiser keeps its state differ.
        let mut initializer = Initializer::new(!seed, device);
        Ok(Self { curves: initializer.zeros([CHANNELS, KNOTS]), correction: config.init(seed, device)? })
    }
}

impl PictureNetwork for RestorationNetwork {
    fn finish(&self, input: &NetworkInput) -> Tensor<4> {
        let seen = vec![
            input.picture(),
            input.developed.clone(),
            input.field.clone(),
            input.noise.clone() * NOISE_SCALE,
        ];
        // The U-Net adds its output to its first channels, which are the restored picture.
        self.correction.forward(Tensor::cat(seen, 1))
    }

    fn curves(&self) -> Option<Tensor<2>> {
        Some(self.curves.val() * CURVE_SCALE)
    }
}
