//! Every block of `sh`, `toml` and `python` of README and book runs, or says why it cannot.
//!
//! The blocks of a page run one after the other in a folder of their own. What its first line may say:
//!
//! - ```` ```sh short=--steps 2 ````: these options are given to each command of the block that has them, in place of its own, so that it is done in
//!   seconds. `short=tiny` stands for the numbers of the smallest experiment. With `PETZVAL_WHOLE_BOOK=1`, as in `cargo xtask full`, nothing is shortened.
//! - ```` ```python short=STEPS = 1 ````: this line takes the place of the one that sets the same names.
//! - ```` ```toml file=mine.toml ````: the block is also written as a file, for later blocks; a program is only written.
//! - ```` ```sh skip=cluster ````: the block cannot run, for one of [`fence::REASONS`].
//!
//! Blocks of Python are run by the tests of the Python package, by the same rules (`crates/petzval-python/tests/book.py`).

mod fence;
mod links;
mod toml_kind;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use fence::{Block, blocks};

use crate::common::{data, read, snapshot, tiny_settings};

/// Longest time of a block. Nothing is measured by it: a block that waits for something that never comes must not hang.
const LONGEST: Duration = Duration::from_secs(if cfg!(debug_assertions) { 1800 } else { 900 });

/// Files that a page may name as its reader's own, and what they are here.
const STAND_INS: &[(&str, &str)] = &[
    ("my-lens.zmx", "crates/petzval/tests/lenses/double-gauss.zmx"),
    ("double-gauss.zmx", "crates/petzval/tests/lenses/double-gauss.zmx"),
    ("photo.png", "crates/petzval-data/data/photos/astronaut.png"),
];

/// Folders of pictures that a page may name as its reader's own.
const PICTURE_FOLDERS: &[&str] = &["my-pictures", "my-photos", "photos"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the workspace")
}

/// README, and the pages of the book, by their path.
fn pages() -> Vec<(String, String)> {
    let root = root();
    let book = root.join("book/src");
    let of_book = snapshot(&book).into_keys().filter(|path| path.extension().is_some_and(|end| end == "md"));
    let all = [root.join("README.md"), root.join("CONTRIBUTING.md")].into_iter().chain(of_book);
    let name =
        |path: &Path| path.strip_prefix(&root).expect("below the root").to_string_lossy().replace('\\', "/");
    all.map(|path| (name(&path), read(&path))).collect()
}

/// Runs the pages of some folders; all problems in one message, each with page and line.
fn run_pages(is_here: impl Fn(&str) -> bool) {
    let mut problems = Vec::new();
    for (name, text) in pages() {
        if is_here(&name) {
            let found = blocks(&text).unwrap_or_else(|problem| {
                problems.push(format!("{name}, {problem}"));
                Vec::new()
            });
            run_page(&name, &found, &mut problems);
        }
    }
    assert!(problems.is_empty(), "{} blocks fail:\n\n{}", problems.len(), problems.join("\n\n"));
}

fn run_page(name: &str, found: &[Block], problems: &mut Vec<String>) {
    if !found.iter().any(|block| ["sh", "toml"].contains(&block.language.as_str())) {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    prepare(folder.path());
    for block in found {
        let started = Instant::now();
        let result = run_block(block, folder.path());
        if block.language == "sh" && block.skip.is_none() {
            println!("{:7.2} s  {name}:{}", started.elapsed().as_secs_f64(), block.line);
        }
        if let Err(what) = result {
            problems.push(format!("{name}:{}: {what}\n{}", block.line, block.text));
        }
    }
}

/// What a page finds in its folder: the examples of the book, the library as `data`, and the files that stand for the reader's own.
fn prepare(folder: &Path) {
    let root = root();
    let examples = root.join("book/src/examples");
    for (path, contents) in snapshot(&examples).into_iter().filter(|(path, _)| path.is_file()) {
        std::fs::write(folder.join(path.file_name().expect("a name")), contents).expect("a copy");
    }
    for (name, from) in STAND_INS {
        let from = from.strip_prefix("data/").map_or_else(|| root.join(from), data);
        std::fs::copy(from, folder.join(name)).expect("a copy");
    }
    for name in PICTURE_FOLDERS {
        std::fs::create_dir(folder.join(name)).expect("a folder");
        for picture in ["astronaut.png", "chelsea.png", "china.png", "coffee.png"] {
            std::fs::copy(data("photos").join(picture), folder.join(name).join(picture)).expect("a copy");
        }
    }
    #[cfg(unix)]
    std::os::unix::fs::symlink(data("."), folder.join("data")).expect("a link");
}

fn run_block(block: &Block, folder: &Path) -> Result<(), String> {
    if let Some(file) = &block.file {
        let path = folder.join(file);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, &block.text).map_err(|error| error.to_string())?;
    }
    match block.language.as_str() {
        _ if block.skip.is_some() => Ok(()),
        "toml" => toml_kind::check(&block.text, folder),
        "sh" if block.file.is_none() && cfg!(unix) => shell(block, folder),
        _ => Ok(()),
    }
}

