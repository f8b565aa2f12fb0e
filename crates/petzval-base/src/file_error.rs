//! Errors in a file: what is wrong, where, and what to write instead.

use std::fmt;
use std::ops::Range;

use serde::de::DeserializeOwned;

/// One error in a file. The caller, who opened the file, adds its path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct FileError {
    /// Line, from 1; `None` where the error has no single place.
    pub line: Option<u32>,
    /// Column, in characters from 1.
    pub column: Option<u32>,
    /// The key as the file spells it; empty where the text is not TOML.
    pub key: String,
    /// The value as the file spells it; empty where the key is missing.
    pub value: String,
    /// What is wrong.
    pub message: String,
    /// What to write instead.
    pub hint: Option<String>,
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.line, self.column) {
            (Some(line), Some(column)) => write!(f, "line {line}, column {column}: ")?,
            (Some(line), None) => write!(f, "line {line}: ")?,
            _ => {}
        }
        match (self.key.is_empty(), self.value.is_empty()) {
            (false, false) => write!(f, "`{} = {}`: ", self.key, self.value)?,
            (false, true) => write!(f, "`{}`: ", self.key)?,
            (true, false) => write!(f, "`{}`: ", self.value)?,
            (true, true) => {}
        }
        write!(f, "{}", self.message)?;
        match &self.hint {
            Some(hint) => write!(f, " (hint: {hint})"),
            None => Ok(()),
        }
    }
}

/// Reason and hint of an error that writes both as one text, `reason; hint: what to do`. The hint is empty where there is none.
pub fn reason_and_hint(text: &str) -> (&str, &str) {
    text.split_once("; hint: ").unwrap_or((text, ""))
}

impl FileError {
    /// An error about the bytes `span` of `text`; the value is quoted from there.
    pub fn at(text: &str, span: Range<usize>, key: &str, message: impl Into<String>) -> Self {
        let (line, column) = position(text, span.start);
        Self {
            line: Some(line),
            column: Some(column),
            key: key.into(),
            value: quote(text.get(span).unwrap_or("")),
            message: message.into(),
            hint: None,
        }
    }

    /// An error about a whole line of a file that has no keys; the line is quoted.
    pub fn at_line(line: u32, record: &str, message: impl Into<String>) -> Self {
        Self {
            line: (line > 0).then_some(line),
            column: None,
            key: String::new(),
            value: quote(record),
            message: message.into(),
            hint: None,
        }
    }

    /// An error about the value at a path of keys, e.g. `["psf", "grid"]`, of a text that is valid TOML. A number is the place of
    /// an element in an array, from 0: `["variant", "2", "name"]`.
    pub fn at_key(text: &str, path: &[&str], message: impl Into<String>) -> Self {
        let key = path.last().copied().unwrap_or("");
        match toml::de::DeTable::parse(text).ok().and_then(|table| value_span(table.get_ref(), path)) {
            Some(span) => Self::at(text, span, key, message),
            None => Self {
                line: None,
                column: None,
                key: key.into(),
                value: String::new(),
                message: message.into(),
                hint: None,
            },
        }
    }

    /// The same error with a hint.
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// The same error without a quoted value, for a key that is missing.
    pub fn without_value(mut self) -> Self {
        self.value.clear();
        self
    }

