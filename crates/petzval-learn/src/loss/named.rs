//! A loss with its parts by name.

use burn::prelude::*;

use super::{LossError, image_loss::read_back};

/// A loss with its graph, and its parts by name.
pub struct NamedLoss {
    /// The loss, one value, with its graph.
    pub total: Tensor<1>,
    /// The loss as `total`, and its unweighted parts, by name.
    pub parts: Vec<(&'static str, f64)>,
}

impl NamedLoss {
    /// The sum of parts of weight 1.
    pub fn sum(parts: Vec<(&'static str, Tensor<1>)>) -> Result<Self, LossError> {
        let mut named = Vec::with_capacity(parts.len() + 1);
        for (name, part) in &parts {
            named.push((*name, f64::from(read_back(part)?)));
        }
        named.push(("total", named.iter().map(|(_, value)| value).sum()));
        let total = parts.into_iter().map(|(_, part)| part).reduce(|sum, part| sum + part);
        let total = total.ok_or_else(|| LossError::ReadBack("a loss without parts".to_owned()))?;
        Ok(Self { total, parts: named })
    }
}
