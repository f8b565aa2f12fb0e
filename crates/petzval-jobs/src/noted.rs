//! What a job says of its files, without a line for each file.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::{Mutex, PoisonError};

use petzval_files::PictureNotes;

use crate::context::Context;
use crate::event::WarningKind;

/// Collects the notes and warnings of a job on its files. When it goes out of scope it reports them, once for each kind with a count and the first
/// file: no caller can leave that out. Texts that differ in their numbers alone are of one kind.
pub(crate) struct Noted<'c> {
    context: &'c Context,
    /// What one file is called.
    noun: &'static str,
    /// Notes have no kind of warning.
    texts: Mutex<BTreeMap<Option<WarningKind>, PictureNotes>>,
}

impl<'c> Noted<'c> {
    /// Nothing yet. `noun` is what one file is called, such as `frame`.
    pub fn new(context: &'c Context, noun: &'static str) -> Self {
        Self { context, noun, texts: Mutex::default() }
    }

    /// The context to which it reports.
    pub fn context(&self) -> &'c Context {
        self.context
    }

    /// Adds a note on a file.
    pub fn note(&self, file: impl Display, text: String) {
        self.add(None, &file.to_string(), text);
    }

    /// Adds a warning of a file.
    pub fn warning(&self, file: impl Display, kind: WarningKind, text: String) {
        self.add(Some(kind), &file.to_string(), text);
    }

    fn add(&self, kind: Option<WarningKind>, file: &str, text: String) {
        // The map stays valid if a thread panics while it holds the lock.
        let mut texts = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        texts.entry(kind).or_default().add(file, [&text]);
    }
}

impl Drop for Noted<'_> {
    fn drop(&mut self) {
        let texts = self.texts.get_mut().unwrap_or_else(PoisonError::into_inner);
        for (kind, notes) in texts.iter() {
            for clause in notes.clauses_of(self.noun) {
                match kind {
                    Some(kind) => self.context.warning(*kind, clause),
                    None => self.context.note(clause),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::event::Lines;

    #[test]
    fn what_is_said_of_files_is_one_event_for_each_kind_at_the_end() {
        let lines = Arc::new(Lines::default());
        let context = Context::new(crate::built_in_assets(), lines.clone());
        let noted = Noted::new(&context, "frame");
        for (i, file) in ["a", "b", "c"].into_iter().enumerate() {
            noted.warning(file, WarningKind::RawFrame, format!("{i} dark pixels"));
            noted.note(file, "it is merged".to_owned());
        }
        noted.warning("b", WarningKind::RawFrame, "no sensor".to_owned());
        noted.warning("c", WarningKind::Saturation, "7 dark pixels".to_owned());
        assert!(lines.0.lock().unwrap().is_empty());
        drop(noted);
        let wanted = [
            "a and 2 other frames: it is merged",
            "warning: c: 7 dark pixels",
            "warning: a and 2 other frames: 0 dark pixels",
            "warning: b: no sensor",
        ];
        assert_eq!(*lines.0.lock().unwrap(), wanted);
    }
}
