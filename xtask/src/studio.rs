//! `cargo xtask studio`: the page of the studio as its sources make it. It is built anew and compared with the files that are committed, so that no
//! user of cargo needs node; then the studio is tested in a browser. With `--page`, the page alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::ended::Ended;

/// Most bytes of the page, as its files stand.
const MOST_BYTES: u64 = 500_000;

/// Checks the page, and tests it. Without node or a browser it is not run, and the report says so.
pub fn check(page_alone: bool) -> Result<Ended, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    run(&root, page_alone, &answers).map_err(|problem| vec![problem])
}

/// Runs it as a part of `cargo xtask full`. `answers` says whether a program can be run.
pub fn run(root: &Path, page_alone: bool, answers: &dyn Fn(&str) -> bool) -> Result<Ended, String> {
    if !answers("npm") || !node_is_new() {
        return Ok(Ended::NotRun(format!("there is no npm here with node {OLDEST_NODE} or newer")));
    }
    if !page_alone && !answers("chromium") {
        let page = run(root, true, answers)?;
        return Ok(Ended::NotRun(format!("there is no chromium here for the studio in a browser; {page}")));
    }
    let page = root.join("crates/petzval-studio/page");
    let npm = |words: &[&str]| succeeds(Command::new("npm").args(words).current_dir(&page));
    if let Err(problem) = npm(&["install", "--no-audit", "--no-fund"]) {
        return Ok(Ended::NotRun(format!("npm installs nothing here: {problem}")));
    }
    npm(&["run", "--silent", "check"])?;
    let out = target(root).join("studio-page");
    npm(&["run", "--silent", "build", "--", "--emptyOutDir", "--outDir", &out.display().to_string()])?;
    let (made, kept) = (files(&out)?, files(&page.join("dist"))?);
    if made != kept {
        let names = |files: &BTreeMap<PathBuf, Vec<u8>>| format!("{:?}", files.keys().collect::<Vec<_>>());
        return Err(format!(
            "page/dist is not what its sources make: {} are committed, and {} are made; run `npm run build` in crates/petzval-studio/page",
            names(&kept),
            names(&made)
        ));
    }
    let bytes: u64 = kept.values().map(|bytes| bytes.len() as u64).sum();
    if bytes > MOST_BYTES {
        return Err(format!("the page has {bytes} bytes, more than {MOST_BYTES}"));
    }
    if page_alone {
        return Ok(Ended::Passed(format!("the page of the studio is what its sources make: {bytes} bytes")));
    }
    let build = ["build", "--release", "--bin", "petzval"];
    succeeds(Command::new(env!("CARGO")).args(build).current_dir(root))?;
    let mut test = Command::new("npm");
    test.args(["run", "--silent", "test"])
        .current_dir(&page)
        .env("PETZVAL", target(root).join("release/petzval"));
    succeeds(&mut test)?;
    Ok(Ended::Passed(format!(
        "the page of the studio ({bytes} bytes) is what its sources make, and passes its tests in a browser"
    )))
}

/// The oldest node that the tools of the page take.
const OLDEST_NODE: u32 = 20;

/// Whether node is new enough: it says `v20.20.2`.
fn node_is_new() -> bool {
    let said = Command::new("node").arg("--version").output().ok();
    let text = said.and_then(|output| String::from_utf8(output.stdout).ok());
    let major = text.and_then(|text| text.trim().strip_prefix('v')?.split('.').next()?.parse::<u32>().ok());
    major.is_some_and(|major| major >= OLDEST_NODE)
}

/// Where cargo puts what it builds.
fn target(root: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from)
}

/// Whether a program can be run.
pub fn answers(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

fn succeeds(command: &mut Command) -> Result<(), String> {
    let status = command.status().map_err(|e| format!("{command:?}: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?}: {status}")) }
}

/// Every file below a folder, by its path in it.
fn files(folder: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>, String> {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(next) = open.pop() {
        let entries = std::fs::read_dir(&next).map_err(|e| format!("{}: {e}", next.display()))?;
        for entry in entries {
            let path = entry.map_err(|e| e.to_string())?.path();
            if path.is_dir() {
                open.push(path);
            } else if let Ok(below) = path.strip_prefix(folder) {
                let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
                found.insert(below.to_path_buf(), bytes);
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_its_programs_the_studio_has_not_passed() {
        let ended = run(Path::new("/nowhere"), false, &|_| false).unwrap();
        assert!(matches!(&ended, Ended::NotRun(why) if why.contains("npm")), "{ended}");
    }
}
