//! The network that gives pixels classes.

use burn::optim::{AdamConfig, GradientsParams};
use burn::prelude::*;
use petzval_learn::loss::cross_entropy;
use petzval_learn::network::Segmenter;
use petzval_learn::weight_file::Weights;

use crate::support::random;

#[test]
fn it_begins_undecided_and_learns_the_classes_of_bright_and_dark_pixels() {
    let device = Device::flex().autodiff();
    let mut network = Segmenter::init(3, 8, 2, 1, &device).unwrap();
    assert_eq!(network.classes(), 3);
    let pictures = (random([2, 3, 24, 20], 1, &device) + 1.0) * 0.5;
    let mean: Vec<f32> = pictures.clone().mean_dim(1).into_data().try_to_vec().unwrap();
    // The third class is nowhere.
    let labels: Vec<u8> = mean.iter().map(|v| u8::from(*v > 0.5)).collect();
    let value = |loss: &Tensor<1>| loss.clone().into_data().try_to_vec::<f32>().unwrap()[0];
    let first = cross_entropy(network.forward(pictures.clone()), &labels, &[1.0; 3]).unwrap();
    assert!((value(&first) - 3.0_f32.ln()).abs() < 1e-5);
    let mut optimizer = AdamConfig::new().init();
    for _ in 0..200 {
        let loss = cross_entropy(network.forward(pictures.clone()), &labels, &[1.0; 3]).unwrap();
        let gradients = GradientsParams::from_grads(loss.backward(), &network);
        network = optimizer.step(1e-2, network, gradients);
    }
    let last = value(&cross_entropy(network.forward(pictures.clone()), &labels, &[1.0; 3]).unwrap());
    assert!(last < 0.3, "{last}");
    // Its file is read back; one of another number of classes is refused.
    let file = network.to_safetensors().unwrap();
    let read = Segmenter::init(3, 8, 2, 9, &device).unwrap().with_weights(&file).unwrap();
    assert_eq!(read.to_safetensors().unwrap(), file);
    assert!(Segmenter::init(4, 8, 2, 9, &device).unwrap().with_weights(&file).is_err());
    assert!(Segmenter::init(65, 8, 2, 9, &device).is_err());
}
