//! Times the convolutions, ours beside the framework's: forward and backward, batch 4.
//!
//! `cargo bench -p petzval-learn --bench networks -- FILTER`. Run it on an idle machine.

use std::time::Duration;

use burn::{
    prelude::*,
    tensor::{activation::leaky_relu, module::conv2d, ops::ConvOptions},
};
use criterion::{Criterion, criterion_group, criterion_main};
use petzval_learn::network::conv_leaky;

// The allocator of the command: without it, fresh pages of the system cost as much as the arithmetic.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Pictures per batch.
const BATCH: usize = 4;

/// A tracked tensor of values between 0 and 1.
fn tracked<const D: usize>(shape: [usize; D]) -> Tensor<D> {
    let values: Vec<f32> =
        (0..shape.iter().product()).map(|i: usize| (i as f32 * 0.37).sin().abs()).collect();
    Tensor::from_data(TensorData::new(values, shape), &Device::flex().autodiff()).require_grad()
}

/// Dense convolutions: kernel, step, inputs, outputs and side of the picture.
fn convolutions(criterion: &mut Criterion) {
    for (kernel, step, inputs, outputs, side) in
        [(3, 1, 16, 16, 96), (3, 2, 16, 32, 96), (1, 1, 32, 32, 96), (7, 1, 16, 16, 96)]
    {
        let mut group = criterion.benchmark_group(format!(
            "conv {kernel}x{kernel} step {step}, {inputs} to {outputs}, {side} x {side}"
        ));
        let x = tracked([BATCH, inputs, side, side]);
        let (weight, bias) = (tracked([outputs, inputs, kernel, kernel]), tracked([outputs]));
        group.bench_function("ours", |bench| {
            bench.iter(|| conv_leaky(x.clone(), weight.clone(), bias.clone(), step, 0.2).sum().backward());
        });
        group.bench_function("framework", |bench| {
            let options = ConvOptions::new([step; 2], [kernel / 2; 2], [1; 2], 1);
            bench.iter(|| {
                let plain = conv2d(x.clone(), weight.clone(), Some(bias.clone()), options.clone());
                leaky_relu(plain, 0.2).sum().backward()
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = convolutions
}
criterion_main!(benches);
