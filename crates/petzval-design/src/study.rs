//! A study of several seeds: how far the differences between cameras scatter. A run of one seed quotes it beside its own figures.

use std::collections::BTreeMap;

use petzval_base::FileError;
use petzval_learn::score::ScoreDescription;
use petzval_report::design_report::{SeedDifference, SeedStudy, Spread};
use serde::{Deserialize, Serialize};

use crate::assets::Assets;
use crate::error::DesignError;

/// The built-in study, a file of `data/studies/`.
const STUDY: &str = "cooke-triplet-image-quality";

/// The file of a study.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// The experiment that was repeated.
    pub experiment: String,
    /// Its seeds.
    pub seeds: Vec<u64>,
    /// Network steps of each camera.
    pub network_steps: usize,
    /// Differences between its cameras.
    pub difference: Vec<Difference>,
}

/// The difference between two cameras.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// The camera from whose scores those of the other are taken.
    pub camera: String,
    /// The other.
    pub against: String,
    /// By the name of the score.
    pub score: BTreeMap<String, MeanAndDeviation>,
}

/// Mean and standard deviation over the seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeanAndDeviation {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

impl Study {
    /// The built-in study.
    pub fn built_in(assets: &Assets) -> Result<Self, DesignError> {
        let source = assets.text("study", "studies", STUDY)?;
        toml::from_str(&source.text)
            .map_err(|e| DesignError::input(&source.path)(FileError::from_toml(&source.text, &e)))
    }

    /// The study in these scores, for a report.
    pub fn in_scores(&self, scores: &[ScoreDescription]) -> SeedStudy {
        let spread = |d: &Difference, i: usize, score: &ScoreDescription| {
            let MeanAndDeviation { mean, deviation } = *d.score.get(&score.name)?;
            Some(Spread { score: i, mean, deviation })
        };
        let difference = |d: &Difference| SeedDifference {
            camera: d.camera.clone(),
            against: d.against.clone(),
            spreads: scores.iter().enumerate().filter_map(|(i, score)| spread(d, i, score)).collect(),
        };
        SeedStudy {
            experiment: self.experiment.clone(),
            seeds: self.seeds.len(),
            network_steps: self.network_steps,
            differences: self.difference.iter().map(difference).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figures that runs quote are those of the manual.
    #[test]
    fn the_study_is_that_of_the_book() {
        let study: Study =
            toml::from_str(include_str!("../../../data/studies/cooke-triplet-image-quality.toml")).unwrap();
        let book = include_str!("../../../book/src/experiments.md");
        assert_eq!(study.seeds, [1, 2, 3]);
        for difference in &study.difference {
            let cell = |score: &str, decimals: usize| {
                let MeanAndDeviation { mean, deviation } = difference.score[score];
                format!("{mean:+.decimals$} +- {deviation:.decimals$}")
            };
            let cells = [cell("one_minus_lpips", 4), cell("psnr_db", 2), cell("ssim", 4)];
            let row = format!("| {} | {} |", difference.against, cells.join(" | "));
            assert!(book.contains(&row), "the book has no row {row}");
        }
    }
}
