//! Tests of the U-Net: shapes, initial identity, gradient, repeatability, storage.

use burn::{
    module::Module,
    optim::{AdamConfig, GradientsParams, ModuleOptimizer},
    prelude::*,
    tensor::Bytes,
};
use petzval_learn::network::{NetworkError, UNet, UNetConfig};
use petzval_learn::weight_file::Weights;

fn picture(shape: [usize; 4], seed: u32, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = (0..shape.iter().product::<usize>() as u32)
        .map(|i| {
            let z = (i ^ seed.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
            ((z ^ (z >> 13)).wrapping_mul(0xc2b2_ae35) >> 8) as f32 / (1 << 24) as f32
        })
        .collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn bits(tensor: Tensor<4>) -> Vec<u32> {
    tensor.into_data().try_to_vec::<f32>().unwrap().iter().map(|v| v.to_bits()).collect()
}

fn adam() -> ModuleOptimizer {
    AdamConfig::new().init()
}

/// One training step towards half the brightness; also returns the loss.
fn step(unet: UNet, optimizer: &mut ModuleOptimizer, number: u32, device: &Device) -> (UNet, f32) {
    let input = picture([2, 3, 32, 32], number, device);
    let loss = (unet.forward(input.clone()) - input * 0.5).abs().mean();
    let value = loss.clone().into_scalar();
    let gradients = GradientsParams::from_grads(loss.backward(), &unet);
    (optimizer.step(1e-3, unet, gradients), value)
}

#[test]
fn starts_as_the_identity_for_any_size() {
    let device = Device::flex();
    for (config, height, width) in [
        (UNetConfig::default(), 32, 40),
        (UNetConfig::default(), 33, 47),
        (UNetConfig { base_channels: 4, levels: 2, ..Default::default() }, 1, 5),
    ] {
        let unet = config.init(7, &device).unwrap();
        let input = picture([2, 3, height, width], 1, &device);
        assert_eq!(bits(unet.forward(input.clone())), bits(input));
    }
}

#[test]
fn odd_sizes_can_be_trained() {
    let device = Device::flex().autodiff();
    let unet = UNetConfig { base_channels: 8, levels: 2, ..Default::default() }.init(7, &device).unwrap();
    let (mut unet, mut optimizer) = (unet, adam());
    let input = picture([1, 3, 19, 22], 3, &device);
    let mut losses = Vec::new();
    for _ in 0..30 {
        let loss = (unet.forward(input.clone()) - input.clone() * 0.5).square().mean();
        losses.push(loss.clone().into_scalar::<f32>());
        let gradients = GradientsParams::from_grads(loss.backward(), &unet);
        unet = optimizer.step(3e-3, unet, gradients);
    }
    assert!(losses[29] < 0.5 * losses[0], "{} to {}", losses[0], losses[29]);
}

#[test]
fn input_gradient_agrees_with_central_differences() {
    let device = Device::flex().autodiff();
    let (mut unet, mut optimizer) =
        (UNetConfig { base_channels: 8, levels: 2, ..Default::default() }.init(3, &device).unwrap(), adam());
    for number in 0..5 {
        unet = step(unet, &mut optimizer, number, &device).0;
    }
    let shape = [1, 3, 13, 16];
    let probe = picture(shape, 8, &device) - 0.5;
    let input = picture(shape, 9, &device).require_grad();
    let values = input.clone().into_data().try_to_vec::<f32>().unwrap();
    let gradients = (unet.forward(input.clone()) * probe.clone()).sum().backward();
    let gradient = input.grad(&gradients).unwrap().into_data().try_to_vec::<f32>().unwrap();

    // Move every pixel, every second and every fifth along the sign of its gradient, far enough to exceed f32 rounding.
    for period in [1, 2, 5] {
        let direction: Vec<f32> = gradient
            .iter()
            .enumerate()
            .map(|(i, g)| if i % period == 0 { g.signum() } else { 0.0 })
            .collect();
        let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(g * d)).sum();
        let moved = |sign: f32| -> f64 {
            let moved: Vec<f32> = values.iter().zip(&direction).map(|(v, d)| v + sign * 2e-3 * d).collect();
            let moved = Tensor::<4>::from_data(TensorData::new(moved, shape), &device);
            f64::from((unet.forward(moved) * probe.clone()).sum().into_scalar::<f32>())
        };
        let difference = (moved(1.0) - moved(-1.0)) / 4e-3;
        assert!((along - difference).abs() < 0.01 * along.abs(), "{along} against {difference}");
    }
}

#[test]
fn equal_seeds_give_equal_bits_for_any_thread_count() {
    let train = || {
        let device = Device::flex().autodiff();
        let (mut unet, mut optimizer) = (UNetConfig::default().init(11, &device).unwrap(), adam());
        for number in 0..3 {
            unet = step(unet, &mut optimizer, number, &device).0;
        }
        unet.to_bytes().unwrap()
    };
    // Compare without assert_eq, whose message would print every byte.
    let first = train();
    let same = |bytes: Vec<u8>| {
        let other = bytes.iter().zip(&first).filter(|(a, b)| a != b).count();
        assert!(other == 0 && bytes.len() == first.len(), "{other} of {} bytes differ", bytes.len());
    };
    same(train());
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        same(pool.install(train));
    }
}

