//! A network of any kind from its weights alone, with a name for each of them, and what it makes of arrays.
//!
//! A file of weights says by names and shapes which network they belong to. Weights of detectors have two names: the path of fields, as in the
//! files of this program, and the name in torchvision. Both come from the one place that builds the detector. Other networks have paths alone.

mod run;
mod spec;

use std::collections::BTreeMap;

use burn::module::{Module, ParamId};
use burn::prelude::*;

use crate::detection::{AnyDetector, BackboneKind};
use crate::network::{IspProxy, Network, NetworkError, NetworkKind, OpticsProxy, Segmenter};
use crate::weight_file::{NamedArray, Weight, Weights, kind_in, read_arrays, weights_of, write_arrays};

pub use spec::{DetectorSpec, NetworkSpec, RestorationSpec, SegmenterSpec};

use spec::{Shapes, check_classes, missing};

/// A network of any kind.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one, which is hardly ever moved")]
enum AnyNetwork {
    Pictures(Network),
    Segmenter(Segmenter),
    IspProxy(IspProxy),
    OpticsProxy(OpticsProxy),
    Detector(AnyDetector),
}

/// A network with its kind, its sizes and the names of its weights.
#[derive(Clone, Debug)]
pub struct NamedNetwork {
    spec: NetworkSpec,
    network: AnyNetwork,
    names: Vec<Names>,
}

/// The names of a weight.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Names {
    /// In the files of this program: the path of fields.
    path: String,
    /// For users: that of torchvision in a detector, the path otherwise.
    public: String,
    shape: Vec<usize>,
}

/// By which names a file has the weights of a detector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FileNames {
    /// The paths of fields, as all files of runs have them.
    #[default]
    Petzval,
    /// Those of torchvision. Only a detector of two stages on one of torchvision's backbones has them.
    Torchvision,
}

impl NamedNetwork {
    /// A network with weights drawn from `seed` alone.
    pub fn drawn(spec: NetworkSpec, seed: u64) -> Result<Self, NetworkError> {
        let device = Device::flex();
        let blank = Self::blank(spec, seed, &device)?;
        Ok(match spec.of_detector() {
            Some((kind, of)) => {
                let detector = kind.init(of.backbone, of.classes, seed, &device)?;
                Self { network: AnyNetwork::Detector(detector), ..blank }
            }
            None => blank,
        })
    }

    /// The network of a safetensors file, under the paths of this program or under the names of [`tensors`](Self::tensors). `kind` says what it
    /// is where neither its weights nor the metadata of the file do. Fails on a weight that is missing, too many, of another shape or not
    /// finite, and names it.
    pub fn read(file: &[u8], kind: Option<&str>) -> Result<Self, NetworkError> {
        let said = kind_in(file);
        Self::of(read_arrays(file)?, kind.or(said.as_deref()))
    }

    /// The network of weights, as [`read`](Self::read) has them from a file.
    pub fn of(weights: Vec<NamedArray>, kind: Option<&str>) -> Result<Self, NetworkError> {
        let bad = NetworkError::BadWeights;
        let shapes = Shapes(weights.iter().map(|w| (w.name.clone(), w.shape.clone())).collect());
        let spec = NetworkSpec::of_shapes(&shapes, kind)?;
        let blank = Self::blank(spec, 0, &Device::flex())?;
        let mut given: BTreeMap<String, NamedArray> =
            weights.into_iter().map(|weight| (weight.name.clone(), weight)).collect();

        // A file has all weights by path or all by public name; where the first is missing, errors name it as the file would.
        let is_public =
            blank.names.iter().any(|names| names.public != names.path && given.contains_key(&names.public));
        let mut by_path = Vec::with_capacity(blank.names.len());
        for Names { path, public, shape } in &blank.names {
            let name = if is_public { public } else { path };
            let weight = given.remove(name).ok_or_else(|| missing(name))?;
            if weight.shape != *shape {
                let found = weight.shape;
                return Err(bad(format!("{name} has shape {found:?}, and this network needs {shape:?}")));
            }
            if !weight.values.iter().all(|v| v.is_finite()) {
                return Err(NetworkError::NotFinite(name.clone()));
            }
            by_path.push(NamedArray { name: path.clone(), ..weight });
        }
        if let Some(name) = given.into_keys().next() {
            return Err(bad(format!("{name} is no weight of a network of the kind {}", spec.kind())));
        }
        let network = blank.network.with_weights(&write_arrays(&by_path, None)?)?;
        Ok(Self { network, ..blank })
    }

