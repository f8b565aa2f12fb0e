//! Times the convolutions, ours beside the framework's, and the networks: forward and backward, batch 4.
//!
//! `cargo bench -p petzval-learn --bench networks -- FILTER`. Run it on an idle machine, with
//! `MIMALLOC_PURGE_DELAY=-1` in the environment, as `petzval` does: memory that is returned to the system between steps costs time.

use std::time::Duration;

use burn::{
    module::Module,
    optim::{AdamWConfig, GradientsParams, ModuleOptimizer},
    prelude::*,
    tensor::{activation::leaky_relu, module::conv2d, ops::ConvOptions},
};
use criterion::{Criterion, criterion_group, criterion_main};
use petzval_learn::network::{
    IspProxy, IspProxyConfig, Naf, NafConfig, UNet, UNetConfig, conv_leaky, depthwise, gated_pointwise,
    normalized_pointwise, pointwise,
};

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

/// A 1x1 convolution as a matrix product of the framework.
fn product(x: Tensor<4>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<4> {
    let ([batch, inputs, rows, columns], [outputs]) = (x.dims(), bias.dims());
    let mixed = weight.unsqueeze::<3>().matmul(x.reshape([batch, inputs, rows * columns]));
    mixed.reshape([batch, outputs, rows, columns]) + bias.reshape([1, outputs, 1, 1])
}

/// 1x1 and depthwise convolutions. The framework's 1x1 convolution is a matrix product, its fastest way.
fn narrow_convolutions(criterion: &mut Criterion) {
    type Mix = fn(Tensor<4>, Tensor<2>, Tensor<1>) -> Tensor<4>;
    let normalized: Mix = |x, weight, bias| {
        let centred = x.clone() - x.mean_dim(1);
        let variance = centred.clone().square().mean_dim(1);
        product(centred / (variance + 1e-6).sqrt(), weight, bias)
    };
    let gated: Mix = |x, weight, bias| {
        let halves = x.chunk(2, 1);
        product(halves[0].clone() * halves[1].clone(), weight, bias)
    };
    let kinds: [(&str, Mix, Mix, usize); 3] = [
        ("1x1", pointwise, product, 1),
        ("normalized 1x1", normalized_pointwise, normalized, 1),
        ("gated 1x1", gated_pointwise, gated, 2),
    ];
    for (inputs, outputs, side) in [(16, 32, 96), (64, 64, 24)] {
        let (weight, bias) = (tracked([outputs, inputs]), tracked([outputs]));
        for (name, ours, theirs, halves) in kinds {
            let x = tracked([BATCH, halves * inputs, side, side]);
            let mut group =
                criterion.benchmark_group(format!("{name}, {inputs} to {outputs}, {side} x {side}"));
            for (who, mix) in [("ours", ours), ("framework", theirs)] {
                group.bench_function(who, |bench| {
                    bench.iter(|| mix(x.clone(), weight.clone(), bias.clone()).sum().backward());
                });
            }
        }
    }
    for kernel in [3, 7] {
        let x = tracked([BATCH, 32, 96, 96]);
        let (weight, bias) = (tracked([32, kernel, kernel]), tracked([32]));
        let mut group =
            criterion.benchmark_group(format!("depthwise {kernel}x{kernel}, 32 channels, 96 x 96"));
        group.bench_function("ours", |bench| {
            bench.iter(|| depthwise(x.clone(), weight.clone(), bias.clone()).sum().backward());
        });
        group.bench_function("framework", |bench| {
            let options = ConvOptions::new([1; 2], [kernel / 2; 2], [1; 2], 32);
            bench.iter(|| {
                let kernels = weight.clone().unsqueeze_dim::<4>(1);
                conv2d(x.clone(), kernels, Some(bias.clone()), options.clone()).sum().backward()
            });
        });
    }
}

/// Networks of their default sizes: forward, mean absolute difference, backward; then the same with the optimiser's step.
fn networks(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    let mut group = criterion.benchmark_group("step");
    macro_rules! bench {
        ($name:literal, $network:expr, $forward:expr) => {
            let mut network = $network;
            let forward = $forward;
            group.bench_function(concat!($name, ", forward and backward"), |bench| {
                bench.iter(|| forward(&network).abs().mean().backward());
            });
            let mut optimizer: ModuleOptimizer = AdamWConfig::new().init();
            group.bench_function(concat!($name, ", with AdamW"), |bench| {
                bench.iter(|| {
                    let gradients = forward(&network).abs().mean().backward();
                    let gradients = GradientsParams::from_grads(gradients, &network);
                    network = optimizer.step(1e-4, network.clone(), gradients);
                });
            });
        };
    }
    let picture = tracked([BATCH, 8, 96, 96]).detach();
    let unet = UNetConfig { in_channels: 8, ..Default::default() }.init(1, &device).expect("default sizes");
    bench!("U-Net, 8 x 96 x 96", unet, |network: &UNet| network.forward(picture.clone()));
    for base in [16, 24] {
        let naf = NafConfig { base_channels: base, ..Default::default() }.init(1, &device).expect("sizes");
        println!("base {base}: {} parameters", naf.num_params());
        if base == 16 {
            bench!("NAF, 8 x 96 x 96", naf, |network: &Naf| network.forward(picture.clone()));
        } else {
            bench!("NAF 24, 8 x 96 x 96", naf, |network: &Naf| network.forward(picture.clone()));
        }
    }
    let proxy = IspProxyConfig::default().init(1, &device).expect("default sizes");
    let (raw, theta) = (tracked([BATCH, 4, 64, 64]).detach(), tracked([BATCH, 16]).detach());
    bench!("ISP proxy, raw 128 x 128", proxy, |network: &IspProxy| {
        network.forward(raw.clone(), theta.clone())
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = convolutions, narrow_convolutions, networks
}
criterion_main!(benches);
