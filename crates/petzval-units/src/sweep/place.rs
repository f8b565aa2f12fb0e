//! Errors at places of a file.

use petzval_base::FileError;

/// An error about the value at a path of keys. An element of a list is called by the key of the list.
pub(super) fn at_place(text: &str, place: &[&str], message: impl Into<String>) -> FileError {
    let error = FileError::at_key(text, place, message);
    let key = place.iter().rfind(|part| part.parse::<usize>().is_err());
    FileError { key: key.map_or_else(String::new, |key| (*key).to_owned()), ..error }
}
