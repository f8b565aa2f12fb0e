//! `cargo xtask python`: the Python package as its user gets it. pip builds and installs it in an environment of its own, beside the built files;
//! then its types are checked and its tests run. With `--torch`, also those that need PyTorch.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::ended::Ended;

/// The oldest Python that the package takes.
const OLDEST: (u32, u32) = (3, 11);

/// What the tests of the optional parts need. PyTorch takes 5.4 GB from PyPI, which has it for Linux with the libraries of CUDA alone.
const OPTIONAL: [&str; 7] = ["torch", "torchvision", "onnx", "onnxruntime", "onnxscript", "pandas", "xarray"];

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
    let environment = environment(&root);
    succeeds(Command::new(python).args(["-m", "venv"]).arg(&environment))?;
    let own = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
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
    let environment = environment(&root);
    succeeds(Command::new(python).args(["-m", "venv"]).arg(&environment))?;
    let own = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    let pip = ["-m", "pip", "install", "--quiet"];
    succeeds(Command::new(&own).args(pip).args(packages).arg(root.join("crates/petzval-python")))?;
    Ok(own)
}

/// The first Python on the path that is new enough.
fn interpreter() -> Option<String> {
    let is_new = format!("import sys, venv, ensurepip; sys.exit(sys.version_info < {OLDEST:?})");
    let names = ["python3", "python3.14", "python3.13", "python3.12", "python3.11", "python"];
    let found = names.into_iter().find(|name| {
        let probe = Command::new(name).args(["-c", &is_new]).output();
        probe.is_ok_and(|output| output.status.success())
    });
    found.map(str::to_owned)
}

/// Where the environment stands: beside what cargo builds.
fn environment(root: &Path) -> PathBuf {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir));
    target.join("python")
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
