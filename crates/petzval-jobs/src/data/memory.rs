//! What `data check` remembers of pictures: a file for each data set in the cache folder of the user, because data sets may be read-only.

use std::path::{Path, PathBuf};

use petzval_files::{CheckedPictures, hex_digest};

use crate::context::Context;

/// Digits of the digest of a path that name its file.
const NAME_DIGITS: usize = 32;

/// Where the pictures of a place are remembered; none if the system has no cache folder.
fn file_of(place: &Path) -> Option<PathBuf> {
    let place = std::fs::canonicalize(place).ok()?;
    let digest = hex_digest(place.as_os_str().as_encoded_bytes());
    Some(dirs::cache_dir()?.join("petzval").join("checked").join(format!("{}.json", &digest[..NAME_DIGITS])))
}

/// The pictures of a place that were checked before.
pub(super) fn remembered(place: &Path) -> CheckedPictures {
    file_of(place).map_or_else(CheckedPictures::default, |file| CheckedPictures::read(&file))
}

/// Remembers what was checked of a place. That it cannot is no failure of the check, and noted.
pub(super) fn remember(place: &Path, checked: &CheckedPictures, context: &Context) {
    let Some(file) = file_of(place).filter(|_| checked.has_fresh()) else { return };
    if let Err(error) = checked.write(&file) {
        let file = file.display();
        context.note(format!(
            "{file}: what was checked cannot be remembered ({error}); the next check takes as long"
        ));
    }
}
