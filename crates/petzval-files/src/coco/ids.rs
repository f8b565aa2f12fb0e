//! Ids of the pictures, classes or objects of a file: whole numbers, or texts that stand for numbers.

use std::collections::HashMap;

use super::loose::{Loose, Wrong};
use super::numbers::NO_NUMBER;

/// How the ids of a list become numbers.
pub(super) enum Ids {
    /// They are numbers.
    Numbers,
    /// They are texts; each gets the number that it writes, or, unless all write one, the place of its first record, counted from 1.
    Texts(HashMap<String, u64>),
}

impl Ids {
    /// Of the ids of all records of a list. Texts are ids only where none is a number: `"7"` beside `7` may be the same or another.
    pub fn of<'a>(ids: impl IntoIterator<Item = &'a Loose>) -> Self {
        let mut numbers = HashMap::new();
        for (place, id) in (1..).zip(ids) {
            match id {
                Loose::Text(text) if is_id(text) => drop(numbers.entry(text.clone()).or_insert(place)),
                id if id.whole().is_ok() => return Self::Numbers,
                _ => {}
            }
        }
        if numbers.is_empty() {
            return Self::Numbers;
        }
        // Texts that are all written numbers stand for these: weights know classes by their numbers.
        let written = |text: &String| text.parse().ok().filter(|n: &u64| n.to_string() == *text);
        if numbers.keys().all(|text| written(text).is_some()) {
            numbers.iter_mut().for_each(|(text, number)| *number = written(text).unwrap_or(*number));
        }
        Self::Texts(numbers)
    }

    /// The number of an id. A text that no record has as its id is [`Wrong::Unlisted`].
    pub fn number(&self, id: &Loose) -> Result<u64, Wrong> {
        match (self, id) {
            (Self::Texts(numbers), Loose::Text(text)) if is_id(text) => {
                numbers.get(text).copied().ok_or_else(|| Wrong::Unlisted(id.to_string()))
            }
            // A number among texts names nothing.
            (Self::Texts(_), id) if id.whole().is_ok() => Err(Wrong::Type(id.to_string())),
            (_, id) => id.whole(),
        }
    }

    /// The number that an id of the wrong type stands for, if any, such as `"7"` beside ids that are numbers. Its record is not used, but whose
    /// record is lost is known.
    pub fn meant(&self, id: &Loose) -> Option<u64> {
        match (self, id) {
            (Self::Numbers, Loose::Text(text)) => text.trim().parse().ok(),
            (Self::Texts(numbers), id) => numbers.get(&id.whole().ok()?.to_string()).copied(),
            _ => None,
        }
    }

    /// The id as the file has it, where ids are texts.
    pub fn text(&self, id: &Loose) -> Option<String> {
        match (self, id) {
            (Self::Texts(_), Loose::Text(text)) => Some(text.clone()),
            _ => None,
        }
    }
}

fn is_id(text: &str) -> bool {
    !text.is_empty() && text != NO_NUMBER
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vec<Loose> {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn texts_are_ids_where_no_id_is_a_number() {
        let ids = Ids::of(&read(r#"["a", null, "b", "a"]"#));
        let numbers: Vec<_> = read(r#"["b", "a", "", "c", 1]"#).iter().map(|id| ids.number(id)).collect();
        let wrong = |text: &str| Err(Wrong::Type(text.to_owned()));
        let unlisted = Err(Wrong::Unlisted("\"c\"".to_owned()));
        assert_eq!(numbers, [Ok(3), Ok(1), wrong("\"\""), unlisted, wrong("1")]);
        assert_eq!(ids.text(&Loose::Text("b".into())).as_deref(), Some("b"));
        let named = Ids::of(&read(r#"["7", "08"]"#));
        assert_eq!([7, 8].map(|id| named.meant(&Loose::Whole(id))), [Some(1), None]);
        let written = Ids::of(&read(r#"["7", "13"]"#));
        assert_eq!(written.number(&Loose::Text("13".into())), Ok(13));
        for mixed in [r#"["a", 7]"#, r#"["7", 7.0]"#, "[7]", "[]"] {
            let ids = Ids::of(&read(mixed));
            assert_eq!(ids.number(&Loose::Whole(7)), Ok(7));
            assert_eq!(ids.number(&Loose::Text("7".into())), wrong("\"7\""), "{mixed}");
            assert_eq!(ids.text(&Loose::Text("7".into())), None);
            let meant = [ids.meant(&Loose::Text("7".into())), ids.meant(&Loose::Text("a".into()))];
            assert_eq!(meant, [Some(7), None]);
        }
    }
}
