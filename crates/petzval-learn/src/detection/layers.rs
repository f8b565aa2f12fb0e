//! The layers that detectors are built from, with the names that torchvision gives to their weights.

use burn::module::{Module, Param};
use burn::prelude::*;
use burn::tensor::activation::relu;

use super::parameters::{Parameters, Start};
use crate::network::{NetworkError, conv_leaky, depthwise};

/// Shape of a convolution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConvShape {
    pub inputs: usize,
    pub outputs: usize,
    /// Side of the kernel, odd; the border is half of it.
    pub kernel: usize,
    /// 1, or 2 to halve the picture.
    pub step: usize,
}

impl ConvShape {
    pub fn new(inputs: usize, outputs: usize, kernel: usize) -> Self {
        Self { inputs, outputs, kernel, step: 1 }
    }

    pub fn halving(self) -> Self {
        Self { step: 2, ..self }
    }

    /// Standard deviation that keeps the variance through a rectifier (He 2015).
    pub fn rectified(&self) -> Start {
        Start::Normal((2.0 / (self.kernel * self.kernel * self.inputs) as f32).sqrt())
    }
}

/// A convolution with a bias.
#[derive(Module, Debug)]
pub(crate) struct Conv {
    weight: Param<Tensor<4>>,
    bias: Param<Tensor<1>>,
    #[module(skip)]
    step: usize,
}

impl Conv {
    /// `{name}.weight` and `{name}.bias`; the bias starts at `bias`.
    pub fn new(
        from: &Parameters,
        name: &str,
        shape: ConvShape,
        start: Start,
        bias: f32,
    ) -> Result<Self, NetworkError> {
        let ConvShape { inputs, outputs, kernel, step } = shape;
        Ok(Self {
            weight: from.trained(&format!("{name}.weight"), [outputs, inputs, kernel, kernel], start)?,
            bias: from.trained(&format!("{name}.bias"), [outputs], Start::Constant(bias))?,
            step,
        })
    }

    /// Behind the convolution, negative values are multiplied by `slope`; 1 leaves them.
    pub fn leaky(&self, x: Tensor<4>, slope: f32) -> Tensor<4> {
        conv_leaky(x, self.weight.val(), self.bias.val(), self.step, slope)
    }

    /// The convolution alone.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.leaky(x, 1.0)
    }
}

/// A matrix with a bias.
#[derive(Module, Debug)]
pub(crate) struct Linear {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

impl Linear {
    /// `{name}.weight`, `[outputs, inputs]`, and `{name}.bias`, which starts at 0.
    pub fn new(
        from: &Parameters,
        name: &str,
        [inputs, outputs]: [usize; 2],
        start: Start,
    ) -> Result<Self, NetworkError> {
        Ok(Self {
            weight: from.trained(&format!("{name}.weight"), [outputs, inputs], start)?,
            bias: from.trained(&format!("{name}.bias"), [outputs], Start::Constant(0.0))?,
        })
    }

    /// `[items, inputs]` to `[items, outputs]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        x.matmul(self.weight.val().transpose()) + self.bias.val().unsqueeze()
    }
}

/// Added to the variance of a batch normalisation.
const VARIANCE_FLOOR: f32 = 1e-5;

/// A convolution without a bias, behind it a batch normalisation whose statistics and factors are frozen.
#[derive(Module, Debug)]
pub(crate) struct NormalizedConv {
    weight: ConvWeight,
    scale: Param<Tensor<1>>,
    shift: Param<Tensor<1>>,
    mean: Param<Tensor<1>>,
    variance: Param<Tensor<1>>,
    #[module(skip)]
    step: usize,
}

/// Weight of a convolution over all channels, or of one kernel per channel.
#[derive(Module, Debug)]
enum ConvWeight {
    Full(Param<Tensor<4>>),
    Depthwise(Param<Tensor<4>>),
}

impl NormalizedConv {
    /// `{conv}.weight`, and `{norm}.weight`, `.bias`, `.running_mean` and `.running_var`.
    pub fn new(from: &Parameters, conv: &str, norm: &str, shape: ConvShape) -> Result<Self, NetworkError> {
        let ConvShape { inputs, outputs, kernel, .. } = shape;
        let weight =
            from.trained(&format!("{conv}.weight"), [outputs, inputs, kernel, kernel], shape.rectified())?;
        Self::behind(ConvWeight::Full(weight), from, norm, shape)
    }

