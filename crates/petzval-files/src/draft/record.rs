//! Lines of a file.

use petzval_base::FileError;

/// What ends a line: in files of old Macintoshes a carriage return alone.
pub(crate) fn line_end(text: &str) -> char {
    if text.contains('\n') { '\n' } else { '\r' }
}

/// A line of a file, for messages.
#[derive(Clone, Debug, Default)]
pub(crate) struct Record {
    /// From 1; 0 for what no line says.
    pub line: u32,
    /// As it stands there.
    pub text: String,
}

impl Record {
    pub fn new(line: u32, text: &str) -> Self {
        Self { line, text: text.to_owned() }
    }

    pub fn error(&self, message: impl Into<String>) -> FileError {
        FileError::at_line(self.line, &self.text, message)
    }
}
