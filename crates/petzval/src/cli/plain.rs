//! Text of others made fit for a terminal: names and values from files and arguments may hold control characters, and be very long.

use std::borrow::Cow;
use std::path::Path;

use crate::base::is_obeyed;

/// Characters of the longest line of a message. Paths are shorter on nearly every system.
const LONGEST_LINE: usize = 1000;

/// Characters of its end that are kept.
const KEPT_END: usize = 100;

/// Text without control characters other than the end of a line and a tab: a name could otherwise move the cursor or change colours. Others,
/// and those that turn the direction of text, are written by their numbers: `\u{1b}`.
pub fn plain(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_control) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        // Ends of lines as Windows writes them.
        let is_half_of_an_end = c == '\r' && rest.peek() == Some(&'\n');
        if is_half_of_an_end {
            continue;
        }
        if is_control(c) {
            out.extend(c.escape_unicode());
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// Plain text on one line: ends of lines and tabs are written as `\n`, `\r` and `\t`.
pub fn line(text: &str) -> Cow<'_, str> {
    if !text.contains(['\n', '\r', '\t']) {
        return plain(text);
    }
    Cow::Owned(plain(&text.replace('\n', "\\n").replace('\r', "\\r").replace('\t', "\\t")).into_owned())
}

/// A path, or a sentence that names one, on one line, whatever its name.
pub fn shown(path: impl AsRef<Path>) -> String {
    line(&path.as_ref().display().to_string()).into_owned()
}

/// JSON without control characters in its texts: they are written as JSON writes them, so that its readers find them again.
pub fn json(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_control) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| if is_control(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    Cow::Owned(text.chars().map(escaped).collect())
}

fn is_control(c: char) -> bool {
    is_obeyed(c) && c != '\n' && c != '\t'
}

/// [`line`] of a message, which says one thing: not longer than needed. A break in it is that of a name or a value.
pub fn message(text: &str) -> String {
    line(&cut(text, LONGEST_LINE, KEPT_END)).into_owned()
}

/// [`plain`] text whose lines are not longer than a message needs.
pub fn messages(text: &str) -> String {
    let lines: Vec<Cow<str>> = text.split('\n').map(|line| cut(line, LONGEST_LINE, KEPT_END)).collect();
    plain(&lines.join("\n")).into_owned()
}

/// A line of at most about `longest` characters: of a longer one the start, and `end` characters of its end.
fn cut(line: &str, longest: usize, end: usize) -> Cow<'_, str> {
    let count = line.chars().count();
    if count <= longest {
        return Cow::Borrowed(line);
    }
    let start = longest - end;
    let byte_at = |character: usize| line.char_indices().nth(character).map_or(line.len(), |(byte, _)| byte);
    let (head, tail) = (&line[..byte_at(start)], &line[byte_at(count - end)..]);
    Cow::Owned(format!("{head} ... ({} characters) ... {tail}", count - longest))
}

/// The part of a line around a character, so that it fits on a screen.
pub fn around(line: &str, character: usize) -> String {
    const BEFORE: usize = 60;
    const AFTER: usize = 60;
    let count = line.chars().count();
    if count <= BEFORE + AFTER {
        return plain(line).into_owned();
    }
    let from = character.saturating_sub(BEFORE).min(count - BEFORE);
    let part: String = line.chars().skip(from).take(BEFORE + AFTER).collect();
    let before = if from > 0 { "... " } else { "" };
    let after = if from + BEFORE + AFTER < count { " ..." } else { "" };
    format!("{before}{}{after}", plain(&part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_not_obeyed() {
        assert_eq!(plain("a\u{1b}[31mb\u{7}"), r"a\u{1b}[31mb\u{7}");
        assert_eq!(plain("gnp\u{202e}.exe\u{9b}2J"), r"gnp\u{202e}.exe\u{9b}2J");
        assert_eq!(plain("one\r\ntwo\tthree\rfour"), "one\ntwo\tthree\\u{d}four");
        assert!(matches!(plain("Gauß, 行人\n"), Cow::Borrowed(_)));
        assert_eq!(line("a\r\nwarning:\tb\u{1b}"), r"a\r\nwarning:\tb\u{1b}");
        assert_eq!(message("none\n.zmx: no such file"), r"none\n.zmx: no such file");
    }

    #[test]
    fn json_keeps_its_values() {
        let value = serde_json::json!({"name": "a\u{1b}\u{9b}b\u{7f}\u{202e}\n"});
        let text = serde_json::to_string_pretty(&value).unwrap();
        let shown = json(&text);
        assert!(shown.contains(r"\u009bb\u007f\u202e\n") && plain(&shown) == shown, "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
    }

    #[test]
    fn long_lines_keep_their_start_and_end() {
        let long = format!("{}ä{}", "a".repeat(3000), "b".repeat(3000));
        let short = messages(&format!("{long}\nnext"));
        assert!(short.starts_with("aaa") && short.ends_with("bbb\nnext"), "{short}");
        assert!(short.contains("(5001 characters)") && short.len() < 1100, "{short}");
        let path = "/x".repeat(400);
        assert_eq!(message(&path), path);
    }

    #[test]
    fn a_part_of_a_line_is_around_its_place() {
        assert_eq!(around("short\u{1b}", 3), r"short\u{1b}");
        let line = format!("{}HERE{}", "ä".repeat(500), "b".repeat(500));
        let part = around(&line, 500);
        assert!(part.contains("HERE") && part.chars().count() < 140, "{part}");
        assert!(part.starts_with("... ä") && part.ends_with("b ..."), "{part}");
        assert!(around(&line, 1004).ends_with('b') && around(&line, 0).starts_with('ä'));
    }
}
