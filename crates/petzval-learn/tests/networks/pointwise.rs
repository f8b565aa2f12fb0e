//! Compares the 1x1 and the depthwise convolution with the framework's operations.

use burn::{prelude::*, tensor::DType};
use petzval_learn::network::{depthwise, gated_pointwise, normalized_pointwise, pointwise};

use crate::support::{assert_same, random};

/// Batch, inputs, outputs, height, width: whole strips and blocks, and remainders of every kind.
const CASES: [[usize; 5]; 6] = [
    [2, 16, 32, 32, 32],
    [1, 3, 16, 61, 47],
    [2, 5, 11, 7, 19],
    [1, 1, 1, 1, 1],
    [3, 17, 9, 2, 33],
    [1, 40, 24, 96, 96],
];

type Mix = fn(Tensor<4>, Tensor<2>, Tensor<1>) -> Tensor<4>;

#[test]
fn pointwise_agrees_with_the_framework() {
    let device = Device::flex().autodiff();
    let kinds: [(&str, Mix, usize); 3] =
        [("plain", pointwise, 1), ("normalized", normalized_pointwise, 1), ("gated", gated_pointwise, 2)];
    for [batch, inputs, outputs, height, width] in CASES {
        for (name, mix, halves) in kinds {
            // One channel has no variance: its normalisation is 0, and its gradient too.
            if inputs == 1 && name == "normalized" {
                continue;
            }
            let x = random([batch, halves * inputs, height, width], 1, &device).require_grad();
            let weight = random([outputs, inputs], 2, &device).require_grad();
            let bias = random([outputs], 3, &device).require_grad();
            // Numbers of double precision take the framework's operations.
            let double = |t: Tensor<4>| t.cast(DType::F64);
            let theirs =
                mix(double(x.clone()), weight.clone().cast(DType::F64), bias.clone().cast(DType::F64));
            let ours = mix(x.clone(), weight.clone(), bias.clone());
            let case = format!("{name} {batch} x {inputs} -> {outputs} x {height} x {width}");
            assert_same(&case, ours, theirs.cast(DType::F32), (&x, &weight, &bias));
        }
    }
}

#[test]
fn depthwise_agrees_with_the_framework() {
    let device = Device::flex().autodiff();
    for [batch, channels, _, height, width] in CASES {
        for kernel in [3, 7] {
            let x = random([batch, channels, height, width], 1, &device).require_grad();
            let weight = random([channels, kernel, kernel], 2, &device).require_grad();
            let bias = random([channels], 3, &device).require_grad();
            let ours = depthwise(x.clone(), weight.clone(), bias.clone());
            let double =
                (x.clone().cast(DType::F64), weight.clone().cast(DType::F64), bias.clone().cast(DType::F64));
            let theirs = depthwise(double.0, double.1, double.2);
            let case = format!("{batch} x {channels} x {height} x {width}, kernel {kernel}");
            assert_same(&case, ours, theirs.cast(DType::F32), (&x, &weight, &bias));
        }
    }
}

#[test]
fn linear_operations_are_adjoint() {
    // <probe, J v> must equal <J^T probe, v>.
    let device = Device::flex().autodiff();
    let (weight, bias) = (random([12, 7], 5, &device), Tensor::<1>::zeros([12], &device));
    let (kernels, none) = (random([7, 3, 3], 5, &device), Tensor::<1>::zeros([7], &device));
    let mixed = |x: Tensor<4>| pointwise(x, weight.clone(), bias.clone());
    let filtered = |x: Tensor<4>| depthwise(x, kernels.clone(), none.clone());
    let operations: [(&str, &dyn Fn(Tensor<4>) -> Tensor<4>); 2] =
        [("1x1", &mixed), ("depthwise", &filtered)];
    for (name, operation) in operations {
        let x = random([2, 7, 21, 18], 6, &device).require_grad();
        let v = random([2, 7, 21, 18], 7, &device);
        let moved = operation(v.clone());
        let probe = random(moved.dims(), 8, &device);
        let forward: f32 = (moved * probe.clone()).sum().into_scalar();
        let gradients = (operation(x.clone()) * probe).sum().backward();
        let backward: f32 = (x.grad(&gradients).unwrap() * v.inner()).sum().into_scalar();
        assert!(
            (forward - backward).abs() < 2e-4 * forward.abs().max(1.0),
            "{name}: {forward} against {backward}"
        );
    }
}
