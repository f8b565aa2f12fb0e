//! Errors of the analyses.

use petzval_base::Cancelled;

/// Why a lens cannot be analysed at a field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AnalysisError {
    /// The job was cancelled.
    #[error("stopped before all fields were analysed")]
    Stopped(#[from] Cancelled),
    /// The chief ray is lost.
    #[error(
        "at {field_deg} degrees and {wavelength_um} um no ray through the middle of the stop reaches the image"
    )]
    NoChiefRay {
        /// The field, degrees.
        field_deg: f64,
        /// The wavelength, um.
        wavelength_um: f64,
    },
    /// All of its light is lost.
    #[error("at {field_deg} degrees no light reaches the image")]
    NoLight {
        /// The field, degrees.
        field_deg: f64,
    },
}
