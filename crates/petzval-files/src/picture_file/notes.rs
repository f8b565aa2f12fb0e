//! What the files of many pictures say that is not obeyed, without a line for each picture.

use std::collections::BTreeMap;

/// Notes on pictures ([`Picture::notes`](super::Picture::notes)), by kind: notes that differ in their numbers alone are of one kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PictureNotes {
    kinds: BTreeMap<String, Kind>,
}

/// A kind of notes.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Kind {
    /// The first picture that has one.
    picture: String,
    /// Its note.
    note: String,
    /// Further notes of the kind.
    others: usize,
}

impl PictureNotes {
    /// Adds the notes on a picture of this name.
    pub fn add<'n>(&mut self, picture: &str, notes: impl IntoIterator<Item = &'n String>) {
        for note in notes {
            let kind: String = note.chars().filter(|c| !matches!(c, '0'..='9' | '.')).collect();
            match self.kinds.get_mut(&kind) {
                Some(kind) => kind.others += 1,
                None => {
                    let first = Kind { picture: picture.to_owned(), note: note.clone(), others: 0 };
                    self.kinds.insert(kind, first);
                }
            }
        }
    }

    /// A clause for each kind: its first picture, how many others there are, and what the file of the first says.
    pub fn clauses(&self) -> Vec<String> {
        self.clauses_of("picture")
    }

    /// The same for files that are called otherwise: `noun` is what one of them is called, such as `frame`.
    pub fn clauses_of(&self, noun: &str) -> Vec<String> {
        let clause = |Kind { picture, note, others }: &Kind| {
            let others = match others {
                0 => String::new(),
                1 => format!(" and another {noun}"),
                n => format!(" and {n} other {noun}s"),
            };
            format!("{picture}{others}: {note}")
        };
        self.kinds.values().map(clause).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_a_kind_are_one_clause_with_a_count() {
        let mut notes = PictureNotes::default();
        assert_eq!(notes.clauses(), [""; 0]);
        let profile = "its ICC profile (Display P3) is ignored".to_owned();
        let clear = |count: usize| format!("{count} of its 64 pixels are transparent");
        notes.add("a.png", &[profile.clone(), clear(7)]);
        notes.add("b.png", &[]);
        notes.add("c.png", &[clear(12)]);
        notes.add("d.png", &[clear(9)]);
        let wanted = [
            "a.png and 2 other pictures: 7 of its 64 pixels are transparent".to_owned(),
            format!("a.png: {profile}"),
        ];
        assert_eq!(notes.clauses(), wanted);
        assert_eq!(
            notes.clauses_of("frame")[0],
            "a.png and 2 other frames: 7 of its 64 pixels are transparent"
        );
    }
}
