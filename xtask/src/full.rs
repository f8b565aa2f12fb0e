//! `cargo xtask full`: what continuous integration has no time for. Every part is a command of its own; all of them run, and the last lines say how
//! each ended.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Damaged files of each kind that readers are fed.
const MUTATIONS: &str = "200000";

/// A part: its name, and the words of its command behind `cargo`.
struct Part {
    name: String,
    words: Vec<String>,
    mutations: bool,
}

/// Runs every part. The report has a line for each; it is an error if one fails.
pub fn check() -> Result<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let parts = parts(&root).map_err(|problem| vec![problem])?;
    let (mut lines, mut failed) = (Vec::new(), 0);
    for part in &parts {
        println!("== {}", part.name);
        let started = Instant::now();
        let mut command = Command::new(env!("CARGO"));
        command.args(&part.words).current_dir(&root);
        if part.mutations {
            command.env("PETZVAL_MUTATIONS", MUTATIONS);
        }
        let passed = command.status().is_ok_and(|status| status.success());
        failed += usize::from(!passed);
        let ended = if passed { "passed" } else { "FAILED" };
        lines.push(format!("{ended} {:6.0} s  {}", started.elapsed().as_secs_f64(), part.name));
    }
    lines.push(format!("{} passed, {failed} failed", parts.len() - failed));
    if failed == 0 { Ok(lines.join("\n")) } else { Err(lines) }
}

fn parts(root: &Path) -> Result<Vec<Part>, String> {
    let part = |name: String, words: &[&str], mutations| Part {
        name,
        words: words.iter().map(|word| (*word).to_owned()).collect(),
        mutations,
    };
    let test = ["test", "--release", "--workspace", "--no-fail-fast", "--"];
    let mut all = vec![
        part("widths of the fixed-point ISP, with overflow checks".to_owned(), &["widths"], false),
        part(
            format!("readers of files, {MUTATIONS} damaged files of each kind"),
            &[&test[..], &["damaged", "mutat"]].concat(),
            true,
        ),
        part(
            "tests that continuous integration leaves out".to_owned(),
            &[&test[..], &["--ignored"]].concat(),
            false,
        ),
        part("the Python package, with PyTorch".to_owned(), &["xtask", "python", "--torch"], false),
    ];
    for experiment in experiments(root)? {
        let check = ["run", "--release", "--quiet", "--", "design", "--check", &experiment];
        all.push(part(format!("the built-in experiment {experiment} can begin"), &check, false));
    }
    Ok(all)
}

/// The names of the built-in experiments.
fn experiments(root: &Path) -> Result<Vec<String>, String> {
    let folder = root.join("data/experiments");
    let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| e.to_string())?.path();
        if path.extension().is_some_and(|ending| ending == "toml")
            && let Some(stem) = path.file_stem()
        {
            names.push(stem.to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_experiment_is_a_part() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let parts = parts(&root).unwrap();
        let has = |words: &str| parts.iter().any(|part| part.words.join(" ").contains(words));
        assert!(has("design --check cooke-triplet-image-quality") && has("widths"));
        assert!(parts.len() > 20 && parts.iter().any(|part| part.mutations));
    }
}
