//! A user's own lens in place of an experiment: the experiment, the lens and the sensor that fit it.

use std::path::Path;

use petzval_design::assets::extension;
use petzval_design::experiment::Experiment;
use petzval_design::fit::{FitOf, fit};
use petzval_files::write_lens;

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;

/// Endings of lens files of other programs.
const FOREIGN: [&str; 3] = ["zmx", "seq", "json"];

/// An experiment fitted to a lens, with the files that it needs.
pub(crate) struct OwnLens {
    /// The experiment. Its lens and sensor are still to be named.
    pub experiment: Experiment,
    /// The lens file.
    pub lens_text: String,
    /// The sensor file.
    pub sensor_text: String,
    /// The sensor whose pixels are taken.
    pub sensor_name: String,
    /// Whether the lens was given variables because its file names none.
    pub gave_variables: bool,
}

/// Whether a name stands for a lens and not for an experiment: a lens file by its ending or its content, the text of one
/// in a request, or a built-in lens.
pub(crate) fn is_lens(name: &str, context: &Context) -> bool {
    let path = Path::new(name);
    if FOREIGN.contains(&extension(path).as_str()) {
        return true;
    }
    let text = match context.assets.text_in_no_file(name) {
        None if path.is_file() => petzval_base::read_text(path).ok(),
        inline => inline.map(str::to_owned),
    };
    if let Some(text) = text {
        return is_lens_text(&text);
    }
    let is_known = |folder: &str| context.assets.names(folder).contains(&name);
    !is_known("experiments") && is_known("lenses")
}

/// Whether a text in TOML is that of a lens and not of an experiment.
pub fn is_lens_text(text: &str) -> bool {
    text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("surface"))
}

/// Fits an experiment to a lens, and to a sensor if one is named. Every choice is reported.
pub(crate) fn own_lens(
    experiment: Experiment,
    lens: &str,
    sensor: Option<&str>,
    context: &Context,
) -> Result<OwnLens> {
    let import = context.assets.reported(lens)?;
    let pictures = context.assets.facts_of(&experiment)?.pictures;
    let fitted = fit(FitOf { experiment, lens: import, lens_name: lens, sensor, pictures }, &context.assets)?;
    fitted.notes.iter().for_each(|note| context.note(note));
    fitted
        .warnings
        .iter()
        .for_each(|warning| context.warning(WarningKind::Experiment, format!("{lens}: {warning}")));
    // The text of a file that needs no change keeps its comments.
    let is_ours = !FOREIGN.contains(&extension(Path::new(lens)).as_str());
    let lens_text = if fitted.changes_lens || !is_ours {
        write_lens(&fitted.lens)
    } else {
        context.assets.text("lens", "lenses", lens)?.text
    };
    let sensor_text = if fitted.changes_sensor {
        format!(
            "# The pixels of the sensor `{}` in an array that fits the lens.\n{}",
            fitted.sensor_name,
            toml::to_string(&fitted.sensor).map_err(|e| JobError::failed(e.to_string()))?
        )
    } else {
        context.assets.text("sensor", "sensors", &fitted.sensor_name)?.text
    };
    Ok(OwnLens {
        experiment: fitted.experiment,
        lens_text,
        sensor_text,
        sensor_name: fitted.sensor_name,
        gave_variables: fitted.gave_variables,
    })
}
