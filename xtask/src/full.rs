//! `cargo xtask full`: what continuous integration has no time for. All parts run, and the last lines say how each ended, and which could not be
//! run because a program is missing. Words after it, such as `Python studio`, run the parts whose names hold one of them: after a mend, or where a
//! part was ended.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use crate::ended::Ended;
use crate::{devices, engines, python, studio};

/// Damaged files of each kind that readers are fed.
const MUTATIONS: &str = "200000";

/// A part with its name.
struct Part {
    name: String,
    work: Work,
}

/// What a part does.
enum Work {
    /// A command of cargo, by its words, with a variable of the environment, if any.
    Cargo { words: Vec<String>, variable: Option<(&'static str, &'static str)> },
    /// The Python package, with PyTorch.
    Python,
    /// A training step beside one of DeepLens.
    DeepLens,
    /// Tensors on a GPU.
    Devices,
    /// The page of the studio, and the studio in a browser.
    Studio,
    /// Units of work under a program of others.
    Engine(&'static engines::Part),
}

/// Runs every part, or those whose names hold one of the words. The report has a line for each; it is an error if one fails, or if a word is in no
/// name. What could not be run is said last.
pub fn check(words: &[String]) -> Result<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let parts = parts(&root).and_then(|all| chosen(all, words)).map_err(|problem| vec![problem])?;
    let (mut lines, mut not_run, mut failed) = (Vec::new(), Vec::new(), 0);
    for part in &parts {
        println!("== {}", part.name);
        let started = Instant::now();
        let ended = part.work.run(&root);
        let line = |how: &str, what: &str| {
            let what = what.lines().next().unwrap_or_default();
            format!("{how:7} {:6.0} s  {}: {what}", started.elapsed().as_secs_f64(), part.name)
        };
        match ended {
            Ok(Ended::Passed(seen)) => lines.push(line("passed", &seen)),
            Ok(Ended::NotRun(why)) => not_run.push(line("NOT RUN", &why)),
            Err(problem) => {
                println!("{problem}");
                failed += 1;
                lines.push(line("FAILED", &problem));
            }
        }
    }
    let passed = parts.len() - failed - not_run.len();
    let counts = format!("{passed} passed, {failed} failed, {} NOT RUN", not_run.len());
    lines.extend(not_run);
    lines.push(counts);
    if failed == 0 { Ok(lines.join("\n")) } else { Err(lines) }
}

impl Work {
    fn run(&self, root: &Path) -> Result<Ended, String> {
        match self {
            Self::Cargo { words, variable } => {
                let mut command = Command::new(env!("CARGO"));
                command.args(words).current_dir(root);
                command.envs(*variable);
                match command.status() {
                    Ok(status) if status.success() => Ok(Ended::Passed("ok".to_owned())),
                    Ok(status) => Err(format!("{status}")),
                    Err(error) => Err(error.to_string()),
                }
            }
            Self::Python => python::check(true).map_err(|problems| problems.join("\n")),
            Self::DeepLens => python::beside_deeplens(),
            Self::Devices => devices::run(root, None),
            Self::Studio => studio::run(root, false, &studio::answers),
            Self::Engine(part) => engines::run(part),
        }
    }
}

/// The parts whose names hold one of the words; all without words.
fn chosen(all: Vec<Part>, words: &[String]) -> Result<Vec<Part>, String> {
    if let Some(unknown) = words.iter().find(|word| !all.iter().any(|part| part.name.contains(*word))) {
        let names: Vec<&str> = all.iter().map(|part| part.name.as_str()).collect();
        return Err(format!("{unknown}: in no name of a part; there are {}", names.join("; ")));
    }
    let is_chosen = |part: &Part| words.is_empty() || words.iter().any(|word| part.name.contains(word));
    Ok(all.into_iter().filter(is_chosen).collect())
}

fn parts(root: &Path) -> Result<Vec<Part>, String> {
    let part = |name: String, words: &[&str], variable| {
        let words = words.iter().map(|word| (*word).to_owned()).collect();
        Part { name, work: Work::Cargo { words, variable } }
    };
    let test = ["test", "--release", "--workspace", "--no-fail-fast", "--"];
    let mut all = vec![
        part("widths of the fixed-point ISP, with overflow checks".to_owned(), &["widths"], None),
        part(
            format!("readers of files, {MUTATIONS} damaged files of each kind"),
            &[&test[..], &["damaged", "mutat"]].concat(),
            Some(("PETZVAL_MUTATIONS", MUTATIONS)),
        ),
        part(
            "tests that continuous integration leaves out".to_owned(),
            &[&test[..], &["--ignored"]].concat(),
            None,
        ),
        part(
            "the blocks of README and book, none of them shortened".to_owned(),
            &["test", "--release", "--test", "book", "--", "run", "--nocapture"],
            Some(("PETZVAL_WHOLE_BOOK", "1")),
        ),
        Part { name: "the Python package, with PyTorch".to_owned(), work: Work::Python },
        Part { name: "a training step beside DeepLens".to_owned(), work: Work::DeepLens },
        Part { name: "tensors on a GPU, by software Vulkan".to_owned(), work: Work::Devices },
        Part { name: "the studio, in a browser".to_owned(), work: Work::Studio },
    ];
    for experiment in experiments(root)? {
        let check = ["run", "--release", "--quiet", "--", "design", "--check", &experiment];
        all.push(part(format!("the built-in experiment {experiment} can begin"), &check, None));
    }
    let engine = |part: &'static engines::Part| Part {
        name: format!("units of work: {}", part.0),
        work: Work::Engine(part),
    };
    all.extend(engines::PARTS.iter().map(engine));
    Ok(all)
}

/// The names of the built-in experiments.
fn experiments(root: &Path) -> Result<Vec<String>, String> {
    let folder = root.join("crates/petzval-data/data/experiments");
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
        let cargo = parts.iter().filter_map(|part| match &part.work {
            Work::Cargo { words, variable } => Some((words.join(" "), *variable)),
            _ => None,
        });
        let cargo: Vec<_> = cargo.collect();
        let has = |words: &str| cargo.iter().any(|(line, _)| line.contains(words));
        assert!(has("design --check cooke-triplet-image-quality") && has("widths"));
        let sets =
            |name: &str| cargo.iter().any(|(_, variable)| variable.is_some_and(|(set, _)| set == name));
        assert!(parts.len() > 20 && sets("PETZVAL_MUTATIONS") && sets("PETZVAL_WHOLE_BOOK"));
        assert!(parts.iter().any(|part| part.name.ends_with("slurm")));
        // A chore that may end without having run is no command, whose exit code says only whether it failed.
        assert!(parts.iter().any(|part| matches!(part.work, Work::DeepLens)));
        let of_words = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            chosen(super::parts(&root).unwrap(), &words)
        };
        let named = of_words(&["PyTorch", "slurm"]).unwrap();
        let names: Vec<&str> = named.iter().map(|part| part.name.as_str()).collect();
        assert_eq!(names, ["the Python package, with PyTorch", "units of work: slurm"]);
        assert!(of_words(&["ray"]).is_ok() && of_words(&["no such part"]).is_err());
        assert!(!has("xtask") && parts.iter().any(|part| matches!(part.work, Work::Studio)));
    }
}
