//! `cargo xtask python`: the Python package as its user gets it. pip builds and installs it in an environment of its own, beside the built files;
//! then its types are checked and its tests run. With `--torch`, also those that need PyTorch. `--deeplens` runs the examples that compare a
//! training step with one of DeepLens, and nothing else.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::ended::Ended;

/// The oldest Python that the package takes.
const OLDEST: (u32, u32) = (3, 11);

/// What the tests of the optional parts need. PyTorch takes 5.4 GB from PyPI, which has it for Linux with the libraries of CUDA alone.
const OPTIONAL: [&str; 7] = ["torch", "torchvision", "onnx", "onnxruntime", "onnxscript", "pandas", "xarray"];

/// The only Python that deeplens-core takes.
const OF_DEEPLENS: (u32, u32) = (3, 12);

/// The examples that compare Petzval with DeepLens, with their arguments. The last line of the last one has times and errors of both.
const BESIDE_DEEPLENS: [&[&str]; 3] =
    [&["deeplens_loop.py"], &["deeplens_loop.py", "deeplens"], &["deeplens_side_by_side.py"]];

/// Installs and tests the package. Without a Python that is new enough nothing is tested, and the report says so.
pub fn check(with_torch: bool) -> Result<Ended, Vec<String>> {
    let Some(python) = interpreter() else {
        let (major, minor) = OLDEST;
        return Ok(Ended::NotRun(format!(
            "there is no Python {major}.{minor} or newer with venv and pip here"
        )));
    };
    run(&python, with_torch).map(Ended::Passed).map_err(|problem| vec![problem])
}

fn run(python: &str, with_torch: bool) -> Result<String, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let package = root.join("crates/petzval-python");
    let own = environment(&root, python, "python")?;
    let pip =
        |what: &[&OsStr]| succeeds(Command::new(&own).args(["-m", "pip", "install", "--quiet"]).args(what));
    let mut with_tests = package.clone().into_os_string();
    with_tests.push("[test,examples]");
    pip(&[&with_tests])?;
    if with_torch {
        pip(&OPTIONAL.map(OsStr::new))?;
    }
    let module = |words: &[&str]| succeeds(Command::new(&own).arg("-m").args(words).current_dir(&package));
    module(&["mypy"])?;
    module(&["pytest", "-q", "tests", "--ignore", "tests/torch"])?;
    if with_torch {
        module(&["pytest", "-q", "tests/torch"])?;
        return Ok("the Python package is installed, typed and tested, with PyTorch".to_owned());
    }
    Ok("the Python package is installed, typed and tested; without PyTorch, see `cargo xtask full`"
        .to_owned())
}

/// A Python that has the package and further ones of PyPI, in the environment of [`check`]. None if there is no Python, or PyPI cannot be reached:
/// the text says which.
pub fn with_packages(packages: &[&str]) -> Result<PathBuf, String> {
    let python = interpreter().ok_or("no Python that is new enough, with venv and pip")?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let own = environment(&root, &python, "python")?;
    let pip = ["-m", "pip", "install", "--quiet"];
    succeeds(Command::new(&own).args(pip).args(packages).arg(root.join("crates/petzval-python")))?;
    Ok(own)
}

/// Compares a training step with one of DeepLens, in an environment of its own. The examples fail where PSFs or a gradient of Petzval are off.
/// Without Python 3.12, or where PyPI has no DeepLens for it, nothing is compared.
pub fn beside_deeplens() -> Result<Ended, String> {
    let (major, minor) = OF_DEEPLENS;
    let names = [format!("python{major}.{minor}"), "python3".to_owned(), "python".to_owned()];
    let Some(python) = first_of(&names, &format!("sys.version_info[:2] == {OF_DEEPLENS:?}")) else {
        return Ok(Ended::NotRun(format!(
            "deeplens-core needs Python {major}.{minor}, and there is none with venv and pip here"
        )));
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let own = environment(&root, &python, "python-deeplens")?;
    let pip = |what: &OsStr| succeeds(Command::new(&own).args(["-m", "pip", "install", "--quiet"]).arg(what));
    if let Err(problem) = pip(OsStr::new("deeplens-core")) {
        return Ok(Ended::NotRun(problem));
    }
    if let Err(problem) = succeeds(Command::new(&own).args(["-c", "import deeplens"])) {
        return Ok(Ended::NotRun(format!("deeplens-core is installed, and its import fails: {problem}")));
    }
    let package = root.join("crates/petzval-python");
    pip(package.as_os_str())?;
    let mut last = String::new();
    for words in BESIDE_DEEPLENS {
        last = last_line(Command::new(&own).args(words).current_dir(package.join("examples")))?;
    }
    Ok(Ended::Passed(last))
}

/// The first Python on the path that is new enough.
fn interpreter() -> Option<String> {
    let names = ["python3", "python3.14", "python3.13", "python3.12", "python3.11", "python"];
    first_of(&names.map(str::to_owned), &format!("sys.version_info >= {OLDEST:?}"))
}

/// The first of some programs that is a Python with venv and pip, and of which a condition is true.
fn first_of(names: &[String], condition: &str) -> Option<String> {
    let words = format!("import sys, venv, ensurepip; sys.exit(not ({condition}))");
    let is_right = |name: &&String| {
        let probe = Command::new(name).args(["-c", &words]).output();
        probe.is_ok_and(|output| output.status.success())
    };
    names.iter().find(is_right).cloned()
}

/// The Python of an environment, which stands beside what cargo builds.
fn environment(root: &Path, python: &str, name: &str) -> Result<PathBuf, String> {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir));
    let environment = target.join(name);
    succeeds(Command::new(python).args(["-m", "venv"]).arg(&environment))?;
    Ok(environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" }))
}

/// Runs a command, shows what it prints, and returns the last line of that.
fn last_line(command: &mut Command) -> Result<String, String> {
    let output =
        command.stderr(Stdio::inherit()).output().map_err(|error| format!("{command:?}: {error}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    print!("{said}");
    if !output.status.success() {
        return Err(format!("{command:?}: {}", output.status));
    }
    Ok(said.lines().last().unwrap_or_default().to_owned())
}

fn succeeds(command: &mut Command) -> Result<(), String> {
    // Cargo sets these for xtask itself: the build inside pip is not part of it.
    for name in ["CARGO_MANIFEST_DIR", "CARGO_MANIFEST_PATH", "CARGO_PKG_NAME"] {
        command.env_remove(name);
    }
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{command:?}: {status}")),
        Err(error) => Err(format!("{command:?}: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_is_no_python_is_none() {
        assert_eq!(first_of(&["no-such-python".to_owned(), env!("CARGO").to_owned()], "True"), None);
    }

    #[test]
    fn the_last_line_of_what_a_command_prints_is_kept() {
        let version = last_line(Command::new(env!("CARGO")).arg("--version")).unwrap();
        assert!(version.starts_with("cargo "), "{version}");
        let failed = last_line(Command::new(env!("CARGO")).arg("no-such-verb")).unwrap_err();
        assert!(failed.contains("no-such-verb"), "{failed}");
    }

    #[test]
    fn the_examples_beside_deeplens_are_there() {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/petzval-python/examples");
        assert!(BESIDE_DEEPLENS.iter().all(|words| examples.join(words[0]).is_file()));
    }
}
