//! The device forms beside the kernels of the CPU, on the device that this machine has: `cargo xtask devices` gives it one that computes on
//! the CPU, and fails if none is found.

use std::io::Write;
use std::panic::catch_unwind;
use std::sync::OnceLock;

use burn::prelude::*;
use burn::tensor::DType;
use petzval_camera::device::facts;
use petzval_camera::tape::{computes_in_place, is_served};

use crate::network::depthwise::Depthwise;
use crate::network::pointwise::Pointwise;
use crate::network::{Prologue, conv_leaky, depthwise, gated_pointwise, normalized_pointwise, pointwise};

/// Set by those who need the tests to run: then a machine without a device fails.
const REQUIRED: &str = "PETZVAL_DEVICE_REQUIRED";

/// Batch, inputs, outputs, height, width: blocks, tiles and cubes that are full, that are not, and more than one of them.
const CASES: [[usize; 5]; 7] = [
    [2, 16, 32, 24, 32],
    [1, 3, 16, 61, 47],
    [2, 5, 11, 7, 19],
    [1, 2, 1, 1, 1],
    [3, 17, 70, 2, 33],
    [1, 70, 130, 13, 9],
    [2, 33, 24, 96, 130],
];

/// The device; none, and a line that says so, where there is none.
fn device() -> Option<Device> {
    static FOUND: OnceLock<Option<Device>> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let opened = catch_unwind(|| {
            #[cfg(feature = "wgpu")]
            let device = Device::wgpu(Default::default());
            #[cfg(not(feature = "wgpu"))]
            let device = Device::cuda(0);
            facts(&device).map(|_| device.autodiff())
        });
        opened.ok().flatten()
    });
    if found.is_none() {
        assert!(std::env::var_os(REQUIRED).is_none(), "{REQUIRED} is set, and there is no device");
        // Not by a macro: the text of those is kept back where a test passes.
        let text = "NOT TESTED: no device for the kernels of GPUs (apt install mesa-vulkan-drivers)";
        writeln!(std::io::stderr(), "{text}").unwrap();
    }
    found.clone()
}

/// Repeatable values in -1..1.
fn noise(count: usize, stream: u64) -> Vec<f32> {
    let value = |i: usize| {
        let mut z =
            (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ stream.wrapping_mul(0xd1b5_4a32_d192_ed03);
        z = (z ^ (z >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (z >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    };
    (0..count).map(value).collect()
}

fn random<const D: usize>(shape: [usize; D], stream: u64, device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(noise(shape.iter().product(), stream), shape), device)
}

fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_to_vec().unwrap()
}

/// How the memory of pictures is ordered.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    /// As the shape says.
    Contiguous,
    /// The channels of a pixel are neighbours, as the framework's convolutions leave them.
    ChannelsLast,
    /// A part of a larger picture: rows are longer than the picture is wide.
    Padded,
}

impl Order {
    /// A tensor with the same values, in this order.
    fn of(self, x: Tensor<4>) -> Tensor<4> {
        let [batch, channels, height, width] = x.dims();
        match self {
            Self::Contiguous => x,
            Self::ChannelsLast => {
                let turned = host(x.clone().permute([0, 2, 3, 1]));
                let turned = TensorData::new(turned, [batch, height, width, channels]);
                Tensor::<4>::from_data(turned, &x.device()).permute([0, 3, 1, 2])
            }
            Self::Padded => {
                let larger = Tensor::zeros([batch, channels, height + 1, width + 3], &x.device());
                let part = [0..batch, 0..channels, 1..height + 1, 2..width + 2];
                larger.slice_assign(part.clone(), x).slice(part)
            }
        }
    }
}

/// A layer's shapes of input and weight, the number of its outputs, and the layer of three tensors.
struct Layer<'a, const D: usize> {
    name: String,
    x: [usize; 4],
    weight: [usize; D],
    outputs: usize,
    apply: &'a dyn Fn(Tensor<4>, Tensor<D>, Tensor<1>) -> Tensor<4>,
}

impl<const D: usize> Layer<'_, D> {
    /// The result, and the gradients of the inputs that are wanted.
    fn passes(&self, device: &Device, wanted: [bool; 3], order: Order) -> [Option<Vec<f32>>; 4] {
        let x = order.of(random(self.x, 1, device));
        let x = if wanted[0] { x.detach().require_grad() } else { x };
        let weight = random(self.weight, 2, device);
        let weight = if wanted[1] { weight.require_grad() } else { weight };
        let bias = random([self.outputs], 3, device);
        let bias = if wanted[2] { bias.require_grad() } else { bias };
        let y = (self.apply)(x.clone(), weight.clone(), bias.clone());
        let probe = order.of(random(y.dims(), 4, device));
        // The cotangent that comes back has the order of the probe.
        let gradients = (y.clone() * probe).sum().backward();
        [
            Some(host(y)),
            x.grad(&gradients).map(host),
            weight.grad(&gradients).map(host),
            bias.grad(&gradients).map(host),
        ]
    }

    /// Asserts that the device gives what the CPU gives, and the same bits again.
    fn assert_agrees(&self, device: &Device, wanted: [bool; 3], order: Order) {
        let theirs = self.passes(&Device::flex().autodiff(), wanted, Order::Contiguous);
        let ours = self.passes(device, wanted, order);
        let names = ["value", "gradient of the input", "gradient of the weight", "gradient of the bias"];
        for ((name, ours), theirs) in names.iter().zip(&ours).zip(&theirs) {
            let case = format!("{}, {order:?}, {wanted:?}: {name}", self.name);
            assert_eq!(ours.as_ref().map(Vec::len), theirs.as_ref().map(Vec::len), "{case}");
            let (Some(ours), Some(theirs)) = (ours, theirs) else { continue };
            let scale = theirs.iter().fold(0.0f32, |most, v| most.max(v.abs()));
            for (i, (a, b)) in ours.iter().zip(theirs).enumerate() {
                assert!((a - b).abs() <= 1e-5 * scale, "{case}, value {i}: {a} for {b}, largest {scale}");
            }
        }
        assert!(ours == self.passes(device, wanted, order), "{}, {order:?}: other bits", self.name);
    }
}

