//! The sentences of a paragraph, with the words that count.

/// A word of a comment, with its line.
#[derive(Clone, Debug)]
pub(super) struct Word {
    pub text: String,
    pub line: usize,
}

/// Words that end in a full stop and end no sentence.
const ABBREVIATIONS: [&str; 17] = [
    "e.g.", "i.e.", "cf.", "vs.", "approx.", "fig.", "figs.", "eq.", "eqs.", "sec.", "no.", "p.", "pp.",
    "vol.", "ed.", "al.", "resp.",
];

/// A sentence of a paragraph.
#[derive(Debug)]
pub(super) struct Sentence {
    /// The words, code spans as a backquote.
    pub words: Vec<Word>,
}

impl Sentence {
    /// The line it begins on.
    pub fn line(&self) -> usize {
        self.words.first().map_or(0, |word| word.line)
    }

    /// Number of words. Code spans and lone signs do not count.
    pub fn count(&self) -> usize {
        self.words.iter().filter(|word| word.text.contains(char::is_alphanumeric)).count()
    }

    /// The sentence on one line.
    pub fn text(&self) -> String {
        let words: Vec<&str> = self.words.iter().map(|word| word.text.as_str()).collect();
        words.join(" ")
    }
}

/// Splits a paragraph into sentences. Its lines come with their numbers.
///
/// A sentence ends at a full stop, a question mark or an exclamation mark before a space. Colons and semicolons do not end it.
pub(super) fn split(paragraph: &[(usize, String)]) -> Vec<Sentence> {
    let (mut found, mut words) = (Vec::new(), Vec::new());
    for word in words_of(paragraph) {
        let ends = ends_sentence(&word.text);
        words.push(word);
        if ends {
            found.push(Sentence { words: std::mem::take(&mut words) });
        }
    }
    if !words.is_empty() {
        found.push(Sentence { words });
    }
    found
}

fn ends_sentence(word: &str) -> bool {
    let bare = word.trim_end_matches([')', ']', '"', '\'', '*', '_', '»']);
    let is_abbreviation =
        ABBREVIATIONS.contains(&bare.trim_start_matches(['(', '[']).to_lowercase().as_str());
    bare.ends_with(['.', '?', '!']) && !is_abbreviation
}

/// The words of a paragraph. A code span becomes a backquote, a link its text.
fn words_of(paragraph: &[(usize, String)]) -> Vec<Word> {
    let lines: Vec<&str> = paragraph.iter().map(|(_, line)| line.as_str()).collect();
    let plain = without_targets(&without_code(&lines.join("\n")));
    let numbered = plain.split('\n').zip(paragraph);
    let words = numbered.flat_map(|(line, (number, _))| {
        line.split_whitespace().map(|word| Word { text: word.to_owned(), line: *number })
    });
    words.collect()
}

/// Replaces each code span by one backquote. Line ends stay.
fn without_code(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let run = |start: usize| chars[start..].iter().take_while(|c| **c == '`').count();
    let (mut plain, mut i) = (String::new(), 0);
    while i < chars.len() {
        if chars[i] != '`' {
            plain.push(chars[i]);
            i += 1;
            continue;
        }
        // As many backquotes as open the span close it.
        let ticks = run(i);
        let closes = |k: &usize| chars[*k] == '`' && chars[*k - 1] != '`' && run(*k) == ticks;
        plain.push('`');
        let Some(close) = (i + ticks..chars.len()).find(closes) else {
            i += ticks;
            continue;
        };
        plain.extend(chars[i..close].iter().filter(|c| **c == '\n'));
        i = close + ticks;
    }
    plain
}

/// Removes the targets of links: `[text](target)` is `[text]`.
fn without_targets(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some(start) = rest.find("](") {
        let (before, target) = rest.split_at(start + 1);
        plain.push_str(before);
        let Some(end) = target.find(')') else {
            rest = target;
            break;
        };
        plain.extend(target[..end].chars().filter(|c| *c == '\n'));
        rest = &target[end + 1..];
    }
    plain.push_str(rest);
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentences(text: &str) -> Vec<(usize, usize, String)> {
        let lines: Vec<(usize, String)> =
            text.lines().enumerate().map(|(i, line)| (i + 10, line.to_owned())).collect();
        split(&lines).iter().map(|s| (s.line(), s.count(), s.text())).collect()
    }

    fn expect(text: &str, expected: &[(usize, usize, &str)]) {
        let expected: Vec<_> = expected.iter().map(|(line, n, s)| (*line, *n, (*s).to_owned())).collect();
        assert_eq!(sentences(text), expected, "{text}");
    }

    #[test]
    fn full_stops_before_a_space_end_a_sentence() {
        expect(
            "The gain is 1.5 dB. Is it? (It\nis.) Yes",
            &[(10, 5, "The gain is 1.5 dB."), (10, 2, "Is it?"), (10, 2, "(It is.)"), (11, 1, "Yes")],
        );
        expect("Reads lens.toml: one file; two words", &[(10, 6, "Reads lens.toml: one file; two words")]);
        expect("See e.g. Fig. 3 (cf. eq. 2).", &[(10, 7, "See e.g. Fig. 3 (cf. eq. 2).")]);
    }

    #[test]
    fn code_and_targets_of_links_do_not_count() {
        expect("Calls `a. b c`. Then ``d ` e``", &[(10, 1, "Calls `."), (10, 1, "Then `")]);
        expect("Span `over\ntwo lines` here. Next.", &[(10, 2, "Span ` here."), (11, 1, "Next.")]);
        expect("See [the page](https://a.b/c d). End", &[(10, 3, "See [the page]."), (10, 1, "End")]);
        expect("a - b = `c` + 4", &[(10, 3, "a - b = ` + 4")]);
    }
}