    /// An error about the value at a path such as `run.new.changes` of a value that is in no file, from the message of serde. The keys of an
    /// unknown key's neighbours give the hint.
    pub fn of_value(path: &str, message: &str) -> Self {
        let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        // A question mark stands for a place that has no name.
        let path = path.trim_end_matches('?').trim_end_matches('.');
        let (key, message, hint) = match words.split_first() {
            Some((unknown, known)) if message.starts_with("unknown field") => {
                let is_named = path == *unknown || path.ends_with(&format!(".{unknown}"));
                let key = match path {
                    "" => (*unknown).to_owned(),
                    path if is_named => path.to_owned(),
                    path => format!("{path}.{unknown}"),
                };
                (key, "no such key here".to_owned(), key_hint(unknown, known))
            }
            Some((missing, _)) if message.starts_with("missing field") => {
                (path.to_owned(), format!("the key `{missing}` is missing"), None)
            }
            Some((unknown, known)) if message.starts_with("unknown variant") => {
                let takes: Vec<String> = known.iter().map(|word| format!("\"{word}\"")).collect();
                let hint = nearest(unknown, known).map(|near| format!("did you mean \"{near}\"?"));
                (path.to_owned(), format!("\"{unknown}\": this key takes {}", takes.join(" or ")), hint)
            }
            _ if message.starts_with("invalid type") || message.starts_with("invalid length") => {
                let (message, hint) = of_type(message, u64::MAX.into());
                // The hint of the reader is that of a file.
                let below =
                    (!path.is_empty()).then(|| format!("it holds keys: name one of them, `{path}.KEY`"));
                let hint = if message.starts_with("expected a table") {
                    below
                } else {
                    hint.filter(|_| !message.contains("a table")).map(str::to_owned)
                };
                (path.to_owned(), message.replace("a table", "an object"), hint)
            }
            Some((value, _)) if message.starts_with("invalid value: integer") => {
                let (message, hint) = of_type(message, u64::MAX.into());
                (path.to_owned(), format!("{value}: {message}"), hint.map(str::to_owned))
            }
            _ => (path.to_owned(), message.to_owned(), None),
        };
        Self { line: None, column: None, key, value: String::new(), message, hint }
    }

    /// Reads TOML. The reader takes tables in the order of their names; of several wrong keys and values, the error is about the first of the text.
    pub fn read_toml<T: DeserializeOwned>(text: &str) -> Result<T, Self> {
        let mut error = match toml::from_str(text) {
            Ok(read) => return Ok(read),
            Err(error) => error,
        };
        while let Some(above) = lines_above(text, &error)
            && let Err(earlier) = toml::from_str::<T>(above)
            && is_of_a_key(&earlier)
            && earlier.span().is_some_and(|span| span.start < above.len())
        {
            error = earlier;
        }
        Err(Self::from_toml(text, &error))
    }

    /// Turns an error of the TOML reader into one with key, value and, for an unknown key, the nearest known key as a hint.
    pub fn from_toml(text: &str, error: &toml::de::Error) -> Self {
        let span = error.span().unwrap_or(0..0);
        let message = error.message().trim().replace('\n', ", ");
        let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();

        if message.starts_with("unknown field") && !words.is_empty() {
            let mut unknown = Self::at(text, span.clone(), words[0], "no such key here");
            unknown.value = quote(value_after(text, span.end));
            unknown.hint = key_hint(words[0], &words[1..]);
            return unknown;
        }
        if message.starts_with("missing field") && !words.is_empty() {
            let message = format!("the key `{}` is missing", words[0]);
            let missing = Self::at(text, span, words[0], message).without_value();
            return missing.hint(format!("add a line `{} = ...`", words[0]));
        }
        // A value of the wrong type belongs to the key before the last `=`.
        let key = |start| key_before(text, start);
        match words.split_first() {
            Some((unknown, known)) if message.starts_with("unknown variant") => {
                let takes: Vec<String> = known.iter().map(|word| format!("\"{word}\"")).collect();
                let message = format!("no such value; this key takes {}", takes.join(" or "));
                // A word that is like none of them is no misspelling.
                let hint = match nearest(unknown, known) {
                    Some(near) => format!("did you mean \"{near}\"?"),
                    None => "write one of these values".to_owned(),
                };
                Self::at(text, span.clone(), key(span.start), message).hint(hint)
            }
            _ if message == "wanted string or table" => {
                Self::at(text, span.clone(), key(span.start), "expected text in quotes")
                    .hint("put the value in quotes")
            }
            _ if BEYOND_64_BITS.iter().any(|end| message.ends_with(end)) => {
                Self::at(text, span.clone(), key(span.start), WHOLE_NUMBERS_OF_TOML).hint(SMALLER_NUMBER)
            }
            _ if message.starts_with("invalid") => {
                let (message, hint) = of_type(&message, i64::MAX.into());
                if let Some(path) = header_to(text, &span).filter(|_| message.ends_with("found a table")) {
                    let name = path.rsplit('.').next().unwrap_or(path);
                    let error = Self::at(text, span.clone(), name, message).without_value();
                    return error.hint(format!("a header `[[{path}]]` is missing above, or misspelled"));
                }
                let hint = hint.map(str::to_owned);
                Self { hint, ..Self::at(text, span.clone(), key(span.start), message) }
            }
            _ if message == "duplicate key" => Self::at(text, span, "", message)
                .hint("it stands above already; take one out, or correct a header above that is misspelled"),
            _ => Self::at(text, span, "", message),
        }
    }
}

