//! Functions of tensors with hand-written adjoints, as differentiable operations of the tensor framework.
//!
//! A [`Kernel`] is plain Rust on borrowed values. [`apply`] makes one an operation on any device: on the CPU the kernel reads the memory
//! of the framework; from other devices values are copied to the host and results back, unless the kernel has a [`DeviceForm`] there.

use std::fmt::Debug;
use std::sync::Arc;

use burn::backend::autodiff::Autodiff;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Backend, BackendTensor, Dispatch, DispatchAutodiffContext, DispatchKindConversion, DispatchTensor,
    DispatchTensorKind, ExtensionType, Flex, TensorMetadata, backend_extension,
};
use burn::prelude::*;
use burn::tensor::{DType, TensorData};

/// Values of a tensor, row-major, and its shape.
#[derive(Clone, Debug)]
pub struct View<'a> {
    /// As many values as the shape has elements.
    pub values: &'a [f32],
    /// Length along each dimension.
    pub shape: Vec<usize>,
}

impl View<'_> {
    /// The shape of a tensor of rank `D`.
    ///
    /// # Panics
    /// Panics if the tensor has another rank.
    pub fn dims<const D: usize>(&self) -> [usize; D] {
        self.shape.as_slice().try_into().expect("rank of the tensor")
    }
}

/// A function of one to eight tensors with its hand-written adjoint.
///
/// Both methods depend on their arguments alone: the same inputs give the same bits.
pub trait Kernel: Debug + Send + Sync {
    /// Value of the function and its shape. `tracked` marks the inputs that are on the tape: derivatives by others are never wanted, so
    /// nothing need be recorded for them.
    fn forward(&self, inputs: &[View<'_>], tracked: &[bool]) -> (Vec<f32>, Vec<usize>);

    /// `J^T gradient` for each input that `wanted` marks, in the shape of the input. What is returned for other inputs is not read: a
    /// kernel saves the work and returns nothing.
    ///
    /// `gradient` is the cotangent of the value. `output` is that value, or empty unless the kernel
    /// [reads it](Self::reads_output).
    fn backward(
        &self,
        inputs: &[View<'_>],
        output: &[f32],
        gradient: &[f32],
        wanted: &[bool],
    ) -> Vec<Vec<f32>>;

    /// True if the backward pass needs the value of the function. The tape keeps it for that long.
    fn reads_output(&self) -> bool {
        false
    }

    /// The form of the kernel that needs no copies to the host, if it has one.
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        None
    }
}

/// A kernel that takes its tensors where they are, such as on a GPU. Its tensors carry no tape.
///
/// It computes what the [`Kernel`] computes on the host, within the rounding of the device.
pub trait DeviceForm {
    /// True if the form can compute with inputs like this one, by its device and its number type: most compute with all that [`is_served`].
    fn serves(&self, input: &DispatchTensor) -> bool {
        is_served(input)
    }

    /// See [`Kernel::forward`]. The value stays on the device of the inputs.
    fn forward(&self, inputs: &[DispatchTensor], tracked: &[bool]) -> DispatchTensor;

    /// See [`Kernel::backward`]; none for inputs that are not wanted.
    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>>;
}

/// True for tensors of f32 on a device.
pub fn is_served(input: &DispatchTensor) -> bool {
    match &input.kind {
        #[cfg(any(feature = "wgpu", feature = "cuda"))]
        DispatchTensorKind::Cube(tensor) => tensor.dtype() == DType::F32,
        _ => false,
    }
}

/// What the backward pass of a [`DeviceForm`] starts from; see [`Kernel::backward`].
#[derive(Clone, Copy)]
pub struct BackwardPass<'a> {
    /// The value of the function; none unless the kernel [reads it](Kernel::reads_output).
    pub output: Option<&'a DispatchTensor>,
    /// The cotangent of that value.
    pub gradient: &'a DispatchTensor,
    /// The inputs whose cotangents are wanted.
    pub wanted: &'a [bool],
}

/// Applies a kernel to tensors of any rank; `R` is the rank of its value. The value has the device and the number type of the first input.
///
/// # Panics
/// Panics if the value has another rank, or if there are no inputs or more than eight.
pub fn apply<const R: usize>(
    kernel: Arc<dyn Kernel>,
    inputs: impl IntoIterator<Item = DispatchTensor>,
) -> Tensor<R> {
    let inputs = Inputs(inputs.into_iter().collect());
    let count = inputs.0.len();
    assert!((1..=MOST_INPUTS).contains(&count), "{kernel:?} has {count} inputs, not 1 to {MOST_INPUTS}");
    let value = <Dispatch as KernelOps>::kernel(kernel.clone(), inputs);
    assert_eq!(value.rank(), R, "rank of the value of {kernel:?}");
    Tensor::from_dispatch(value)
}

/// True if kernels read the memory of this tensor without copies: f32 values on the CPU.
pub fn is_on_host<const D: usize>(x: &Tensor<D>) -> bool {
    x.device().without_autodiff() == Device::flex() && x.dtype() == DType::F32
}

/// True if [`apply`] computes with tensors like this one without copies: in the memory of the CPU, or by the kernel's [`DeviceForm`].
pub fn computes_in_place<const D: usize>(kernel: &dyn Kernel, x: &Tensor<D>) -> bool {
    let serves = |form: &dyn DeviceForm| form.serves(&x.clone().without_autodiff().into_dispatch());
    is_on_host(x) || kernel.device_form().is_some_and(serves)
}

/// The tape has a step type for each number of inputs up to this one.
const MOST_INPUTS: usize = 8;

/// The inputs of a kernel, tensors of one backend.
struct Inputs<B: Backend>(Vec<FloatTensor<B>>);

/// Lets the framework find the backend of the inputs. The framework derives this only for a fixed number of tensors.
impl<B: Backend> ExtensionType<B> for Inputs<B> {
    type Target = Inputs<Dispatch>;

