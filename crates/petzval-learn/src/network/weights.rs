//! Initial weights from a seed.

use std::ops::RangeInclusive;

use burn::module::{Param, ParamId};
use burn::prelude::*;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::NetworkError;

/// Draws initial weights and parameter numbers from a seed, so that the same seed gives the same network.
pub(crate) struct Initializer {
    generator: ChaCha8Rng,
    seed: u64,
    count: u64,
    device: Device,
}

impl Initializer {
    pub fn new(seed: u64, device: &Device) -> Self {
        Self { generator: ChaCha8Rng::seed_from_u64(seed), seed, count: 0, device: device.clone() }
    }

    /// Normal weights of standard deviation `deviation`.
    pub fn normal<const D: usize>(&mut self, shape: [usize; D], deviation: f32) -> Param<Tensor<D>> {
        let values = (0..shape.iter().product())
            .map(|_| {
                let value: f32 = StandardNormal.sample(&mut self.generator);
                value * deviation
            })
            .collect();
        self.parameter(values, shape)
    }

    /// All zeros.
    pub fn zeros<const D: usize>(&mut self, shape: [usize; D]) -> Param<Tensor<D>> {
        self.constant(shape, 0.0)
    }

    /// All the same.
    pub fn constant<const D: usize>(&mut self, shape: [usize; D], value: f32) -> Param<Tensor<D>> {
        self.parameter(vec![value; shape.iter().product()], shape)
    }

    /// These values, row-major.
    pub fn parameter<const D: usize>(&mut self, values: Vec<f32>, shape: [usize; D]) -> Param<Tensor<D>> {
        // Derive the parameter's number from the seed by one round of splitmix64. Optimisers store their state under this
        // number; a random number would make two equal runs write different checkpoints.
        self.count += 1;
        let mut id = self.seed.wrapping_add(self.count.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        id = (id ^ (id >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        id = (id ^ (id >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let parameter = Param::<Tensor<D>>::from_data(TensorData::new(values, shape), &self.device);
        Param::from_mapped_value(ParamId::from(id ^ (id >> 31)), parameter.val(), Default::default())
            .set_require_grad(true)
    }
}

/// Checks `(name, value, permitted values, the same in words)` of the sizes of a network.
pub(crate) fn check_sizes(
    sizes: &[(&'static str, usize, RangeInclusive<usize>, &'static str)],
) -> Result<(), NetworkError> {
    for &(name, value, ref permitted, range) in sizes {
        if !permitted.contains(&value) {
            return Err(NetworkError::BadSize { name, value, range });
        }
    }
    Ok(())
}
