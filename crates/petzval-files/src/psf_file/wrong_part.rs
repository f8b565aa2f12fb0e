//! Defects of the files of a bank.

use petzval_base::FileError;

use super::PsfFault;
use super::axes::at_key;

/// What is wrong with a bank, and in which of its files.
#[derive(Clone, Debug, PartialEq)]
pub enum WrongPart {
    /// The file with the axes.
    Axes(FileError),
    /// The array of PSFs.
    Values(FileError),
    /// The array of relative illumination.
    Illumination(FileError),
}

/// An error without a place.
pub(super) fn message(message: impl Into<String>, hint: &str) -> FileError {
    FileError::at_line(0, "", message).hint(hint)
}

/// A fault as the error of the file that has it.
pub(super) fn part(text: &str, fault: &PsfFault) -> WrongPart {
    let PsfFault { key, value, message: reason, hint } = fault;
    match *key {
        "values" => WrongPart::Values(message(reason.clone(), hint)),
        "illumination" => WrongPart::Illumination(message(reason.clone(), hint)),
        key => {
            let error = at_key(text, key, reason.clone()).hint(*hint);
            WrongPart::Axes(FileError { value: value.clone(), ..error })
        }
    }
}