    /// One kernel per channel.
    pub fn depthwise(
        from: &Parameters,
        conv: &str,
        norm: &str,
        shape: ConvShape,
    ) -> Result<Self, NetworkError> {
        let ConvShape { outputs, kernel, .. } = shape;
        let start = ConvShape { inputs: 1, ..shape }.rectified();
        let weight = from.trained(&format!("{conv}.weight"), [outputs, 1, kernel, kernel], start)?;
        Self::behind(ConvWeight::Depthwise(weight), from, norm, shape)
    }

    fn behind(
        weight: ConvWeight,
        from: &Parameters,
        norm: &str,
        shape: ConvShape,
    ) -> Result<Self, NetworkError> {
        let part = |name: &str, value| from.frozen(&format!("{norm}.{name}"), [shape.outputs], value);
        Ok(Self {
            weight,
            scale: part("weight", 1.0)?,
            shift: part("bias", 0.0)?,
            mean: part("running_mean", 0.0)?,
            variance: part("running_var", 1.0)?,
            step: shape.step,
        })
    }

    /// The normalisation is a factor per output channel and a bias: both are folded into the convolution.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let factor = self.scale.val() / (self.variance.val() + VARIANCE_FLOOR).sqrt();
        let bias = self.shift.val() - self.mean.val() * factor.clone();
        let [channels] = factor.dims();
        let factor = factor.reshape([channels, 1, 1, 1]);
        match &self.weight {
            ConvWeight::Full(weight) => conv_leaky(x, weight.val() * factor, bias, self.step, 1.0),
            ConvWeight::Depthwise(weight) => {
                let weight = weight.val() * factor;
                let [_, _, kernel, _] = weight.dims();
                let y = depthwise(x, weight.reshape([channels, kernel, kernel]), bias);
                if self.step == 1 { y } else { even_places(y) }
            }
        }
    }

    /// The same behind a rectifier.
    pub fn rectified(&self, x: Tensor<4>) -> Tensor<4> {
        relu(self.forward(x))
    }
}

/// The even rows and columns of a picture.
pub(crate) fn even_places(x: Tensor<4>) -> Tensor<4> {
    let [batch, channels, height, width] = x.dims();
    x.slice([
        burn::tensor::Slice::new(0, Some(batch as isize), 1),
        burn::tensor::Slice::new(0, Some(channels as isize), 1),
        burn::tensor::Slice::new(0, Some(height as isize), 2),
        burn::tensor::Slice::new(0, Some(width as isize), 2),
    ])
}

#[cfg(test)]
mod tests {
    use burn::optim::{AdamConfig, GradientsParams};
    use burn::tensor::TensorData;

    use super::*;

    #[test]
    fn a_frozen_normalisation_stays_while_its_convolution_learns() {
        let device = Device::flex().autodiff();
        let from = Parameters::drawn(1, &device);
        let shape = ConvShape { inputs: 3, outputs: 4, kernel: 3, step: 1 };
        let read = |layer: &NormalizedConv| -> [Vec<f32>; 5] {
            let values = |tensor: Tensor<1>| tensor.into_data().try_to_vec().unwrap();
            let ConvWeight::Full(weight) = &layer.weight else { panic!("a full convolution") };
            let norm = [&layer.scale, &layer.shift, &layer.mean, &layer.variance];
            let [scale, shift, mean, variance] = norm.map(|part| values(part.val()));
            [scale, shift, mean, variance, values(weight.val().reshape([-1]))]
        };
        let mut layer = NormalizedConv::new(&from, "conv", "norm", shape).unwrap();
        let before = read(&layer);
        let mut optimizer = AdamConfig::new().init();
        for step in 0..3 {
            let values: Vec<f32> =
                (0..2 * 3 * 64).map(|i| 1.0 + 2.0 * (0.7 * i as f32 + step as f32).sin()).collect();
            let x = Tensor::<4>::from_data(TensorData::new(values, [2, 3, 8, 8]), &device);
            let loss = layer.rectified(x).powi_scalar(2).mean();
            let gradients = GradientsParams::from_grads(loss.backward(), &layer);
            layer = optimizer.step(1e-2, layer, gradients);
        }
        let after = read(&layer);
        assert_eq!(before[..4], after[..4]);
        assert!(before[4].iter().zip(&after[4]).all(|(a, b)| a != b));
    }
}
