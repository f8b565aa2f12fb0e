//! Errors of a network.

/// Why a network cannot be built, stored or restored.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// A size of the network is outside its range.
    #[error("{name} is {value}; it must be {range}")]
    BadSize {
        /// Name of the setting.
        name: &'static str,
        /// The value.
        value: usize,
        /// The permitted range, in words.
        range: &'static str,
    },
    /// The stored weights cannot be read, or belong to another network.
    #[error("stored weights do not fit this network ({0}); use the configuration they were trained with")]
    BadWeights(String),
    /// A stored weight is no finite number.
    #[error(
        "the stored weight {0} is not finite everywhere; the file is damaged, or the training went astray"
    )]
    NotFinite(String),
    /// An input of a network is missing, or its network cannot take it.
    #[error("input `{name}` {problem}")]
    BadInput {
        /// Name of the input.
        name: String,
        /// What is wrong, and what is right.
        problem: String,
    },
    /// The weights could not be stored.
    #[error("the weights could not be stored: {0}")]
    NotStored(String),
}
