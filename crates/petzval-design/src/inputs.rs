//! What a run was made from. Its folder keeps lens and sensor, so that it stands on its own; of photographs it keeps a
//! fingerprint, because a run that went on with other pictures would be worth nothing.

use petzval_base::FileError;
use petzval_files::write_lens;
use sha2::{Digest, Sha256};

use crate::assets::Assets;
use crate::error::DesignError;
use crate::experiment::Experiment;
use crate::run::{RunFolder, RunRecord, write_file};
use crate::setup::Setup;

/// SHA-256 of the lens with its glasses, the sensor, and every photograph by name and content.
fn fingerprint(setup: &Setup) -> Result<String, DesignError> {
    let mut hash = Sha256::new();
    for variant in &setup.variants {
        hash.update(write_lens(&setup.start(variant).lens_file));
    }
    hash.update(DesignError::json("the sensor", &setup.body.sensor)?);
    for (list, photos) in [("training", setup.photos.training()), ("held out", setup.photos.held_out())] {
        for photo in photos {
            hash.update(format!("{list}: {} {}x{}", photo.name, photo.image.height, photo.image.width));
            for value in &photo.image.data {
                hash.update(value.to_le_bytes());
            }
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Keeps in a new run folder what the run is made from, and writes the `config.toml` that names it, and its record.
pub fn keep_inputs(setup: &Setup, assets: &Assets, run: &RunFolder) -> Result<(), DesignError> {
    let experiment = &setup.experiment;
    // The setup has read the lens already, and reported its warnings.
    let lens = assets.import(&experiment.lens)?.file;
    write_file(&run.nominal_lens(), write_lens(&lens).as_bytes())?;
    let sensor = assets.text("sensor", "sensors", &experiment.sensor)?;
    write_file(&run.sensor(), sensor.text.as_bytes())?;
    write_file(&run.fingerprint(), format!("{}\n", fingerprint(setup)?).as_bytes())?;
    // Names in an experiment are looked for beside it.
    let mut kept = Experiment {
        lens: "inputs/lens.toml".to_owned(),
        sensor: "inputs/sensor.toml".to_owned(),
        ..experiment.clone()
    };
    for variant in &mut kept.variant {
        if let Some(name) = &mut variant.lens {
            let file = format!("{}-lens.toml", variant.name);
            let lens = assets.import(name)?.file;
            write_file(&run.input(&file), write_lens(&lens).as_bytes())?;
            *name = format!("inputs/{file}");
        }
    }
    let text = kept.to_toml()?;
    RunRecord::begin(kept).write(run)?;
    write_file(&run.config(), text.as_bytes())
}

/// The values of a run's `config.toml`.
pub fn read_config(run: &RunFolder) -> Result<Experiment, DesignError> {
    let text = config_text(run)?;
    Experiment::parse_complete(&text).map_err(DesignError::input(&run.config()))
}

/// How the values of a run's `config.toml` differ from those of its record: the place of the first key, and every key by name.
pub fn changed_config(record: &RunRecord, run: &RunFolder) -> Result<Option<FileError>, DesignError> {
    let changes = read_config(run)?.differences(&record.config);
    let Some((first, _)) = changes.first() else { return Ok(None) };
    let path: Vec<&str> = first.split('.').collect();
    let was: Vec<String> = changes.iter().map(|(key, was)| format!("{key} was {was}")).collect();
    let message = format!("config.toml has changed since the run was begun: {}", was.join(", "));
    Ok(Some(FileError::at_key(&config_text(run)?, &path, message)))
}

/// Makes a run longer: `longer` becomes what it was begun with, and what was made of the finished cameras together is removed.
///
/// The record is written last. Where this is cut short, `config.toml` differs from the record; the same extension then completes it.
pub fn extend_run(run: &RunFolder, record: RunRecord, longer: Experiment) -> Result<(), DesignError> {
    for stale in [run.metrics(), run.report()] {
        if stale.exists() {
            std::fs::remove_file(&stale).map_err(DesignError::io(&stale))?;
        }
    }
    write_file(&run.config(), longer.to_toml()?.as_bytes())?;
    RunRecord { config: longer, finished: None, ..record }.write(run)
}

fn config_text(run: &RunFolder) -> Result<String, DesignError> {
    let path = run.config();
    std::fs::read_to_string(&path).map_err(DesignError::io(&path))
}

/// Refuses to go on with a run, or to score it again, from other inputs than it was made from.
pub fn check_inputs(setup: &Setup, run: &RunFolder) -> Result<(), DesignError> {
    let path = run.fingerprint();
    let noted = std::fs::read_to_string(&path).map_err(DesignError::io(&path))?;
    if noted.trim() == fingerprint(setup)? {
        return Ok(());
    }
    let problem =
        "the lens, its glasses, the sensor or the photographs are not those that this run began with; \
                   put them back, or start a new run"
            .to_owned();
    Err(DesignError::Run { path, problem })
}
