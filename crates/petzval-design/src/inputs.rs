//! What a run was made from, as a fingerprint: names in `config.toml` may come to mean something else while a run
//! rests, and half a run on other pictures would be worth nothing.

use petzval_optics::format::write_lens;
use sha2::{Digest, Sha256};

use crate::error::DesignError;
use crate::run::{RunFolder, write_atomically};
use crate::setup::Setup;

/// SHA-256 of the lens with its glasses, the sensor, and every photograph by name and content.
fn fingerprint(setup: &Setup) -> Result<String, DesignError> {
    let mut hash = Sha256::new();
    hash.update(write_lens(&setup.lens_file));
    hash.update(DesignError::json("the sensor", &setup.sensor)?);
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

/// Notes in a new run folder what the run is made from.
pub fn note_inputs(setup: &Setup, run: &RunFolder) -> Result<(), DesignError> {
    write_atomically(&run.inputs(), format!("{}\n", fingerprint(setup)?).as_bytes())
}

/// Refuses to go on with a run, or to score it again, from other inputs than it was made from.
pub fn check_inputs(setup: &Setup, run: &RunFolder) -> Result<(), DesignError> {
    let path = run.inputs();
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
