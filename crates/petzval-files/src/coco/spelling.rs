//! Spellings of the names of files: one name may be written in several ways.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

/// A name with each letter and its marks in one sign where there is one (NFC). Archives of macOS have them apart (NFD).
pub(super) fn composed(name: &OsStr) -> Cow<'_, OsStr> {
    match name.to_str() {
        Some(text) if !text.is_ascii() => Cow::Owned(text.nfc().collect::<String>().into()),
        _ => Cow::Borrowed(name),
    }
}

/// [`composed`] for all names of a path.
pub(super) fn composed_path(path: &Path) -> PathBuf {
    PathBuf::from(composed(path.as_os_str()).into_owned())
}

/// What all spellings of a name have in common: one form of its letters, and small letters in its ending.
pub(super) fn common_spelling(name: &OsStr) -> PathBuf {
    let name = composed_path(Path::new(name));
    let ending = name.extension().map(OsStr::to_ascii_lowercase);
    ending.map_or_else(|| name.clone(), |ending| name.with_extension(ending))
}
