//! The page of events and warnings, from their types and from the places where they are written.

use std::collections::BTreeMap;
use std::path::Path;

use petzval::files::coco::{DefectKind, Severity};
use petzval::jobs::Event;

use super::Page;
use super::markdown::{code, prose, sentence, table};
use super::schema_rows::{Schema, as_table};
use crate::common::read;
use crate::common::snapshot;

/// Kinds of events, kinds of warnings with their texts, and defects of data sets.
pub fn pages() -> Vec<Page> {
    let schema = schemars::schema_for!(Event).to_value();
    let mut out = "## Warnings\n\n".to_owned();
    let texts = texts();
    let kinds = schema["$defs"]["WarningKind"]["oneOf"].as_array().expect("kinds");
    let mut rows = Vec::new();
    for kind in kinds {
        let name = kind["const"].as_str().expect("a name");
        rows.push(vec![
            if texts.contains_key(name) { format!("[{}](#{name})", code(name)) } else { code(name) },
            sentence(kind["description"].as_str().unwrap_or_default()),
        ]);
    }
    out += &table(&["kind", "about"], &rows);
    for kind in kinds {
        let name = kind["const"].as_str().expect("a name");
        let Some(texts) = texts.get(name) else { continue };
        out += &format!("\n### {name}\n\n");
        for text in texts {
            out += &format!("- {}\n", prose(text));
        }
    }
    out += "\n## Events\n\n";
    for event in schema["oneOf"].as_array().expect("events") {
        let name = event["properties"]["event"]["const"].as_str().expect("a name");
        out += &format!(
            "**{}**: {}\n\n",
            code(name),
            sentence(event["description"].as_str().unwrap_or_default())
        );
        let one = serde_json::json!({"$defs": schema["$defs"], "properties": event["properties"], "required": event["required"]});
        let keys: Vec<_> = Schema(&one).rows(2).into_iter().filter(|row| row.key != "event").collect();
        out += &as_table(&keys);
        out.push('\n');
    }
    let mut defects = String::new();
    for (severity, title) in [(Severity::Error, "Errors"), (Severity::Warning, "Warnings")] {
        let of = DefectKind::ALL.iter().filter(|kind| kind.severity() == severity);
        let rows: Vec<_> = of.map(|kind| vec![sentence(kind.sentence()), sentence(kind.hint())]).collect();
        defects += &format!("## {title}\n\n{}\n", table(&["defect", "what to do"], &rows));
    }
    let frame = "# Defects of data sets\n\n`petzval data check` names them, and every run with a data set does before its first step.\n";
    vec![
        Page { path: "warnings.md".to_owned(), frame: String::new(), generated: out },
        Page { path: "warnings/data-sets.md".to_owned(), frame: frame.to_owned(), generated: defects },
    ]
}

/// The texts of the warnings of each kind, as the jobs write them: what is filled in stands in braces. A warning whose text another crate writes has none here.
fn texts() -> BTreeMap<String, Vec<String>> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-jobs/src");
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in snapshot(&crates).into_keys().filter(|path| path.extension().is_some_and(|end| end == "rs")) {
        let source = read(&path);
        for (at, kind) in source.match_indices("WarningKind::") {
            let rest = &source[at + kind.len()..];
            let name: String = rest.chars().take_while(char::is_ascii_alphanumeric).collect();
            let Some(text) = literal(&rest[name.len()..]) else { continue };
            if has_words(&text) && !found.get(&kebab(&name)).is_some_and(|texts| texts.contains(&text)) {
                found.entry(kebab(&name)).or_default().push(text);
            }
        }
    }
    found
}

/// The text that follows the kind of a warning, itself or in `format!`.
fn literal(source: &str) -> Option<String> {
    let rest = source.strip_prefix(',')?.trim_start();
    let rest = rest.strip_prefix("format!(").unwrap_or(rest).trim_start();
    let mut text = String::new();
    let mut chars = rest.strip_prefix('"')?.chars();
    while let Some(c) = chars.next() {
        match c {
            '"' => return Some(text),
            '\\' => match chars.next()? {
                '\n' => {
                    let skipped = chars.as_str().len() - chars.as_str().trim_start().len();
                    chars.nth(skipped.checked_sub(1)?);
                }
                'n' => text.push(' '),
                other => text.push(other),
            },
            c => text.push(c),
        }
    }
    None
}

/// Whether a text says something besides what is filled in.
fn has_words(text: &str) -> bool {
    let outside =
        text.split('{').map(|part| part.split_once('}').map_or(part, |(_, after)| after)).collect::<String>();
    outside.split_whitespace().filter(|word| word.chars().any(char::is_alphabetic)).count() > 2
}

fn kebab(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('-');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

#[test]
fn texts_are_found_in_the_sources() {
    assert_eq!(literal(", \"a \\\"b\\\" \\\n    c\")").as_deref(), Some("a \"b\" c"));
    assert_eq!(literal(", format!(\n    \"{x}: of\", y)").as_deref(), Some("{x}: of"));
    assert_eq!(literal(", text)"), None);
    assert!(!has_words("{}: {x}") && has_words("{a}: the pixels are dark"));
    assert_eq!(kebab("LostLight"), "lost-light");
}
