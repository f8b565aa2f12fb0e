//! Weights of any network as bytes of Burn and as safetensors files.

mod error;

use std::collections::HashMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param, ParamId};
use burn::prelude::*;
use burn::store::{ModuleRecord, RecordError};
use burn::tensor::Bytes;
use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError, SafeTensors};

pub use error::NetworkError;

/// Weights of a network, to be kept and to be taken over.
pub trait Weights: Module {
    /// All weights as bytes in Burn's format, exact to the bit.
    fn to_bytes(&self) -> Result<Vec<u8>, NetworkError> {
        let bytes = self.clone().into_record().into_bytes();
        Ok(bytes.map_err(|error| NetworkError::NotStored(error.to_string()))?.to_vec())
    }

    /// Loads weights that [`to_bytes`](Self::to_bytes) wrote. Fails if they belong to another configuration, and if one is no finite number.
    fn load_bytes(self, bytes: Vec<u8>) -> Result<Self, NetworkError> {
        let refuse = |error: RecordError| NetworkError::BadWeights(error.to_string());
        let record = ModuleRecord::from_bytes(Bytes::from_bytes_vec(bytes)).map_err(refuse)?;
        let network = self.try_load_record(record).map_err(refuse)?;
        match not_finite(&network) {
            Some(name) => Err(NetworkError::NotFinite(name)),
            None => Ok(network),
        }
    }

    /// Loads weights that [`to_bytes`](Self::to_bytes) or [`to_safetensors`](Self::to_safetensors) wrote.
    fn load_any(self, bytes: Vec<u8>) -> Result<Self, NetworkError> {
        if SafeTensors::read_metadata(&bytes).is_ok() {
            self.with_weights(&bytes)
        } else {
            self.load_bytes(bytes)
        }
    }

    /// All weights as a safetensors file, for other programs: 32-bit floats, row-major, under the path of fields and of places in lists, as
    /// `encoder.0.weight`. The values are those of the network to the bit. Where names and shapes fit two kinds of networks, the metadata say
    /// under `petzval_kind` which it is.
    fn to_safetensors(&self) -> Result<Vec<u8>, NetworkError> {
        weights_file(self)
    }

    /// The network with the weights of a file that [`to_safetensors`](Self::to_safetensors) wrote, or of one with the same names in half
    /// precision. Fails if a weight is missing or has another shape, if the file has weights that the network does not have, and if its metadata
    /// say that it is of another kind.
    fn with_weights(self, file: &[u8]) -> Result<Self, NetworkError> {
        with_weights_of(self, file)
    }
}

impl<M: Module> Weights for M {}

/// An array with a name, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedArray {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// As many values as the shape says.
    pub values: Vec<f32>,
}

impl NamedArray {
    pub(crate) fn new(name: &str, shape: impl Into<Vec<usize>>, values: Vec<f32>) -> Self {
        Self { name: name.to_owned(), shape: shape.into(), values }
    }
}

/// How many batches a normalisation of torchvision has seen: a whole number beside its weights, which nothing here needs.
const BATCHES_SEEN: &str = "num_batches_tracked";

/// Under which key the metadata of a file say the kind of its network.
const KIND: &str = "petzval_kind";

/// Networks whose weights have the names and shapes of those of another kind, by the type that the framework gives to their fields.
const NAMED_KINDS: [(&str, &str); 1] = [("Struct:Segmenter", "segmenter")];

/// The kind of network that the metadata of a safetensors file name; none in files of other programs.
pub(crate) fn kind_in(file: &[u8]) -> Option<String> {
    let (_, header) = SafeTensors::read_metadata(file).ok()?;
    header.metadata().as_ref()?.get(KIND).cloned()
}

