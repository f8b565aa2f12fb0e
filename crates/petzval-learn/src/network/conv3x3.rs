//! A 3x3 convolution with a leaky rectifier, as one differentiable operation.
//!
//! With few channels the framework's CPU convolution spends most of its time rearranging memory. This operation computes the
//! same result directly and keeps no intermediate picture. Measured on two cores of an AMD EPYC, batch 4, 128 x 128, forward
//! and backward: 16 to 16 channels 5.7 ms against 72 ms, 32 to 16 channels 11 against 144 ms; at 16 x 16 with 128 to 128
//! channels 2.9 against 5.7 ms.

use burn::{
    backend::{
        Autodiff, Backend, Dispatch, Flex, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    prelude::*,
    tensor::{DType, activation::leaky_relu, module::conv2d, ops::ConvOptions},
};

use super::{conv_kernel, planes::PlaneShape};

/// `leaky(conv(x, weight) + bias)` with a 3x3 kernel, stride 1 and a border of zeros; `leaky(v) = max(v, slope v)`.
///
/// Shapes: `x` `[batch, inputs, height, width]`, `weight` `[outputs, inputs, 3, 3]`, `bias` `[outputs]`, result
/// `[batch, outputs, height, width]`. `slope` is above 0 and at most 1; a slope of 1 gives the plain convolution. Devices
/// other than the CPU and numbers other than f32 use the framework's own operations.
///
/// # Panics
/// Panics if the shapes disagree, as every tensor operation does, or if `slope` is out of range.
pub fn conv3x3_leaky(x: Tensor<4>, weight: Tensor<4>, bias: Tensor<1>, slope: f32) -> Tensor<4> {
    let ([_, inputs, _, _], [outputs, weight_inputs, rows, columns]) = (x.dims(), weight.dims());
    assert_eq!(
        [inputs, 3, 3],
        [weight_inputs, rows, columns],
        "conv3x3_leaky: kernel does not fit the input"
    );
    assert_eq!([outputs], bias.dims(), "conv3x3_leaky: one bias per output channel");
    assert!(slope > 0.0 && slope <= 1.0, "conv3x3_leaky: slope {slope} is outside 0..1");
    if x.device().without_autodiff() != Device::flex() || x.dtype() != DType::F32 {
        let options = ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
        return leaky_relu(conv2d(x, weight, Some(bias), options), f64::from(slope));
    }
    Tensor::from_dispatch(<Dispatch as ConvExtension>::conv3x3_leaky(
        x.into_dispatch(),
        weight.into_dispatch(),
        bias.into_dispatch(),
        slope,
    ))
}

/// The convolution and its gradients on one backend.
trait ConvBackend: Backend {
    fn forward(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        slope: f32,
    ) -> FloatTensor<Self>;

    /// Gradients of `x` (`None` unless `wants[0]`), `weight` and `bias` (`None` unless `wants[1]`). `y` is the result of
    /// `forward`, `gradient` its cotangent.
    fn backward(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        y: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        slope: f32,
        wants: [bool; 2],
    ) -> [Option<FloatTensor<Self>>; 3];
}

/// Routes the operation to the backend of its inputs.
#[backend_extension(Flex, Autodiff)]
pub(crate) trait ConvExtension: Backend {
    fn conv3x3_leaky(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        slope: f32,
    ) -> FloatTensor<Self>;
}

impl ConvBackend for Flex {
    fn forward(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        slope: f32,
    ) -> FloatTensor<Self> {
        let [batch, inputs, height, width] = x.shape().dims();
        let [outputs] = bias.shape().dims();
        let (x, weight, bias) = (x.to_contiguous(), weight.to_contiguous(), bias.to_contiguous());
        let shape = PlaneShape { height, width };
        let y = conv_kernel::forward(values(&x), values(&weight), values(&bias), inputs, shape, slope);
        tensor(y, &[batch, outputs, height, width])
    }

    fn backward(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        y: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        slope: f32,
        wants: [bool; 2],
    ) -> [Option<FloatTensor<Self>>; 3] {
        let x_shape: [usize; 4] = x.shape().dims();
        let [outputs, inputs, ..]: [usize; 4] = weight.shape().dims();
        let [x, weight, y, gradient] = [x, weight, y, gradient].map(|t| t.to_contiguous());
        let (for_x, for_weight, for_bias) = conv_kernel::backward(
            values(&x),
            values(&weight),
            values(&y),
            values(&gradient),
            [outputs, inputs],
            PlaneShape { height: x_shape[2], width: x_shape[3] },
            slope,
            wants,
        );
        [
            wants[0].then(|| tensor(for_x, &x_shape)),
            wants[1].then(|| tensor(for_weight, &[outputs, inputs, 3, 3])),
            wants[1].then(|| tensor(for_bias, &[outputs])),
        ]
    }
}

impl ConvExtension for Flex {
    fn conv3x3_leaky(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        slope: f32,
    ) -> FloatTensor<Self> {
        Self::forward(x, weight, bias, slope)
    }
}

/// The values of a contiguous f32 tensor.
fn values(tensor: &FloatTensor<Flex>) -> &[f32] {
    tensor.as_slice().expect("a contiguous tensor of f32")
}

fn tensor(values: Vec<f32>, shape: &[usize]) -> FloatTensor<Flex> {
    FloatTensor::<Flex>::from_data(TensorData::new(values, shape.to_vec()))
}

impl<B: ConvBackend, C: CheckpointStrategy> ConvExtension for Autodiff<B, C> {
    fn conv3x3_leaky(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        slope: f32,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct ConvGradient;
        impl<B: ConvBackend> Backward<B, 3> for ConvGradient {
            type State = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, f32);

            fn backward(self, ops: Ops<Self::State, 3>, gradients: &mut Gradients, _: &mut Checkpointer) {
                let (x, weight, y, slope) = ops.state;
                let gradient = gradients.consume::<B>(&ops.node);
                let wants = [ops.parents[0].is_some(), ops.parents[1].is_some() || ops.parents[2].is_some()];
                let found = B::backward(x, weight, y, gradient, slope, wants);
                for (node, gradient) in ops.parents.into_iter().zip(found) {
                    if let (Some(node), Some(gradient)) = (node, gradient) {
                        gradients.register::<B>(node.id, gradient);
                    }
                }
            }
        }
        let nodes = [x.node(), weight.node(), bias.node()];
        let (x, weight, bias) = (x.into_primitive(), weight.into_primitive(), bias.into_primitive());
        let y = B::forward(x.clone(), weight.clone(), bias, slope);
        match ConvGradient.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((x, weight, y.clone(), slope), y),
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }
}
