//! Weights as bytes in Burn's format, exact to the bit.

use burn::{module::Module, store::ModuleRecord, tensor::Bytes};

use super::NetworkError;

/// All weights of a network.
pub(super) fn to_bytes<M: Module>(network: &M) -> Result<Vec<u8>, NetworkError> {
    let bytes = network.clone().into_record().into_bytes();
    Ok(bytes.map_err(|error| NetworkError::NotStored(error.to_string()))?.to_vec())
}

/// The network with the weights that [`to_bytes`] wrote. Fails if they belong to another configuration.
pub(super) fn load_bytes<M: Module>(network: M, bytes: Vec<u8>) -> Result<M, NetworkError> {
    let refuse = |error: burn::store::RecordError| NetworkError::BadWeights(error.to_string());
    let record = ModuleRecord::from_bytes(Bytes::from_bytes_vec(bytes)).map_err(refuse)?;
    network.try_load_record(record).map_err(refuse)
}
