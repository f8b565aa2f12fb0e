//! Lines of a file.

use crate::loss::{Effect, Losses};
use petzval_base::FileError;

/// The character that ends a line: files of old Macintoshes have carriage returns alone.
pub(crate) fn line_end(text: &str) -> char {
    if text.contains('\n') { '\n' } else { '\r' }
}

/// A line of a file, for messages.
#[derive(Clone, Debug, Default)]
pub(crate) struct Record {
    /// Line number from 1; 0 if the error belongs to no line.
    pub line: u32,
    /// Text of the line.
    pub text: String,
}

impl Record {
    pub fn new(line: u32, text: &str) -> Self {
        Self { line, text: text.to_owned() }
    }

    pub fn error(&self, message: impl Into<String>) -> FileError {
        FileError::at_line(self.line, &self.text, message)
    }

    /// Adds a loss of the line.
    pub fn lose(&self, losses: &mut Losses, effect: Effect, message: impl Into<String>) {
        losses.add(self.line, &self.text, effect, message);
    }
}