/// The lines above that of an error, if there are any.
fn lines_above<'t>(text: &'t str, error: &toml::de::Error) -> Option<&'t str> {
    let end = text.get(..error.span()?.start)?.rfind('\n')? + 1;
    text.get(..end)
}

/// Whether an error is about a key or a value that stands in the text: it is wrong whatever follows.
fn is_of_a_key(error: &toml::de::Error) -> bool {
    let starts = ["unknown field", "unknown variant", "invalid type", "invalid value"];
    starts.iter().any(|start| error.message().starts_with(start))
}

/// The path of keys that a header such as `[variant.stage]` names up to the end of `span`; `None` outside of headers.
fn header_to<'t>(text: &'t str, span: &Range<usize>) -> Option<&'t str> {
    let line_start = text.get(..span.start)?.rfind('\n').map_or(0, |i| i + 1);
    let path = text.get(line_start..span.end)?.trim_start().strip_prefix('[')?.trim_start_matches('[').trim();
    path.starts_with(|c: char| c.is_ascii_alphabetic()).then_some(path)
}

/// How the reader of TOML ends a message about a whole number that 64 bits with a sign cannot hold.
const BEYOND_64_BITS: [&str; 3] =
    ["u64 value was too large", "integer number overflowed", "expected any valid TOML value"];

/// Which whole numbers a file of TOML, and so an experiment, can hold.
pub const WHOLE_NUMBERS_OF_TOML: &str =
    "TOML holds whole numbers from -9223372036854775808 to 9223372036854775807";

/// What to write in place of a whole number that is too large.
pub const SMALLER_NUMBER: &str = "write a smaller whole number";

/// The least and the largest whole number of a type of Rust; `None` for all other types.
fn ends_of(integer: &str) -> Option<(i128, i128)> {
    Some(match integer {
        "u8" => (0, u8::MAX.into()),
        "u16" => (0, u16::MAX.into()),
        "u32" => (0, u32::MAX.into()),
        "u64" | "usize" => (0, u64::MAX.into()),
        "i8" => (i8::MIN.into(), i8::MAX.into()),
        "i16" => (i16::MIN.into(), i16::MAX.into()),
        "i32" => (i32::MIN.into(), i32::MAX.into()),
        "i64" | "isize" => (i64::MIN.into(), i64::MAX.into()),
        _ => return None,
    })
}

/// Message and hint about a whole number that the type `wanted` cannot hold; `None` for other errors. `found` is the text of serde that quotes the number.
/// `largest` is the largest whole number of the kind of file. A negative number where none may be is of the wrong type.
fn beyond_ends(found: &str, wanted: &str, largest: i128) -> Option<(String, &'static str)> {
    let (low, high) = ends_of(wanted).map(|(low, high)| (low, high.min(largest)))?;
    let number = found.strip_prefix("integer `").or_else(|| found.strip_prefix("floating point `"))?;
    let (value, _) = number.split_once('`')?;
    // A reader of JSON makes a number with a decimal point of what 64 bits cannot hold.
    let as_float = || value.parse::<f64>().ok().filter(|value| value.fract() == 0.0);
    let value = value.parse::<i128>().ok().or_else(|| as_float().map(|value| value as i128))?;
    let hint = match value {
        value if value > high => SMALLER_NUMBER,
        value if value < low && low < 0 => "write a larger whole number",
        _ => return None,
    };
    Some((format!("must lie between {low} and {high}"), hint))
}

