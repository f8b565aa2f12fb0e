//! Splits the text of a file into commands: words on lines, with quotes, comments and continuations.

use std::collections::VecDeque;

use crate::decimal::shifted;
use crate::draft::{MOST_VALUES, Record, line_end};
use petzval_base::FileError;

/// Longest command with its continuations, characters.
const LONGEST: usize = 64 << 10;

/// A word of a command.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word {
    pub text: String,
    /// Whether it was in quotes.
    pub quoted: bool,
}

/// A command with its values.
#[derive(Clone, Debug)]
pub(super) struct Command {
    /// Its line.
    pub record: Record,
    /// Its name in upper case. Names are distinguished by three letters; longer forms are cut to three.
    pub name: String,
    /// The whole name in upper case, for private glasses.
    pub full: String,
    /// Whether the name was in quotes, like the name of a glass.
    pub quoted: bool,
    /// The values.
    pub words: Vec<Word>,
    /// Whether it is the first position of a zoomed command, which overrides an earlier command of its name.
    pub zoomed: bool,
}

impl Command {
    fn new(line: u32, text: &str) -> Option<Self> {
        Self::of_words(Record::new(line, text.trim()), split_words(text))
    }

    /// The command that words make; `None` without words.
    fn of_words(record: Record, mut words: Vec<Word>) -> Option<Self> {
        if words.is_empty() {
            return None;
        }
        let first = words.remove(0);
        let upper = first.text.to_uppercase();
        let name = if first.quoted || !upper.bytes().all(|b| b.is_ascii_alphabetic()) {
            upper.clone()
        } else {
            upper.chars().take(3).collect()
        };
        Some(Self { record, name, full: upper, quoted: first.quoted, words, zoomed: false })
    }

    /// The first position of a zoomed command, `ZOO name [surface] [qualifiers] value value ...`: its name with surface, qualifiers and first value.
    /// `None` if one of these is missing.
    pub fn first_position(&self) -> Option<Self> {
        let name = self.word(0)?.to_uppercase();
        let is_surface = |word: &Word| !word.quoted && surface_name(&word.text.to_uppercase()).is_some();
        let qualified = 1 + usize::from(self.words.get(1).is_some_and(is_surface));
        // The values of a glass may be codes, which look like numbers. Other values are numbers, or words without qualifiers.
        let is_number = |word: &Word| !word.quoted && word.text.parse::<f64>().is_ok();
        let number =
            self.words.iter().skip(qualified).position(is_number).filter(|_| !name.starts_with("GLA"));
        let words = self.words.get(..=qualified + number.unwrap_or(0))?;
        Self::of_words(self.record.clone(), words.to_vec()).map(|command| Self { zoomed: true, ..command })
    }

    pub fn error(&self, message: impl Into<String>) -> FileError {
        self.record.error(message)
    }

    /// The text of value `index`.
    pub fn word(&self, index: usize) -> Option<&str> {
        self.words.get(index).map(|word| word.text.as_str())
    }

    /// Value `index` as a finite number. Fails if it is missing.
    pub fn number(&self, index: usize) -> Result<f64, FileError> {
        match self.words.get(index) {
            Some(word) => self.parse(word),
            None => Err(self.error(format!("value {} is missing", index + 1))),
        }
    }

    /// The only value, as a finite number.
    pub fn only_number(&self) -> Result<f64, FileError> {
        match self.words.len() {
            0 | 1 => self.number(0),
            count => Err(self.error(format!("one value is read, but there are {count}"))),
        }
    }

    /// Whether a command that switches something on does so: alone or with `Y` or `YES` it does, with `N` or `NO` it does not. Fails with any other
    /// word.
    pub fn says_yes(&self) -> Result<bool, FileError> {
        let is =
            |names: [&str; 2], word: &Word| names.iter().any(|name| word.text.eq_ignore_ascii_case(name));
        match &self.words[..] {
            [] => Ok(true),
            [yes] if is(["Y", "YES"], yes) => Ok(true),
            [no] if is(["N", "NO"], no) => Ok(false),
            _ => {
                let error = self.error(format!("{} says yes or no", self.full));
                Err(error.hint(format!("write {0} Y or {0} N", self.full)))
            }
        }
    }

    /// All values as finite numbers. Fails if there are more than `most`.
    pub fn numbers(&self, most: usize) -> Result<Vec<f64>, FileError> {
        if self.words.len() > most {
            return Err(self.error(format!("more than {most} values are not read")));
        }
        self.words.iter().map(|word| self.parse(word)).collect()
    }

    /// A list of numbers times ten to a power; or, after `F2` or `W2`, the `earlier` list with another number 2, filled up with `missing`.
    ///
    /// Fails if a value is no finite number, if there are too many, or if a zoomed value leaves open which number of several it is.
    pub fn list(&self, earlier: &[f64], missing: f64, power: i32) -> Result<Vec<f64>, FileError> {
        let scaled = |word: &Word| {
            self.parse(word)?;
            let error = || self.error(format!("`{}` is not a finite number", word.text));
            shifted(&word.text, power).ok_or_else(error)
        };
        let named = self.words.first().filter(|word| !word.quoted).map(|word| word.text.to_uppercase());
        let number = named.as_deref().and_then(|word| word.strip_prefix(['F', 'W'])?.parse::<usize>().ok());
        let Some(number) = number else {
            if self.zoomed && earlier.len() > 1 {
                let error = self.error(format!("this is one value for {} numbers", earlier.len()));
                return Err(error.hint("name the field or the wavelength, as F2 or W2"));
            }
            self.numbers(MOST_VALUES)?;
            return self.words.iter().map(scaled).collect();
        };
        let [_, word] = &self.words[..] else {
            return Err(self.error("one value follows the number of a field or wavelength"));
        };
        if !(1..=MOST_VALUES).contains(&number) {
            return Err(self.error(format!("fields and wavelengths are numbered from 1 to {MOST_VALUES}")));
        }
        let mut list = earlier.to_vec();
        list.resize(list.len().max(number), missing);
        list[number - 1] = scaled(word)?;
        Ok(list)
    }