    fn map_to_dispatch<F>(self, map_kind: F, autodiff: DispatchAutodiffContext) -> Self::Target
    where
        F: Fn(BackendTensor<B>) -> DispatchTensorKind,
    {
        let wrap = |tensor| DispatchTensor { kind: map_kind(BackendTensor::Float(tensor)), autodiff };
        Inputs(self.0.into_iter().map(wrap).collect())
    }

    fn map_from_dispatch<F>(target: Self::Target, unwrap_kind: F) -> Self
    where
        F: Fn(DispatchTensor) -> BackendTensor<B>,
    {
        Self(target.0.into_iter().map(|tensor| unwrap_kind(tensor).float()).collect())
    }

    fn routing_tensor(target: &Self::Target) -> Option<&DispatchTensor> {
        target.0.first()
    }

    fn routing_float_tensor(target: &Self::Target) -> Option<&DispatchTensor> {
        target.0.first()
    }

    fn autodiff_context(target: &Self::Target) -> DispatchAutodiffContext {
        let merge = |all: DispatchAutodiffContext, tensor: &DispatchTensor| all.merge(tensor.autodiff);
        target.0.iter().fold(DispatchAutodiffContext::Disabled, merge)
    }
}

/// Routes a kernel to the backend of its inputs. A new backend needs an entry in the attribute, an `impl` as short as that of [`Flex`],
/// and its [`Memory`].
#[backend_extension(Flex, Cube: cfg(any(feature = "wgpu", feature = "cuda")), Autodiff)]
trait KernelOps: Backend {
    fn kernel(kernel: Arc<dyn Kernel>, #[extension_type] inputs: Inputs<Self>) -> FloatTensor<Self>;
}

impl KernelOps for Flex {
    fn kernel(kernel: Arc<dyn Kernel>, inputs: Inputs<Self>) -> FloatTensor<Self> {
        forward::<Self>(&*kernel, &inputs.0, &[false; MOST_INPUTS][..inputs.0.len()])
    }
}

#[cfg(any(feature = "wgpu", feature = "cuda"))]
impl KernelOps for burn::backend::Cube {
    fn kernel(kernel: Arc<dyn Kernel>, inputs: Inputs<Self>) -> FloatTensor<Self> {
        forward::<Self>(&*kernel, &inputs.0, &[false; MOST_INPUTS][..inputs.0.len()])
    }
}

/// How kernels reach the tensors of a backend.
trait Memory: Backend {
    /// Values on the host: a copy, unless the backend shares its memory.
    fn values(tensor: &FloatTensor<Self>) -> Values {
        copied::<Self>(tensor)
    }

