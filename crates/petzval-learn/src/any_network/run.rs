//! What a network makes of arrays.

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::image::CHANNELS;

use super::{AnyNetwork, NamedNetwork};
use crate::detection::{AnyDetector, Detection, Detector};
use crate::loss::LossError;
use crate::network::{Network, NetworkError, NetworkInput, PictureNetwork};
use crate::weight_file::NamedArray;

/// Colours of the mosaic that a network in place of an ISP takes.
const MOSAIC: usize = 4;

impl NamedNetwork {
    /// What the network makes of its inputs, on the processor.
    ///
    /// | kind | inputs | outputs |
    /// |---|---|---|
    /// | `u-net` | `pictures` `[batch, channels, y, x]` | `finished` `[batch, 3, y, x]` |
    /// | `restoration`, `restoration-naf` | `restored`, `developed` `[batch, 3, y, x]`, `field`, `noise` `[batch, 1, y, x]` | `finished`, `curves` `[3, knots]` |
    /// | `segmenter` | `pictures` `[batch, 3, y, x]` | `logits` `[batch, classes, y, x]` |
    /// | `isp-proxy` | `raw` `[batch, 4, y / 2, x / 2]`, `theta` `[batch, parameters]` | `picture` `[batch, 3, y, x]` |
    /// | `optics-proxy` | `inputs` `[batch, inputs]` | `values` `[batch, 3, 128, 128]`, `illumination` `[batch, 3]` |
    /// | `faster-rcnn`, `fcos` | `pictures` `[batch, 3, y, x]` | `boxes` `[found, 4]`, `scores`, `classes`, `pictures` `[found]`, and its [heads](AnyDetector::heads) |
    ///
    /// Fails on an input that is missing, is none of its kind, has another shape or is not finite, and names it.
    pub fn run(&self, inputs: Vec<NamedArray>) -> Result<Vec<NamedArray>, NetworkError> {
        let mut inputs = Inputs { arrays: inputs, batch: None };
        match &self.network {
            AnyNetwork::Pictures(Network::UNet(network)) => {
                let channels = self.spec.in_channels();
                let pictures = inputs.take("pictures", [None, channels, None, None])?;
                inputs.end()?;
                Ok(vec![read("finished", network.forward(pictures))?])
            }
            AnyNetwork::Pictures(network) => {
                let developed = inputs.take("developed", [None, Some(CHANNELS), None, None])?;
                let [_, _, height, width] = developed.dims();
                let mut same = |name: &str, channels| {
                    inputs.take(name, [None, Some(channels), Some(height), Some(width)])
                };
                let restored = Some(same("restored", CHANNELS)?);
                let (field, noise) = (same("field", 1)?, same("noise", 1)?);
                inputs.end()?;
                let finished = network.finish_in_tiles(&NetworkInput { developed, restored, field, noise });
                let curves = network.curves().map(|curves| read("curves", curves)).transpose()?;
                Ok([read("finished", finished)?].into_iter().chain(curves).collect())
            }
            AnyNetwork::Segmenter(network) => {
                let pictures = inputs.take("pictures", [None, Some(CHANNELS), None, None])?;
                inputs.end()?;
                Ok(vec![read("logits", network.forward_in_tiles(pictures))?])
            }
            AnyNetwork::IspProxy(network) => {
                let raw = inputs.take("raw", [None, Some(MOSAIC), None, None])?;
                let theta = inputs.take("theta", [None, Some(network.parameters())])?;
                inputs.end()?;
                Ok(vec![read("picture", network.forward(raw, theta))?])
            }
            AnyNetwork::OpticsProxy(network) => {
                let numbers = inputs.take("inputs", [None, Some(network.inputs())])?;
                inputs.end()?;
                let psfs = network.forward(numbers);
                Ok(vec![read("values", psfs.values)?, read("illumination", psfs.illumination)?])
            }
            AnyNetwork::Detector(detector) => {
                let pictures = inputs.take("pictures", [None, Some(CHANNELS), None, None])?;
                inputs.end()?;
                seen(detector, pictures).map_err(|error| NetworkError::BadWeights(error.to_string()))
            }
        }
    }
}

/// What a detector finds in pictures, and what its last layers say.
fn seen(detector: &AnyDetector, pictures: Tensor<4>) -> Result<Vec<NamedArray>, LossError> {
    let heads = detector.heads(pictures.clone())?;
    let by_picture = (0..).zip(detector.detect(pictures)?);
    let found: Vec<(usize, Detection)> =
        by_picture.flat_map(|(i, all)| all.into_iter().map(move |d| (i, d))).collect();
    let count = found.len();
    let column = |name: &str, of: &dyn Fn(&(usize, Detection)) -> f32| {
        NamedArray::new(name, [count], found.iter().map(of).collect())
    };
    let sides = found.iter().flat_map(|(_, d)| [d.bbox.x1, d.bbox.y1, d.bbox.x2, d.bbox.y2]).collect();
    let mut all = vec![
        NamedArray::new("boxes", [count, 4], sides),
        column("scores", &|(_, d)| d.score),
        column("classes", &|(_, d)| d.class as f32),
        column("pictures", &|(i, _)| *i as f32),
    ];
    all.extend(heads);
    Ok(all)
}

/// The values of a tensor.
fn read<const D: usize>(name: &str, tensor: Tensor<D>) -> Result<NamedArray, NetworkError> {
    let shape = tensor.dims();
    let values = tensor.into_data().try_to_vec();
    let values = values.map_err(|e| NetworkError::NotStored(format!("{name}: {e:?}")))?;
    Ok(NamedArray::new(name, shape, values))
}

/// Arrays that are taken one by one.
struct Inputs {
    arrays: Vec<NamedArray>,
    /// Length of the first axis of all of them, once one was taken.
    batch: Option<usize>,
}

impl Inputs {
    /// The input of a name as a tensor. `expected`: lengths of its axes, as far as they are known; the first is that of the inputs before.
    fn take<const D: usize>(
        &mut self,
        name: &str,
        mut expected: [Option<usize>; D],
    ) -> Result<Tensor<D>, NetworkError> {
        let bad = |problem: String| NetworkError::BadInput { name: name.to_owned(), problem };
        expected[0] = self.batch;
        let in_words = expected.map(|length| length.map_or("any".to_owned(), |length| length.to_string()));
        let in_words = in_words.join(", ");
        let place = self.arrays.iter().position(|array| array.name == name);
        let place = place.ok_or_else(|| bad(format!("is missing; give an array of shape [{in_words}]")))?;
        let NamedArray { shape, values, .. } = self.arrays.swap_remove(place);
        let fits = |(length, expected): (&usize, &Option<usize>)| {
            expected.is_none_or(|e| e == *length) && *length > 0
        };
        if shape.len() != D || !shape.iter().zip(&expected).all(fits) {
            return Err(bad(format!("has shape {shape:?}; give [{in_words}]")));
        }
        if let Some(value) = values.iter().find(|v| !v.is_finite()) {
            return Err(bad(format!("has a value of {value}; give finite numbers")));
        }
        self.batch = shape.first().copied();
        Ok(Tensor::from_data(TensorData::new(values, shape), &Device::flex()))
    }

    /// Refuses what is left.
    fn end(&self) -> Result<(), NetworkError> {
        match self.arrays.first() {
            None => Ok(()),
            Some(array) => Err(NetworkError::BadInput {
                name: array.name.clone(),
                problem: "is none of this network; leave it out".to_owned(),
            }),
        }
    }
}
