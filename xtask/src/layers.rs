//! The layering of the workspace, checked against the manifests and the sources: crates use only those before them, and modules
//! of a crate do not use each other in a circle.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::circles;
use super::files::rust_files;
use super::result_paths;

/// Crates in the order in which light meets them. A crate may use those of the groups before its own.
const ORDER: [&[&str]; 11] = [
    &["petzval-base", "petzval-data", "petzval-fourier"],
    &["petzval-optics", "petzval-camera", "petzval-street"],
    &["petzval-files"],
    &["petzval-lab", "petzval-learn"],
    &["petzval-report"],
    &["petzval-design"],
    &["petzval-jobs"],
    &["petzval-units"],
    &["petzval-studio"],
    &["petzval"],
    &["petzval-python"],
];

/// Outside crates that only some of ours may use directly, with the reason.
const RESERVED: [(&str, &[&str], &str); 11] = [
    ("burn", &["petzval-camera", "petzval-learn", "petzval-design"], "the tape is cut at the PSF"),
    (
        "burn-cubecl",
        &["petzval-camera", "petzval-learn"],
        "kernels for devices stand beside those for the CPU",
    ),
    ("maud", &["petzval-report"], "reports are made in one place"),
    ("clap", &["petzval"], "only the command has a command line"),
    ("miette", &["petzval"], "libraries return typed errors"),
    ("indicatif", &["petzval"], "libraries do not draw"),
    ("include_dir", &["petzval-data", "petzval-studio"], "data and the page travel with the binary"),
    ("realfft", &["petzval-fourier"], "transforms are compiled once"),
    ("rustfft", &["petzval-fourier"], "transforms are compiled once"),
    ("pyo3", &["petzval-python"], "one crate talks to Python"),
    ("signal-hook", &["petzval"], "only the command owns the process"),
];

/// Words that a crate's sources may not hold, with the reason.
const FORBIDDEN_WORDS: [(&str, &[&str], &str); 2] = [
    (
        "petzval-optics",
        &["std::fs", "File::open", "std::thread"],
        "optics reads no file and starts no thread",
    ),
    ("petzval-camera", &["std::fs", "File::open"], "the camera reads no file"),
];

/// The command parses arguments, calls a job and prints its response: the libraries behind the jobs, files and threads are not
/// its business.
const BEHIND_THE_JOBS: [&str; 7] = ["optics", "camera", "lab", "learn", "report", "files", "design"];
const NO_JOB_LOGIC: [&str; 6] = ["petzval_", "crate::{", "std::fs", "::File::", "par_iter", "write_whole"];

/// Checks everything; the report on success, all problems otherwise.
pub fn check() -> Result<String, Vec<String>> {
    let metadata = metadata().map_err(|e| vec![e])?;
    let packages = metadata["packages"].as_array().cloned().unwrap_or_default();
    let mut problems = Vec::new();
    let mut edges = 0;
    for package in &packages {
        let name = package["name"].as_str().unwrap_or("");
        let Some(own) = rank(name) else {
            if name != "xtask" {
                problems.push(format!("{name} has no place in the order; add it to xtask/src/layers.rs"));
            }
            continue;
        };
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            let used = dependency["name"].as_str().unwrap_or("");
            let for_tests = dependency["kind"].as_str() == Some("dev");
            if let Some(other) = rank(used) {
                edges += 1;
                // Tests of inner crates may read lens and sensor files.
                let reads_files_for_tests = for_tests && used == "petzval-files";
                if other >= own && !reads_files_for_tests {
                    problems
                        .push(format!("{name} uses {used}, which does not come before it in the light path"));
                }
            }
            for (reserved, allowed, reason) in RESERVED {
                if used == reserved && !for_tests && !allowed.contains(&name) {
                    problems.push(format!("{name} uses {used}: {reason}"));
                }
            }
        }
        let sources = Path::new(package["manifest_path"].as_str().unwrap_or("")).with_file_name("src");
        if name != "petzval" {
            problems.extend(find_words(&sources, &["print!", "println!"], "libraries do not print"));
        }
        for (owner, words, reason) in FORBIDDEN_WORDS {
            if owner == name {
                problems.extend(find_words(&sources, words, reason));
            }
        }
        if name == "petzval" {
            let reason = "the command holds no job logic; it belongs to petzval-jobs";
            let libraries = BEHIND_THE_JOBS.map(|library| format!("crate::{library}"));
            let words: Vec<&str> = libraries.iter().map(String::as_str).chain(NO_JOB_LOGIC).collect();
            problems.extend(find_words(&sources.join("cli"), &words, reason));
            problems.extend(own_prints(&sources));
        }
        if name != "petzval-base" {
            problems.extend(own_reads(&sources));
        }
        // The base holds the attribute itself; Python opens the files that a run names.
        if name != "petzval-base" && name != "petzval-python" {
            problems.extend(result_paths::find(lines_outside_of_tests(&sources)));
        }
        problems.extend(carried_from_outside(&sources));
        let circles = circles::find(&sources);
        problems.extend(circles.iter().map(|circle| format!("{name}: {circle}")));
    }
    if problems.is_empty() {
        Ok(format!(
            "layers: {edges} edges between {} crates, all along the light path; no circles of modules or folders",
            ORDER.concat().len()
        ))
    } else {
        Err(problems)
    }
}

