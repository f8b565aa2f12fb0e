//! Weights as safetensors: every weight is there once, to the bit, under the path of its fields.

use burn::module::{Module, ModuleVisitor, Param};
use burn::prelude::*;
use petzval_learn::network::NetworkKind;
use petzval_learn::network::{IspProxyConfig, OpticsProxyConfig};
use petzval_learn::weight_file::Weights;
use safetensors::{Dtype, SafeTensors};

/// Collects shapes and bits of all weights.
#[derive(Default)]
struct All(Vec<(Vec<usize>, Vec<u8>)>);

impl ModuleVisitor for All {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let values = param.val().detach().into_data().try_to_vec::<f32>().unwrap();
        self.0.push((param.val().dims().to_vec(), values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }
}

/// The names in a file, in alphabetical order, once its tensors are known to be those of the network.
fn names<M: Module>(network: &M, file: &[u8]) -> Vec<String> {
    let read = SafeTensors::deserialize(file).unwrap();
    let mut own = All::default();
    network.visit(&mut own);
    let of_file = |(_, view): (&str, safetensors::tensor::TensorView)| {
        assert_eq!(view.dtype(), Dtype::F32);
        (view.shape().to_vec(), view.data().to_vec())
    };
    let mut found: Vec<_> = read.iter().map(of_file).collect();
    found.sort();
    own.0.sort();
    assert!(found == own.0, "other weights than the network has");
    assert_eq!(
        found.iter().map(|(shape, _)| shape.iter().product::<usize>()).sum::<usize>(),
        network.num_params()
    );
    let mut names: Vec<String> = read.names().into_iter().map(str::to_owned).collect();
    names.sort();
    names
}

#[test]
fn every_weight_is_in_the_file_under_its_path() {
    let device = Device::flex();
    for (kind, last) in [
        (NetworkKind::UNet, "last_weight"),
        (NetworkKind::Restoration, "correction.last_weight"),
        (NetworkKind::RestorationNaf, "correction.last.weight"),
    ] {
        let network = kind.init(8, 2, 3, &device).unwrap();
        let names = names(&network, &network.to_safetensors().unwrap());
        assert!(names.iter().any(|name| name == last), "{names:?}");
        assert_eq!(names.iter().any(|name| name == "curves"), kind.needs_restoration());
    }
    let proxy = IspProxyConfig { base_channels: 8, levels: 2, ..IspProxyConfig::default() };
    let proxy = proxy.init(3, &device).unwrap();
    assert!(!names(&proxy, &proxy.to_safetensors().unwrap()).is_empty());
    let proxy = OpticsProxyConfig { channels: 8, ..OpticsProxyConfig::default() }.init(3, &device).unwrap();
    let names = names(&proxy, &proxy.to_safetensors().unwrap());
    assert!(names.iter().any(|name| name == "coarse.0.weight"), "{names:?}");
}
