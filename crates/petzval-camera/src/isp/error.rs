//! What can be wrong with a frame, with parameters, or with an ISP.

/// Why a frame cannot be developed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IspError {
    /// The ISP does not take the frame or its calibration.
    #[error("{what} is {got}; it must be {need}")]
    Input {
        /// Name of the property.
        what: &'static str,
        /// Its value.
        got: String,
        /// What is permitted.
        need: &'static str,
    },
    /// The wrong number of parameters.
    #[error("the ISP has {expected} parameters, {got} values were given")]
    Count {
        /// Parameters of the ISP.
        expected: usize,
        /// Values given.
        got: usize,
    },
    /// A parameter is outside its range.
    #[error("ISP parameter {name} is {value}; it must lie between {min} and {max}")]
    Parameter {
        /// Its name, `stage.key`.
        name: String,
        /// The value given.
        value: f64,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// An ISP outside this program failed.
    #[error("the external ISP failed: {0}")]
    External(String),
    /// An ISP outside this program was stopped, because the job was cancelled.
    #[error("the external ISP {0} was stopped before it made a picture")]
    Stopped(String),
}
