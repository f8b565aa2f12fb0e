//! A user's own pictures in place of those of an experiment.

use std::path::Path;

use petzval_design::experiment::{Experiment, PicturesKey};
use petzval_design::path_text::path_text;

use crate::error::{JobError, Result};

/// An experiment with pictures of the user's own: photographs, or a data set with labels, whichever `key` the experiment reads.
pub(crate) fn with_pictures(
    mut experiment: Experiment,
    photos: Option<&Path>,
    data: Option<&Path>,
    key: PicturesKey,
) -> Result<Experiment> {
    if let Some(photos) = photos {
        if key == PicturesKey::Data {
            let hint = "name the pictures with their labels: --data, or `data` of a call";
            let message = "the experiment needs labels, and photographs have none";
            return Err(JobError::setting("photos", photos.display(), message, hint));
        }
        experiment.photos = absolute(photos)?;
    }
    if let Some(data) = data {
        if key == PicturesKey::Photos {
            let hint = "it is for experiments on labelled scenes, such as pedestrian-vehicle; name pictures without labels by --photos, or `photos` of a call";
            return Err(JobError::setting("data", data.display(), "the experiment makes pictures", hint));
        }
        experiment.data = absolute(data)?;
    }
    Ok(experiment)
}

/// The path of a file or folder that is there, from the root.
pub(crate) fn absolute(path: &Path) -> Result<String> {
    let path = std::fs::canonicalize(path).map_err(|error| {
        JobError::input(format!("{}: {error}", path.display()), "give a folder or file that exists")
    })?;
    Ok(path_text(&path)?)
}