    fn parse(&self, word: &Word) -> Result<f64, FileError> {
        match word.text.parse::<f64>() {
            Ok(value) if value.is_finite() && !word.quoted => Ok(value),
            _ => Err(self.error(format!("`{}` is not a finite number", word.text))),
        }
    }
}

/// The text after the `S` of a word that names surfaces: object, image, stop, all, a number, a label, or a range of these.
/// `None` for other words, such as the glass SF5.
pub(super) fn surface_name(word: &str) -> Option<&str> {
    let of = word.strip_prefix('S')?;
    let one = |name: &str| {
        matches!(name, "O" | "I" | "S" | "A") || name.bytes().all(|b| b.is_ascii_digit()) && !name.is_empty()
    };
    let label = of.starts_with(['\'', '"']);
    (label
        || of.split("..").all(|name| one(name.strip_prefix('S').filter(|n| !n.is_empty()).unwrap_or(name))))
    .then_some(of)
}

/// Iterator over the commands of a text.
pub(super) struct Commands<'a> {
    lines: std::iter::Zip<std::str::Split<'a, char>, std::ops::RangeFrom<u32>>,
    waiting: VecDeque<Command>,
}

impl<'a> Commands<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { lines: text.split(line_end(text)).zip(1..), waiting: VecDeque::new() }
    }
}

impl Iterator for Commands<'_> {
    type Item = Result<Command, FileError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.waiting.is_empty() {
            // Join a line with its continuations, then split it at semicolons.
            let (line, number) = self.lines.next()?;
            let mut whole = without_comment(line).trim_end().to_owned();
            while let Some(kept) = whole.strip_suffix('&') {
                whole = kept.to_owned();
                let Some((more, _)) = self.lines.next() else { break };
                whole.push(' ');
                whole.push_str(without_comment(more).trim_end());
                if whole.len() > LONGEST {
                    break;
                }
            }
            if whole.len() > LONGEST {
                let message = format!("a line of more than {LONGEST} characters is not read");
                return Some(Err(FileError::at_line(number, &whole, message)));
            }
            self.waiting.extend(parts(&whole).into_iter().filter_map(|part| Command::new(number, part)));
        }
        self.waiting.pop_front().map(Ok)
    }
}

/// Calls `at` with the position and value of each byte outside quotes, until `at` returns `true`.
fn scan(text: &str, mut at: impl FnMut(usize, u8) -> bool) {
    let mut quote = None;
    for (i, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (None, b'\'' | b'"') => quote = Some(byte),
            (Some(open), _) if open == byte => quote = None,
            (Some(_), _) => {}
            (None, _) => {
                if at(i, byte) {
                    return;
                }
            }
        }
    }
}

/// The part of a line before its comment.
fn without_comment(line: &str) -> &str {
    let mut end = line.len();
    scan(line, |i, byte| {
        if byte == b'!' {
            end = i;
        }
        byte == b'!'
    });
    &line[..end]
}

/// The commands of a line.
fn parts(line: &str) -> Vec<&str> {
    let mut cuts = vec![0];
    scan(line, |i, byte| {
        if byte == b';' {
            cuts.push(i + 1);
        }
        false
    });
    cuts.push(line.len() + 1);
    cuts.windows(2).map(|w| &line[w[0]..w[1] - 1]).collect()
}

/// The words of a command. A quote within a word does not begin a new word.
fn split_words(text: &str) -> Vec<Word> {
    let mut words = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let (text, quoted, after) = match first {
            '\'' | '"' => match rest[1..].split_once(first) {
                Some((inside, after)) => (inside, true, after),
                None => (rest[1..].trim_end(), true, ""),
            },
            _ => {
                let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
                (&rest[..end], false, &rest[end..])
            }
        };
        words.push(Word { text: text.to_owned(), quoted });
        rest = after.trim_start();
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn semicolons_comments_quotes_and_continuations() {
        let text = "rdm;LEN \"a; b ! c\"\nXAN 0.0 & ! more\n  1.0\n\nTITLE 'it''s' ! end\n  A 1; B -2.e-3";
        let all: Vec<Command> = Commands::new(text).map(Result::unwrap).collect();
        let names: Vec<&str> = all.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["RDM", "LEN", "XAN", "TIT", "A", "B"]);
        assert_eq!(all[1].word(0), Some("a; b ! c"));
        assert_eq!(all[2].numbers(9).unwrap(), [0.0, 1.0]);
        assert_eq!((all[2].record.line, all[3].record.line, all[5].record.line), (2, 5, 6));
        assert_eq!(all[5].number(0).unwrap(), -2e-3);
        assert!(all[4].number(1).unwrap_err().to_string().contains("line 6: `A 1`: value 2 is missing"));
    }
}
