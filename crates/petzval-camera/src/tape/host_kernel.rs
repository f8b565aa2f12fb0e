//! Differentiable operations of the tensor framework from plain Rust code on the host.

use std::fmt::Debug;
use std::sync::Arc;

use burn::backend::autodiff::Autodiff;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::prelude::*;
use burn::tensor::TensorData;

/// A function of one, two or four tensors with its hand-written adjoint. Tensors arrive flattened, row-major, as f32.
///
/// Both methods must depend on their arguments alone: the same inputs give the same bits.
pub trait HostKernel: Debug + Send + Sync {
    /// Shape of the output.
    fn output_shape(&self) -> Vec<usize>;

    /// Value of the function: as many elements as `output_shape` has.
    fn forward(&self, inputs: &[&[f32]]) -> Vec<f32>;

    /// `J^T d_output` for each input, in the shape of the input.
    fn adjoint(&self, inputs: &[&[f32]], d_output: &[f32]) -> Vec<Vec<f32>>;

    /// [`HostKernel::adjoint`] where only the inputs marked in `wanted` are tracked. What it returns for the others is not looked at: a
    /// kernel may save the work.
    fn adjoint_of(&self, inputs: &[&[f32]], d_output: &[f32], _wanted: &[bool]) -> Vec<Vec<f32>> {
        self.adjoint(inputs, d_output)
    }
}

/// Applies a kernel to one tensor of any rank; `R` must be the rank of the kernel's output.
pub fn apply<const D: usize, const R: usize>(kernel: Arc<dyn HostKernel>, input: Tensor<D>) -> Tensor<R> {
    assert_eq!(kernel.output_shape().len(), R, "rank of the output of {kernel:?}");
    Tensor::from_dispatch(<Dispatch as HostOps>::host_one(kernel, input.into_dispatch()))
}

/// Applies a kernel to two tensors of any rank; `R` must be the rank of the kernel's output.
pub fn apply_two<const D: usize, const E: usize, const R: usize>(
    kernel: Arc<dyn HostKernel>,
    first: Tensor<D>,
    second: Tensor<E>,
) -> Tensor<R> {
    assert_eq!(kernel.output_shape().len(), R, "rank of the output of {kernel:?}");
    let (first, second) = (first.into_dispatch(), second.into_dispatch());
    Tensor::from_dispatch(<Dispatch as HostOps>::host_two(kernel, first, second))
}

/// Applies a kernel to four tensors of any rank; `R` must be the rank of the kernel's output.
pub fn apply_four<const A: usize, const B: usize, const C: usize, const D: usize, const R: usize>(
    kernel: Arc<dyn HostKernel>,
    (a, b, c, d): (Tensor<A>, Tensor<B>, Tensor<C>, Tensor<D>),
) -> Tensor<R> {
    assert_eq!(kernel.output_shape().len(), R, "rank of the output of {kernel:?}");
    let (a, b, c, d) = (a.into_dispatch(), b.into_dispatch(), c.into_dispatch(), d.into_dispatch());
    Tensor::from_dispatch(<Dispatch as HostOps>::host_four(kernel, a, b, c, d))
}

/// Backend operations that [`apply`], [`apply_two`] and [`apply_four`] call. A new backend needs one entry in the attribute and an empty
/// `impl`: the default bodies copy tensors to the host and back.
#[backend_extension(Flex, Cube: cfg(any(feature = "wgpu", feature = "cuda")), Autodiff)]
trait HostOps: Backend {
    fn host_one(kernel: Arc<dyn HostKernel>, input: FloatTensor<Self>) -> FloatTensor<Self> {
        let values = to_host::<Self>(&input);
        to_device::<Self>(kernel.forward(&[&values]), kernel.output_shape(), &input)
    }

    fn host_two(
        kernel: Arc<dyn HostKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let (a, b) = (to_host::<Self>(&first), to_host::<Self>(&second));
        to_device::<Self>(kernel.forward(&[&a, &b]), kernel.output_shape(), &first)
    }

    fn host_four(
        kernel: Arc<dyn HostKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        third: FloatTensor<Self>,
        fourth: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [a, b, c, d] = [&first, &second, &third, &fourth].map(to_host::<Self>);
        to_device::<Self>(kernel.forward(&[&a, &b, &c, &d]), kernel.output_shape(), &first)
    }
}

impl HostOps for Flex {}

#[cfg(any(feature = "wgpu", feature = "cuda"))]
impl HostOps for burn::backend::Cube {}

/// The values of a tensor, flattened.
fn to_host<B: Backend>(tensor: &FloatTensor<B>) -> Vec<f32> {
    let data = burn::tensor::try_read_sync(B::float_into_data(tensor.clone()));
    let data = data.expect("backend reads synchronously").expect("tensor can be read");
    data.convert::<f32>().try_to_vec::<f32>().expect("converted to f32")
}

/// A tensor on the device and with the number type of `like`.
fn to_device<B: Backend>(values: Vec<f32>, shape: Vec<usize>, like: &FloatTensor<B>) -> FloatTensor<B> {
    let data = TensorData::new(values, shape).convert_dtype(like.dtype());
    B::float_from_data(data, &like.device())
}

/// The backward pass of a kernel with `N` inputs, in the order of the forward call.
#[derive(Debug)]
struct HostBackward;

impl<B: Backend, const N: usize> Backward<B, N> for HostBackward {
    type State = (Arc<dyn HostKernel>, [FloatTensor<B>; N]);

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (kernel, inputs) = ops.state;
        let d_output = to_host::<B>(&grads.consume::<B>(&ops.node));
        let values: Vec<Vec<f32>> = inputs.iter().map(to_host::<B>).collect();
        let slices: Vec<&[f32]> = values.iter().map(Vec::as_slice).collect();
        let wanted: Vec<bool> = ops.parents.iter().map(Option::is_some).collect();
        let gradients = kernel.adjoint_of(&slices, &d_output, &wanted);
        for ((parent, input), gradient) in ops.parents.into_iter().zip(&inputs).zip(gradients) {
            // An input that is not tracked has no node.
            if let Some(node) = parent {
                let shape = input.shape().as_slice().to_vec();
                grads.register::<B>(node.id, to_device::<B>(gradient, shape, input));
            }
        }
    }
}

impl<B: Backend + HostOps, C: CheckpointStrategy> HostOps for Autodiff<B, C> {
    fn host_one(kernel: Arc<dyn HostKernel>, input: FloatTensor<Self>) -> FloatTensor<Self> {
        let nodes = [input.node()];
        let input = input.into_primitive();
        let output = B::host_one(kernel.clone(), input.clone());
        match <HostBackward as Backward<B, 1>>::prepare::<C>(HostBackward, nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((kernel, [input]), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }

    fn host_two(
        kernel: Arc<dyn HostKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let nodes = [first.node(), second.node()];
        let (first, second) = (first.into_primitive(), second.into_primitive());
        let output = B::host_two(kernel.clone(), first.clone(), second.clone());
        match <HostBackward as Backward<B, 2>>::prepare::<C>(HostBackward, nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((kernel, [first, second]), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }

    fn host_four(
        kernel: Arc<dyn HostKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        third: FloatTensor<Self>,
        fourth: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let inputs = [first, second, third, fourth];
        let nodes = inputs.each_ref().map(|input| input.node());
        let [a, b, c, d] = inputs.map(|input| input.into_primitive());
        let output = B::host_four(kernel.clone(), a.clone(), b.clone(), c.clone(), d.clone());
        match <HostBackward as Backward<B, 4>>::prepare::<C>(HostBackward, nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((kernel, [a, b, c, d]), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }
}
