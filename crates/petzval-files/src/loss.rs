//! What a lens loses on its way from one format to another: nothing is dropped in silence.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// How a record that is not kept matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// It changes no ray: coatings, tolerances, merit functions, solves whose value is kept.
    NoRay,
    /// The file does not say it; what its program takes by default is taken.
    Assumed,
    /// The lens here is nearly, but not exactly, what it says.
    Approximated,
    /// It is not understood.
    NotUnderstood,
}

impl Effect {
    /// A word for machines.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoRay => "no-ray",
            Self::Assumed => "assumed",
            Self::Approximated => "approximated",
            Self::NotUnderstood => "not-understood",
        }
    }
}

/// One thing that is not, or not exactly, in the lens that was read or in the text that was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loss {
    /// Line in the file that was read, from 1; `None` for what the file does not say, and for losses of writing.
    pub line: Option<u32>,
    /// The record as the file spells it, cut to a length that fits in a message; or the part of the lens.
    pub record: String,
    /// How it matters.
    pub effect: Effect,
    /// What happened to it.
    pub message: String,
    /// How many further records of the same kind were treated alike.
    pub more: usize,
}

impl Loss {
    /// The loss with the file it is from, as `FILE:LINE: ...`.
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
            more => write!(f, " (and {more} more such)"),
        }
    }
}

/// Kinds of losses that are listed one by one; beyond them they are only counted.
const MOST_KINDS: usize = 200;

/// Characters of a record that are quoted.
const LONGEST: usize = 60;

/// The losses of one file. Records that begin with the same word and are treated alike are one loss.
#[derive(Clone, Debug, Default)]
pub(super) struct Losses {
    list: Vec<Loss>,
    /// Where each kind stands in the list: first word, effect, message, whether it has a line.
    kinds: HashMap<(String, Effect, String, bool), usize>,
    /// Where the parts of a file stand.
    parts: HashMap<String, usize>,
}

impl Losses {
    /// Adds a loss; line 0 stands for none.
    pub fn add(&mut self, line: u32, record: &str, effect: Effect, message: impl Into<String>) {
        self.place(line, record, effect, message.into());
    }

    /// Adds a loss, and says where in the list it is.
    fn place(&mut self, line: u32, record: &str, effect: Effect, message: String) -> usize {
        let word = cut(record.split_whitespace().next().unwrap_or(""));
        let kind = (word, effect, message.clone(), line > 0);
        // Beyond the cap all kinds are one, the last.
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

    /// Adds a loss of a part of the file; its records are one loss, whatever they begin with.
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
    fn alike_records_are_one_loss_and_no_file_makes_a_long_list() {
        let mut losses = Losses::default();
        losses.add(3, "COAT AR", Effect::NoRay, "coatings are not read");
        losses.add(9, "COAT HEAR1", Effect::NoRay, "coatings are not read");
        losses.add(0, "", Effect::Assumed, "surface 1 is the stop");
        let list = losses.clone().into_list();
        assert_eq!(list[0].to_string(), "line 3: `COAT AR`: coatings are not read (and 1 more such)");
        assert_eq!(list[1].to_string(), "surface 1 is the stop");
        for i in 0..1000 {
            losses.add(10, &format!("R{i}"), Effect::NotUnderstood, "no such record");
        }
        losses.add_part(12, "TOL", "tolerances are not read");
        losses.add_part(13, "TOL", "tolerances are not read");
        let list = losses.into_list();
        assert_eq!(list.len(), MOST_KINDS + 1);
        // Every record is counted: 3 that are told above, 1002 here.
        let all: usize = list.iter().map(|loss| 1 + loss.more).sum();
        assert_eq!(all, 3 + 1002);
    }

    /// As many kinds as a file of the largest size has take no longer each than the first ones.
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
