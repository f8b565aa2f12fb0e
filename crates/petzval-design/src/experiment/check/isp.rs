//! What a hardware ISP needs of an experiment.

use petzval_base::FileError;
use petzval_camera::isp::IspSettings;

use super::checked::Checked;
use crate::experiment::{OF_THE_WHOLE_FRAME, places_of};

/// Refuses parameters that cannot move, and windows that a Bayer array does not fill evenly.
pub(super) fn parameters_and_windows(c: &Checked) -> Result<(), FileError> {
    if !c.experiment.isp.is_used() {
        return Ok(());
    }
    let vary = |message: String, hint: &'static str| {
        Err(FileError::at_key(c.text, &["isp", "vary"], message).hint(hint))
    };
    if c.experiment.isp.vary.is_empty() {
        return vary("names no parameter".to_owned(), "name parameters or stages, such as \"sharpen\"");
    }
    if c.experiment.isp.vary.iter().any(|name| name == OF_THE_WHOLE_FRAME) {
        let message =
            format!("`{OF_THE_WHOLE_FRAME}` depends on the place in the whole frame, and windows have none");
        return vary(message, "leave it out; the other parameters of its stage may move");
    }
    // Those of a file are known when it is read.
    let parameters = IspSettings::parameters();
    let is_unknown =
        |name: &&String| !c.experiment.isp.is_in_file() && places_of(name, &parameters).is_empty();
    if let Some(name) = c.experiment.isp.vary.iter().find(is_unknown) {
        let message = format!("no parameter or stage of the ISP is called `{name}`");
        return vary(message, "`petzval isp show` lists them");
    }
    for (table, crop) in [("training", c.experiment.training.crop), ("scoring", c.experiment.scoring.crop)] {
        if !crop.is_multiple_of(2) {
            let error = FileError::at_key(c.text, &[table, "crop"], "must be even for a hardware ISP");
            return Err(error.hint(format!("take {}", crop + 1)));
        }
    }
    Ok(())
}
