//! A JSON value of any type, so that a wrong one is a defect of its record and not the end of the file.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Visitor,
};

use super::defect::DefectKind;
use super::numbers::NO_NUMBER;

/// Values of a list that are kept: one more than a box has.
const MOST: usize = 5;

/// Characters of a text that an error quotes.
const LONGEST: usize = 40;

/// A value of any type.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Loose {
    /// The key is missing, or its value is `null`.
    #[default]
    Absent,
    Flag(bool),
    /// A whole number from 0.
    Whole(u64),
    Number(f64),
    Text(String),
    /// The first values of a list.
    List(Vec<Loose>),
    Table,
}

/// Why a value cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Wrong {
    Absent,
    /// The value, as a message shows it.
    Type(String),
    NotFinite(String),
    /// An id that no record has.
    Unlisted(String),
}

impl Wrong {
    /// What a record with such a value for a key is, and in words.
    pub fn defect(self, key: &str) -> (DefectKind, String) {
        let kind = match &self {
            Self::Absent => DefectKind::MissingField,
            Self::Type(_) => DefectKind::WrongType,
            Self::NotFinite(_) => DefectKind::NotFinite,
            Self::Unlisted(_) if key == "category_id" => DefectKind::UnknownCategory,
            Self::Unlisted(_) => DefectKind::UnknownImage,
        };
        let what = match self {
            Self::Absent => "missing".to_owned(),
            Self::Type(value) | Self::NotFinite(value) | Self::Unlisted(value) => value,
        };
        (kind, format!("{key} is {what}"))
    }
}

impl Loose {
    /// A whole number from 0. A floating-point number without a fraction counts, because some programs write `1.0`.
    pub fn whole(&self) -> Result<u64, Wrong> {
        match self {
            Self::Whole(n) => Ok(*n),
            Self::Number(v) if *v >= 0.0 && v.fract() == 0.0 && *v < 2f64.powi(53) => Ok(*v as u64),
            other => Err(other.wrong()),
        }
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64, Wrong> {
        match self {
            Self::Whole(n) => Ok(*n as f64),
            Self::Number(v) if v.is_finite() => Ok(*v),
            Self::Number(_) => Err(Wrong::NotFinite(self.to_string())),
            Self::Text(text) if text == NO_NUMBER => Err(Wrong::NotFinite("NaN or infinity".to_owned())),
            other => Err(other.wrong()),
        }
    }

    /// A text.
    pub fn text(&self) -> Result<&str, Wrong> {
        match self {
            Self::Text(text) => Ok(text),
            other => Err(other.wrong()),
        }
    }

    /// A text, or a number as text; an empty text is none.
    pub fn name(&self) -> Result<Option<String>, Wrong> {
        match self {
            Self::Absent => Ok(None),
            Self::Text(text) => Ok(Some(text.clone()).filter(|text| !text.trim().is_empty())),
            Self::Whole(n) => Ok(Some(n.to_string())),
            other => Err(other.wrong()),
        }
    }

    /// True or false, or 1 or 0; absent is false.
    pub fn flag(&self) -> Result<bool, Wrong> {
        match self {
            Self::Absent => Ok(false),
            Self::Flag(flag) => Ok(*flag),
            Self::Whole(n @ 0..=1) => Ok(*n == 1),
            Self::Number(v) if *v == 0.0 || *v == 1.0 => Ok(*v == 1.0),
            other => Err(other.wrong()),
        }
    }

    /// Four finite numbers.
    pub fn four(&self) -> Result<[f64; 4], Wrong> {
        match self {
            Self::List(values) if values.len() == 4 => {
                let mut four = [0.0; 4];
                for (number, value) in four.iter_mut().zip(values) {
                    *number = value.number().map_err(|wrong| match wrong {
                        Wrong::Type(_) => Wrong::Type(self.to_string()),
                        // `null` in place of a number is how JSON writers without NaN write it.
                        _ => Wrong::NotFinite(self.to_string()),
                    })?;
                }
                Ok(four)
            }
            other => Err(other.wrong()),
        }
    }

    fn wrong(&self) -> Wrong {
        match self {
            Self::Absent => Wrong::Absent,
            other => Wrong::Type(other.to_string()),
        }
    }
}

impl fmt::Display for Loose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Absent => f.write_str("null"),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Whole(n) => write!(f, "{n}"),
            Self::Number(v) => write!(f, "{v}"),
            Self::Text(text) if text == NO_NUMBER => f.write_str("NaN or infinity"),
            Self::Text(text) => write!(f, "{:?}", text.chars().take(LONGEST).collect::<String>()),
            Self::List(values) => {
                f.write_str("[")?;
                for (i, value) in values.iter().enumerate() {
                    write!(f, "{}{value}", if i > 0 { ", " } else { "" })?;
                }
                f.write_str(if values.len() == MOST { ", ...]" } else { "]" })
            }
            Self::Table => f.write_str("{...}"),
        }
    }
}

/// A value that is read from JSON of any type.
pub(super) trait AnyValue<'de>: Sized {
    /// From a value that is neither list nor table.
    fn plain(value: Loose) -> Self;

    /// From a text, which is copied unless the type takes it as it is.
    fn text(text: &str) -> Self {
        Self::plain(Loose::Text(text.to_owned()))
    }

    /// From a list.
    fn list<A: SeqAccess<'de>>(list: A) -> Result<Self, A::Error>;

    /// From a table.
    fn table<A: MapAccess<'de>>(table: A) -> Result<Self, A::Error>;
}

