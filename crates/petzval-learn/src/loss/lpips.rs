//! LPIPS: distance of two pictures in the features of an image-recognition network.

use burn::{
    prelude::*,
    tensor::{activation::relu, module::max_pool2d, ops::MaxPoolOptions},
};
use safetensors::SafeTensors;

use super::{LossError, same_shape};
use crate::convolution;
use crate::weight_file::read_weights;

/// Least side of a picture, pixels: the last pooling needs one whole window.
pub const LEAST_SIDE: usize = 31;

/// Mean and standard deviation of AlexNet's training images, for inputs in -1..1 (R, G, B).
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];

/// Added to the length of a feature vector before the division by it.
const EPSILON: f32 = 1e-10;

/// One stage of AlexNet: optional pooling, convolution, rectification.
#[derive(Clone)]
struct Stage {
    weight: Tensor<4>,
    bias: Tensor<1>,
    stride: usize,
    padding: usize,
    pooled: bool,
    /// Weight of each channel in the distance, shape `[1, channels, 1, 1]`.
    head: Tensor<4>,
}

/// LPIPS v0.1 with AlexNet features. The weights are frozen: gradients flow to the pictures only.
///
/// ```text
/// d(a, b) = sum over layers l of the mean over pixels of sum over channels c of w_lc (A_lc - B_lc)^2
/// A_l = F_l(a) / (|F_l(a)| + 1e-10), the length taken over channels
/// ```
///
/// `F_l` are the outputs of the five rectified convolutions. Equal pictures have distance 0; 0.1 is visible, 0.7 is bad.
/// Source: R. Zhang, P. Isola, A. Efros, E. Shechtman, O. Wang, "The Unreasonable Effectiveness of Deep Features as a
/// Perceptual Metric", CVPR 2018.
#[derive(Clone)]
pub struct Lpips {
    stages: Vec<Stage>,
    shift: Tensor<4>,
    inverse_scale: Tensor<4>,
}

/// The unit-length features of a reference picture, computed once.
pub struct LpipsTarget {
    shape: [usize; 4],
    features: Vec<Tensor<4>>,
}

