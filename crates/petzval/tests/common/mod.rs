//! Helpers for the tests of the command: running it, and a tiny experiment.

#![allow(dead_code, reason = "every test program uses a part of this")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

use serde_json::Value;

/// The command in a working directory, with plain output.
pub fn petzval(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_petzval"));
    command.current_dir(folder).env("NO_COLOR", "1").env_remove("RUST_BACKTRACE").stdin(Stdio::null());
    command
}

/// The result of a command.
#[derive(Debug)]
pub struct Outcome {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("no JSON on stdout: {e}\n{self:?}"))
    }

    /// What stderr says, without the line breaks that fit it to a terminal.
    pub fn says(&self, needle: &str) -> bool {
        let plain = |text: &str| text.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        plain(&self.stderr).contains(&plain(needle))
    }
}

/// Runs the command to its end; a panic always fails the test.
pub fn run(folder: &Path, args: &[&str]) -> Outcome {
    outcome(petzval(folder).args(args).output().expect("the command starts"))
}

pub fn outcome(output: Output) -> Outcome {
    let outcome = Outcome {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).expect("stdout is UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("stderr is UTF-8"),
    };
    assert!(!outcome.stderr.contains("panicked"), "{}", outcome.stderr);
    outcome
}

/// Runs the command, which must succeed.
pub fn run_ok(folder: &Path, args: &[&str]) -> Outcome {
    let outcome = run(folder, args);
    assert_eq!(outcome.code, Some(0), "{args:?}\n{}", outcome.stderr);
    outcome
}

/// Runs the command, which must fail with `code`, print all of `needles` on stderr, and not change the folder.
pub fn run_fails(folder: &Path, args: &[&str], code: i32, needles: &[&str]) -> Outcome {
    let before = snapshot(folder);
    let outcome = run(folder, args);
    assert_eq!(outcome.code, Some(code), "{args:?}\n{}", outcome.stderr);
    for needle in needles {
        assert!(outcome.says(needle), "{args:?} does not say {needle:?}:\n{}", outcome.stderr);
    }
    assert!(outcome.stdout.is_empty(), "{args:?} prints on stdout: {}", outcome.stdout);
    assert_same_files(&before, &snapshot(folder));
    outcome
}

/// Every file below a folder with its contents; folders have none.
pub fn snapshot(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let contents = if path.is_dir() { Vec::new() } else { std::fs::read(&path).expect("a file") };
            if path.is_dir() {
                open.push(path.clone());
            }
            found.insert(path, contents);
        }
    }
    found
}

pub fn assert_same_files(before: &BTreeMap<PathBuf, Vec<u8>>, after: &BTreeMap<PathBuf, Vec<u8>>) {
    let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(before), names(after), "files appeared or went away");
    for (path, contents) in before {
        assert!(after[path] == *contents, "{} has changed", path.display());
    }
}

pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a new folder");
    for (path, contents) in snapshot(from) {
        let target = to.join(path.strip_prefix(from).expect("below the folder"));
        if path.is_dir() {
            std::fs::create_dir_all(target).expect("a new folder");
        } else {
            std::fs::create_dir_all(target.parent().expect("a parent")).expect("a new folder");
            std::fs::write(target, contents).expect("a copy");
        }
    }
}

/// A file of the library.
pub fn data(path: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
    root.canonicalize().expect("the library").join(path)
}

pub fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

pub fn read_json(path: &Path) -> Value {
    serde_json::from_str(&read(path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Network steps of each camera in the tiny experiment.
pub const NETWORK_STEPS: usize = 4;
/// Steps of the end-to-end lens.
pub const LENS_STEPS: usize = 3;
/// Stages of the tiny experiment that improve a lens alone; each is one step.
pub const LENS_STAGES: usize = 3;
/// All steps of the tiny experiment: scoring a camera is one.
pub const ALL_STEPS: usize = 3 * (NETWORK_STEPS + 1) + LENS_STAGES + LENS_STEPS;

/// The numbers of the tiny experiment, by key path, as TOML.
pub fn tiny_settings() -> Vec<(&'static str, String)> {
    let settings = [
        ("psf.fields", "3"),
        ("psf.grid", "64"),
        ("psf.kind", "\"geometric\""),
        ("psf.scoring_pupil_error", "2.0"),
        ("psf.scoring_fields", "3"),
        ("psf.scoring_blend_error", "2.0"),
        ("psf.patches", "[2,2]"),
        ("psf.pupil_cells", "16"),
        ("psf.scoring_pupil_cells", "16"),
        ("network.base_channels", "4"),
        ("network.levels", "1"),
        ("training.steps", ""),
        ("training.batch", "1"),
        ("training.crop", "64"),
        ("optics.steps", ""),
        ("spot.iterations", "3"),
        ("scoring.places_per_side", "1"),
        ("scoring.crop", "64"),
        ("checkpoint.every", "3"),
        ("checkpoint.keep", "2"),
    ];
    let value = |key, value: &str| match key {
        "training.steps" => NETWORK_STEPS.to_string(),
        "optics.steps" => LENS_STEPS.to_string(),
        _ => value.to_owned(),
    };
    settings.into_iter().map(|(key, of)| (key, value(key, of))).collect()
}

/// The built-in experiment, made so small that it runs in about a second.
pub fn tiny_experiment() -> String {
    let text = read(&data("experiments/cooke-triplet-image-quality.toml"));
    let mut table: toml::Table = text.parse().expect("the built-in experiment");
    for (key, value) in tiny_settings() {
        let (section, key) = key.split_once('.').expect("a key of a table");
        let value: toml::Table = format!("{key} = {value}").parse().expect("TOML");
        let section = table[section].as_table_mut().expect("a table");
        let old = section.insert(key.to_owned(), value[key].clone());
        assert!(old.is_some(), "the experiment has no key `{key}` any more");
    }
    toml::to_string(&table).expect("a table is TOML")
}

/// Writes the tiny experiment as `tiny.toml`.
pub fn write_tiny(folder: &Path) {
    std::fs::write(folder.join("tiny.toml"), tiny_experiment()).expect("tiny.toml");
}

/// Runs the tiny experiment into `folder/NAME`.
pub fn tiny_run(folder: &Path, name: &str, more: &[&str]) -> PathBuf {
    write_tiny(folder);
    run_ok(folder, &[&["design", "tiny.toml", "--out", name], more].concat());
    folder.join(name)
}

/// The finished tiny experiment as the folder `run`, beside its file. A test program makes it once; every folder gets a copy.
pub fn finished_run(folder: &Path) -> PathBuf {
    static FILES: LazyLock<BTreeMap<PathBuf, Option<Vec<u8>>>> = LazyLock::new(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let run = tiny_run(folder.path(), "run", &[]);
        let below = |path: &Path| path.strip_prefix(folder.path()).expect("below the folder").to_owned();
        let file = |(path, bytes): (PathBuf, Vec<u8>)| (below(&path), path.is_file().then_some(bytes));
        snapshot(&run).into_iter().map(file).collect()
    });
    write_tiny(folder);
    for (path, bytes) in FILES.iter() {
        let path = folder.join(path);
        let parent = if bytes.is_some() { path.parent().expect("a folder") } else { &path };
        std::fs::create_dir_all(parent).expect("a new folder");
        if let Some(bytes) = bytes {
            std::fs::write(&path, bytes).expect("a copy");
        }
    }
    folder.join("run")
}

/// The events of a run, in order.
pub fn events(run: &Path) -> Vec<Value> {
    let path = run.join("events.jsonl");
    let parse = |line: &str| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}"));
    read(&path).lines().map(parse).collect()
}
