//! The network of a camera that names the class of every pixel.

use burn::optim::ModuleOptimizer;
use burn::prelude::*;
use petzval_learn::dataset::ClassMap;
use petzval_learn::network::{Segmenter, resized};
use petzval_learn::optimizer::muon_and_adam;

use crate::block::{CameraNetwork, NetworkBlock, Sight};
use crate::camera::{Camera, to_host};
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, NetworkConfig};

/// What reads the class of every pixel in the finished pictures of a camera.
pub struct PixelReader {
    network: Segmenter,
    /// By how much pictures are enlarged for the network.
    zoom: f64,
}

impl PixelReader {
    /// Logits `[batch, classes, height, width]` of pictures `[batch, 3, height, width]`, sRGB-encoded. Those of enlarged pictures are brought back
    /// to the pixels of the pictures.
    pub fn logits(&self, pictures: Tensor<4>) -> Tensor<4> {
        self.seen_by(pictures, Segmenter::forward)
    }

    /// The most probable class of each pixel of a picture `[1, 3, height, width]`, the first of equally probable ones. Fails where a logit is no
    /// number.
    pub fn read(&self, picture: Tensor<4>) -> Result<ClassMap> {
        let [_, _, height, width] = picture.dims();
        let logits = to_host(self.seen_by(picture, Segmenter::forward_in_tiles))?;
        if logits.iter().any(|v| !v.is_finite()) {
            return Err(DesignError::NotFinite("the network's classes of pixels".to_owned()));
        }
        let pixels = height * width;
        let mut best = vec![(f32::NEG_INFINITY, 0_u8); pixels];
        for (class, plane) in logits.chunks_exact(pixels).enumerate() {
            for (best, logit) in best.iter_mut().zip(plane).filter(|(best, logit)| **logit > best.0) {
                *best = (*logit, class as u8);
            }
        }
        Ok(ClassMap::new(height, width, best.into_iter().map(|(_, class)| class).collect()))
    }

    /// What the network makes of the pictures as it sees them, brought back to their size.
    fn seen_by(
        &self,
        pictures: Tensor<4>,
        forward: impl Fn(&Segmenter, Tensor<4>) -> Tensor<4>,
    ) -> Tensor<4> {
        if self.zoom == 1.0 {
            return forward(&self.network, pictures);
        }
        let [_, _, height, width] = pictures.dims();
        let enlarged = [height, width].map(|side| (self.zoom * side as f64).round().max(1.0) as usize);
        resized(forward(&self.network, resized(pictures, enlarged)), [height, width])
    }
}

/// A network for the classes of pixels that learns in a camera.
pub struct Segmenting;

impl CameraNetwork for Segmenting {
    type Module = Segmenter;

    fn attached(&self, network: Segmenter, camera: &Camera, sight: Sight) -> Camera {
        camera.with_reader(PixelReader { network, zoom: sight.zoom }, sight.sees)
    }

    fn optimizer(&self, network: &Segmenter) -> ModuleOptimizer {
        muon_and_adam(network)
    }
}

/// The network of an experiment at the start, with weights drawn from its seed.
pub(super) fn block(experiment: &Experiment, device: &Device) -> Result<NetworkBlock> {
    let NetworkConfig { base_channels, levels, .. } = experiment.network;
    let classes = experiment.classes().counted().len();
    let network = Segmenter::init(classes, base_channels, levels, experiment.seed, device)?;
    Ok(NetworkBlock::new(network, Segmenting))
}

#[cfg(test)]
mod tests {
    use petzval_camera::image::LinearImage;
    use petzval_camera::tape::on_device;

    use super::*;

    #[test]
    fn a_reader_that_sees_enlarged_pictures_names_the_pixels_of_the_picture() {
        let device = Device::flex();
        let picture = LinearImage {
            channels: 3,
            height: 20,
            width: 30,
            data: (0..3 * 20 * 30).map(|i| (i % 30) as f32 / 30.0).collect(),
        };
        let picture = on_device(&picture, &device);
        for zoom in [1.0, 1.5] {
            let reader = PixelReader { network: Segmenter::init(4, 8, 2, 1, &device).unwrap(), zoom };
            assert_eq!(reader.logits(picture.clone()).dims(), [1, 4, 20, 30]);
            // An untrained network finds all classes equally probable: the first one is named.
            assert_eq!(reader.read(picture.clone()).unwrap(), ClassMap::new(20, 30, vec![0; 600]));
        }
    }
}
