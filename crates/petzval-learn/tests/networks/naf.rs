//! Tests of the restoration network: shapes, start, gradient, tiles, repeatability, storage.

use burn::{
    optim::{AdamConfig, GradientsParams, ModuleOptimizer},
    prelude::*,
    tensor::DType,
};
use petzval_learn::network::{Naf, NafConfig, NetworkError};
use petzval_learn::weight_file::Weights;

use crate::support::{assert_slope, doubled, random, shaken, values};

const SMALL: NafConfig =
    NafConfig { in_channels: 4, out_channels: 3, base_channels: 8, levels: 2, blocks: 1 };

#[test]
fn starts_at_zero_for_any_size() {
    let device = Device::flex();
    for (config, height, width) in
        [(NafConfig::default(), 32, 40), (NafConfig::default(), 33, 47), (SMALL, 1, 5), (SMALL, 20, 21)]
    {
        let naf = config.init(7, &device).unwrap();
        let output = naf.forward(random([2, config.in_channels, height, width], 1, &device));
        assert_eq!(output.dims(), [2, 3, height, width]);
        assert!(values(output).iter().all(|v| *v == 0.0));
    }
}

#[test]
fn input_gradient_agrees_with_central_differences() {
    let device = Device::flex().autodiff();
    let naf = shaken(SMALL.init(3, &device).unwrap(), 0.2);
    let (shape, probe) = ([1, 4, 13, 16], random([1, 3, 13, 16], 8, &device));
    let input = random(shape, 9, &device).require_grad();
    let gradients = (naf.forward(input.clone()) * probe.clone()).sum().backward();
    let gradient = input.grad(&gradients).unwrap();
    let (exact, probe) = (doubled(naf), probe.cast(DType::F64));
    assert_slope(input, gradient, |moved| (exact.forward(moved) * probe.clone()).sum());
}

#[test]
fn nothing_beyond_the_reach_matters() {
    let device = Device::flex();
    let naf = shaken(SMALL.init(5, &device).unwrap(), 0.2);
    let length = 128;
    let frame = random([1, 4, 8, length], 2, &device);
    let before = values(naf.forward(frame.clone()));
    let mut farthest = 0;
    for moved in 60..64 {
        let place = [0..1, 0..4, 0..8, moved..moved + 1];
        let after =
            values(naf.forward(frame.clone().slice_assign(place.clone(), frame.clone().slice(place) + 3.0)));
        for (i, (a, b)) in after.iter().zip(&before).enumerate() {
            if a != b {
                farthest = farthest.max((i % length).abs_diff(moved));
            }
        }
    }
    let reach = naf.reach().pixels;
    assert!(farthest <= reach && farthest + 4 > reach, "{farthest}, stated {reach}");
}

#[test]
fn training_repeats_to_the_bit_for_any_thread_count() {
    let train = || {
        let device = Device::flex().autodiff();
        let mut naf = NafConfig::default().init(11, &device).unwrap();
        let mut optimizer: ModuleOptimizer = AdamConfig::new().init();
        let mut losses = Vec::new();
        for _ in 0..12 {
            let input = random([2, 8, 40, 40], 1, &device);
            let target = input.clone().slice([0..2, 0..3, 0..40, 0..40]) * 0.5;
            let loss = (naf.forward(input) - target).abs().mean();
            losses.push(loss.clone().into_scalar::<f32>());
            let gradients = GradientsParams::from_grads(loss.backward(), &naf);
            naf = optimizer.step(3e-3, naf, gradients);
        }
        (naf.to_bytes().unwrap(), losses)
    };
    let (first, losses) = train();
    assert!(losses[11] < 0.8 * losses[0], "{losses:?}");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(train).0 == first, "{threads} threads give other weights");
    }
}

#[test]
fn weights_are_stored_exactly_and_fit_only_their_size() {
    let device = Device::flex();
    let stored = shaken(SMALL.init(1, &device).unwrap(), 0.1).to_bytes().unwrap();
    let loaded: Naf = SMALL.init(2, &device).unwrap().load_bytes(stored.clone()).unwrap();
    assert!(loaded.to_bytes().unwrap() == stored);
    let large = NafConfig::default().init(1, &device).unwrap();
    assert!(matches!(large.load_bytes(stored).err(), Some(NetworkError::BadWeights(_))));
}

#[test]
fn impossible_sizes_are_refused_by_name() {
    for (config, name) in [
        (NafConfig { base_channels: 0, ..SMALL }, "base_channels"),
        (NafConfig { levels: 9, ..SMALL }, "levels"),
        (NafConfig { in_channels: 0, ..SMALL }, "in_channels"),
        (NafConfig { out_channels: 0, ..SMALL }, "out_channels"),
        (NafConfig { blocks: 0, ..SMALL }, "blocks"),
    ] {
        let error = config.init(1, &Device::flex()).err().unwrap().to_string();
        assert!(error.contains(name), "{error}");
    }
}
