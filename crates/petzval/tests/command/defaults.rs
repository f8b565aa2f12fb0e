//! Defaults of arguments stand in the requests of jobs: the command writes out none.

use std::path::Path;

/// Lines of the sources whose default is written out: a text, a number, or a variant of an enumeration.
fn written_out(folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            written_out(&path, found);
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let key = ["default", "_value"].concat();
        for (at, _) in text.match_indices(&key) {
            let Some((word, value)) = text[at..].split_once('=') else { continue };
            let is_key = word.trim().trim_start_matches(&key).chars().all(|c| "_tsifos".contains(c));
            let value = value.trim_start();
            let is_call = value.split([',', ')']).next().is_some_and(|value| value.contains('('));
            let first = value.chars().next().unwrap_or(' ');
            let is_written = first == '"' || first == '-' || first.is_ascii_digit();
            let is_variant = first.is_ascii_uppercase() && !is_call && value.contains("::");
            if is_key && (is_written || is_variant && !is_constant(value)) {
                found.push(format!("{}: {}", path.display(), value.lines().next().unwrap_or("")));
            }
        }
    }
}

/// Whether a value is a constant, by its capitals.
fn is_constant(value: &str) -> bool {
    let name: String = value.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    name.chars().all(|c| c == '_' || c.is_ascii_uppercase() || c.is_ascii_digit())
}

#[test]
fn no_default_is_written_out_beside_the_arguments() {
    let mut found = Vec::new();
    written_out(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli"), &mut found);
    assert!(found.is_empty(), "take it from the request of the job:\n{}", found.join("\n"));
}
