//! Texts of the program as Markdown.

use std::fmt::Write as _;

/// A table: its head, then its rows. Empty columns are left out.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let used: Vec<usize> = (0..head.len()).filter(|&c| rows.iter().any(|row| !row[c].is_empty())).collect();
    let line = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    let mut out = line(used.iter().map(|&c| head[c]).collect());
    out += &format!("|{}\n", "---|".repeat(used.len()));
    for row in rows {
        out += &line(used.iter().map(|&c| row[c].as_str()).collect());
    }
    out
}

/// A text as one paragraph: links of Rust's documentation become plain words, signs of Markdown and HTML stay what they are.
pub fn prose(text: &str) -> String {
    let one_line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut out = String::new();
    let mut in_code = false;
    for c in unlinked(&one_line).chars() {
        in_code ^= c == '`';
        match c {
            '|' => out += "\\|",
            '<' if !in_code => out += "&lt;",
            '*' | '_' | '[' | ']' | '~' if !in_code => write!(out, "\\{c}").unwrap(),
            c => out.push(c),
        }
    }
    out
}

/// A text without the targets of its links, ``[`Name`](crate::Name)`` and ``[`Name`]``; brackets that are no links stay.
fn unlinked(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find('[') {
        let Some(length) = rest[start..].find(']') else { break };
        let (inner, after) = (&rest[start + 1..start + length], &rest[start + length + 1..]);
        let target = after.strip_prefix('(').and_then(|after| after.find(')'));
        let is_link = target.is_some() || (inner.starts_with('`') && inner.ends_with('`') && inner.len() > 2);
        out += &rest[..start];
        if is_link {
            // The name alone: `Families::First` is `First`.
            let name = inner.trim_matches('`').rsplit("::").next().unwrap_or(inner);
            out += &if inner.starts_with('`') { format!("`{name}`") } else { inner.to_owned() };
            rest = target.map_or(after, |end| &after[end + 2..]);
        } else {
            out += &rest[start..start + 1];
            rest = &rest[start + 1..];
        }
    }
    out + rest
}

/// Words as code.
pub fn code(text: &str) -> String {
    format!("`{}`", text.replace('|', "\\|"))
}

/// A sentence that ends with a full stop.
pub fn sentence(text: &str) -> String {
    let text = prose(text);
    if text.is_empty() || text.ends_with(['.', '!', '?', ':']) { text } else { text + "." }
}

/// Paragraphs; those whose lines are indented are shown as they are.
pub fn paragraphs(text: &str) -> String {
    let mut out = String::new();
    for paragraph in text.split("\n\n").filter(|paragraph| !paragraph.trim().is_empty()) {
        let lines: Vec<&str> = paragraph.lines().filter(|line| !line.trim().is_empty()).collect();
        if lines.iter().all(|line| line.starts_with("  ")) {
            out += &format!(
                "```text\n{}\n```\n\n",
                lines.iter().map(|line| &line[2..]).collect::<Vec<_>>().join("\n")
            );
        } else {
            out += &format!("{}\n\n", prose(paragraph));
        }
    }
    out
}

#[test]
fn links_of_the_sources_become_words() {
    assert_eq!(
        prose("The [square root](Stabiliser) of [`Light::Sum`], a|b in [0, 1]"),
        "The square root of `Sum`, a\\|b in \\[0, 1\\]"
    );
    assert_eq!(prose("a <NAME> and `<NAME>`\n  goes on"), "a &lt;NAME> and `<NAME>` goes on");
}
