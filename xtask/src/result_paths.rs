//! Paths in results. JSON holds nothing but UTF-8, and serde fails with any other path, once the work is done and its files are written.

use std::path::{Path, PathBuf};

/// Writes any path, with U+FFFD in place of bytes that are no UTF-8.
const ANY_PATH: &str = "petzval_base::lossy_path::serialize";

/// Names of requests: their paths lead to files.
const REQUESTS: [&str; 2] = ["Request", "Start"];

/// Other types whose paths lead to files, with the sources that hold them.
const READ_AGAIN: [(&str, &str); 5] = [
    ("petzval-design/src/run/input_list.rs", "Pictures"),
    ("petzval-jobs/src/call.rs", "Call"),
    ("petzval-jobs/src/detect/finder.rs", "Source"),
    ("petzval-jobs/src/evaluate.rs", "LensTolerances"),
    ("petzval-units/src/store/record.rs", "StoredResult"),
];

/// Fields of types that serde writes, whose paths must be UTF-8 and need not be. A line of the sources has its file and its number from 1.
pub(super) fn find(lines: Vec<(PathBuf, usize, String)>) -> Vec<String> {
    let (mut found, mut attributes, mut open) = (Vec::new(), String::new(), None);
    for (path, number, line) in lines {
        let code = line.trim();
        if code.is_empty() {
            continue;
        }
        // An attribute may go over several lines.
        if code.starts_with("#[") || attributes.matches('[').count() > attributes.matches(']').count() {
            attributes += code;
            continue;
        }
        let indent = &line[..line.len() - line.trim_start().len()];
        if let Some(name) = declared(code) {
            let is_result = attributes.contains("Serialize") && !is_read_again(&path, name);
            open = is_result.then(|| indent.to_owned());
        }
        let takes_any = [ANY_PATH, "serde(skip)"].iter().any(|word| attributes.contains(word));
        if open.is_some() && code.contains("PathBuf") && !takes_any {
            let reason = "a path of a result has #[serde(serialize_with = \"petzval_base::lossy_path::serialize\")]; \
                          a type whose paths are read again stands in xtask/src/result_paths.rs";
            found.push(format!("{}:{number}: {reason}", path.display()));
        }
        if code.ends_with(';') || (code == "}" && open.as_deref() == Some(indent)) {
            open = None;
        }
        attributes.clear();
    }
    found
}

/// The name of the type that a line declares.
fn declared(code: &str) -> Option<&str> {
    let mut words = code.split_whitespace().skip_while(|word| word.starts_with("pub"));
    words.next().filter(|word| ["struct", "enum"].contains(word))?;
    words.next()?.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// Whether the paths of a type lead to files.
fn is_read_again(path: &Path, name: &str) -> bool {
    REQUESTS.contains(&name) || READ_AGAIN.iter().any(|(file, known)| path.ends_with(file) && *known == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines_found(path: &str, text: &str) -> Vec<usize> {
        let lines = text.lines().enumerate().map(|(i, line)| (PathBuf::from(path), i + 1, line.to_owned()));
        let found = find(lines.collect());
        let number = |line: &String| line.strip_prefix(path)?.split(':').nth(1)?.parse::<usize>().ok();
        found.iter().filter_map(number).collect()
    }

    #[test]
    fn a_path_of_a_result_that_must_be_utf_8_is_found() {
        let text = r#"#[derive(Clone, Serialize)]
pub struct Response {
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub one: PathBuf,
    #[serde(
        default,
        serialize_with = "petzval_base::lossy_path::serialize"
    )]
    pub two: PathBuf,
    #[serde(default)]
    pub three: Vec<PathBuf>,
}
#[derive(Serialize)]
pub(crate) struct Four(PathBuf);
#[derive(Deserialize)]
struct Five {
    six: PathBuf,
}
#[derive(Serialize)]
pub enum Start {
    New { out: PathBuf },
}
"#;
        assert_eq!(lines_found("a.rs", text), [11, 14]);
    }

    #[test]
    fn an_exception_is_a_type_of_its_file() {
        let text = "#[derive(Serialize)]\npub struct Call {\n    glasses: Vec<PathBuf>,\n}\n";
        assert_eq!(lines_found("crates/petzval-jobs/src/call.rs", text), [0_usize; 0]);
        assert_eq!(lines_found("crates/petzval-jobs/src/other.rs", text), [3]);
    }
}
