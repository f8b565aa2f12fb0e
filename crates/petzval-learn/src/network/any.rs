//! Every kind of network for pictures that an experiment may name, as one module.

use burn::{module::Module, prelude::*};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Naf, NetworkError, NetworkInput, PictureNetwork, Reach, RestorationNetwork, UNet, UNetConfig};

/// A kind of network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NetworkKind {
    /// A U-Net that sees the picture alone.
    #[default]
    UNet,
    /// A U-Net behind a restoration whose regularisation is trained with it. It sees the pictures before and after restoration, its place
    /// in the field and the noise.
    Restoration,
    /// The same with a [`Naf`] in place of the U-Net.
    RestorationNaf,
}

/// A network of one of the kinds.
#[derive(Module, Debug)]
pub enum Network {
    /// See [`UNet`].
    UNet(UNet),
    /// See [`RestorationNetwork`].
    Restoration(RestorationNetwork<UNet>),
    /// The same with another network in it.
    RestorationNaf(RestorationNetwork<Naf>),
}

impl NetworkKind {
    /// Whether it stands behind a restoration, without which it cannot work.
    pub const fn needs_restoration(self) -> bool {
        match self {
            Self::UNet => false,
            Self::Restoration | Self::RestorationNaf => true,
        }
    }

    /// A network of these sizes on `device`, with weights drawn from `seed` alone. Fails on a size that is out of range.
    pub fn init(
        self,
        base_channels: usize,
        levels: usize,
        seed: u64,
        device: &Device,
    ) -> Result<Network, NetworkError> {
        Ok(match self {
            Self::UNet => {
                let config = UNetConfig { base_channels, levels, ..Default::default() };
                Network::UNet(config.init(seed, device)?)
            }
            Self::Restoration => {
                Network::Restoration(RestorationNetwork::init(base_channels, levels, seed, device)?)
            }
            Self::RestorationNaf => {
                Network::RestorationNaf(RestorationNetwork::init(base_channels, levels, seed, device)?)
            }
        })
    }
}

impl Network {
    fn of_kind(&self) -> &dyn PictureNetwork {
        match self {
            Self::UNet(network) => network,
            Self::Restoration(network) => network,
            Self::RestorationNaf(network) => network,
        }
    }
}

impl PictureNetwork for Network {
    fn finish(&self, input: &NetworkInput) -> Tensor<4> {
        self.of_kind().finish(input)
    }

    fn reach(&self) -> Option<Reach> {
        self.of_kind().reach()
    }

    fn curves(&self) -> Option<Tensor<2>> {
        self.of_kind().curves()
    }
}

#[cfg(test)]
mod tests {
    use burn::optim::{AdamConfig, GradientsParams};

    use super::*;
    use crate::weight_file::Weights;

    fn input(device: &Device, side: usize) -> NetworkInput {
        let tensor = |channels: usize, scale: f32| {
            let values = (0..channels * side * side).map(|i| 0.5 + 0.4 * (scale * i as f32).sin()).collect();
            Tensor::<4>::from_data(TensorData::new::<f32, _>(values, [1, channels, side, side]), device)
        };
        NetworkInput {
            developed: tensor(3, 0.7),
            restored: Some(tensor(3, 0.3)),
            field: tensor(1, 0.01),
            noise: tensor(1, 0.0),
        }
    }

    fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
        tensor.into_data().try_to_vec().unwrap()
    }

    #[test]
    fn an_untrained_network_changes_nothing() {
        let device = Device::flex().autodiff();
        let mut seen = input(&device, 20);
        for kind in [NetworkKind::UNet, NetworkKind::Restoration, NetworkKind::RestorationNaf] {
            let network = kind.init(8, 2, 3, &device).unwrap();
            let (finished, picture) = (host(network.finish(&seen)), host(seen.picture()));
            assert!(finished.iter().zip(&picture).all(|(a, b)| (a - b).abs() < 1e-6));
        }
        // Without restoration the picture is the developed one.
        seen.restored = None;
        assert_eq!(host(seen.picture()), host(seen.developed.clone()));
        assert!(NetworkKind::UNet.init(0, 2, 3, &device).is_err());
    }

    #[test]
    fn curves_and_weights_move_by_one_optimiser_and_come_back_from_their_bytes() {
        let device = Device::flex().autodiff();
        let seen = input(&device, 16);
        for kind in [NetworkKind::Restoration, NetworkKind::RestorationNaf] {
            let mut network = kind.init(8, 1, 3, &device).unwrap();
            let mut optimizer = AdamConfig::new().init();
            let before = host(network.curves().unwrap());
            assert!(before.iter().all(|v| *v == 0.0));
            for _ in 0..2 {
                let of_curves = (network.curves().unwrap() - 1.0).square().sum();
                let loss = of_curves + (network.finish(&seen) - 0.2).square().mean();
                let gradients = GradientsParams::from_grads(loss.backward(), &network);
                network = optimizer.step(1e-2, network, gradients);
            }
            let moved = host(network.curves().unwrap());
            assert!(moved.iter().all(|v| *v > 0.01), "{moved:?}");
            assert!(host(network.finish(&seen)) != host(seen.picture()));
            let other = kind.init(8, 1, 99, &device).unwrap();
            let loaded = other.load_bytes(network.to_bytes().unwrap()).unwrap();
            assert_eq!(host(loaded.finish(&seen)), host(network.finish(&seen)));
            assert_eq!(host(loaded.curves().unwrap()), moved);
            let file = network.to_safetensors().unwrap();
            let read = kind.init(8, 1, 7, &device).unwrap().with_weights(&file).unwrap();
            assert_eq!(read.to_safetensors().unwrap(), file);
            // Weights of another kind or size are refused.
            let of_another = |another: NetworkKind, base| {
                another.init(base, 1, 3, &device).unwrap().load_bytes(network.to_bytes().unwrap())
            };
            assert!(of_another(NetworkKind::UNet, 8).is_err());
            assert!(of_another(kind, 16).is_err());
            // More or fewer weights than the file has, others, and no file at all.
            let refused = |base, levels, file: &[u8]| {
                let another = kind.init(base, levels, 3, &device).unwrap();
                another.with_weights(file).unwrap_err().to_string()
            };
            assert!(refused(16, 1, &file).contains("is of shape"), "{}", refused(16, 1, &file));
            assert!(refused(8, 2, &file).contains("is missing"), "{}", refused(8, 2, &file));
            assert!(refused(8, 1, &file[..100]).contains("not a safetensors file"));
            let tensors = safetensors::SafeTensors::deserialize(&file).unwrap();
            let mut all = tensors.tensors();
            all.push(("more".to_owned(), all[0].1.clone()));
            let surplus = safetensors::serialize(all, None).unwrap();
            assert!(refused(8, 1, &surplus).contains("weights, and the network has"));
        }
    }
}
