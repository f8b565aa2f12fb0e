//! An experiment under check.

use petzval_base::FileError;

use crate::experiment::{Experiment, TaskFacts, VariantConfig};

/// An experiment under check, with its file for the places of errors and the facts of its task.
pub(super) struct Checked<'a> {
    pub experiment: &'a Experiment,
    pub text: &'a str,
    pub facts: &'a TaskFacts,
}

impl Checked<'_> {
    /// An error at a path of keys.
    pub fn at(&self, path: &[&str], message: impl Into<String>) -> FileError {
        FileError::at_key(self.text, path, message)
    }

    /// The place of the first variant of which this is true.
    pub fn first_config(&self, is_meant: impl Fn(&VariantConfig) -> bool) -> Option<String> {
        self.experiment.variant.iter().position(is_meant).map(|place| place.to_string())
    }
}