const ALL: [bool; 3] = [true; 3];

#[test]
fn the_forms_serve_32_bits_on_the_device_and_nothing_else() {
    let Some(device) = device() else { return };
    let x = random([1, 4, 3, 3], 1, &device);
    let on_cpu = random([1, 4, 3, 3], 1, &Device::flex());
    let gate = Pointwise(Prologue::Gate);
    assert!(computes_in_place(&Depthwise, &x) && computes_in_place(&gate, &x));
    assert!(computes_in_place(&gate, &x.clone().without_autodiff()));
    assert!(!is_served(&on_cpu.clone().into_dispatch()));
    let double = on_cpu.cast(DType::F64);
    assert!(!computes_in_place(&Depthwise, &double) && !computes_in_place(&gate, &double));
    if device.supports_dtype(DType::F16) {
        assert!(!computes_in_place(&Depthwise, &x.cast(DType::F16)));
    }
}

#[test]
fn depthwise_agrees_with_the_cpu() {
    let Some(device) = device() else { return };
    let layer = |[batch, channels, _, height, width]: [usize; 5], size: usize| Layer {
        name: format!("depthwise {size}x{size}, {batch} x {channels} x {height} x {width}"),
        x: [batch, channels, height, width],
        weight: [channels, size, size],
        outputs: channels,
        apply: &depthwise,
    };
    for case in CASES {
        layer(case, 3).assert_agrees(&device, ALL, Order::Contiguous);
    }
    for size in [1, 5, 7, 9] {
        layer([2, 5, 5, 11, 34], size).assert_agrees(&device, ALL, Order::Contiguous);
    }
    for order in [Order::ChannelsLast, Order::Padded] {
        layer(CASES[2], 3).assert_agrees(&device, ALL, order);
    }
    for wanted in [[true, false, false], [false, true, false], [false, false, true], [true, false, true]] {
        layer(CASES[2], 3).assert_agrees(&device, wanted, Order::Contiguous);
    }
}

#[test]
fn pointwise_agrees_with_the_cpu() {
    let Some(device) = device() else { return };
    type Mix = fn(Tensor<4>, Tensor<2>, Tensor<1>) -> Tensor<4>;
    let kinds: [(&str, Mix, usize); 3] =
        [("plain", pointwise, 1), ("normalized", normalized_pointwise, 1), ("gated", gated_pointwise, 2)];
    for (name, mix, halves) in &kinds {
        let layer = |[batch, inputs, outputs, height, width]: [usize; 5]| Layer {
            name: format!("{name}, {batch} x {inputs} x {height} x {width} to {outputs}"),
            x: [batch, halves * inputs, height, width],
            weight: [outputs, inputs],
            outputs,
            apply: mix,
        };
        for case in CASES {
            layer(case).assert_agrees(&device, ALL, Order::Contiguous);
        }
        for order in [Order::ChannelsLast, Order::Padded] {
            layer(CASES[2]).assert_agrees(&device, ALL, order);
            layer(CASES[5]).assert_agrees(&device, ALL, order);
        }
        for wanted in [[true, false, false], [false, true, false], [false, false, true], [true, false, true]]
        {
            layer(CASES[2]).assert_agrees(&device, wanted, Order::Contiguous);
        }
    }
}

#[test]
fn convolutions_with_a_rectifier_agree_with_the_cpu() {
    let Some(device) = device() else { return };
    // Batch, inputs, outputs, height, width; size of the kernel, step, slope. The last ones are several parts of the sum for the bias, and
    // channels left over in a block.
    let cases = [
        ([2, 4, 7, 9, 14], 3, 1, 0.2),
        ([2, 4, 7, 9, 14], 3, 2, 1.0),
        ([2, 4, 7, 9, 14], 5, 2, 0.1),
        ([2, 3, 33, 70, 61], 3, 1, 0.2),
    ];
    for (i, ([batch, inputs, outputs, height, width], size, step, slope)) in cases.into_iter().enumerate() {
        let conv = |x, weight, bias| conv_leaky(x, weight, bias, step, slope);
        let layer = Layer {
            name: format!(
                "{size}x{size}, step {step}, slope {slope}, {batch} x {inputs} x {height} x {width} to {outputs}"
            ),
            x: [batch, inputs, height, width],
            weight: [outputs, inputs, size, size],
            outputs,
            apply: &conv,
        };
        layer.assert_agrees(&device, ALL, Order::Contiguous);
        if i > 1 {
            continue;
        }
        for order in [Order::ChannelsLast, Order::Padded] {
            layer.assert_agrees(&device, ALL, order);
        }
        for wanted in [[true, false, false], [false, true, false], [false, false, true]] {
            layer.assert_agrees(&device, wanted, Order::Contiguous);
        }
    }
}
