//! Spellings of the names of files: one name may be written in several ways.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

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

/// The names in a path, without its root. A step upwards takes the name before it away; where there is none, it does not count.
pub(super) fn names_in(path: &Path) -> Vec<&OsStr> {
    let mut names = Vec::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => names.push(name),
            Component::ParentDir => drop(names.pop()),
            _ => {}
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_upwards_takes_the_name_before_it_away() {
        for (path, names) in [
            ("a/../x.png", &["x.png"][..]),
            ("./a//b/../x.png", &["a", "x.png"]),
            ("../images/x.png", &["images", "x.png"]),
            ("/a/b", &["a", "b"]),
            ("a/..", &[]),
        ] {
            assert_eq!(names_in(Path::new(path)), names, "{path}");
        }
    }
}
