//! A network behind a restoration whose regularisation is trained with it.

use burn::{
    module::{Module, Param},
    prelude::*,
};
use petzval_camera::image::CHANNELS;
use petzval_camera::render::KNOTS;

use super::{NetworkError, NetworkInput, PictureNetwork, UNet, UNetConfig, weights::Initializer};

/// Channels of the input: restored 3, developed 3, field 1, noise 1.
const IN_CHANNELS: usize = 2 * CHANNELS + 2;

/// The noise of 400 electrons of white, 0.025 roots of white, becomes 1.
const NOISE_SCALE: f32 = 40.0;

/// The curves bend by this times their parameter, so that the learning rate of the weights suits them.
const CURVE_SCALE: f32 = 4.0;

/// Mixes the restored with the developed picture and adds what it finds missing:
/// `output = restored + share (developed - restored) + missing`, with `(share, missing) = U(restored, developed, field, noise)`.
///
/// The restoration in front of it has divided out the blur with the PSFs of the place; its regularisation, a curve over frequency for each
/// colour, is trained with the weights. Restoration rings beside strong edges, most visibly in the dark, and where the lens is sharp there
/// is little to restore: there the developed picture is the better one, and the network finds its share pixel by pixel and colour by colour.
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
        let out_channels = 2 * CHANNELS;
        let config = UNetConfig { base_channels, levels, in_channels: IN_CHANNELS, out_channels };
        // Another seed than the weights': their numbers under which an optimiser keeps its state differ.
        let mut initializer = Initializer::new(!seed, device);
        Ok(Self { curves: initializer.zeros([CHANNELS, KNOTS]), correction: config.init(seed, device)? })
    }
}

impl PictureNetwork for RestorationNetwork {
    fn finish(&self, input: &NetworkInput) -> Tensor<4> {
        let (restored, developed) = (input.picture(), input.developed.clone());
        let pictures = Tensor::cat(vec![restored.clone(), developed.clone()], 1);
        let seen = vec![pictures.clone(), input.field.clone(), input.noise.clone() * NOISE_SCALE];
        // The U-Net adds what it finds to its first channels, which are the two pictures.
        let found = (self.correction.forward(Tensor::cat(seen, 1)) - pictures).chunk(2, 1);
        let [missing, share] = found.try_into().expect("two halves");
        restored.clone() + share * (developed - restored) + missing
    }

    fn curves(&self) -> Option<Tensor<2>> {
        Some(self.curves.val() * CURVE_SCALE)
    }
}
