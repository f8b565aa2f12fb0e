//! Quantum efficiency over the spectrum: how many electrons a photon gives.

use serde::{Deserialize, Serialize};

/// Quantum efficiency curves, 0..1, on common wavelengths; between samples linear, outside zero.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuantumEfficiency {
    /// Wavelengths, um, ascending.
    pub wavelength_um: Vec<f64>,
    /// Red pixels; empty if the sensor has none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub red: Vec<f64>,
    /// Green pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub green: Vec<f64>,
    /// Blue pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blue: Vec<f64>,
    /// Pixels without a colour filter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clear: Vec<f64>,
}