    /// A network of these sizes with the names of its weights, which are drawn or zero.
    fn blank(spec: NetworkSpec, seed: u64, device: &Device) -> Result<Self, NetworkError> {
        let pictures = |kind: NetworkKind, of: RestorationSpec| {
            kind.init(of.base_channels, of.levels, seed, device).map(AnyNetwork::Pictures)
        };
        let (network, listed) = match spec {
            NetworkSpec::UNet(of) => {
                (AnyNetwork::Pictures(Network::UNet(of.init(seed, device)?)), Vec::new())
            }
            NetworkSpec::Restoration(of) => (pictures(NetworkKind::Restoration, of)?, Vec::new()),
            NetworkSpec::RestorationNaf(of) => (pictures(NetworkKind::RestorationNaf, of)?, Vec::new()),
            NetworkSpec::Segmenter(of) => {
                let network = Segmenter::init(of.classes, of.base_channels, of.levels, seed, device)?;
                (AnyNetwork::Segmenter(network), Vec::new())
            }
            NetworkSpec::IspProxy(of) => (AnyNetwork::IspProxy(of.init(seed, device)?), Vec::new()),
            NetworkSpec::OpticsProxy(of) => (AnyNetwork::OpticsProxy(of.init(seed, device)?), Vec::new()),
            NetworkSpec::FasterRcnn(of) | NetworkSpec::Fcos(of) => {
                check_classes(of.classes)?;
                let kind = spec.of_detector().map(|(kind, _)| kind).unwrap_or_default();
                let (detector, names) = kind.listed(of.backbone, of.classes, device)?;
                (AnyNetwork::Detector(detector), names)
            }
        };
        let public: BTreeMap<ParamId, String> = listed.into_iter().collect();
        let names = weights_of(&network)?.into_iter().map(|weight| {
            let NamedArray { name: path, shape, .. } = weight.array;
            let public = public.get(&weight.id).unwrap_or(&path).clone();
            Names { path, public, shape }
        });
        let names = names.collect();
        Ok(Self { spec, network, names })
    }

    /// Its kind and sizes.
    pub fn spec(&self) -> NetworkSpec {
        self.spec
    }

    /// All weights, in the order of the layers: those of detectors under torchvision's names where torchvision has such weights.
    pub fn tensors(&self) -> Result<Vec<NamedArray>, NetworkError> {
        let named =
            |(weight, names): (Weight, &Names)| NamedArray { name: names.public.clone(), ..weight.array };
        Ok(weights_of(&self.network)?.into_iter().zip(&self.names).map(named).collect())
    }

