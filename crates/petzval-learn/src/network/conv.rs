//! A convolution with a leaky rectifier, as one differentiable operation.
//!
//! With few channels the framework's CPU convolution spends most of its time rearranging memory. This operation computes the same result
//! directly and keeps no intermediate picture. Measured on two cores of an AMD EPYC, batch 4, 3x3, forward and backward. At 128 x 128: 5.7
//! ms against 72 ms for 16 to 16 channels, 11 against 144 ms for 32 to 16. At 16 x 16 with 128 to 128 channels: 2.9 against 5.7 ms. As CPU
//! time at 96 x 96: 3x3 with step 2, 16 to 32 channels, 5 against 18 ms; 7x7, 16 to 16 channels, 33 against 305 ms.

use std::sync::Arc;

use burn::{
    prelude::*,
    tensor::{activation::leaky_relu, module::conv2d, ops::ConvOptions},
};

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use petzval_camera::tape::DeviceForm;
use petzval_camera::tape::{Kernel, View, apply, computes_in_place};

use crate::convolution::{self, Convolution, ConvolutionKind};

use super::conv_kernel::{self, ConvShape};

/// `leaky(conv(x, weight) + bias)` with a 3x3 kernel, stride 1 and a border of zeros: [`conv_leaky`] with a step of 1.
///
/// # Panics
/// Panics as [`conv_leaky`] does, and if the kernel is not 3x3.
pub fn conv3x3_leaky(x: Tensor<4>, weight: Tensor<4>, bias: Tensor<1>, slope: f32) -> Tensor<4> {
    let [_, _, rows, _] = weight.dims();
    assert_eq!(rows, 3, "conv3x3_leaky: kernel does not fit the input");
    conv_leaky(x, weight, bias, 1, slope)
}

/// `leaky(conv(x, weight) + bias)` with a square kernel and a border of zeros; `leaky(v) = max(v, slope v)`.
///
/// Shapes: `x` `[batch, inputs, height, width]`, `weight` `[outputs, inputs, kernel, kernel]` with an odd `kernel` of at most
/// 15, `bias` `[outputs]`. A `step` of 1 gives `[batch, outputs, height, width]`; a step of 2 keeps the even rows and columns
/// of that, `[batch, outputs, ceil(height / 2), ceil(width / 2)]`. `slope` is above 0 and at most 1; a slope of 1 gives the
/// plain convolution. Numbers other than f32 use the framework's own operations.
///
/// # Panics
/// Panics if the shapes disagree, as every tensor operation does, or if `kernel`, `step` or `slope` is out of range.
pub fn conv_leaky(x: Tensor<4>, weight: Tensor<4>, bias: Tensor<1>, step: usize, slope: f32) -> Tensor<4> {
    let ([_, inputs, _, _], [outputs, weight_inputs, rows, columns]) = (x.dims(), weight.dims());
    assert_eq!([inputs, rows], [weight_inputs, columns], "conv_leaky: kernel does not fit the input");
    assert_eq!([outputs], bias.dims(), "conv_leaky: one bias per output channel");
    assert!(rows % 2 == 1 && rows <= 15, "conv_leaky: kernel {rows} is not odd or above 15");
    assert!(step == 1 || step == 2, "conv_leaky: step {step} is not 1 or 2");
    assert!(slope > 0.0 && slope <= 1.0, "conv_leaky: slope {slope} is outside 0..1");
    let (kind, sides) = (ConvolutionKind::Full, [rows, columns]);
    convolution::note(Convolution { kind, input: x.dims(), outputs, kernel: sides, step, border: rows / 2 });
    let kernel = ConvLeaky { step, slope };
    if computes_in_place(&kernel, &x) {
        return apply(Arc::new(kernel), [x.into_dispatch(), weight.into_dispatch(), bias.into_dispatch()]);
    }
    leaky_relu(conv_by_framework(x, weight, bias, step), f64::from(slope))
}

/// [`conv_leaky`] without its rectifier, by the framework on any device.
pub(crate) fn conv_by_framework(x: Tensor<4>, weight: Tensor<4>, bias: Tensor<1>, step: usize) -> Tensor<4> {
    let [_, _, rows, _] = weight.dims();
    conv2d(x, weight, Some(bias), ConvOptions::new([step; 2], [rows / 2; 2], [1; 2], 1))
}

#[derive(Debug)]
pub(super) struct ConvLeaky {
    pub(super) step: usize,
    pub(super) slope: f32,
}

impl ConvLeaky {
    fn shape(&self, x: &View<'_>, weight: &View<'_>) -> ConvShape {
        let ([_, inputs, height, width], [outputs, _, kernel, _]) = (x.dims(), weight.dims());
        ConvShape { inputs, outputs, kernel, step: self.step, size: [height, width] }
    }
}

impl Kernel for ConvLeaky {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let [x, weight, bias] = inputs else { unreachable!("three inputs") };
        let conv = self.shape(x, weight);
        let y = conv_kernel::forward(conv, x.values, weight.values, bias.values, self.slope);
        (y, vec![x.shape[0], conv.outputs, conv.result().height, conv.result().width])
    }

    fn backward(&self, inputs: &[View<'_>], y: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let [x, weight, _] = inputs else { unreachable!("three inputs") };
        let (shape, wanted) = (self.shape(x, weight), [wanted[0], wanted[1] || wanted[2]]);
        let (for_x, for_weight, for_bias) =
            conv_kernel::backward(shape, x.values, weight.values, y, gradient, self.slope, wanted);
        vec![for_x, for_weight, for_bias]
    }

    /// The sign of the value is the branch of the rectifier.
    fn reads_output(&self) -> bool {
        true
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}
