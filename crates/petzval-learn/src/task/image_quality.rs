//! Image quality: a U-Net as software ISP, trained with L1 and LPIPS against the photograph.

use std::path::Path;

use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::prelude::*;
use burn::tensor::Bytes;

use super::{Task, TaskError, TaskLoss};
use crate::loss::{ImageLoss, Lpips};
use crate::network::{UNet, UNetConfig};

const NETWORK_FILE: &str = "network.bin";
const OPTIMIZER_FILE: &str = "optimizer.bin";

/// The software ISP, its loss and its optimiser.
pub struct ImageQualityTask {
    network: UNet,
    optimizer: ModuleOptimizer,
    loss: ImageLoss,
    lpips: Lpips,
}

impl ImageQualityTask {
    /// A new task with weights drawn from `seed` and the Adam optimiser. The untrained network returns its input.
    pub fn new(
        config: UNetConfig,
        seed: u64,
        loss: ImageLoss,
        lpips: Lpips,
        device: &Device,
    ) -> Result<Self, TaskError> {
        loss.check()?;
        Ok(Self { network: config.init(seed, device)?, optimizer: AdamConfig::new().init(), loss, lpips })
    }

    fn loss_of(&self, network: &UNet, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError> {
        let target = self.loss.target(&self.lpips, truth)?;
        let parts = self.loss.evaluate(&self.lpips, network.forward(developed), &target)?;
        let mut named = Vec::new();
        let mut total = 0.0;
        for (name, weight, value) in
            [("l1", self.loss.l1_weight, parts.l1), ("lpips", self.loss.lpips_weight, parts.lpips)]
        {
            if let Some(value) = value {
                named.push((name, f64::from(value)));
                total += f64::from(weight) * f64::from(value);
            }
        }
        named.push(("total", total));
        Ok(TaskLoss { total: parts.total, parts: named })
    }
}

impl Task for ImageQualityTask {
    fn learning_loss(&self, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError> {
        self.loss_of(&self.network, developed, truth)
    }

    fn held_loss(&self, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError> {
        self.loss_of(&self.network.clone().no_grad(), developed, truth)
    }

    fn learn(&mut self, loss: TaskLoss, learning_rate: f64) {
        let gradients = GradientsParams::from_grads(loss.total.backward(), &self.network);
        self.network = self.optimizer.step(learning_rate, self.network.clone(), gradients);
    }

    fn picture(&self, developed: Tensor<4>) -> Tensor<4> {
        self.network.clone().no_grad().forward(developed)
    }

    fn save(&self, folder: &Path) -> Result<(), TaskError> {
        let optimizer_path = folder.join(OPTIMIZER_FILE);
        let optimizer = self
            .optimizer
            .into_bytes()
            .map_err(|e| TaskError::Optimizer { path: optimizer_path.clone(), problem: e.to_string() })?;
        for (path, bytes) in
            [(folder.join(NETWORK_FILE), self.network.to_bytes()?), (optimizer_path, optimizer.to_vec())]
        {
            std::fs::write(&path, bytes).map_err(|error| TaskError::File { path, error })?;
        }
        Ok(())
    }

    fn load(&mut self, folder: &Path) -> Result<(), TaskError> {
        let read = |path: &Path| {
            std::fs::read(path).map_err(|error| TaskError::File { path: path.to_path_buf(), error })
        };
        let path = folder.join(NETWORK_FILE);
        self.network = self
            .network
            .clone()
            .load_bytes(read(&path)?)
            .map_err(|error| TaskError::Weights { path, error })?;
        let path = folder.join(OPTIMIZER_FILE);
        let bytes = Bytes::from_bytes_vec(read(&path)?);
        self.optimizer = AdamConfig::new()
            .init()
            .from_bytes(bytes)
            .map_err(|e| TaskError::Optimizer { path, problem: e.to_string() })?;
        Ok(())
    }
}