/// All weights of a safetensors file, of f16 or f32. Fails on one of another type and on one that is not finite, and names it.
pub(crate) fn read_arrays(file: &[u8]) -> Result<Vec<NamedArray>, NetworkError> {
    let bad = NetworkError::BadWeights;
    let file = SafeTensors::deserialize(file).map_err(|e| bad(format!("not a safetensors file: {e}")))?;
    let weights = file.iter().filter(|(name, _)| !name.ends_with(BATCHES_SEEN));
    let array = |(name, view): (&str, TensorView)| {
        let values = read_weights(&file, name, view.shape())
            .map_err(|problem| bad(format!("{name} is {problem}, expected F32 or F16")))?;
        Ok(NamedArray::new(name, view.shape(), values))
    };
    weights.map(array).collect()
}

/// Arrays as a safetensors file, whose metadata may name the kind of network.
pub(crate) fn write_arrays(arrays: &[NamedArray], kind: Option<&str>) -> Result<Vec<u8>, NetworkError> {
    let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let tensors: Vec<NamedTensor> =
        arrays.iter().map(|a| (a.name.clone(), a.shape.clone(), bytes(&a.values))).collect();
    safetensors_of(&tensors, kind).map_err(|error| NetworkError::NotStored(error.to_string()))
}

/// A weight of a network.
pub(crate) struct Weight {
    /// Its number for optimisers.
    pub id: ParamId,
    /// Its path, shape and values.
    pub array: NamedArray,
}

/// All weights of a network in its own order.
pub(crate) fn weights_of<M: Module>(network: &M) -> Result<Vec<Weight>, NetworkError> {
    Ok(weights_and_kind(network)?.0)
}

/// All weights of a network in its own order, and its kind where they do not say it.
fn weights_and_kind<M: Module>(network: &M) -> Result<(Vec<Weight>, Option<&'static str>), NetworkError> {
    let mut found = NamedWeights::default();
    network.visit(&mut found);
    let kind = found.kind;
    let weight = |((name, shape, data), id): ((String, Vec<usize>, TensorData), ParamId)| {
        let values =
            data.try_to_vec::<f32>().map_err(|e| NetworkError::NotStored(format!("{name}: {e:?}")))?;
        Ok(Weight { id, array: NamedArray { name, shape, values } })
    };
    let weights: Result<Vec<Weight>, NetworkError> =
        found.tensors.into_iter().zip(found.ids).map(weight).collect();
    Ok((weights?, kind))
}

/// Values of a tensor of f16 or f32, all finite. The error says what is there in place of a tensor of this shape.
pub(crate) fn read_weights(file: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
    let view = file.tensor(name).map_err(|_| "missing".to_owned())?;
    if view.shape() != shape {
        return Err(format!("of shape {:?}", view.shape()));
    }
    let values: Vec<f32> = match view.dtype() {
        Dtype::F16 => {
            view.data().chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect()
        }
        Dtype::F32 => {
            view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
        }
        other => return Err(format!("{other:?}")),
    };
    if values.iter().all(|v| v.is_finite()) { Ok(values) } else { Err("not finite everywhere".to_owned()) }
}

fn weights_file<M: Module>(network: &M) -> Result<Vec<u8>, NetworkError> {
    let (weights, kind) = weights_and_kind(network)?;
    let arrays: Vec<NamedArray> = weights.into_iter().map(|weight| weight.array).collect();
    write_arrays(&arrays, kind)
}

/// Name, shape and values of a tensor: 32-bit floats, row-major, the least significant byte first.
pub(crate) type NamedTensor = (String, Vec<usize>, Vec<u8>);

/// The kind of a network that its weights do not say.
fn named_kind<M: Module>(network: &M) -> Option<&'static str> {
    let mut found = NamedWeights::default();
    network.visit(&mut found);
    found.kind
}