/// The place of a crate's group in the order.
fn rank(name: &str) -> Option<usize> {
    ORDER.iter().position(|group| group.contains(&name))
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

/// Lines of the command that print without its one writer, and so panic where nobody can read.
fn own_prints(sources: &Path) -> Vec<String> {
    let words = ["print!", "println!", "stdout()", "stderr()"];
    let mut found = find_words(sources, &words, "cli/output.rs writes what the command prints");
    // A bar is drawn by its library, which drops what it cannot draw.
    found.retain(|line| !line.contains("/cli/output.rs:") && !line.contains("/cli/watcher.rs:"));
    found
}

/// Lines outside of tests that carry a file of another crate: a published crate holds its own files alone.
fn carried_from_outside(sources: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for (path, number, line) in lines_outside_of_tests(sources) {
        let depth = path.strip_prefix(sources).map_or(0, |inner| inner.components().count());
        let carries = ["include_str!(\"", "include_bytes!(\""].into_iter().any(|word| {
            let ups =
                line.split(word).skip(1).map(|path| path.split('/').take_while(|part| *part == "..").count());
            ups.max().is_some_and(|ups| ups > depth)
        });
        if carries {
            let reason = "carries a file from outside its crate, which a published crate does not hold";
            found.push(format!("{}:{number}: {reason}", path.display()));
        }
    }
    found
}

/// Lines of code, without comments, of the files below a folder that are no tests, each with its file and its number from 1.
fn lines_outside_of_tests(sources: &Path) -> Vec<(PathBuf, usize, String)> {
    let mut lines = Vec::new();
    for path in rust_files(sources).into_iter().filter(|path| !path.to_string_lossy().contains("tests")) {
        let text = fs::read_to_string(&path).unwrap_or_default();
        let code = text.lines().take_while(|line| line.trim() != "#[cfg(test)]").enumerate();
        let code = code.map(|(number, line)| {
            (path.clone(), number + 1, line.split("//").next().unwrap_or("").to_owned())
        });
        lines.extend(code);
    }
    lines
}

/// Lines outside of tests that open a file by themselves. The system's own files below /proc have an end.
fn own_reads(sources: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for (path, number, code) in lines_outside_of_tests(sources) {
        let opens =
            ["fs::read(", "fs::read_to_string(", "File::open("].iter().any(|word| code.contains(word));
        if opens && !code.contains("\"/proc/") {
            let reason = "petzval_base::read_whole, read_text and open_file refuse what has no end";
            found.push(format!("{}:{number}: {reason}", path.display()));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_from_outside_a_crate_are_found() {
        let folder = std::env::temp_dir().join(format!("petzval-layers-{}", std::process::id()));
        fs::create_dir_all(folder.join("src/inner")).unwrap();
        let write = |name: &str, text: &str| fs::write(folder.join("src").join(name), text).unwrap();
        write(
            "lib.rs",
            "const A: &str = include_str!(\"../data/a\");\nconst B: &str = include_str!(\"../../b\");\n",
        );
        write(
            "inner/mod.rs",
            "const A: &str = include_str!(\"../../a\");\n#[cfg(test)]\nconst T: &str = include_str!(\"../../../t\");\n",
        );
        write("inner/bytes.rs", "const A: &[u8] = include_bytes!(\"../../../a\");\n");
        let found = carried_from_outside(&folder.join("src"));
        fs::remove_dir_all(&folder).unwrap();
        let found: Vec<&str> =
            found.iter().filter_map(|line| line.split("src/").nth(1)?.split(": ").next()).collect();
        assert_eq!(found, ["inner/bytes.rs:1", "lib.rs:2"]);
    }
}
