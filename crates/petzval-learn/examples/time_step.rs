//! Times a training step: network forward, loss, backward, Adam. `RAYON_NUM_THREADS` sets the threads.

use std::{fs, time::Instant};

use burn::{
    module::Module,
    optim::{AdamConfig, GradientsParams},
    prelude::*,
};
use petzval_learn::{
    loss::{ImageLoss, Lpips},
    network::UNetConfig,
};

/// User and system time of this process so far, ms (Linux; 0 elsewhere).
fn cpu_ms() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = stat.rsplit(')').next().unwrap_or("").split_whitespace().skip(11).take(2);
    ticks.filter_map(|v| v.parse::<f64>().ok()).sum::<f64>() * 10.0
}

/// Page faults of this process so far (Linux; 0 elsewhere).
fn page_faults() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    stat.rsplit(')')
        .next()
        .unwrap_or("")
        .split_whitespace()
        .nth(7)
        .and_then(|v| v.parse().ok())
        .unwrap_or(0.0)
}

fn time(name: &str, mut run: impl FnMut()) {
    run();
    run();
    let (mut best, count, cpu, pages, all) = (f64::INFINITY, 12, cpu_ms(), page_faults(), Instant::now());
    for _ in 0..count {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    let mean = all.elapsed().as_secs_f64() * 1e3 / f64::from(count);
    let per_run = |total: f64| total / f64::from(count);
    let (cpu, pages) = (per_run(cpu_ms() - cpu), per_run(page_faults() - pages));
    println!("{name:46} wall best {best:7.1} mean {mean:7.1} ms, cpu {cpu:7.1} ms, {pages:7.0} new pages");
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let device = Device::flex().autodiff();
    let weights =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../petzval-data/data/weights/lpips_alex_f16.safetensors");
    let lpips = Lpips::from_safetensors(&fs::read(weights)?, &device)?;
    let loss = ImageLoss::default();
    for batch in [4, 2] {
        let picture = |scale: f32| {
            let values: Vec<f32> =
                (0..batch * 3 * 128 * 128).map(|i| (i as f32 * scale).sin() * 0.5 + 0.5).collect();
            Tensor::<4>::from_data(TensorData::new(values, [batch, 3, 128, 128]), &device)
        };
        let (input, reference) = (picture(0.37), picture(0.11));
        let target = loss.target(&lpips, reference.clone())?;
        for (base_channels, levels) in [(16, 3), (16, 2), (24, 3), (32, 3), (32, 4)] {
            let config = UNetConfig { base_channels, levels, ..Default::default() };
            let mut unet = Some(config.init(1, &device)?);
            let parameters = unet.as_ref().map_or(0, |u| u.num_params());
            let mut optimizer = AdamConfig::new().init();
            time(&format!("batch {batch}: base {base_channels} levels {levels} ({parameters}) L1"), || {
                let Some(network) = unet.take() else { return };
                let loss = (network.forward(input.clone()) - reference.clone()).abs().mean();
                let gradients = GradientsParams::from_grads(loss.backward(), &network);
                unet = Some(optimizer.step(1e-4, network, gradients));
            });
            if (base_channels, levels) == (16, 3) {
                time(&format!("batch {batch}: the same with L1 and LPIPS"), || {
                    let Some(network) = unet.take() else { return };
                    if let Ok(parts) = loss.evaluate(&lpips, network.forward(input.clone()), &target) {
                        let gradients = GradientsParams::from_grads(parts.total.backward(), &network);
                        unet = Some(optimizer.step(1e-4, network, gradients));
                    }
                });
                let tracked = input.clone().require_grad();
                if let Some(network) = &unet {
                    time(&format!("batch {batch}: forward alone"), || drop(network.forward(input.clone())));
                    time(&format!("batch {batch}: frozen, gradient to the input"), || {
                        let frozen = network.clone().no_grad();
                        drop(frozen.forward(tracked.clone()).sum().backward());
                    });
                }
            }
        }
        let tracked = input.clone().require_grad();
        time(&format!("batch {batch}: LPIPS forward and backward"), || {
            if let Ok(parts) = loss.evaluate(&lpips, tracked.clone(), &target) {
                drop(parts.total.backward());
            }
        });
        time(&format!("batch {batch}: LPIPS target"), || drop(loss.target(&lpips, reference.clone())));
    }
    Ok(())
}
