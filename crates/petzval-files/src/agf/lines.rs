//! Records of a file: lines, with their continuations.

use petzval_base::FileError;

/// A record of the file: one line, or several whose later ones begin with a number.
#[derive(Debug)]
pub(super) struct Line {
    /// Line number of its beginning, from 1.
    pub number: usize,
    /// The text, with continuations, without surrounding spaces.
    pub text: String,
}

impl Line {
    /// The records of a text.
    ///
    /// Some catalogues break long records after a number. No record begins with a number, so a line that begins with one continues the record
    /// before it. Comments are not continued.
    pub fn all(text: &str) -> Vec<Self> {
        let mut records: Vec<Self> = Vec::new();
        let end = crate::draft::line_end(text);
        for (number, line) in (1..).zip(text.split(end)) {
            let line = line.trim();
            if line.is_empty() {
                continue;
            }
            match records.last_mut().filter(|before| before.is_record()) {
                Some(before) if line.split_whitespace().next().and_then(finite).is_some() => {
                    before.text.push(' ');
                    before.text.push_str(line);
                }
                _ => records.push(Self { number, text: line.to_owned() }),
            }
        }
        records
    }

    /// The letters that name the record.
    pub fn record(&self) -> &str {
        self.text.split(char::is_whitespace).next().unwrap_or("")
    }

    /// Whether it begins with the letters of a record, other than a comment.
    fn is_record(&self) -> bool {
        matches!(self.record(), "NM" | "GC" | "ED" | "CD" | "TD" | "OD" | "LD" | "IT")
    }

    pub fn error(&self, message: impl Into<String>) -> FileError {
        error_at(self.number, &self.text, message)
    }

    /// The words after the record's name.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        self.text.split_whitespace().skip(1)
    }

    /// The numbers after the record's name; `None` if a word is not a finite number.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        self.words().map(finite).collect()
    }
}

/// An error at a line, about a text in it.
pub(super) fn error_at(number: usize, about: &str, message: impl Into<String>) -> FileError {
    FileError::at_line(u32::try_from(number).unwrap_or(0), about, message)
}

pub(super) fn finite(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}
