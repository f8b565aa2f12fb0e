//! The layering of the workspace, checked against the manifests and the sources: crates use only those before them, and modules
//! of a crate do not use each other in a circle.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::circles;

/// Crates in the order in which light meets them: each may use only those before it.
const ORDER: [&str; 10] = [
    "petzval-base",
    "petzval-optics",
    "petzval-camera",
    "petzval-files",
    "petzval-lab",
    "petzval-learn",
    "petzval-report",
    "petzval-design",
    "petzval-jobs",
    "petzval",
];

/// Outside crates that only some of ours may use directly, with the reason.
const RESERVED: [(&str, &[&str], &str); 7] = [
    ("burn", &["petzval-camera", "petzval-learn", "petzval-design"], "the tape is cut at the PSF"),
    ("maud", &["petzval-report"], "reports are made in one place"),
    ("clap", &["petzval"], "only the command has a command line"),
    ("miette", &["petzval"], "libraries return typed errors"),
    ("indicatif", &["petzval"], "libraries do not draw"),
    ("include_dir", &["petzval-jobs"], "data travels with the binary"),
    ("signal-hook", &["petzval"], "only the command owns the process"),
];

/// Crates whose circles of modules are still to be cut, with what stands in the way. Each entry goes when its crate has none.
const TO_BE_CUT: [(&str, &str); 2] = [
    ("petzval-report", "to be cut: the input structs of a page move out of the file that assembles it"),
    ("petzval", "to be cut: what all verbs print with moves out of the file that lists them"),
];

/// Words that a crate's sources may not hold, with the reason.
const FORBIDDEN_WORDS: [(&str, &[&str], &str); 5] = [
    (
        "petzval-optics",
        &["std::fs", "File::open", "std::thread"],
        "optics reads no file and starts no thread",
    ),
    ("petzval-camera", &["std::fs", "File::open"], "the camera reads no file"),
    ("petzval-optics", &["println!", "eprintln!"], "libraries do not print"),
    ("petzval-camera", &["println!", "eprintln!"], "libraries do not print"),
    ("petzval-learn", &["println!", "eprintln!"], "libraries do not print"),
];

/// Checks everything; the report on success, all problems otherwise.
pub fn check() -> Result<String, Vec<String>> {
    let metadata = metadata().map_err(|e| vec![e])?;
    let packages = metadata["packages"].as_array().cloned().unwrap_or_default();
    let mut problems = Vec::new();
    let (mut edges, mut open_circles) = (0, 0);
    for package in &packages {
        let name = package["name"].as_str().unwrap_or("");
        let Some(rank) = ORDER.iter().position(|n| *n == name) else {
            if name != "xtask" {
                problems.push(format!("{name} has no place in the order; add it to xtask/src/layers.rs"));
            }
            continue;
        };
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            let used = dependency["name"].as_str().unwrap_or("");
            let for_tests = dependency["kind"].as_str() == Some("dev");
            if let Some(other) = ORDER.iter().position(|n| *n == used) {
                edges += 1;
                // Tests of inner crates may read lens and sensor files.
                let reads_files_for_tests = for_tests && used == "petzval-files";
                if other >= rank && !reads_files_for_tests {
                    problems.push(format!("{name} uses {used}, which comes after it in the light path"));
                }
            }
            for (reserved, allowed, reason) in RESERVED {
                if used == reserved && !for_tests && !allowed.contains(&name) {
                    problems.push(format!("{name} uses {used}: {reason}"));
                }
            }
        }
        let sources = Path::new(package["manifest_path"].as_str().unwrap_or("")).with_file_name("src");
        for (owner, words, reason) in FORBIDDEN_WORDS {
            if owner == name {
                problems.extend(find_words(&sources, words, reason));
            }
        }
        let circles = circles::find(&sources);
        match TO_BE_CUT.iter().find(|(owner, _)| *owner == name) {
            Some(_) if circles.is_empty() => {
                problems.push(format!("{name} has no circle of modules any more; take it off TO_BE_CUT"));
            }
            Some(_) => open_circles += circles.len(),
            None => problems.extend(circles.iter().map(|circle| format!("{name}: {circle}"))),
        }
    }
    if problems.is_empty() {
        Ok(format!(
            "layers: {edges} edges between {} crates, all along the light path; {open_circles} circles of modules to be cut",
            ORDER.len()
        ))
    } else {
        Err(problems)
    }
}

fn metadata() -> Result<Value, String> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--no-deps"])
        .output()
        .map_err(|e| format!("cargo metadata: {e}"))?;
    serde_json::from_slice(&output.stdout).map_err(|e| format!("cargo metadata: {e}"))
}

/// Lines of code (not comments) below a folder that hold a word.
fn find_words(folder: &Path, words: &[&str], reason: &str) -> Vec<String> {
    let mut found = Vec::new();
    for path in rust_files(folder) {
        let text = fs::read_to_string(&path).unwrap_or_default();
        for (number, line) in text.lines().enumerate() {
            let code = line.split("//").next().unwrap_or("");
            if words.iter().any(|w| code.contains(w)) {
                found.push(format!("{}:{}: {reason}", path.display(), number + 1));
            }
        }
    }
    found
}

pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut open) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}