    /// The tensor without its backend in the type.
    fn erased(tensor: FloatTensor<Self>) -> DispatchTensor;

    /// The reverse of [`erased`](Self::erased).
    fn concrete(tensor: DispatchTensor) -> FloatTensor<Self>;
}

/// Bodies that differ in the type of the backend alone.
macro_rules! erase_and_restore {
    () => {
        fn erased(tensor: FloatTensor<Self>) -> DispatchTensor {
            <DispatchTensor as DispatchKindConversion<Self>>::from_backend(BackendTensor::Float(tensor))
        }

        fn concrete(tensor: DispatchTensor) -> FloatTensor<Self> {
            let found = <DispatchTensor as DispatchKindConversion<Self>>::try_into_backend(tensor);
            found.expect("a device form returns tensors of its own device, without a tape").float()
        }
    };
}

impl Memory for Flex {
    fn values(tensor: &FloatTensor<Self>) -> Values {
        if tensor.dtype() == DType::F32 {
            return Values::InPlace(tensor.to_contiguous());
        }
        copied::<Self>(tensor)
    }

    erase_and_restore!();
}

#[cfg(any(feature = "wgpu", feature = "cuda"))]
impl Memory for burn::backend::Cube {
    erase_and_restore!();
}

/// Values of a tensor on the host.
enum Values {
    /// The memory of the framework: contiguous and f32.
    InPlace(FloatTensor<Flex>),
    Copied {
        values: Vec<f32>,
        shape: Vec<usize>,
    },
}

impl Values {
    fn view(&self) -> View<'_> {
        match self {
            Self::InPlace(tensor) => {
                let values = tensor.as_slice().expect("a contiguous tensor of f32");
                View { values, shape: tensor.shape().as_slice().to_vec() }
            }
            Self::Copied { values, shape } => View { values, shape: shape.clone() },
        }
    }
}

/// The values of a tensor, read from its device and converted.
fn copied<B: Backend>(tensor: &FloatTensor<B>) -> Values {
    let data = burn::tensor::try_read_sync(B::float_into_data(tensor.clone()));
    let data = data.expect("backend reads synchronously").expect("tensor can be read");
    let values = data.convert::<f32>().try_to_vec::<f32>().expect("converted to f32");
    Values::Copied { values, shape: tensor.shape().as_slice().to_vec() }
}

/// A tensor on the device and with the number type of `like`.
fn to_device<B: Backend>(values: Vec<f32>, shape: Vec<usize>, like: &FloatTensor<B>) -> FloatTensor<B> {
    let data = TensorData::new(values, shape).convert_dtype(like.dtype());
    B::float_from_data(data, &like.device())
}

/// The form of a kernel for tensors like these, with the tensors as it takes them.
fn served<'k, B: Memory>(
    kernel: &'k dyn Kernel,
    inputs: &[FloatTensor<B>],
) -> Option<(&'k dyn DeviceForm, Vec<DispatchTensor>)> {
    let form = kernel.device_form()?;
    let inputs: Vec<_> = inputs.iter().cloned().map(B::erased).collect();
    form.serves(&inputs[0]).then_some((form, inputs))
}

fn forward<B: Memory>(kernel: &dyn Kernel, inputs: &[FloatTensor<B>], tracked: &[bool]) -> FloatTensor<B> {
    if let Some((form, inputs)) = served::<B>(kernel, inputs) {
        return B::concrete(form.forward(&inputs, tracked));
    }
    let values: Vec<Values> = inputs.iter().map(B::values).collect();
    let views: Vec<View> = values.iter().map(Values::view).collect();
    let (values, shape) = kernel.forward(&views, tracked);
    to_device::<B>(values, shape, &inputs[0])
}

