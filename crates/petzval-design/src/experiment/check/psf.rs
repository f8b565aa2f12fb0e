//! What PSFs of a file need of an experiment.

use petzval_base::FileError;

use super::checked::Checked;
use crate::experiment::{BlockName, PsfsBy, variants};

/// Refuses the kind "file" without a file, and a file that is not read.
pub(super) fn files_and_kinds(c: &Checked) -> Result<(), FileError> {
    let psf = &c.experiment.psf;
    match (psf.kind == PsfsBy::File, psf.named_file()) {
        (true, None) => {
            let error = c.at(&["psf", "kind"], "psf.file does not name the file");
            Err(error.hint(
                "add `file = \"FOLDER\"`, a folder that `petzval psf` or `petzval psf-calibrate` wrote",
            ))
        }
        (false, Some(_)) => {
            let error = c.at(&["psf", "file"], "this file is not read: psf.kind is another");
            Err(error.hint("write `kind = \"file\"`, or leave the file out"))
        }
        _ => Ok(()),
    }
}

/// PSFs of a file are held: refuses what would change the lens behind them.
pub(super) fn no_lens_moves(c: &Checked) -> Result<(), FileError> {
    let e = c.experiment;
    if e.psf.kind != PsfsBy::File {
        return Ok(());
    }
    for (i, variant) in e.variant.iter().enumerate() {
        let (name, place) = (&variant.name, i.to_string());
        let own = [("lens", variant.lens.is_some()), ("optics_proxy", variant.optics_proxy.is_some())];
        if let Some((key, _)) = own.into_iter().find(|(_, is_there)| *is_there) {
            let message =
                format!("variant `{name}`: every camera has the PSFs of the file, whatever its lens");
            let error = variants::at(c.text, &["variant", &place, key], message);
            return Err(error.hint("leave it out, or write \"diffraction\" for psf.kind"));
        }
        let moving = variant.stage.iter().position(|stage| stage.moves.contains(&BlockName::Optics));
        if let Some(k) = moving {
            let message =
                format!("variant `{name}`: the PSFs of a file are held, so that its lens cannot move");
            let error = variants::at(c.text, &["variant", &place, "stage", &k.to_string(), "moves"], message);
            let hint = "leave \"optics\" out, or write \"diffraction\" or \"geometric\" for psf.kind";
            return Err(error.hint(hint));
        }
    }
    Ok(())
}
