//! The paragraphs of the comments of a source.

use crate::lexer::{Kind, Token};

/// The lines of a paragraph, with their numbers.
pub(super) type Paragraph = Vec<(usize, String)>;

/// The paragraphs of the comments among tokens. Samples of code, tables and rules are left out; an item of a list is a paragraph.
pub(super) fn paragraphs(tokens: &[Token]) -> Vec<Paragraph> {
    let mut found = Vec::new();
    for block in blocks(tokens) {
        split_block(&block, &mut found);
    }
    found.retain(|paragraph: &Paragraph| !paragraph.is_empty());
    found
}

/// Comments of one kind on successive lines, without their slashes.
fn blocks(tokens: &[Token]) -> Vec<Paragraph> {
    let mut found: Vec<(&str, Paragraph)> = Vec::new();
    // A comment behind code is a block of its own.
    let mut last_code_line = 0;
    for token in tokens {
        if token.kind != Kind::Comment {
            last_code_line = token.line;
            continue;
        }
        let (marker, lines) = bare(token);
        let follows = found.last().is_some_and(|(before, lines)| {
            *before == marker && lines.last().is_some_and(|(line, _)| line + 1 == token.line)
        });
        match found.last_mut() {
            Some((_, block)) if follows && last_code_line != token.line => block.extend(lines),
            _ => found.push((marker, lines)),
        }
    }
    found.into_iter().map(|(_, block)| block).collect()
}

/// The marker of a comment and its lines without it.
fn bare(token: &Token) -> (&'static str, Paragraph) {
    if let Some(text) = token.text.strip_prefix("/*") {
        let text = text.trim_start_matches(['*', '!']).trim_end_matches('/').trim_end_matches('*');
        let line =
            |(i, line): (usize, &str)| (token.line + i, line.trim_start_matches([' ', '*']).to_owned());
        return ("/*", text.lines().enumerate().map(line).collect());
    }
    for marker in ["//!", "///", "//"] {
        if let Some(text) = token.text.strip_prefix(marker) {
            return (marker, vec![(token.line, text.to_owned())]);
        }
    }
    ("", Vec::new())
}

/// Splits a block of Markdown into paragraphs.
fn split_block(block: &[(usize, String)], found: &mut Vec<Paragraph>) {
    let mut is_sample = false;
    found.push(Paragraph::new());
    for (number, line) in block {
        let line = line.trim();
        if line.starts_with("```") {
            is_sample = !is_sample;
        }
        let is_left_out = is_sample || line.starts_with("```") || line.starts_with('|');
        if is_left_out || line.is_empty() {
            found.push(Paragraph::new());
            continue;
        }
        let item = item_text(line);
        if item.is_some() {
            found.push(Paragraph::new());
        }
        if let Some(paragraph) = found.last_mut() {
            paragraph.push((*number, item.unwrap_or(line).to_owned()));
        }
        if line.starts_with('#') {
            found.push(Paragraph::new());
        }
    }
}

/// The text of a line that begins an item of a list: `- text`, `* text` or `1. text`.
fn item_text(line: &str) -> Option<&str> {
    let digits = line.chars().take_while(char::is_ascii_digit).count();
    let rest = if digits > 0 { &line[digits..] } else { line };
    let bullets: &[&str] = if digits > 0 { &[". ", ") "] } else { &["- ", "* "] };
    bullets.iter().find_map(|bullet| rest.strip_prefix(*bullet))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lexer::lex;

    fn found(source: &str) -> Vec<Vec<(usize, String)>> {
        paragraphs(&lex(source))
    }

    fn shown(source: &str) -> Vec<String> {
        let join = |p: Paragraph| {
            p.into_iter().map(|(n, line)| format!("{n} {line}")).collect::<Vec<_>>().join(" / ")
        };
        found(source).into_iter().map(join).collect()
    }

    #[test]
    fn lines_of_one_comment_are_one_paragraph() {
        let source = "//! Of the\n//! file.\n//!\n//! Second.\n\n/// Of the\n/// item.\nfn f() {} // behind\n// before\nlet x;";
        let expected = ["1 Of the / 2 file.", "4 Second.", "6 Of the / 7 item.", "8 behind / 9 before"];
        assert_eq!(shown(source), expected);
        // Two comments behind code are two paragraphs.
        assert_eq!(shown("a, // one\nb, // two\n"), ["1 one", "2 two"]);
    }

    #[test]
    fn samples_and_tables_are_left_out_and_items_are_apart() {
        let source = "/// # Title\n/// Text:\n/// - one\n///   more\n/// - two\n/// | a | b |\n/// ```\n/// let a;\n/// ```\n/// End\n/* 1. block\n * text */";
        let expected = ["1 # Title", "2 Text:", "3 one / 4 more", "5 two", "10 End", "11 block / 12 text"];
        assert_eq!(shown(source), expected);
    }
}