/// Reads a value of any type.
pub(super) fn any_value<'de, T: AnyValue<'de>, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_any(AnyVisitor(PhantomData))
}

struct AnyVisitor<T>(PhantomData<T>);

impl<'de, T: AnyValue<'de>> Visitor<'de> for AnyVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<T, E> {
        Ok(T::plain(Loose::Absent))
    }

    fn visit_bool<E>(self, flag: bool) -> Result<T, E> {
        Ok(T::plain(Loose::Flag(flag)))
    }

    fn visit_u64<E>(self, n: u64) -> Result<T, E> {
        Ok(T::plain(Loose::Whole(n)))
    }

    fn visit_i64<E>(self, n: i64) -> Result<T, E> {
        Ok(T::plain(u64::try_from(n).map_or(Loose::Number(n as f64), Loose::Whole)))
    }

    fn visit_f64<E>(self, v: f64) -> Result<T, E> {
        Ok(T::plain(Loose::Number(v)))
    }

    fn visit_str<E>(self, text: &str) -> Result<T, E> {
        Ok(T::text(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<T, A::Error> {
        T::list(list)
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<T, A::Error> {
        T::table(table)
    }
}

impl<'de> Deserialize<'de> for Loose {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        any_value(deserializer)
    }
}

impl<'de> AnyValue<'de> for Loose {
    fn plain(value: Loose) -> Self {
        value
    }

    fn list<A: SeqAccess<'de>>(mut list: A) -> Result<Self, A::Error> {
        let mut values = Vec::new();
        while values.len() < MOST {
            match list.next_element()? {
                Some(value) => values.push(value),
                None => return Ok(Self::List(values)),
            }
        }
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Self::List(values))
    }

    fn table<A: MapAccess<'de>>(mut table: A) -> Result<Self, A::Error> {
        while table.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Self::Table)
    }
}

/// A record that can say which of its fields are not read.
pub(super) trait Fields {
    /// The fields that are read, and those that say nothing of objects; `None` where fields are not looked at.
    const KNOWN: Option<&'static [&'static str]> = None;

    /// Takes the names of all other fields.
    fn set_unread(&mut self, _fields: Vec<String>) {}
}

/// A record of a list, or what is there in its place. A derived reader would take a list for a record.
pub(super) enum Record<T> {
    Table(T),
    Other(Loose),
}

impl<'de, T: Deserialize<'de> + Fields> Deserialize<'de> for Record<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        any_value(deserializer)
    }
}

impl<T> Record<T> {
    /// The record, if it is one.
    pub fn table(&self) -> Option<&T> {
        match self {
            Self::Table(record) => Some(record),
            Self::Other(_) => None,
        }
    }
}

/// The entries of a table; keeps the names of those that are not known.
struct Noting<'k, A> {
    table: A,
    known: &'static [&'static str],
    unread: &'k mut Vec<String>,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Noting<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, A::Error> {
        let Some(name) = self.table.next_key::<String>()? else { return Ok(None) };
        let key = seed.deserialize(name.as_str().into_deserializer())?;
        if !self.known.contains(&name.as_str()) {
            self.unread.push(name);
        }
        Ok(Some(key))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.table.next_value_seed(seed)
    }
}

impl<'de, T: Deserialize<'de> + Fields> AnyValue<'de> for Record<T> {
    fn plain(value: Loose) -> Self {
        Self::Other(value)
    }

    fn list<A: SeqAccess<'de>>(list: A) -> Result<Self, A::Error> {
        Loose::list(list).map(Self::Other)
    }

    fn table<A: MapAccess<'de>>(table: A) -> Result<Self, A::Error> {
        let Some(known) = T::KNOWN else {
            return T::deserialize(MapAccessDeserializer::new(table)).map(Self::Table);
        };
        let mut unread = Vec::new();
        let noting = Noting { table, known, unread: &mut unread };
        let mut record = T::deserialize(MapAccessDeserializer::new(noting))?;
        record.set_unread(unread);
        Ok(Self::Table(record))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_other_types_are_distinguished() {
        let of = |text: &str| serde_json::from_str::<Loose>(text).unwrap();
        assert_eq!(of("7").whole(), Ok(7));
        assert_eq!(of("7.0").whole(), Ok(7));
        assert_eq!(of("-7").whole(), Err(Wrong::Type("-7".into())));
        assert_eq!(of("null").whole(), Err(Wrong::Absent));
        assert_eq!(of("\"7\"").whole(), Err(Wrong::Type("\"7\"".into())));
        assert_eq!(of("\"?\"").number(), Err(Wrong::NotFinite("NaN or infinity".into())));
        assert_eq!(of("[1, 2, 3.5, -4]").four(), Ok([1.0, 2.0, 3.5, -4.0]));
        assert_eq!(of("[1, 2, null, 4]").four(), Err(Wrong::NotFinite("[1, 2, null, 4]".into())));
        assert_eq!(of("[1, 2, \"a\", 4]").four(), Err(Wrong::Type("[1, 2, \"a\", 4]".into())));
        assert_eq!(of("[1, 2, 3, 4, 5, 6]").four(), Err(Wrong::Type("[1, 2, 3, 4, 5, ...]".into())));
        assert_eq!(of("{\"a\": [1, {}]}").flag(), Err(Wrong::Type("{...}".into())));
        assert_eq!((of("1").flag(), of("null").flag()), (Ok(true), Ok(false)));
        assert_eq!(of("12").name(), Ok(Some("12".into())));
    }
}