/// Runs commands in the shell. `petzval` is this program; `cargo run --release --` is, too.
fn shell(block: &Block, folder: &Path) -> Result<(), String> {
    let programs = tempfile::tempdir().expect("a folder");
    for (name, script) in [("petzval", PETZVAL), ("cargo", CARGO)] {
        let path = programs.path().join(name);
        std::fs::write(&path, script).expect("a script");
        #[cfg(unix)]
        std::fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(0o755))
            .expect("a program");
    }
    let is_whole = std::env::var_os("PETZVAL_WHOLE_BOOK").is_some();
    let short: Vec<String> = if is_whole { Vec::new() } else { block.short.clone() };
    let tiny = tiny_settings()
        .iter()
        .map(|(key, value)| format!("--set {key}={value}"))
        .collect::<Vec<_>>()
        .join(" ");
    let path = std::env::var("PATH").unwrap_or_default();
    let output = std::fs::File::create(programs.path().join("output")).expect("a file");
    let mut child = Command::new("sh")
        .args(["-e", "-c", &block.text])
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", programs.path().display()))
        .env("PETZVAL_PROGRAM", env!("CARGO_BIN_EXE_petzval"))
        .env("PETZVAL_SHORT", short.join(" "))
        .env("PETZVAL_TINY", tiny)
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .stdout(output.try_clone().expect("a file"))
        .stderr(output)
        .spawn()
        .expect("a shell");
    let started = Instant::now();
    let status = loop {
        match child.try_wait().expect("a child") {
            Some(status) => break status,
            None if started.elapsed() > LONGEST => {
                child.kill().ok();
                child.wait().ok();
                return Err(format!("is not done after {} s", LONGEST.as_secs()));
            }
            None => std::thread::sleep(Duration::from_millis(10)),
        }
    };
    let said = read(&programs.path().join("output"));
    let last: Vec<&str> = said.lines().rev().take(12).collect();
    let last = last.into_iter().rev().collect::<Vec<_>>().join("\n");
    if status.success() && !said.contains("panicked") { Ok(()) } else { Err(format!("{status}\n{last}")) }
}

/// The program, with each option of `PETZVAL_SHORT` that its verb has in place of its own.
const PETZVAL: &str = include_str!("petzval.sh");

/// The commands of cargo that a page may show: the program, and its tests, of which this is one.
const CARGO: &str = r#"#!/bin/sh
case "$1" in
    run) while [ "$1" != -- ]; do shift; done; shift; exec petzval "$@" ;;
    test) exit 0 ;;
    *) echo "cargo $*: give the block skip=build" >&2; exit 127 ;;
esac
"#;

#[test]
fn the_blocks_of_readme_and_start_run() {
    run_pages(|page| !page.starts_with("book/") || page.starts_with("book/src/start/"));
}

#[test]
fn the_blocks_of_how_to_run() {
    run_pages(|page| page.starts_with("book/src/how-to/") && page < "book/src/how-to/n");
}

#[test]
fn the_other_blocks_of_how_to_run() {
    run_pages(|page| page.starts_with("book/src/how-to/") && page >= "book/src/how-to/n");
}

#[test]
fn the_blocks_of_the_light_path_run() {
    run_pages(|page| page.starts_with("book/src/light-path/"));
}

#[test]
fn the_other_blocks_of_the_book_run() {
    let folders = ["start/", "how-to/", "light-path/"].map(|folder| format!("book/src/{folder}"));
    run_pages(|page| page.starts_with("book/") && !folders.iter().any(|folder| page.starts_with(folder)));
}