/// Tensors as a safetensors file, whose metadata may name the kind of network.
pub(crate) fn safetensors_of(
    tensors: &[NamedTensor],
    kind: Option<&str>,
) -> Result<Vec<u8>, SafeTensorError> {
    let views: Vec<(&str, TensorView)> = tensors
        .iter()
        .map(|(name, shape, bytes)| Ok((name.as_str(), TensorView::new(Dtype::F32, shape.clone(), bytes)?)))
        .collect::<Result<_, SafeTensorError>>()?;
    safetensors::serialize(views, kind.map(|kind| HashMap::from([(KIND.to_owned(), kind.to_owned())])))
}

fn with_weights_of<M: Module>(network: M, file: &[u8]) -> Result<M, NetworkError> {
    let bad = |problem: String| NetworkError::BadWeights(problem);
    if let Some(kind) = kind_in(file).filter(|kind| named_kind(&network) != Some(kind.as_str())) {
        return Err(bad(format!("weights of a network of the kind `{kind}`")));
    }
    let file = SafeTensors::deserialize(file).map_err(|e| bad(format!("not a safetensors file: {e}")))?;
    let mut reader = WeightReader { file: &file, path: Path::default(), read: 0, problem: None };
    let network = network.map(&mut reader);
    match reader.problem {
        Some(problem) => Err(bad(problem)),
        None if reader.read < file.len() => {
            Err(bad(format!("{} weights, and the network has {}", file.len(), reader.read)))
        }
        None => Ok(network),
    }
}

/// The fields and places in lists that lead to a weight.
#[derive(Default)]
struct Path(Vec<String>);

impl Path {
    fn enter(&mut self, name: &str, container: &str) {
        if Self::is_part(container) {
            self.0.push(name.to_owned());
        }
    }

    fn exit(&mut self, container: &str) {
        if Self::is_part(container) {
            self.0.pop();
        }
    }

    /// The variant of an enum is no part of a path: a network has only one.
    fn is_part(container: &str) -> bool {
        !container.starts_with("Enum:")
    }

    fn name(&self) -> String {
        self.0.join(".")
    }
}

/// Puts the weights of a file into a network.
struct WeightReader<'a> {
    file: &'a SafeTensors<'a>,
    path: Path,
    /// Weights read.
    read: usize,
    /// The first weight that the file does not have.
    problem: Option<String>,
}

impl ModuleMapper for WeightReader<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (name, shape) = (self.path.name(), param.val().dims());
        match read_weights(self.file, &name, &shape) {
            Ok(values) => {
                self.read += 1;
                param.map(|old| {
                    let new = Tensor::<D>::from_data(TensorData::new(values, shape), &old.device());
                    new.set_require_grad(old.is_require_grad())
                })
            }
            Err(problem) => {
                self.problem.get_or_insert(format!("{name}, which has shape {shape:?}, is {problem}"));
                param
            }
        }
    }

    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _name: &str, container: &str) {
        self.path.exit(container);
    }
}

/// The path of the first weight of a network that is not finite everywhere.
pub(crate) fn not_finite<M: Module>(network: &M) -> Option<String> {
    let mut found = NamedWeights::default();
    network.visit(&mut found);
    let is_finite = |data: TensorData| data.iter::<f32>().all(|v| v.is_finite());
    found.tensors.into_iter().find(|(_, _, data)| !is_finite(data.clone())).map(|(name, _, _)| name)
}

/// Collects the weights of a network with their paths.
#[derive(Default)]
struct NamedWeights {
    /// What the network is, where its weights do not say so.
    kind: Option<&'static str>,
    path: Path,
    tensors: Vec<(String, Vec<usize>, TensorData)>,
    ids: Vec<ParamId>,
}

impl ModuleVisitor for NamedWeights {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let weights = param.val().detach();
        self.tensors.push((self.path.name(), weights.dims().to_vec(), weights.into_data()));
        self.ids.push(param.id);
    }

    fn enter_module(&mut self, name: &str, container: &str) {
        let named = NAMED_KINDS.iter().find(|(of, _)| *of == container);
        self.kind = self.kind.or(named.map(|(_, kind)| *kind));
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _name: &str, container: &str) {
        self.path.exit(container);
    }
}
