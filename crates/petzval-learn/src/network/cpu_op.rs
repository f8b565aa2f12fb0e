//! Differentiable operations of the framework from kernels on plain arrays, on the CPU.
//!
//! A [`CpuKernel`] is a function of three tensors, usually a picture, a weight and a bias, with its hand-written adjoint. The tensors are not copied: a kernel
//! reads the memory of the framework. Each kernel belongs to a function that uses the framework's own operations on other
//! devices and for other number types; [`runs_here`] decides.

use std::{fmt::Debug, sync::Arc};

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
    tensor::DType,
};

/// Inputs of a kernel.
const INPUTS: usize = 3;

/// Values of a tensor, row-major, and its shape.
#[derive(Clone, Debug)]
pub(crate) struct View<'a> {
    pub values: &'a [f32],
    pub shape: Vec<usize>,
}

impl View<'_> {
    /// The shape of a tensor of rank `D`.
    pub fn dims<const D: usize>(&self) -> [usize; D] {
        self.shape.as_slice().try_into().expect("rank of the tensor")
    }
}

/// A function of tensors and its adjoint. Both depend on their arguments alone: equal inputs give equal bits.
pub(crate) trait CpuKernel: Debug + Send + Sync {
    /// Value of the function and its shape.
    fn forward(&self, inputs: &[View<'_>]) -> (Vec<f32>, Vec<usize>);

    /// `J^T gradient` for each input, in the shape of the input; empty where `wants` is false. `output` is the result of
    /// [`forward`](Self::forward), `gradient` its cotangent.
    fn backward(
        &self,
        inputs: &[View<'_>],
        output: &[f32],
        gradient: &[f32],
        wants: &[bool],
    ) -> Vec<Vec<f32>>;
}

/// True where the kernels run: f32 values on the CPU.
pub(crate) fn runs_here<const D: usize>(x: &Tensor<D>) -> bool {
    x.device().without_autodiff() == Device::flex() && x.dtype() == DType::F32
}

/// Applies a kernel to its three inputs; `R` must be the rank of its result.
pub(crate) fn apply<const D: usize, const E: usize, const F: usize, const R: usize>(
    kernel: impl CpuKernel + 'static,
    first: Tensor<D>,
    second: Tensor<E>,
    third: Tensor<F>,
) -> Tensor<R> {
    let kernel: Arc<dyn CpuKernel> = Arc::new(kernel);
    let (first, second, third) = (first.into_dispatch(), second.into_dispatch(), third.into_dispatch());
    Tensor::from_dispatch(<Dispatch as CpuOps>::cpu_kernel(kernel, first, second, third))
}

/// A backend whose memory the kernels can read.
trait CpuBackend: Backend {
    fn forward(kernel: &dyn CpuKernel, inputs: &[FloatTensor<Self>]) -> FloatTensor<Self>;

    fn backward(
        kernel: &dyn CpuKernel,
        inputs: &[FloatTensor<Self>],
        output: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        wants: &[bool],
    ) -> Vec<Option<FloatTensor<Self>>>;
}

impl CpuBackend for Flex {
    fn forward(kernel: &dyn CpuKernel, inputs: &[FloatTensor<Self>]) -> FloatTensor<Self> {
        let inputs: Vec<_> = inputs.iter().map(FloatTensor::<Self>::to_contiguous).collect();
        let views: Vec<View> = inputs.iter().map(view).collect();
        let (values, shape) = kernel.forward(&views);
        FloatTensor::<Self>::from_data(TensorData::new(values, shape))
    }

    fn backward(
        kernel: &dyn CpuKernel,
        inputs: &[FloatTensor<Self>],
        output: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        wants: &[bool],
    ) -> Vec<Option<FloatTensor<Self>>> {
        let inputs: Vec<_> = inputs.iter().map(FloatTensor::<Self>::to_contiguous).collect();
        let views: Vec<View> = inputs.iter().map(view).collect();
        let (output, gradient) = (output.to_contiguous(), gradient.to_contiguous());
        let found = kernel.backward(&views, view(&output).values, view(&gradient).values, wants);
        found
            .into_iter()
            .zip(views)
            .zip(wants)
            .map(|((values, view), wanted)| {
                wanted.then(|| FloatTensor::<Self>::from_data(TensorData::new(values, view.shape)))
            })
            .collect()
    }
}

/// The memory of a contiguous f32 tensor.
fn view(tensor: &FloatTensor<Flex>) -> View<'_> {
    let values = tensor.as_slice().expect("a contiguous tensor of f32");
    View { values, shape: tensor.shape().as_slice().to_vec() }
}

/// Routes a kernel to the backend of its inputs.
#[backend_extension(Flex, Autodiff)]
pub(crate) trait CpuOps: Backend {
    fn cpu_kernel(
        kernel: Arc<dyn CpuKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        third: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

impl CpuOps for Flex {
    fn cpu_kernel(
        kernel: Arc<dyn CpuKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        third: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        Self::forward(&*kernel, &[first, second, third])
    }
}

/// The backward pass of a kernel.
#[derive(Debug)]
struct KernelBackward;

impl<B: CpuBackend> Backward<B, INPUTS> for KernelBackward {
    type State = (Arc<dyn CpuKernel>, [FloatTensor<B>; INPUTS], FloatTensor<B>);

    fn backward(self, ops: Ops<Self::State, INPUTS>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let (kernel, inputs, output) = ops.state;
        let gradient = gradients.consume::<B>(&ops.node);
        // An input that is not tracked has no node.
        let wants: Vec<bool> = ops.parents.iter().map(Option::is_some).collect();
        let found = B::backward(&*kernel, &inputs, output, gradient, &wants);
        for (node, gradient) in ops.parents.into_iter().zip(found) {
            if let (Some(node), Some(gradient)) = (node, gradient) {
                gradients.register::<B>(node.id, gradient);
            }
        }
    }
}

impl<B: CpuBackend, C: CheckpointStrategy> CpuOps for Autodiff<B, C> {
    fn cpu_kernel(
        kernel: Arc<dyn CpuKernel>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        third: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let inputs = [first, second, third];
        let nodes = std::array::from_fn(|i| inputs[i].node());
        let inputs = inputs.map(|input| input.into_primitive());
        let output = B::forward(&*kernel, &inputs);
        match KernelBackward.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((kernel, inputs, output.clone()), output),
            OpsKind::UnTracked(prepared) => prepared.finish(output),
        }
    }
}
