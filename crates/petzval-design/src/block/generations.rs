//! Steps of a block without a gradient: each is a generation of CMA-ES, all points of which see the same batch.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::evolution::{Evolution, EvolutionSettings};

/// Noise of batches keeps the best values of generations apart for ever: a search is not restarted for being flat.
const NEVER_FLAT: f64 = 0.0;

/// The search of a stage, from its first step on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Generations(Option<Evolution>);

/// How the first generation of a stage is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstGeneration<'a> {
    /// Its middle: places in ranges, 0..1.
    pub middle: &'a [f64],
    /// Standard deviation of each place.
    pub deviation: f64,
    /// Seed of the search.
    pub seed: u64,
}

/// What a point is worth.
pub(super) struct PointScore {
    /// What is to be lowered.
    pub value: f64,
    /// The losses by name.
    pub losses: BTreeMap<String, f64>,
}

impl Generations {
    /// Scores the points of a generation. Returns the middle of the search after it, and the mean losses of the points. The middle is a better
    /// answer than the best point: losses differ from batch to batch, and the best point was often lucky. `score` returns none at a point where
    /// there is no camera.
    pub fn step(
        &mut self,
        first: FirstGeneration,
        mut score: impl FnMut(&[f64]) -> Result<Option<PointScore>>,
    ) -> Result<(Vec<f64>, BTreeMap<String, f64>)> {
        let search = match &mut self.0 {
            Some(search) => search,
            begun => {
                let settings = EvolutionSettings {
                    first_deviation: first.deviation,
                    least_change: NEVER_FLAT,
                    seed: first.seed,
                    ..EvolutionSettings::default()
                };
                let search = Evolution::new(first.middle, settings);
                begun.insert(search.map_err(|e| DesignError::Device(e.to_string()))?)
            }
        };
        let scores = search.ask().iter().map(|point| score(point)).collect::<Result<Vec<_>, _>>()?;
        let values: Vec<f64> = scores.iter().map(|s| s.as_ref().map_or(f64::INFINITY, |s| s.value)).collect();
        search.tell(&values);
        let count = scores.iter().flatten().count() as f64;
        let mut means = BTreeMap::new();
        for (name, value) in scores.into_iter().flatten().flat_map(|s| s.losses) {
            *means.entry(name).or_insert(0.0) += value / count;
        }
        Ok((search.middle(), means))
    }

    /// Whether it is that of so many places.
    pub fn fits(&self, places: usize) -> bool {
        self.0.as_ref().is_none_or(|search| search.middle().len() == places)
    }
}
