//! The data of the check: which words are refused, and which findings are excepted, with reasons. They stand in `xtask/words.toml`.

use serde::Deserialize;

use super::Finding;

/// The file of words and exceptions.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    /// Most words of a sentence.
    pub most_words: usize,
    #[serde(default)]
    pub word: Vec<HouseWord>,
    #[serde(default)]
    pub exception: Vec<Exception>,
}

/// Forms of a word, or a phrase, that comments do not use.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HouseWord {
    /// The forms, in lower case. A form of several words is a phrase.
    pub forms: Vec<String>,
    /// Words that make the form a standard phrase if one of them follows in the same sentence.
    #[serde(default)]
    pub unless: Vec<String>,
    /// What to write.
    pub instead: String,
    /// True if names in code may not hold the forms either.
    #[serde(default)]
    pub in_names: bool,
}

/// Findings that are allowed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Exception {
    /// Where: the beginning of the path below the root of the workspace.
    pub path: String,
    /// What the finding must hold; everything if it is left out.
    pub text: Option<String>,
    /// Most findings that it covers.
    pub most: usize,
    /// The day it was written.
    pub date: String,
    /// Why it is allowed.
    pub reason: String,
}

impl List {
    /// Reads the file's text.
    pub fn read(text: &str) -> Result<List, String> {
        let list: List = toml::from_str(text).map_err(|e| e.to_string())?;
        let undated = list.exception.iter().find(|e| e.reason.trim().is_empty() || !is_date(&e.date));
        undated.map_or(Ok(()), |e| Err(format!("the exception of {} needs a reason and a date", e.path)))?;
        Ok(list)
    }

    /// Takes the excepted findings out. Returns one note per exception, and a problem for each that covers nothing or too much.
    pub fn except(&self, findings: &mut Vec<Finding>) -> (Vec<String>, Vec<String>) {
        let (mut notes, mut problems) = (Vec::new(), Vec::new());
        for exception in &self.exception {
            let before = findings.len();
            findings.retain(|finding| !exception.covers(finding));
            let (count, Exception { path, most, date, reason, .. }) = (before - findings.len(), exception);
            if count == 0 {
                problems.push(format!("{path}: the exception of {date} covers nothing; delete it"));
            } else if count > *most {
                problems
                    .push(format!("{path}: {count} findings, {most} are excepted since {date}: {reason}"));
            } else {
                notes.push(format!("{path}: {count} findings excepted since {date}: {reason}"));
            }
        }
        (notes, problems)
    }
}

impl Exception {
    fn covers(&self, finding: &Finding) -> bool {
        let holds = self.text.as_ref().is_none_or(|text| finding.text.contains(text.as_str()));
        finding.path.starts_with(&self.path) && holds
    }
}

/// True for `2026-11-28`.
fn is_date(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let lengths: Vec<usize> = parts.iter().map(|part| part.len()).collect();
    lengths == [4, 2, 2] && parts.concat().bytes().all(|c| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exceptions_say_how_much_they_cover() {
        let list = |most: usize, text: &str| {
            List::read(&format!(
                "most_words = 40\n[[exception]]\npath = \"crates/a\"\ntext = \"{text}\"\nmost = {most}\ndate = \"2026-11-28\"\nreason = \"r\""
            ))
            .unwrap()
        };
        let all = || -> Vec<Finding> {
            let of = |path: &str, text: &str| Finding {
                path: path.into(),
                line: 1,
                text: text.into(),
                what: String::new(),
            };
            vec![
                of("crates/a/x.rs", "ask one"),
                of("crates/a/y.rs", "ask two"),
                of("crates/b/x.rs", "ask three"),
            ]
        };
        let mut findings = all();
        let (notes, problems) = list(2, "ask").except(&mut findings);
        assert_eq!((notes.len(), problems.len(), findings.len()), (1, 0, 1));
        assert!(notes[0].contains("2 findings excepted since 2026-11-28: r"), "{notes:?}");
        let (notes, problems) = list(1, "ask").except(&mut all());
        assert_eq!((notes.len(), problems.len()), (0, 1));
        let (_, problems) = list(1, "nothing").except(&mut all());
        assert!(problems[0].contains("covers nothing"), "{problems:?}");
    }

    #[test]
    fn exceptions_need_a_reason_and_a_date() {
        let read = |date: &str, reason: &str| {
            let text = format!(
                "most_words = 40\n[[exception]]\npath = \"a\"\nmost = 1\ndate = \"{date}\"\nreason = \"{reason}\""
            );
            List::read(&text).is_ok()
        };
        assert!(read("2026-11-28", "why") && !read("soon", "why") && !read("2026-11-28", " "));
    }
}