    /// All weights as a safetensors file.
    pub fn to_file(&self, names: FileNames) -> Result<Vec<u8>, NetworkError> {
        match (names, self.spec) {
            (FileNames::Petzval, _) => self.network.to_safetensors(),
            (FileNames::Torchvision, NetworkSpec::FasterRcnn(of)) if of.backbone != BackboneKind::Small => {
                write_arrays(&self.tensors()?, None)
            }
            (FileNames::Torchvision, _) => Err(NetworkError::NotStored(
                "torchvision has no such network; it has faster-rcnn on resnet18, resnet50 and mobilenet-v2"
                    .to_owned(),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{IspProxyConfig, OpticsProxyConfig, UNetConfig};

    fn specs() -> Vec<NetworkSpec> {
        let detector = |backbone, classes| DetectorSpec { backbone, classes };
        let sizes = RestorationSpec { base_channels: 8, levels: 2 };
        vec![
            NetworkSpec::UNet(UNetConfig { base_channels: 8, levels: 1, in_channels: 4, out_channels: 3 }),
            NetworkSpec::Restoration(sizes),
            NetworkSpec::RestorationNaf(sizes),
            NetworkSpec::Segmenter(SegmenterSpec { classes: 5, base_channels: 8, levels: 2 }),
            NetworkSpec::IspProxy(IspProxyConfig {
                parameters: 3,
                base_channels: 8,
                levels: 1,
                ..Default::default()
            }),
            NetworkSpec::OpticsProxy(OpticsProxyConfig { inputs: 3, hidden: 8, channels: 8 }),
            NetworkSpec::FasterRcnn(detector(BackboneKind::Small, 2)),
            NetworkSpec::FasterRcnn(detector(BackboneKind::Resnet18, 1)),
            NetworkSpec::Fcos(detector(BackboneKind::Small, 3)),
            NetworkSpec::Fcos(detector(BackboneKind::MobilenetV2, 1)),
        ]
    }

    #[test]
    fn kind_and_sizes_follow_from_the_weights_under_either_name() {
        for spec in specs() {
            let network = NamedNetwork::drawn(spec, 3).unwrap();
            let file = network.to_file(FileNames::Petzval).unwrap();
            let read = NamedNetwork::read(&file, None).unwrap();
            assert_eq!(read.spec(), spec);
            assert_eq!(read.to_file(FileNames::Petzval).unwrap(), file);
            let tensors = network.tensors().unwrap();
            assert!(tensors.iter().all(|t| t.shape.iter().product::<usize>() == t.values.len()));
            let named = NamedNetwork::of(tensors.clone(), None).unwrap();
            assert_eq!((named.spec(), named.tensors().unwrap()), (spec, tensors));
            assert_eq!(named.to_file(FileNames::Petzval).unwrap(), file);
            let has_names_of_torchvision =
                matches!(spec, NetworkSpec::FasterRcnn(of) if of.backbone != BackboneKind::Small);
            match network.to_file(FileNames::Torchvision) {
                Ok(file) => {
                    assert!(has_names_of_torchvision);
                    assert_eq!(
                        NamedNetwork::read(&file, None).unwrap().tensors().unwrap(),
                        named.tensors().unwrap()
                    );
                    let NetworkSpec::FasterRcnn(DetectorSpec { backbone, classes }) = spec else {
                        panic!("{spec:?}")
                    };
                    AnyDetector::from_torchvision(backbone, classes, &file, &Device::flex()).unwrap();
                }
                Err(_) => assert!(!has_names_of_torchvision),
            }
        }
    }

    #[test]
    fn a_file_says_what_its_weights_do_not() {
        let spec = NetworkSpec::Segmenter(SegmenterSpec { classes: 3, base_channels: 8, levels: 1 });
        let segmenter = NamedNetwork::drawn(spec, 3).unwrap();
        let file = segmenter.to_file(FileNames::Petzval).unwrap();
        let read = NamedNetwork::read(&file, None).unwrap();
        assert_eq!((read.spec(), read.to_file(FileNames::Petzval).unwrap()), (spec, file.clone()));

        // The same weights without it are those of a U-Net, unless it is said.
        let bare = write_arrays(&segmenter.tensors().unwrap(), None).unwrap();
        assert_eq!(NamedNetwork::read(&bare, Some("segmenter")).unwrap().spec(), spec);
        let u_net = NamedNetwork::read(&bare, None).unwrap();
        assert_eq!(u_net.spec().kind(), "u-net");
        assert!(kind_in(&u_net.to_file(FileNames::Petzval).unwrap()).is_none());
        let refused = u_net.network.with_weights(&file).unwrap_err().to_string();
        assert!(refused.contains("of the kind `segmenter`"), "{refused}");
    }

    #[test]
    fn a_small_file_builds_no_large_network() {
        let channels =
            |name: &str, shape: &[usize]| NamedArray::new(name, shape, vec![0.0; shape.iter().product()]);
        let mut weights: Vec<NamedArray> = (0..6)
            .map(|level| channels(&format!("trunk.encoder.{level}.first.weight"), &[256, 1, 1, 1]))
            .collect();
        weights.push(channels("trunk.bottom.first.weight", &[1, 1, 1, 1]));
        weights.push(channels("last_weight", &[4, 1]));
        let refused = NamedNetwork::of(weights, None).unwrap_err().to_string();
        assert!(refused.contains("trunk.bottom.first.weight has 1 x 1 channels"), "{refused}");
    }
}