/// Names of a convolution's weight, bias and head; `[out, in, kernel]`, stride, padding, whether pooling precedes it.
type StageShape = (&'static str, &'static str, &'static str, [usize; 3], usize, usize, bool);

const STAGES: [StageShape; 5] = [
    ("features.0.weight", "features.0.bias", "lin0.weight", [64, 3, 11], 4, 2, false),
    ("features.3.weight", "features.3.bias", "lin1.weight", [192, 64, 5], 1, 2, true),
    ("features.6.weight", "features.6.bias", "lin2.weight", [384, 192, 3], 1, 1, true),
    ("features.8.weight", "features.8.bias", "lin3.weight", [256, 384, 3], 1, 1, false),
    ("features.10.weight", "features.10.bias", "lin4.weight", [256, 256, 3], 1, 1, false),
];

impl Lpips {
    /// Builds the loss from the bytes of a safetensors file (f16 or f32) with the names `features.N.weight`,
    /// `features.N.bias` (N = 0, 3, 6, 8, 10) and `lin0.weight` to `lin4.weight`.
    ///
    /// `device` must be the device of the pictures. Gradients need an autodiff device.
    pub fn from_safetensors(bytes: &[u8], device: &Device) -> Result<Self, LossError> {
        let file = SafeTensors::deserialize(bytes)?;
        let stages = STAGES
            .iter()
            .map(|&(weight, bias, head, [channels, inputs, kernel], stride, padding, pooled)| {
                Ok(Stage {
                    weight: read(&file, weight, [channels, inputs, kernel, kernel], device)?,
                    bias: read(&file, bias, [channels], device)?,
                    stride,
                    padding,
                    pooled,
                    head: read(&file, head, [1, channels, 1, 1], device)?,
                })
            })
            .collect::<Result<_, LossError>>()?;
        let per_channel = |v: [f32; 3]| Tensor::<1>::from_floats(v, device).reshape([1, 3, 1, 1]);
        Ok(Self { stages, shift: per_channel(SHIFT), inverse_scale: per_channel(SCALE.map(|s| 1.0 / s)) })
    }

    /// Distance of each picture of the batch `a` from its counterpart in `b`, shape `[batch]`.
    ///
    /// Shapes `[batch, 3, height, width]`, sRGB-encoded, 0..1, sides of [`LEAST_SIDE`] or more. Gradients flow to both.
    pub fn distance(&self, a: Tensor<4>, b: Tensor<4>) -> Result<Tensor<1>, LossError> {
        same_shape(a.dims(), b.dims())?;
        let b = LpipsTarget { shape: b.dims(), features: self.unit_features(b)? };
        self.distance_to(a, &b)
    }

    /// Computes the features of a reference picture once; no gradient flows to it.
    pub fn target(&self, reference: Tensor<4>) -> Result<LpipsTarget, LossError> {
        let reference = reference.detach();
        Ok(LpipsTarget { shape: reference.dims(), features: self.unit_features(reference)? })
    }

    /// As [`distance`](Self::distance), with the features that [`target`](Self::target) computed.
    pub fn distance_to(&self, image: Tensor<4>, target: &LpipsTarget) -> Result<Tensor<1>, LossError> {
        same_shape(image.dims(), target.shape)?;
        let batch = image.dims()[0];
        let mut total: Option<Tensor<1>> = None;
        for ((stage, ours), theirs) in
            self.stages.iter().zip(self.unit_features(image)?).zip(&target.features)
        {
            // Weight the squared difference by channel and average it over the picture.
            let [_, _, rows, columns] = ours.dims();
            let weighted = (ours - theirs.clone()).square() * stage.head.clone();
            let layer =
                weighted.reshape([batch as i32, -1]).sum_dim(1).reshape([batch]) / (rows * columns) as f32;
            total = Some(match total {
                Some(sum) => sum + layer,
                None => layer,
            });
        }
        // The sum exists, because there are five stages.
        Ok(total.unwrap_or_else(|| Tensor::zeros([batch], &self.shift.device())))
    }

    /// Features of all five layers, each scaled to unit length over its channels.
    fn unit_features(&self, picture: Tensor<4>) -> Result<Vec<Tensor<4>>, LossError> {
        let [_, _, height, width] = picture.dims();
        if height < LEAST_SIDE || width < LEAST_SIDE {
            return Err(LossError::TooSmall { height, width, least: LEAST_SIDE });
        }

        // Map 0..1 to -1..1, then normalise with the statistics of the training images.
        let mut x = (picture * 2.0 - 1.0 - self.shift.clone()) * self.inverse_scale.clone();
        let mut features = Vec::with_capacity(self.stages.len());
        for stage in &self.stages {
            if stage.pooled {
                x = max_pool2d(x, MaxPoolOptions::new([3, 3]).with_stride([2, 2]));
            }
            let (weight, bias) = (stage.weight.clone(), Some(stage.bias.clone()));
            x = relu(convolution::of_loss(x, weight, bias, stage.stride, stage.padding));

            // The square of epsilon under the root keeps the gradient finite where all channels are 0.
            let length = (x.clone().square().sum_dim(1) + EPSILON * EPSILON).sqrt();
            features.push(x.clone() / (length + EPSILON));
        }
        Ok(features)
    }
}

/// Reads one tensor of the file and checks its shape and number type.
fn read<const D: usize>(
    file: &SafeTensors,
    name: &'static str,
    shape: [usize; D],
    device: &Device,
) -> Result<Tensor<D>, LossError> {
    let bad = |found: String| LossError::BadWeight {
        name,
        found,
        expected: format!("F16 or F32 of shape {shape:?}"),
    };
    let values = read_weights(file, name, &shape).map_err(bad)?;
    Ok(Tensor::from_data(TensorData::new(values, shape), device))
}
