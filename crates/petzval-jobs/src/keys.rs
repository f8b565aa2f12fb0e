//! Messages for those who make a [`Call`](crate::Call): they name keys, where those for the command name flags.
//!
//! Jobs write their messages for the command. A flag is the key with two hyphens in front, and hyphens in place of underscores.

use std::sync::Arc;

use crate::error::{JobError, Stopped};
use crate::event::{Event, Watcher};

/// Flags whose key has another name, or stands in the call and not in its request.
const OTHERS: [(&str, &str); 3] = [
    ("force", "\"overwrite\": true"),
    ("threads", "`threads` of the call"),
    ("glasses", "`glasses` of the call"),
];

/// A text with the keys of a request in place of flags. Whole commands in backquotes stay.
pub(crate) fn in_keys(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    for (i, part) in text.split('`').enumerate() {
        let is_quoted = i % 2 == 1;
        if i > 0 {
            found.push('`');
        }
        match (is_quoted, part.starts_with("petzval ")) {
            (true, true) => found.push_str(part),
            // The marks of quotation are there already.
            (true, false) => found.push_str(&without_flags(part, "")),
            (false, _) => found.push_str(&without_flags(part, "`")),
        }
    }
    found
}

/// A text with keys in place of flags, each between two marks.
fn without_flags(text: &str, mark: &str) -> String {
    let mut pieces = text.split("--");
    let mut found = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let is_part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let length = piece.find(|c| !is_part(c)).unwrap_or(piece.len());
        let (flag, rest) = piece.split_at(length);
        let is_flag = flag.starts_with(|c: char| c.is_ascii_lowercase())
            && !found.ends_with(|c: char| c.is_alphanumeric() || c == '-');
        match OTHERS.iter().find(|(other, _)| *other == flag) {
            _ if !is_flag => found.push_str(&format!("--{flag}")),
            Some((_, key)) if mark.is_empty() => found.push_str(&key.replace('`', "")),
            Some((_, key)) => found.push_str(key),
            None => found.push_str(&format!("{mark}{}{mark}", flag.replace('-', "_"))),
        }
        found.push_str(if is_flag { without_placeholder(rest) } else { rest });
    }
    found
}

/// What follows a flag, without the word in capitals that stands for its value: `FILE`.
fn without_placeholder(rest: &str) -> &str {
    let after = rest.strip_prefix(' ').unwrap_or(rest);
    let end = after.find(|c: char| !c.is_ascii_uppercase()).unwrap_or(after.len());
    let is_word = after.len() < rest.len() && end > 0 && !after[end..].starts_with(char::is_alphanumeric);
    if is_word { &after[end..] } else { rest }
}

/// An error with keys in place of flags.
pub fn error_in_keys(error: JobError) -> JobError {
    match error {
        JobError::Setting { key, value, message, hint } => {
            JobError::Setting { key, value, message: in_keys(&message), hint: in_keys(&hint) }
        }
        JobError::Input { message, hint, place } => {
            let error = JobError::input(in_keys(&message), in_keys(&hint));
            if let Some(place) = place { error.at_place(*place) } else { error }
        }
        JobError::Failed(message) => JobError::failed(in_keys(&message)),
        JobError::Stopped(stopped) => {
            let message = in_keys(&stopped.message);
            Stopped { message, ..*stopped }.into()
        }
        other @ (JobError::File { .. } | JobError::Panic { .. }) => other,
    }
}

/// Passes events on, with keys in place of flags.
pub(crate) struct InKeys(pub Arc<dyn Watcher>);

impl Watcher for InKeys {
    fn event(&self, event: &Event) {
        match event {
            Event::Warning { kind, text } => {
                self.0.event(&Event::Warning { kind: *kind, text: in_keys(text) });
            }
            Event::Note { text, figures } => {
                self.0.event(&Event::Note { text: in_keys(text), figures: figures.clone() });
            }
            other => self.0.event(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_become_keys_and_commands_stay() {
        for (flags, keys) in [
            ("--force replaces it", "\"overwrite\": true replaces it"),
            ("try a larger --grid, or --pitch-um 2", "try a larger `grid`, or `pitch_um` 2"),
            ("`--white-e` of the sensor", "`white_e` of the sensor"),
            ("`petzval lens focus a --focus best` moves it", "`petzval lens focus a --focus best` moves it"),
            ("a--b -- c, --- and --", "a--b -- c, --- and --"),
            ("no flag", "no flag"),
            ("; --glasses FILE reads a catalogue", "; `glasses` of the call reads a catalogue"),
            ("give `--out DIR`, or --out DIR", "give `out`, or `out`"),
            ("`--threads 2` and --white PSF5", "`threads of the call 2` and `white` PSF5"),
        ] {
            assert_eq!(in_keys(flags), keys);
        }
        let error = JobError::setting("out", "a", "--out is a file", "give --out another name");
        let JobError::Setting { key, message, hint, .. } = error_in_keys(error) else { panic!() };
        assert_eq!(
            (key, message.as_str(), hint.as_str()),
            ("out", "`out` is a file", "give `out` another name")
        );
    }
}
