//! Compares our convolution with the framework's, values and gradients.

use burn::{
    prelude::*,
    tensor::{DType, activation::leaky_relu, module::conv2d, ops::ConvOptions},
};
use petzval_learn::network::{conv_leaky, conv3x3_leaky};

use crate::support::{assert_same, largest_difference, noise, random};

#[test]
fn agrees_with_the_framework() {
    let device = Device::flex().autodiff();
    // Batch, inputs, outputs, height, width: whole blocks, remainders of every kind, single rows and columns.
    let cases = [
        ([2, 16, 16, 32, 32], 0.2_f32),
        ([1, 3, 16, 128, 128], 0.2),
        ([2, 5, 11, 7, 19], 0.2),
        ([1, 1, 1, 1, 1], 0.2),
        ([3, 17, 9, 2, 33], 0.2),
        ([1, 40, 24, 16, 16], 1.0),
        ([1, 4, 8, 9, 1], 0.01),
    ];
    for ([batch, inputs, outputs, height, width], slope) in cases {
        for (kernel, step) in [(3, 1), (3, 2), (7, 1), (7, 2), (5, 2), (1, 1), (1, 2)] {
            let x = random([batch, inputs, height, width], 1, &device).require_grad();
            let weight = random([outputs, inputs, kernel, kernel], 2, &device).require_grad();
            let bias = random([outputs], 3, &device).require_grad();

            let ours = conv_leaky(x.clone(), weight.clone(), bias.clone(), step, slope);
            let options = ConvOptions::new([step; 2], [kernel / 2; 2], [1; 2], 1);
            let plain = conv2d(x.clone(), weight.clone(), Some(bias.clone()), options);
            let theirs = leaky_relu(plain, f64::from(slope));
            let case =
                format!("{batch} x {inputs} -> {outputs} x {height} x {width}, kernel {kernel} step {step}");
            assert_same(&case, ours, theirs, (&x, &weight, &bias));
        }
    }
}

#[test]
fn forward_and_backward_are_adjoint() {
    // With slope 1 the operation is linear in x: <probe, J v> must equal <J^T probe, v>.
    let device = Device::flex().autodiff();
    for (kernel, step) in [(3, 1), (3, 2), (7, 1), (1, 1)] {
        let weight = random([12, 7, kernel, kernel], 5, &device);
        let bias = Tensor::<1>::zeros([12], &device);
        let x = random([2, 7, 21, 18], 6, &device).require_grad();
        let v = random([2, 7, 21, 18], 7, &device);
        let moved = conv_leaky(v.clone(), weight.clone(), bias.clone(), step, 1.0);
        let probe = random(moved.dims(), 8, &device);
        let forward: f32 = (moved * probe.clone()).sum().into_scalar();
        let gradients = (conv_leaky(x.clone(), weight, bias, step, 1.0) * probe).sum().backward();
        let backward: f32 = (x.grad(&gradients).unwrap() * v.inner()).sum().into_scalar();
        let scale = forward.abs().max(1.0);
        assert!((forward - backward).abs() < 2e-4 * scale, "{kernel}: {forward} against {backward}");
    }
}

#[test]
fn gradient_agrees_with_central_differences() {
    let device = Device::flex().autodiff();
    let (x, probe) = (random([1, 3, 6, 5], 9, &device), random([1, 4, 6, 5], 10, &device));
    let bias = random([4], 11, &device);
    let values = noise(&[4, 3, 3, 3], 12);
    let loss = |values: Vec<f32>| {
        let weight = Tensor::<4>::from_data(TensorData::new(values, [4, 3, 3, 3]), &device).require_grad();
        let loss = (conv3x3_leaky(x.clone(), weight.clone(), bias.clone(), 0.2) * probe.clone()).sum();
        (weight, loss)
    };
    let (weight, total) = loss(values.clone());
    let gradient = weight.grad(&total.backward()).unwrap().into_data().try_to_vec::<f32>().unwrap();
    let mut wrong = 0;
    for i in 0..values.len() {
        let step = 1e-3;
        let moved = |sign: f32| {
            let mut moved = values.clone();
            moved[i] += sign * step;
            f64::from(loss(moved).1.into_scalar::<f32>())
        };
        let difference = (moved(1.0) - moved(-1.0)) / (2.0 * f64::from(step));
        wrong += usize::from((difference - f64::from(gradient[i])).abs() > 0.01 * difference.abs().max(1.0));
    }
    // The difference quotient is wrong where a value crosses the kink of the rectifier within the step.
    assert!(wrong <= values.len() / 20, "{wrong} of {} weights disagree", values.len());
}

#[test]
fn double_precision_uses_the_framework() {
    let device = Device::flex().autodiff();
    let x = random([1, 3, 6, 5], 9, &device);
    let (weight, bias) = (random([4, 3, 3, 3], 10, &device), random([4], 11, &device));
    let single = conv3x3_leaky(x.clone(), weight.clone(), bias.clone(), 0.2);
    let double = DType::F64;
    let result = conv3x3_leaky(x.cast(double), weight.cast(double), bias.cast(double), 0.2);
    assert_eq!(result.dtype(), double);
    assert!(largest_difference(result.cast(DType::F32), single) < 1e-5);
}
