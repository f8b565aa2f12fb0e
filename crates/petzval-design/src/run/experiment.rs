//! The experiment of a run.

use std::path::Path;

use super::input_list::pictures_of_run;
use super::{RunFolder, RunRecord, read_config};
use crate::assets::{Assets, Text};
use crate::error::DesignError;
use crate::experiment::Experiment;

impl Assets {
    /// The experiment that a run was made from, by its record; that of its `config.toml` if it has none.
    pub fn experiment_of_run(&self, run: &RunFolder) -> Result<Experiment, DesignError> {
        let config = match RunRecord::read(run)? {
            Some(record) => record.config,
            None => read_config(run)?,
        };
        self.experiment_in(run, config, None)
    }

    /// An experiment with its lens, sensor and pictures looked for in a run folder. Pictures need not be there; `pictures` says where
    /// they are now.
    pub fn experiment_in(
        &self,
        run: &RunFolder,
        config: Experiment,
        pictures: Option<&Path>,
    ) -> Result<Experiment, DesignError> {
        let source = Text { path: run.config(), text: config.to_toml()? };
        let mut experiment = self.beside(config, &source, &["photos", "data"])?;
        pictures_of_run(run, &mut experiment, pictures)?;
        Ok(experiment)
    }
}
