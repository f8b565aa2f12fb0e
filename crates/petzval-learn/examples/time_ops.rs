//! Times the operations of a network step: ours and those of the framework.

use std::time::Instant;

use burn::{
    prelude::*,
    tensor::{
        activation::leaky_relu,
        module::{avg_pool2d, conv_transpose2d, conv2d, interpolate, max_pool2d},
        ops::{
            AvgPoolOptions, ConvOptions, ConvTransposeOptions, InterpolateMode, InterpolateOptions,
            MaxPoolOptions,
        },
    },
};
use petzval_learn::network::conv3x3_leaky;

fn cpu_ms() -> f64 {
    // User plus system time of this process, in clock ticks of 10 ms.
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> = stat
        .rsplit(')')
        .next()
        .unwrap_or("")
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|v| v.parse().ok())
        .collect();
    fields.iter().sum::<f64>() * 10.0
}

fn time(name: &str, mut run: impl FnMut()) {
    run();
    let (mut best, count, cpu, all) = (f64::INFINITY, 10, cpu_ms(), Instant::now());
    for _ in 0..count {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    let mean = all.elapsed().as_secs_f64() * 1e3 / f64::from(count);
    println!(
        "{name:50} best {best:8.2} ms, mean {mean:8.2} ms, cpu {:8.2} ms",
        (cpu_ms() - cpu) / f64::from(count)
    );
}

fn main() {
    let device = Device::flex().autodiff();
    let x = |c: usize, n: usize| Tensor::<4>::ones([4, c, n, n], &device).require_grad();
    let weights = |o: usize, i: usize, k: usize| {
        (
            Tensor::<4>::ones([o, i, k, k], &device).require_grad(),
            Tensor::<1>::ones([o], &device).require_grad(),
        )
    };
    for (i, o, n) in [
        (3, 16, 128),
        (16, 16, 128),
        (32, 16, 128),
        (32, 32, 64),
        (64, 64, 32),
        (128, 128, 16),
        (64, 64, 128),
    ] {
        let (w, b) = weights(o, i, 3);
        let input = x(i, n);
        time(&format!("ours {i}->{o} at {n}"), || {
            conv3x3_leaky(input.clone(), w.clone(), b.clone(), 0.2).sum().backward();
        });
        time(&format!("ours {i}->{o} at {n} forward"), || {
            conv3x3_leaky(input.clone(), w.clone(), b.clone(), 0.2);
        });
        time(&format!("burn {i}->{o} at {n}"), || {
            leaky_relu(
                conv2d(
                    input.clone(),
                    w.clone(),
                    Some(b.clone()),
                    ConvOptions::new([1, 1], [1, 1], [1, 1], 1),
                ),
                0.2,
            )
            .sum()
            .backward();
        });
    }
    let input = x(16, 128);
    time("max_pool 16 at 128", || {
        max_pool2d(input.clone(), MaxPoolOptions::new([2, 2]).with_stride([2, 2])).sum().backward();
    });
    time("avg_pool 16 at 128", || {
        avg_pool2d(input.clone(), AvgPoolOptions::new([2, 2]).with_stride([2, 2])).sum().backward();
    });
    time("max by reshape 16 at 128", || {
        input.clone().reshape([4 * 16 * 64, 2, 64, 2]).max_dim(3).max_dim(1).sum().backward();
    });
    let (w, b) = weights(32, 16, 2);
    time("strided conv 16->32 at 128", || {
        conv2d(input.clone(), w.clone(), Some(b.clone()), ConvOptions::new([2, 2], [0, 0], [1, 1], 1))
            .sum()
            .backward();
    });
    let low = x(32, 64);
    let (w, b) = weights(32, 16, 2);
    let b16 = Tensor::<1>::ones([16], &device).require_grad();
    let _ = b;
    time("conv_transpose 32->16 at 64", || {
        conv_transpose2d(
            low.clone(),
            w.clone(),
            Some(b16.clone()),
            ConvTransposeOptions::new([2, 2], [0, 0], [0, 0], [1, 1], 1),
        )
        .sum()
        .backward();
    });
    let (w, b) = weights(16, 32, 1);
    time("conv 1x1 32->16 at 64", || {
        conv2d(low.clone(), w.clone(), Some(b.clone()), ConvOptions::new([1, 1], [0, 0], [1, 1], 1))
            .sum()
            .backward();
    });
    let low16 = x(16, 64);
    time("interpolate nearest 16 at 64", || {
        interpolate(
            low16.clone(),
            InterpolateOptions::new(InterpolateMode::Nearest).with_output_size([128, 128]),
        )
        .sum()
        .backward();
    });
    time("repeat 16 at 64", || {
        low16
            .clone()
            .reshape([4 * 16 * 64, 1, 64, 1])
            .repeat(&[1, 2, 1, 2])
            .reshape([4, 16, 128, 128])
            .sum()
            .backward();
    });
    time("expand 16 at 64", || {
        low16
            .clone()
            .reshape([4 * 16 * 64, 1, 64, 1])
            .expand([4 * 16 * 64, 2, 64, 2])
            .reshape([4, 16, 128, 128])
            .sum()
            .backward();
    });
    time("cat 16+16 at 128", || {
        Tensor::cat(vec![input.clone(), input.clone()], 1).sum().backward();
    });
    time("sum 16 at 128", || {
        input.clone().sum().backward();
    });
    let wide = x(16, 128);
    let (w, b) = weights(3, 16, 1);
    time("conv 1x1 16->3 at 128", || {
        conv2d(wide.clone(), w.clone(), Some(b.clone()), ConvOptions::new([1, 1], [0, 0], [1, 1], 1))
            .sum()
            .backward();
    });
    let (w, b) = weights(3, 16, 3);
    time("ours 3x3 16->3 at 128", || {
        conv3x3_leaky(wide.clone(), w.clone(), b.clone(), 1.0).sum().backward();
    });
    let w = Tensor::<3>::ones([1, 3, 16], &device).require_grad();
    time("matmul 16->3 at 128", || {
        w.clone().matmul(wide.clone().reshape([4, 16, 128 * 128])).sum().backward();
    });
}