/// A message of the TOML reader about the type of a value, in the words of a file: numbers, texts, lists and tables in place of
/// `usize`, `string`, `sequence` and `map`; and what to write instead, where the type alone says it. `largest` is the largest whole number that the
/// kind of file holds.
fn of_type(message: &str, largest: i128) -> (String, Option<&'static str>) {
    let parts = message.split_once(": ").or(message.split_once("length "));
    let Some((found, wanted)) = parts.and_then(|(_, rest)| rest.rsplit_once(", expected ")) else {
        return (message.to_owned(), None);
    };
    if let Some((message, hint)) = beyond_ends(found, wanted, largest) {
        return (message, Some(hint));
    }
    let hint = match wanted {
        "usize" | "u64" | "u32" | "u16" | "u8" => Some("write a whole number without quotes, 0 or more"),
        "isize" | "i64" | "i32" | "i16" | "i8" => Some("write a whole number without quotes"),
        "f64" | "f32" | "a number" => {
            Some("write a number without quotes and without a unit; the unit is in the name of the key")
        }
        "a string" => Some("put the value in quotes"),
        "a boolean" => Some("write true or false, without quotes"),
        "a sequence" => Some("write the values in square brackets, with commas between them"),
        "a map" => Some("write `[key]` and the keys of the table in lines below, or `key = { ... }`"),
        other if other.starts_with("an array of length ") => {
            Some("write as many values in square brackets, with commas between them")
        }
        other if other.starts_with("struct ") => {
            Some("write `[key]` and the keys of the table in lines below, or `key = { ... }`")
        }
        _ => None,
    };
    let wanted = match wanted {
        "usize" | "u64" | "u32" | "u16" | "u8" => "a number from 0 without a decimal point".to_owned(),
        "isize" | "i64" | "i32" | "i16" | "i8" => "a number without a decimal point".to_owned(),
        "f64" | "f32" => "a number".to_owned(),
        "a string" => "text in quotes".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a sequence" => "a list in square brackets".to_owned(),
        "a map" => "a table".to_owned(),
        other => match other.strip_prefix("an array of length ") {
            Some(length) => format!("a list of {length} values"),
            None if other.starts_with("struct ") => "a table".to_owned(),
            None => other.to_owned(),
        },
    };
    let found = match found.split([' ', '(']).next() {
        // The value itself is quoted before the message.
        _ if message.starts_with("invalid value") => return (format!("expected {wanted}"), hint),
        Some("string") => "a text",
        Some("integer") => "a number",
        Some("floating") => "a number with a decimal point",
        Some("boolean") => "true or false",
        Some("sequence") => "a list",
        Some("map") => "a table",
        _ => found,
    };
    (format!("expected {wanted}, found {found}"), hint)
}

/// The bytes that the value at a path of keys occupies.
fn value_span(table: &toml::de::DeTable<'_>, path: &[&str]) -> Option<Range<usize>> {
    let (first, rest) = path.split_first()?;
    let (_, value) = table.iter().find(|(key, _)| key.get_ref().as_ref() == *first)?;
    inner_span(value, rest)
}

/// The bytes that the value at a path of keys and places below a value occupies.
fn inner_span(value: &toml::Spanned<toml::de::DeValue<'_>>, path: &[&str]) -> Option<Range<usize>> {
    use toml::de::DeValue;
    match (path.split_first(), value.get_ref()) {
        (None, _) => Some(value.span()),
        (Some(_), DeValue::Table(inner)) => value_span(inner, path),
        (Some((place, rest)), DeValue::Array(elements)) => {
            inner_span(elements.get(place.parse::<usize>().ok()?)?, rest)
        }
        _ => None,
    }
}

/// Line and column, both from 1, of a byte offset.
fn position(text: &str, offset: usize) -> (u32, u32) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line_start = before.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let line = before.iter().filter(|b| **b == b'\n').count() + 1;
    let column = String::from_utf8_lossy(&before[line_start..]).chars().count() + 1;
    (line as u32, column as u32)
}

/// The first line of a piece of the file, cut to a length that fits in a message.
pub fn quote(piece: &str) -> String {
    const LONGEST: usize = 60;
    let first = piece.trim().lines().next().unwrap_or("").trim_end();
    match first.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &first[..end]),
        None => first.into(),
    }
}

/// The rest of the line behind a key's `=`, up to a comment.
fn value_after(text: &str, key_end: usize) -> &str {
    let line = text.get(key_end..).and_then(|rest| rest.lines().next()).unwrap_or("");
    let value = line.split_once('=').map_or("", |(_, value)| value);
    value.split(" #").next().unwrap_or("")
}

/// The key whose value starts at a byte offset.
fn key_before(text: &str, offset: usize) -> &str {
    let before = text.get(..offset).unwrap_or("");
    let Some((left, _)) = before.rsplit_once('=') else { return "" };
    left.trim_end().rsplit([' ', '\t', '\n', '{', ',', '.']).next().unwrap_or("")
}

