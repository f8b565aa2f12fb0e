//! A study of several seeds: how far the differences between cameras scatter. A run of one seed quotes it beside its own figures, if it is a run
//! of the experiment that was studied.

use std::collections::BTreeMap;

use petzval_base::FileError;
use petzval_files::write_lens;
use petzval_learn::score::ScoreDescription;
use petzval_report::design_report::{SeedDifference, SeedStudy, Spread};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::assets::Assets;
use crate::error::{DesignError, Result};
use crate::experiment::Experiment;
use crate::library::Library;

/// The built-in study, a file of `crates/petzval-data/data/studies/`.
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeanAndDeviation {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

impl Study {
    /// The built-in study, if this is the experiment that it repeated: every key that a figure depends on agrees but the seed, and lens and sensor
    /// have the same content.
    pub fn of(experiment: &Experiment, library: &Library) -> Result<Option<Self>> {
        let study = Self::built_in(library)?;
        let repeated = library.experiment(&study.experiment)?;
        let is_it = agrees(experiment, &repeated)
            && is_same_lens(&experiment.lens, &repeated.lens, library)?
            && library.sensor(&experiment.sensor)? == library.sensor(&repeated.sensor)?;
        Ok(is_it.then_some(study))
    }

    /// The built-in study.
    pub fn built_in(assets: &Assets) -> Result<Self> {
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

/// Whether two experiments differ in nothing that a figure depends on but the seed. Lens and sensor are not compared: they are files, and
/// their names do not determine their contents.
fn agrees(one: &Experiment, other: &Experiment) -> bool {
    let compared = |e: &Experiment| Experiment {
        name: String::new(),
        seed: 0,
        lens: String::new(),
        sensor: String::new(),
        checkpoint: Default::default(),
        reading: Default::default(),
        ..e.clone()
    };
    compared(one) == compared(other)
}

/// Whether two names stand for the same lens, with the same variables and solves.
pub fn is_same_lens(one: &str, other: &str, assets: &Assets) -> Result<bool> {
    Ok(one == other || write_lens(&assets.import(one)?.file) == write_lens(&assets.import(other)?.file))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Its figures belong to its own experiment alone, by whatever name its files are called.
    #[test]
    fn the_study_is_quoted_for_its_own_experiment_alone() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
        let assets = Library::from_folder(&data).unwrap();
        let own = assets.experiment(STUDY).unwrap();
        let is_quoted = |change: &dyn Fn(&mut Experiment)| {
            let mut experiment = own.clone();
            change(&mut experiment);
            Study::of(&experiment, &assets).unwrap().is_some()
        };
        assert!(is_quoted(&|_| ()));
        assert!(is_quoted(&|e| (e.seed, e.name) = (7, "Mine".to_owned())));
        assert!(
            is_quoted(&|e| e.lens = data.join("lenses/cooke-triplet-nominal.toml").display().to_string())
        );
        assert!(!is_quoted(&|e| e.lens = "cooke-triplet-fast".to_owned()));
        assert!(!is_quoted(&|e| e.sensor = "imx249-calibrated".to_owned()));
        assert!(!is_quoted(&|e| e.training.steps = 10));
        assert!(!is_quoted(&|e| e.photos = "mine".to_owned()));
        assert!(!is_quoted(&|e| _ = e.variant.pop()));
    }
}
