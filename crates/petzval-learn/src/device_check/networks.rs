//! The convolutions of networks that no built-in experiment trains, collected from the networks themselves.

use std::collections::BTreeSet;

use burn::prelude::*;

use crate::convolution::{Convolution, collect};
use crate::detection::{BackboneKind, Detector, DetectorKind};
use crate::loss::LossError;
use crate::network::{IspProxyConfig, NetworkError, OpticsProxyConfig};

/// A network that cannot be made, or cannot look at a picture.
#[derive(Debug, thiserror::Error)]
pub enum CollectError {
    /// It cannot be made.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// It cannot look at a picture.
    #[error(transparent)]
    Picture(#[from] LossError),
}

/// Every detector on every backbone, torchvision's and our own.
pub const DETECTORS: [(DetectorKind, BackboneKind); 8] = [
    (DetectorKind::FasterRcnn, BackboneKind::Small),
    (DetectorKind::Fcos, BackboneKind::Small),
    (DetectorKind::FasterRcnn, BackboneKind::Resnet18),
    (DetectorKind::Fcos, BackboneKind::Resnet18),
    (DetectorKind::FasterRcnn, BackboneKind::MobilenetV2),
    (DetectorKind::Fcos, BackboneKind::MobilenetV2),
    (DetectorKind::FasterRcnn, BackboneKind::Resnet50),
    (DetectorKind::Fcos, BackboneKind::Resnet50),
];

/// A detector of one of the [`DETECTORS`], on batches of square windows with so many pixels a side.
pub fn of_detector(
    (kind, backbone): (DetectorKind, BackboneKind),
    batch: usize,
    side: usize,
) -> Result<BTreeSet<Convolution>, CollectError> {
    let device = Device::flex();
    let detector = kind.init(backbone, 2, 1, &device)?;
    // One picture meets the same layers as a batch, in less time.
    let (found, seen) = collect(|| detector.detect(Tensor::zeros([1, 3, side, side], &device)));
    found?;
    Ok(seen.into_iter().map(|convolution| convolution.with_batch(batch)).collect())
}

/// The networks in place of an ISP and of ray tracing, on batches with so many items.
pub fn of_proxies(batch: usize) -> Result<BTreeSet<Convolution>, CollectError> {
    /// Side of a colour of the raw frames from which an imitation of an ISP learns.
    const SIDE: usize = 48;

    let device = Device::flex();
    let isp = IspProxyConfig::default();
    let network = isp.init(1, &device)?;
    let raw = Tensor::zeros([batch, 4, SIDE, SIDE], &device);
    let theta = Tensor::zeros([batch, isp.parameters], &device);
    let (_, mut all) = collect(|| network.forward(raw, theta));
    let optics = OpticsProxyConfig::default();
    let network = optics.init(1, &device)?;
    all.extend(collect(|| network.forward(Tensor::zeros([batch, optics.inputs], &device))).1);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convolution::ConvolutionKind;

    #[test]
    fn a_detector_has_its_convolutions_at_the_size_of_the_batch() {
        // Tests beside this one add convolutions of other batches.
        let all = of_detector(DETECTORS[0], 5, 64).unwrap();
        let all: Vec<_> = all.into_iter().filter(|c| c.input[0] == 5).collect();
        assert!(all.len() > 5, "{all:?}");
        assert!(all.iter().any(|c| c.input[1..] == [3, 64, 64]), "{all:?}");
    }

    #[test]
    fn proxies_have_their_convolutions_at_the_size_of_the_batch() {
        let all: Vec<_> = of_proxies(3).unwrap().into_iter().filter(|c| c.input[0] == 3).collect();
        let full = |c: &&Convolution| c.kind == ConvolutionKind::Full;
        // The last layer of the optics network makes 128 x 128 PSFs of three colours.
        assert!(all.iter().filter(full).any(|c| c.input == [3, 64, 128, 128] && c.outputs == 3));
        assert!(all.iter().any(|c| c.kind == ConvolutionKind::Pointwise));
    }
}
