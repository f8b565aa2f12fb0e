//! `cargo xtask engines`: units of work under the programs that run many jobs on many machines. Each is the real program, started on this machine
//! alone; it is interrupted as on a cluster, and the results must be those of an uninterrupted run, to the bit.

mod cluster;
mod python;
mod slurm;
mod throughput;
mod units;
mod wait;
mod workers;

use std::path::{Path, PathBuf};
use std::process::Command;

pub use crate::ended::Ended;

/// What the parts use.
pub struct Tools {
    /// The command.
    pub petzval: PathBuf,
    /// A Python that has the package; none means that of `cargo xtask python`.
    pub python: Option<PathBuf>,
    /// A folder of this part alone.
    pub folder: PathBuf,
    /// How long parts take.
    pub length: Length,
}

/// How long parts take that kill processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// A minute.
    Short,
    /// A quarter of an hour: as in earnest, with few units. `cargo xtask full` takes it.
    Full,
    /// Most of an hour on two cores.
    Long,
}

/// A part by name.
pub type Part = (&'static str, fn(&Tools) -> Result<Ended, String>);

/// The parts.
pub static PARTS: [Part; 6] = [
    ("workers", workers::run),
    ("slurm", slurm::run),
    ("hyperqueue", python::hyperqueue),
    ("ray", python::ray),
    ("submitit", python::submitit),
    ("throughput", throughput::run),
];

/// How the parts are called.
pub const USAGE: &str = "cargo xtask engines [--full | --long] [--petzval PROGRAM] [--python PYTHON] [PART]..., with parts workers, slurm, hyperqueue, ray, submitit, throughput";

/// Runs the parts that the words name, or all.
pub fn check(words: &[String]) -> Result<String, Vec<String>> {
    let (mut petzval, mut python, mut length, mut named) = (None, None, Length::Short, Vec::new());
    let mut words = words.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--full" => length = Length::Full,
            "--long" => length = Length::Long,
            "--petzval" => petzval = words.next().and_then(|path| std::path::absolute(path).ok()),
            "--python" => python = words.next().and_then(|path| std::path::absolute(path).ok()),
            name if PARTS.iter().any(|(part, _)| *part == name) => named.push(name),
            other => return Err(vec![format!("{other}: no such part; {USAGE}")]),
        }
    }
    let petzval = petzval.map_or_else(built, Ok).map_err(|problem| vec![problem])?;
    let chosen = PARTS.iter().filter(|(name, _)| named.is_empty() || named.contains(name));
    let (mut lines, mut failed) = (Vec::new(), 0);
    for (name, run) in chosen {
        println!("== {name}");
        let line = match in_folder(name, |folder| {
            run(&Tools { petzval: petzval.clone(), python: python.clone(), folder, length })
        }) {
            Ok(Ended::Passed(seen)) => format!("passed   {name}: {seen}"),
            Ok(Ended::NotRun(why)) => format!("NOT RUN  {name}: {why}"),
            Err(problem) => {
                failed += 1;
                format!("FAILED   {name}: {problem}")
            }
        };
        println!("{line}");
        lines.push(line);
    }
    if failed == 0 { Ok(lines.join("\n")) } else { Err(lines) }
}

/// Runs one part, as a part of `cargo xtask full`.
pub fn run(part: &Part) -> Result<Ended, String> {
    let petzval = built()?;
    in_folder(part.0, |folder| part.1(&Tools { petzval, python: None, folder, length: Length::Full }))
}

/// Runs a part in a folder of its own. The folder of one that fails stays.
fn in_folder(name: &str, run: impl FnOnce(PathBuf) -> Result<Ended, String>) -> Result<Ended, String> {
    let folder = std::env::temp_dir().join(format!("petzval-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let ended = run(folder.clone());
    match ended {
        Ok(ended) => {
            std::fs::remove_dir_all(&folder).map(|()| ended).map_err(|e| format!("{}: {e}", folder.display()))
        }
        Err(problem) => Err(format!("{problem}; its files are in {}", folder.display())),
    }
}

/// Builds the command.
fn built() -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut command = Command::new(env!("CARGO"));
    command.args(["build", "--release", "--bin", "petzval"]).current_dir(&root);
    match command.status() {
        Ok(status) if status.success() => {
            let target =
                std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from);
            Ok(target.join("release/petzval"))
        }
        other => Err(format!("{command:?}: {other:?}")),
    }
}
