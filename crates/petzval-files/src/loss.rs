//! Losses of a conversion from one lens format to another: nothing is dropped silently.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The effect of a record that is not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// No ray changes: coatings, tolerances, merit functions, solves whose value is kept.
    NoRay,
    /// The file does not state a value; the default of its program is used.
    Assumed,
    /// The lens represents the record approximately.
    Approximated,
    /// The lens of the file does not fulfil a solve of the file; its numbers are those of the file.
    Unsolved,
    /// The record is not understood.
    NotUnderstood,
}

impl Effect {
    /// The name in machine-readable output.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoRay => "no-ray",
            Self::Assumed => "assumed",
            Self::Approximated => "approximated",
            Self::Unsolved => "unsolved",
            Self::NotUnderstood => "not-understood",
        }
    }
}

/// A record or a part of a lens that the conversion did not keep exactly.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Loss {
    /// Line in the file that was read, from 1; `None` for a missing record, and for losses of writing.
    pub line: Option<u32>,
    /// The record as the file spells it, shortened for a message; or the part of the lens.
    pub record: String,
    /// Effect of the loss on rays.
    pub effect: Effect,
    /// Description of the loss.
    pub message: String,
    /// Number of further records of the same kind that were lost in the same way.
    pub more: usize,
}

impl Loss {
    /// The loss with its file and line, as `FILE:LINE: ...`.
    pub fn in_file(&self, path: &Path) -> String {
        let placeless = Self { line: None, ..self.clone() };
        match self.line {
            Some(line) => format!("{}:{line}: {placeless}", path.display()),
            None => format!("{}: {placeless}", path.display()),
        }
    }
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if !self.record.is_empty() {
            write!(f, "`{}`: ", self.record)?;
        }
        write!(f, "{}", self.message)?;
        match self.more {
            0 => Ok(()),
            more => write!(f, " (and {more} more like it)"),
        }
    }
}

/// Largest number of kinds of losses that are listed. Further kinds are only counted.
const MOST_KINDS: usize = 200;

/// Longest quotation of a record, characters.
const LONGEST: usize = 60;

/// The losses of one file. Records with the same first word and the same message are one loss.
#[derive(Clone, Debug, Default)]
pub(super) struct Losses {
    list: Vec<Loss>,
    /// Index of each kind in the list. A kind is first word, effect, message, and whether it has a line.
    kinds: HashMap<(String, Effect, String, bool), usize>,
    /// Index of each part of a file in the list, by message.
    parts: HashMap<String, usize>,
}

impl Losses {
    /// Adds a loss. Line 0 means no line.
    pub fn add(&mut self, line: u32, record: &str, effect: Effect, message: impl Into<String>) {
        self.place(line, record, effect, message.into());
    }

    /// Adds the loss of a value that the file does not state.
    pub fn assume(&mut self, message: impl Into<String>) {
        self.add(0, "", Effect::Assumed, message);
    }

    /// Adds a loss of a surface, counted from 1.
    pub fn of_surface(&mut self, number: usize, effect: Effect, message: impl Into<String>) {
        self.add(0, &format!("surface {number}"), effect, message);
    }

    /// Adds a loss and returns its index in the list.
    fn place(&mut self, line: u32, record: &str, effect: Effect, message: String) -> usize {
        let word = cut(record.split_whitespace().next().unwrap_or(""));
        let kind = (word, effect, message.clone(), line > 0);
        // Count all kinds beyond the limit in the last entry.
        let full = (self.list.len() > MOST_KINDS).then_some(MOST_KINDS);
        if let Some(known) = self.kinds.get(&kind).copied().or(full) {
            self.list[known].more += 1;
            return known;
        }
        self.kinds.insert(kind, self.list.len());
        let (record, message) = match self.list.len() {
            MOST_KINDS => (String::new(), "too many kinds of records are lost to name them all".to_owned()),
            _ => (cut(record), message),
        };
        self.list.push(Loss { line: (line > 0).then_some(line), record, effect, message, more: 0 });
        self.list.len() - 1
    }

    /// Adds a loss of a part of the file. All its records are one loss, even with different first words.
    pub fn add_part(&mut self, line: u32, record: &str, message: &str) {
        match self.parts.get(message) {
            Some(known) => self.list[*known].more += 1,
            None => {
                let place = self.place(line, record, Effect::NoRay, message.to_owned());
                self.parts.insert(message.to_owned(), place);
            }
        }
    }

    /// The losses in the order of the file, those without a line at the end.
    pub fn into_list(mut self) -> Vec<Loss> {
        self.list.sort_by_key(|loss| loss.line.unwrap_or(u32::MAX));
        self.list
    }
}

/// The first line of a record, cut to a length that fits in a message.
fn cut(record: &str) -> String {
    let first = record.trim().lines().next().unwrap_or("");
    match first.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &first[..end]),
        None => first.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_of_one_kind_are_one_loss_and_the_list_is_limited() {
        let mut losses = Losses::default();
        losses.add(3, "COAT AR", Effect::NoRay, "coatings are not read");
        losses.add(9, "COAT HEAR1", Effect::NoRay, "coatings are not read");
        losses.add(0, "", Effect::Assumed, "surface 1 is the stop");
        let list = losses.clone().into_list();
        assert_eq!(list[0].to_string(), "line 3: `COAT AR`: coatings are not read (and 1 more like it)");
        assert_eq!(list[1].to_string(), "surface 1 is the stop");
        for i in 0..1000 {
            losses.add(10, &format!("R{i}"), Effect::NotUnderstood, "no such record");
        }
        losses.add_part(12, "TOL", "tolerances are not read");
        losses.add_part(13, "TOL", "tolerances are not read");
        let list = losses.into_list();
        assert_eq!(list.len(), MOST_KINDS + 1);
        // Every record is counted: 3 from above, 1002 here.
        let all: usize = list.iter().map(|loss| 1 + loss.more).sum();
        assert_eq!(all, 3 + 1002);
    }

    /// As many kinds as the largest permitted file can have.
    #[test]
    fn many_distinct_records_take_linear_time() {
        let mut losses = Losses::default();
        let start = std::time::Instant::now();
        for i in 0..2_000_000 {
            losses.add(i + 1, &format!("R{i} 1 2 3"), Effect::NotUnderstood, "no such record");
        }
        assert_eq!(losses.into_list().len(), MOST_KINDS + 1);
        assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
    }
}
