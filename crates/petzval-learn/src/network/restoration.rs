//! A network behind a restoration whose regularisation is trained with it.

use burn::{
    module::{Module, Param},
    prelude::*,
};
use petzval_camera::image::CHANNELS;
use petzval_camera::render::KNOTS;

use super::{
    Naf, NafConfig, NetworkError, NetworkInput, PictureNetwork, Reach, UNet, UNetConfig, weights::Initializer,
};

/// Channels of the input: restored 3, developed 3, field 1, noise 1.
const IN_CHANNELS: usize = 2 * CHANNELS + 2;
/// Channels of the output: what is missing 3, share of the developed picture 3.
const OUT_CHANNELS: usize = 2 * CHANNELS;

/// The noise of 400 electrons of white, 0.025 roots of white, becomes 1.
const NOISE_SCALE: f32 = 40.0;

/// The curves bend by this times their parameter, so that the learning rate of the weights suits them.
const CURVE_SCALE: f32 = 4.0;

/// Mixes the restored with the developed picture and adds what it finds missing:
/// `output = restored + share (developed - restored) + missing`, with `(share, missing) = N(restored, developed, field, noise)`,
/// where N is a [`UNet`] or a [`Naf`].
///
/// The restoration in front of it has divided out the blur with the PSFs of the place; its regularisation, a curve over frequency for each
/// colour, is trained with the weights. Restoration rings beside strong edges, most visibly in the dark. Where the lens is sharp there is
/// little to restore, and the developed picture is the better one. The network finds its share pixel by pixel and colour by colour.
#[derive(Module, Debug)]
pub struct RestorationNetwork<N: Module> {
    curves: Param<Tensor<2>>,
    correction: N,
}

/// A network that finds what is missing in a picture, and which share of the developed picture belongs into it.
pub trait Correction: Module + Sync {
    /// A network of these sizes, with weights drawn from `seed` alone, that finds nothing yet.
    fn init(base_channels: usize, levels: usize, seed: u64, device: &Device) -> Result<Self, NetworkError>;

    /// What is missing and the share `[batch, 6, height, width]`, from planes `[batch, 8, height, width]` of which the first six are the
    /// pictures.
    fn find(&self, seen: Tensor<4>) -> Tensor<4>;

    /// How far it looks.
    fn reach(&self) -> Reach;
}

impl Correction for UNet {
    fn init(base_channels: usize, levels: usize, seed: u64, device: &Device) -> Result<Self, NetworkError> {
        let config =
            UNetConfig { base_channels, levels, in_channels: IN_CHANNELS, out_channels: OUT_CHANNELS };
        config.init(seed, device)
    }

    fn find(&self, seen: Tensor<4>) -> Tensor<4> {
        // It adds what it finds to its first channels.
        let [batch, ..] = seen.dims();
        self.forward(seen.clone()) - seen.slice([0..batch, 0..OUT_CHANNELS])
    }

    fn reach(&self) -> Reach {
        self.reach()
    }
}

impl Correction for Naf {
    fn init(base_channels: usize, levels: usize, seed: u64, device: &Device) -> Result<Self, NetworkError> {
        let (in_channels, out_channels) = (IN_CHANNELS, OUT_CHANNELS);
        let config = NafConfig { base_channels, levels, in_channels, out_channels, ..NafConfig::default() };
        config.init(seed, device)
    }

    fn find(&self, seen: Tensor<4>) -> Tensor<4> {
        self.forward(seen)
    }

    fn reach(&self) -> Reach {
        self.reach()
    }
}

impl<N: Correction> RestorationNetwork<N> {
    /// A network of these sizes, with weights drawn from `seed` alone, that starts with the restored picture and straight curves.
    pub fn init(
        base_channels: usize,
        levels: usize,
        seed: u64,
        device: &Device,
    ) -> Result<Self, NetworkError> {
        // Another seed than the weights': their numbers under which an optimiser keeps its state differ.
        let mut initializer = Initializer::new(!seed, device);
        Ok(Self {
            curves: initializer.zeros([CHANNELS, KNOTS]),
            correction: N::init(base_channels, levels, seed, device)?,
        })
    }
}

impl<N: Correction> PictureNetwork for RestorationNetwork<N> {
    fn finish(&self, input: &NetworkInput) -> Tensor<4> {
        let (restored, developed) = (input.picture(), input.developed.clone());
        let seen =
            vec![restored.clone(), developed.clone(), input.field.clone(), input.noise.clone() * NOISE_SCALE];
        let found = self.correction.find(Tensor::cat(seen, 1)).chunk(2, 1);
        let [missing, share] = found.try_into().expect("two halves");
        restored.clone() + share * (developed - restored) + missing
    }

    fn reach(&self) -> Option<Reach> {
        Some(self.correction.reach())
    }

    fn curves(&self) -> Option<Tensor<2>> {
        Some(self.curves.val() * CURVE_SCALE)
    }
}