/// Gradients of the wanted inputs, each on the device and with the number type of its input.
fn backward<B: Memory>(
    kernel: &dyn Kernel,
    inputs: &[FloatTensor<B>],
    output: Option<FloatTensor<B>>,
    gradient: FloatTensor<B>,
    wanted: &[bool],
) -> Vec<Option<FloatTensor<B>>> {
    if let Some((form, inputs)) = served::<B>(kernel, inputs) {
        let (output, gradient) = (output.map(B::erased), B::erased(gradient));
        let at = BackwardPass { output: output.as_ref(), gradient: &gradient, wanted };
        let found = form.backward(&inputs, at);
        return found.into_iter().map(|gradient| gradient.map(B::concrete)).collect();
    }
    let values: Vec<Values> = inputs.iter().map(B::values).collect();
    let views: Vec<View> = values.iter().map(Values::view).collect();
    let (output, gradient) = (output.as_ref().map(B::values), B::values(&gradient));
    let output = output.as_ref().map(Values::view);
    let output = output.as_ref().map_or(&[][..], |view| view.values);
    let found = kernel.backward(&views, output, gradient.view().values, wanted);
    let keep = |((values, input), wanted): ((Vec<f32>, &FloatTensor<B>), &bool)| {
        wanted.then(|| to_device::<B>(values, input.shape().as_slice().to_vec(), input))
    };
    found.into_iter().zip(inputs).zip(wanted).map(keep).collect()
}

/// The backward pass of a kernel with `N` inputs, in the order of the forward call.
#[derive(Debug)]
struct KernelBackward;

impl<B: Memory, const N: usize> Backward<B, N> for KernelBackward {
    type State = (Arc<dyn Kernel>, [FloatTensor<B>; N], Option<FloatTensor<B>>);

    fn backward(self, ops: Ops<Self::State, N>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let (kernel, inputs, output) = ops.state;
        let gradient = gradients.consume::<B>(&ops.node);
        // An input that is not tracked has no node.
        let wanted = ops.parents.each_ref().map(Option::is_some);
        let found = backward::<B>(&*kernel, &inputs, output, gradient, &wanted);
        for (node, gradient) in ops.parents.into_iter().zip(found) {
            if let (Some(node), Some(gradient)) = (node, gradient) {
                gradients.register::<B>(node.id, gradient);
            }
        }
    }
}

impl<B: Memory, C: CheckpointStrategy> KernelOps for Autodiff<B, C> {
    fn kernel(kernel: Arc<dyn Kernel>, inputs: Inputs<Self>) -> FloatTensor<Self> {
        match inputs.0.len() {
            1 => recorded::<B, C, 1>(kernel, inputs),
            2 => recorded::<B, C, 2>(kernel, inputs),
            3 => recorded::<B, C, 3>(kernel, inputs),
            4 => recorded::<B, C, 4>(kernel, inputs),
            5 => recorded::<B, C, 5>(kernel, inputs),
            6 => recorded::<B, C, 6>(kernel, inputs),
            7 => recorded::<B, C, 7>(kernel, inputs),
            _ => recorded::<B, C, MOST_INPUTS>(kernel, inputs),
        }
    }
}

/// Computes the value of a kernel with `N` inputs and puts its backward pass on the tape.
fn recorded<B: Memory, C: CheckpointStrategy, const N: usize>(
    kernel: Arc<dyn Kernel>,
    inputs: Inputs<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let Ok(inputs) = <[_; N]>::try_from(inputs.0) else { unreachable!("the caller counted the inputs") };
    let (tracked, nodes) = (inputs.each_ref().map(|i| i.is_tracked()), inputs.each_ref().map(|i| i.node()));
    let inputs = inputs.map(|input| input.into_primitive());
    let output = forward::<B>(&*kernel, &inputs, &tracked);
    match <KernelBackward as Backward<B, N>>::prepare::<C>(KernelBackward, nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let kept = kernel.reads_output().then(|| output.clone());
            prepared.finish((kernel, inputs, kept), output)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(output),
    }
}
