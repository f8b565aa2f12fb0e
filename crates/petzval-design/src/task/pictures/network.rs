//! The network that finishes pictures.

use std::path::Path;
use std::sync::Arc;

use burn::grad_clipping::GradientClippingConfig;
use burn::optim::{AdamConfig, ModuleOptimizer};
use burn::prelude::Device;
use petzval_learn::guest::{GuestError, Host};
use petzval_learn::network::{GuestNetwork, Network};
use petzval_learn::weight_file::Weights;

use crate::assets::Assets;
use crate::block::{CameraNetwork, NetworkBlock, Sight};
use crate::camera::Camera;
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, NetworkConfig, NetworkRole, TrainingConfig};

/// A network behind the development, which follows its gradients by Adam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finishing {
    /// Decay of the mean of squared gradients.
    pub beta2: f32,
    /// Largest norm of the gradient of each weight tensor; none for no limit.
    pub largest_gradient: Option<f32>,
}

impl CameraNetwork for Finishing {
    type Module = Network;

    fn attached(&self, network: Network, camera: &Camera, _: Sight) -> Camera {
        camera.with_network(Arc::new(network))
    }

    fn optimizer(&self, _: &Network) -> ModuleOptimizer {
        let limit = self.largest_gradient.map(GradientClippingConfig::Norm);
        AdamConfig::new().with_beta_2(self.beta2).with_grad_clipping(limit).init()
    }
}

/// The network of an experiment at the start, with given weights or those drawn from the seed. The host is that of its classes in Python.
pub(super) fn block(
    cameras: &Cameras,
    given_weights: Option<&[u8]>,
    host: Option<&dyn Host>,
) -> Result<NetworkBlock> {
    let experiment = &cameras.experiment;
    let NetworkConfig { kind, base_channels, levels, .. } = experiment.network;
    let Some(kind) = kind.ours() else { return of_class(cameras, given_weights, host) };
    let drawn = kind.init(base_channels, levels, experiment.seed, &cameras.body.device)?;
    let network = match given_weights {
        Some(bytes) => drawn.with_weights(bytes)?,
        None => drawn,
    };
    let TrainingConfig { beta2, largest_gradient, .. } = experiment.training;
    let largest_gradient = (largest_gradient > 0.0).then_some(largest_gradient as f32);
    Ok(NetworkBlock::new(network, Finishing { beta2: beta2 as f32, largest_gradient }))
}

/// The network that a class of the user makes.
fn of_class(
    cameras: &Cameras,
    given_weights: Option<&[u8]>,
    host: Option<&dyn Host>,
) -> Result<NetworkBlock> {
    let experiment = &cameras.experiment;
    let class = experiment.python.as_ref().and_then(|python| python.network.as_ref());
    let (Some(class), Some(host)) = (class, host) else {
        let message = "network.kind is \"python\", and python.network names no class".to_owned();
        let hint = "write [python.network] with class = \"my_module:MyClass\"".to_owned();
        return Err(GuestError::Unusable { message, hint }.into());
    };
    let channels = GuestNetwork::channels(cameras.body.restoration.is_some());
    let network = GuestNetwork::new(host, class, channels, experiment.seed)?;
    if let Some(bytes) = given_weights {
        network.load(bytes)?;
    }
    Ok(NetworkBlock::of_guest(Arc::new(network)))
}

/// The weights that the experiment names; none where they are drawn, or where a hardware ISP takes the place of the network.
pub(super) fn given_weights(
    experiment: &Experiment,
    assets: &Assets,
    device: &Device,
) -> Result<Option<Vec<u8>>> {
    let NetworkConfig { kind, base_channels, levels, ref weights } = experiment.network;
    if !experiment.has_picture_network(NetworkRole::Finishes) || experiment.network.draws_weights() {
        return Ok(None);
    }
    let path = Path::new(weights);
    let Some(kind) = kind.ours() else {
        // Only the class can read its weights.
        let is_named = !experiment.network.has_built_in_weights();
        return is_named.then(|| petzval_base::read_whole(path).map_err(DesignError::io(path))).transpose();
    };
    let drawn = kind.init(base_channels, levels, experiment.seed, device)?;
    if experiment.network.has_built_in_weights() {
        let bytes = assets.bytes(experiment.network.built_in_file(experiment.psf.kind.traced()))?;
        return Ok(drawn.with_weights(bytes).is_ok().then(|| bytes.to_vec()));
    }
    let bytes = petzval_base::read_whole(path).map_err(DesignError::io(path))?;
    // Fails now, while there is no run folder yet, if they do not fit.
    drawn.with_weights(&bytes).map_err(|problem| {
        let hint = "give the network.kind, base_channels and levels of the weights, or write \"none\" for network.weights";
        DesignError::misfit(path, &problem, hint)
    })?;
    Ok(Some(bytes))
}