/// Units that keys end with.
const UNITS: [&str; 20] = [
    "mm", "um", "nm", "cm", "m", "in", "deg", "rad", "e", "dn", "s", "ms", "us", "db", "ev", "lux",
    "percent", "k", "c", "px",
];

/// The hint for an unknown key: the nearest spelling, or the known key of the same quantity in another unit.
fn key_hint(unknown: &str, known: &[&str]) -> Option<String> {
    // One letter too many or too few is a misspelling, not another unit.
    let nearly = |key: &&&str| {
        unknown.len().abs_diff(key.len()) == 1 && (unknown.starts_with(**key) || key.starts_with(unknown))
    };
    if let Some(key) = known.iter().find(nearly) {
        return Some(format!("did you mean `{key}`?"));
    }
    if let Some(key) = begun(unknown, known) {
        return Some(format!("did you mean `{key}`?"));
    }
    // The same quantity in another unit. The last word of `l1_wieght` is no unit, but a misspelling.
    let of_quantity = unknown.rsplit_once('_').and_then(|(quantity, unit)| {
        let other = |key: &&&str| {
            key.rsplit_once('_').is_some_and(|(known, other)| {
                known == quantity
                    && UNITS.contains(&other)
                    && (UNITS.contains(&unit) || nearest(unit, &[other]).is_none())
            })
        };
        Some((unit, *known.iter().find(other)?))
    });
    if let Some((wrong_unit, key)) = of_quantity {
        let unit = key.rsplit('_').next().unwrap_or("");
        return Some(format!("convert from {wrong_unit} to {unit} and write `{key}`"));
    }
    Some(match nearest(unknown, known) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("the keys here are {}", known.join(", ")),
    })
}

/// The shortest known key that begins with the unknown one: it lacks the unit or the last words.
fn begun<'k>(unknown: &str, known: &[&'k str]) -> Option<&'k str> {
    let begins = |word: &&str| word.strip_prefix(unknown).is_some_and(|rest| rest.starts_with('_'));
    known.iter().copied().filter(begins).min_by_key(|word| word.len())
}

/// The known word that an unknown one begins, as `psnr` does `psnr_db`, or misspells: at most half of its letters differ.
pub fn nearest<'k>(unknown: &str, known: &[&'k str]) -> Option<&'k str> {
    if let Some(word) = begun(unknown, known) {
        return Some(word);
    }
    let distance = |word: &&str| strsim::damerau_levenshtein(unknown, word);
    let near = known.iter().copied().min_by_key(distance)?;
    (2 * distance(&near) <= unknown.chars().count()).then_some(near)
}

#[cfg(test)]
mod tests {
    use super::{FileError, key_hint};

    #[test]
    fn an_error_about_a_value_names_its_path_in_plain_words() {
        for (path, message, says, hint) in [
            (
                "psf.grid",
                "invalid type: string \"x\", expected usize",
                "`psf.grid`: expected a number from 0 without a decimal point, found a text",
                Some("write a whole number without quotes, 0 or more"),
            ),
            (
                "run",
                "invalid type: string \"x\", expected struct NewRun",
                "`run`: expected an object, found a text",
                Some("it holds keys: name one of them, `run.KEY`"),
            ),
            (
                "psf",
                "unknown field `gird`, expected one of `grid`, `kind`",
                "`psf.gird`: no such key here",
                Some("did you mean `grid`?"),
            ),
            (
                ".",
                "unknown field `gird`, expected `grid`",
                "`gird`: no such key here",
                Some("did you mean `grid`?"),
            ),
            (
                "psf.kind",
                "unknown variant `wave`, expected `waves` or `rays`",
                "`psf.kind`: \"wave\": this key takes \"waves\" or \"rays\"",
                Some("did you mean \"waves\"?"),
            ),
            (
                "psf.wavelengths_um",
                "invalid length 1, expected an array of length 3",
                "`psf.wavelengths_um`: expected a list of 3 values, found 1",
                Some("write as many values in square brackets, with commas between them"),
            ),
            (
                "trials",
                "invalid value: integer `-1`, expected usize",
                "`trials`: -1: expected a number from 0 without a decimal point",
                Some("write a whole number without quotes, 0 or more"),
            ),
            (
                "values",
                "invalid value: integer `70000`, expected u16",
                "`values`: 70000: must lie between 0 and 65535",
                Some("write a smaller whole number"),
            ),
            (
                "step",
                "invalid value: integer `-129`, expected i8",
                "`step`: -129: must lie between -128 and 127",
                Some("write a larger whole number"),
            ),
            (
                "seed",
                "invalid type: floating point `1e20`, expected u64",
                "`seed`: must lie between 0 and 18446744073709551615",
                Some("write a smaller whole number"),
            ),
            (
                "seed",
                "invalid type: floating point `3.0`, expected u64",
                "`seed`: expected a number from 0 without a decimal point, found a number with a decimal point",
                Some("write a whole number without quotes, 0 or more"),
            ),
        ] {
            let error = FileError::of_value(path, message);
            assert_eq!(error.hint.as_deref(), hint);
            assert_eq!(FileError { hint: None, ..error }.to_string(), says);
        }
    }