#[test]
fn other_seeds_give_other_weights() {
    let device = Device::flex();
    let bytes = |seed| UNetConfig::default().init(seed, &device).unwrap().to_bytes().unwrap();
    assert_ne!(bytes(1), bytes(2));
}

#[test]
fn a_resumed_run_continues_to_the_bit() {
    let device = Device::flex().autodiff();
    let (mut unet, mut optimizer) = (UNetConfig::default().init(5, &device).unwrap(), adam());
    for number in 0..3 {
        unet = step(unet, &mut optimizer, number, &device).0;
    }
    let (stored, stored_optimizer) = (unet.to_bytes().unwrap(), optimizer.into_bytes().unwrap().to_vec());

    let mut resumed = UNetConfig::default().init(99, &device).unwrap().load_bytes(stored).unwrap();
    let mut resumed_optimizer = adam().from_bytes(Bytes::from_bytes_vec(stored_optimizer)).unwrap();
    for number in 3..5 {
        let (loss, resumed_loss);
        (unet, loss) = step(unet, &mut optimizer, number, &device);
        (resumed, resumed_loss) = step(resumed, &mut resumed_optimizer, number, &device);
        assert_eq!(loss.to_bits(), resumed_loss.to_bits());
    }
    assert_eq!(unet.to_bytes().unwrap(), resumed.to_bytes().unwrap());
}

#[test]
fn a_frozen_network_passes_the_same_gradient() {
    let device = Device::flex().autodiff();
    let (unet, _) = step(UNetConfig::default().init(5, &device).unwrap(), &mut adam(), 0, &device);
    let gradient = |unet: &UNet| {
        let input = picture([1, 3, 32, 32], 4, &device).require_grad();
        let gradients = unet.forward(input.clone()).square().sum().backward();
        input.grad(&gradients).unwrap().into_data().try_to_vec::<f32>().unwrap()
    };
    assert_eq!(gradient(&unet), gradient(&unet.clone().no_grad()));
}

#[test]
fn weights_of_another_network_are_refused() {
    let device = Device::flex();
    let small = UNetConfig { base_channels: 8, ..Default::default() }.init(1, &device).unwrap();
    let stored = small.to_bytes().unwrap();
    let large = UNetConfig::default().init(1, &device).unwrap();
    assert!(matches!(large.clone().load_bytes(stored).err(), Some(NetworkError::BadWeights(_))));
    assert!(matches!(large.load_bytes(b"not weights".to_vec()).err(), Some(NetworkError::BadWeights(_))));
}

#[test]
fn weights_that_are_no_numbers_are_refused_by_name() {
    let device = Device::flex();
    let unet = UNetConfig::default().init(1, &device).unwrap();
    let mut stored = unet.to_bytes().unwrap();
    for bad in [f32::NAN, f32::INFINITY] {
        // The values end the file.
        let last = stored.len() - 4;
        stored[last..].copy_from_slice(&bad.to_le_bytes());
        let refused = unet.clone().load_bytes(stored.clone()).err();
        assert!(matches!(&refused, Some(NetworkError::NotFinite(name)) if !name.is_empty()), "{refused:?}");
    }
}

#[test]
fn impossible_sizes_are_refused_by_name() {
    let device = Device::flex();
    for (config, name) in [
        (UNetConfig { base_channels: 0, ..Default::default() }, "base_channels"),
        (UNetConfig { levels: 9, ..Default::default() }, "levels"),
        (UNetConfig { in_channels: 2, ..Default::default() }, "in_channels"),
        (UNetConfig { out_channels: 0, ..Default::default() }, "out_channels"),
    ] {
        let error = config.init(1, &device).err().unwrap().to_string();
        assert!(error.contains(name), "{error}");
    }
}

#[test]
fn parameters_are_trainable_and_counted() {
    let unet = UNetConfig::default().init(1, &Device::flex().autodiff()).unwrap();
    println!("parameters: {}", unet.num_params());
    assert!(unet.num_params() > 100_000);
}
