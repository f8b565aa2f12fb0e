//! The device form of the 1x1 convolution with a normalisation or a gate in front of it.
//!
//! The product with the weights, and with their transpose on the way back, is the framework's matrix product: it is tuned and uses the matrix
//! units of a card. What precedes it is one kernel, and so is the adjoint of that.

use burn::backend::{DispatchTensor, TensorMetadata};
use burn::prelude::*;
use petzval_camera::tape::{BackwardPass, DeviceForm};

use crate::network::pointwise::Pointwise;
use crate::network::pointwise_kernel::Prologue;

use super::gate::{gated, ungated};
use super::normalization::{denormalized, moments_of, normalized};
use super::products::sums_of_products;
use super::{given, tensors};

impl DeviceForm for Pointwise {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let [x, weight, bias] = inputs else { unreachable!("three inputs") };
        let [picture] = tensors([x]);
        let [batch, _, height, width] = picture.shape().dims();
        let weight = Tensor::<2>::from_dispatch(weight.clone());
        let [outputs, inputs] = weight.dims();
        let n = match self.0 {
            Prologue::Plain => x.clone(),
            Prologue::Normalize => given(normalized(picture)),
            Prologue::Gate => given(gated(picture)),
        };
        let n = Tensor::<4>::from_dispatch(n).reshape([batch, inputs, height * width]);
        let mixed = weight.unsqueeze::<3>().matmul(n).reshape([batch, outputs, height, width]);
        let bias = Tensor::<1>::from_dispatch(bias.clone());
        (mixed + bias.reshape([1, outputs, 1, 1])).into_dispatch()
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { gradient, wanted, .. } = at;
        let [x, weight, _] = inputs else { unreachable!("three inputs") };
        let [x, pulled] = tensors([x, gradient]);
        // The adjoint of the normalisation and the products both read the mean and the scale of every pixel.
        let moments = (self.0 == Prologue::Normalize).then(|| moments_of(x.clone()));

        let for_x = wanted[0].then(|| {
            let [batch, outputs, height, width] = pulled.shape().dims();
            let weight = Tensor::<2>::from_dispatch(weight.clone());
            let [_, inputs] = weight.dims();
            let pulled = Tensor::<4>::from_dispatch(gradient.clone());
            let pulled = pulled.reshape([batch, outputs, height * width]);
            let for_n = weight.swap_dims(0, 1).unsqueeze::<3>().matmul(pulled);
            let for_n = for_n.reshape([batch, inputs, height, width]).into_dispatch();
            match (self.0, &moments) {
                (Prologue::Normalize, Some(moments)) => {
                    let [for_n] = tensors([&for_n]);
                    given(denormalized(x.clone(), moments.clone(), for_n))
                }
                (Prologue::Gate, _) => {
                    let [for_n] = tensors([&for_n]);
                    given(ungated(x.clone(), for_n))
                }
                _ => for_n,
            }
        });

        let (for_weight, for_bias) = if wanted[1] || wanted[2] {
            let (for_weight, for_bias) = sums_of_products(self.0 == Prologue::Gate, x, moments, pulled);
            (wanted[1].then(|| given(for_weight)), wanted[2].then(|| given(for_bias)))
        } else {
            (None, None)
        };
        vec![for_x, for_weight, for_bias]
    }
}