    #[test]
    fn a_number_beyond_its_type_gets_the_ends_of_the_type() {
        #[derive(Debug, serde::Deserialize)]
        #[allow(dead_code, reason = "only errors are looked at")]
        struct File {
            seed: Option<u64>,
            values: Option<Vec<u16>>,
        }
        for (text, says) in [
            ("values = [7, 12, 70000]", "must lie between 0 and 65535"),
            ("seed = 99999999999999999999", "must lie between 0 and 9223372036854775807"),
            ("seed = -1", "expected a number from 0 without a decimal point"),
        ] {
            let error = FileError::from_toml(text, &toml::from_str::<File>(text).unwrap_err());
            assert!(error.message == says && error.line == Some(1) && error.hint.is_some(), "{error}");
        }
        // A table of TOML has whole numbers with a sign alone.
        let text = "a = 1\nseed = 18446744073709551615";
        let error = FileError::from_toml(text, &toml::from_str::<toml::Table>(text).unwrap_err());
        assert_eq!((error.message.as_str(), error.line), (super::WHOLE_NUMBERS_OF_TOML, Some(2)));
    }

    #[test]
    fn of_several_wrong_keys_the_first_of_the_text_is_named() {
        #[derive(Debug, Default, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        #[allow(dead_code, reason = "only errors are looked at")]
        struct Part {
            steps: u64,
        }
        #[derive(Debug, Default, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        #[allow(dead_code, reason = "only errors are looked at")]
        struct File {
            name: String,
            spot: Part,
            exposure: Part,
        }
        let wrong = "[exposure]\ntime = 3\n";
        for (above, key) in [
            ("", "time"),
            ("name = \"a\"\n[spot]\nsteps = 1\n", "time"),
            ("name = \"a\"\n[spot]\nstesp = 1\n", "stesp"),
            ("[spot]\nsteps = \"many\"\n", "steps"),
            ("naem = \"a\"\n[spot]\nstesp = 1\n", "naem"),
        ] {
            let error = FileError::read_toml::<File>(&format!("{above}{wrong}")).unwrap_err();
            assert_eq!(error.key, key, "{error}");
        }
        assert_eq!(FileError::read_toml::<File>("[spot]\nsteps = 7\n").unwrap().spot.steps, 7);
    }

    #[test]
    fn a_misspelled_last_word_is_no_unit() {
        let loss = ["l1_weight", "lpips_weight", "ssim_weight"];
        assert_eq!(key_hint("l1_wieght", &loss).unwrap(), "did you mean `l1_weight`?");
        assert_eq!(key_hint("wieght", &["goal", "weight", "weight_mm"]).unwrap(), "did you mean `weight`?");
        assert_eq!(super::nearest("psnr", &["one_minus_lpips", "psnr_db", "ssim"]), Some("psnr_db"));
        assert_eq!(
            key_hint("ssim_scale", &loss).unwrap(),
            "the keys here are l1_weight, lpips_weight, ssim_weight"
        );
        let lens = ["radius_mm", "thickness_mm", "semi_diameter_mm"];
        assert_eq!(key_hint("radius_mn", &lens).unwrap(), "did you mean `radius_mm`?");
        for unit in ["um", "cm", "inch", "furlongs"] {
            let hint = format!("convert from {unit} to mm and write `radius_mm`");
            assert_eq!(key_hint(&format!("radius_{unit}"), &lens).unwrap(), hint);
        }
    }
}
