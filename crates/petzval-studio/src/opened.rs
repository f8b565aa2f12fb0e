//! What the studio is started with: lenses, experiments, runs, and folders of them.

use std::path::{Path, PathBuf};

use petzval_jobs::{Call, Context, JobError};
use petzval_units::runs::is_run;
use petzval_units::sweep::KeptSweep;
use serde::Serialize;
use serde_json::{Value, json};

/// A lens that the page can open at once.
#[derive(Debug, Serialize)]
pub struct Opened {
    /// How the user called it.
    pub name: String,
    /// Its text in Petzval's format.
    pub toml: String,
    /// Records of its file that the lens does not represent.
    pub losses: Value,
}

/// The room that the page shows first, and what in it. Paths are those in the folder of the studio.
#[derive(Debug, Default, PartialEq, Serialize)]
pub struct First {
    /// `lens`, `design` or `runs`.
    pub room: &'static str,
    /// The run that is shown.
    pub run: Option<String>,
    /// The experiment that is shown.
    pub experiment: Option<String>,
    /// The store of a sweep that is shown.
    pub sweep: Option<String>,
    /// The folder whose runs are listed.
    pub runs: Option<String>,
}

/// What was named, before the folder of the studio is known.
pub struct Opening {
    lenses: Vec<Opened>,
    room: &'static str,
    kind: Kind,
    /// The real path of a run, an experiment or a folder of them.
    place: Option<PathBuf>,
    built_in: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Lens,
    Run,
    Experiment,
    Sweep,
    Runs,
}

/// The lens of the studio that is started without one.
const FIRST: &str = "cooke-triplet-nominal";

/// Folder of the cameras of a run, and the lens in each of them.
const CAMERAS: &str = "cameras";
const LENS: &str = "lens.toml";

/// The lens of a run at work without finished cameras.
const RUN_LENS: &str = "inputs/lens.toml";

/// Reads the lenses of names, paths and folders of runs. The first run, experiment or folder among them decides what the page shows first.
pub fn open(names: &[String], context: &Context) -> Result<Opening, JobError> {
    let mut opening =
        Opening { lenses: Vec::new(), room: "lens", kind: Kind::Lens, place: None, built_in: None };
    for name in names {
        let path = Path::new(name);
        let (kind, room) = match () {
            () if is_run(path) => (Kind::Run, "runs"),
            () if KeptSweep::is_in(path) => (Kind::Sweep, "design"),
            () if path.is_dir() => (Kind::Runs, "runs"),
            () if is_experiment(name, context) => (Kind::Experiment, "design"),
            () => (Kind::Lens, "lens"),
        };
        match kind {
            Kind::Run => opening.lenses.extend(lenses_of_run(path, context)?),
            Kind::Lens => opening.lenses.push(lens(name, name, context)?),
            Kind::Sweep | Kind::Runs | Kind::Experiment => {}
        }
        if kind != Kind::Lens && opening.kind == Kind::Lens {
            (opening.kind, opening.room) = (kind, room);
            opening.place = std::fs::canonicalize(path).ok();
            opening.built_in = opening.place.is_none().then(|| name.clone());
        }
    }
    if opening.lenses.is_empty() {
        opening.lenses.push(lens(FIRST, FIRST, context)?);
    }
    Ok(opening)
}

impl Opening {
    /// What was named, if it lies outside of a folder.
    pub fn outside(&self, folder: &Path) -> Option<&Path> {
        self.place.as_deref().filter(|place| !place.starts_with(folder))
    }

    /// The folder that a studio serves to show what was named: a folder of runs itself, and of anything else the folder in which it lies.
    pub fn folder(&self) -> Option<&Path> {
        let place = self.place.as_deref()?;
        if self.kind == Kind::Runs { Some(place) } else { place.parent().or(Some(place)) }
    }

    /// The lenses, and what is shown first, by its path in a folder.
    pub fn seen_from(self, folder: &Path) -> (Vec<Opened>, First) {
        let Self { lenses, room, kind, place, built_in } = self;
        let inside = place.map(|place| {
            let below = place.strip_prefix(folder).unwrap_or(&place);
            let below = if below.as_os_str().is_empty() { Path::new(".") } else { below };
            below.to_string_lossy().into_owned()
        });
        let name = inside.or(built_in);
        let of = |wanted: Kind| name.clone().filter(|_| kind == wanted);
        let first = First {
            room,
            run: of(Kind::Run),
            experiment: of(Kind::Experiment),
            sweep: of(Kind::Sweep),
            runs: of(Kind::Runs),
        };
        (lenses, first)
    }
}

/// Whether a name stands for an experiment: a file that names variants, or a built-in one.
fn is_experiment(name: &str, context: &Context) -> bool {
    let path = Path::new(name);
    if path.is_file() {
        let is_toml = path.extension().is_some_and(|ending| ending == "toml");
        return is_toml && petzval_base::read_text(path).is_ok_and(|text| text.contains("[[variant]]"));
    }
    let is_known = |folder: &str| context.assets.names(folder).contains(&name);
    is_known("experiments") && !is_known("lenses")
}

/// The lenses of the finished cameras of a run; the one that it starts from if none is finished.
fn lenses_of_run(run: &Path, context: &Context) -> Result<Vec<Opened>, JobError> {
    let entries = std::fs::read_dir(run.join(CAMERAS)).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| entry.path().join(LENS)).filter(|path| path.is_file()).collect();
    paths.sort();
    if paths.is_empty() {
        paths.extend(Some(run.join(RUN_LENS)).filter(|path| path.is_file()));
    }
    let read = |path: &PathBuf| {
        let path = path.display().to_string();
        lens(&path, &path, context)
    };
    paths.iter().map(read).collect()
}

/// A lens in Petzval's format.
fn lens(name: &str, called: &str, context: &Context) -> Result<Opened, JobError> {
    let response = Call::new("lens-edit", json!({"lens": name})).run(context)?;
    Ok(Opened {
        name: called.to_owned(),
        toml: response["text"].as_str().unwrap_or_default().to_owned(),
        losses: response["losses_of_reading"].clone(),
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use petzval_jobs::{Silent, built_in_assets};

    use super::*;

    #[test]
    fn of_what_is_named_elsewhere_the_folder_that_is_served_is_no_wider_than_needed() {
        let context = Context::new(built_in_assets(), Arc::new(Silent));
        let (elsewhere, own) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let around = elsewhere.path().canonicalize().unwrap();
        let (runs, sweep) = (around.join("runs"), around.join("sweep"));
        for folder in [&runs, &sweep] {
            std::fs::create_dir(folder).unwrap();
        }
        std::fs::write(sweep.join("sweep.json"), "{}").unwrap();
        let opened = |path: &Path| open(&[path.display().to_string()], &context).unwrap();
        // The folder of runs itself, and nothing beside it.
        let opening = opened(&runs);
        assert_eq!(opening.outside(own.path()), Some(runs.as_path()));
        assert_eq!(opening.outside(&around), None);
        assert_eq!(opening.folder(), Some(runs.as_path()));
        let (_, first) = opening.seen_from(&runs);
        assert_eq!((first.room, first.runs.as_deref()), ("runs", Some(".")));
        // A sweep is named in the folder around it.
        let opening = opened(&sweep);
        assert_eq!(opening.folder(), Some(around.as_path()));
        let (_, first) = opening.seen_from(&around);
        assert_eq!((first.room, first.sweep.as_deref()), ("design", Some("sweep")));
        // A folder that has only a file of that name is no run.
        std::fs::write(runs.join("config.toml"), "").unwrap();
        assert_eq!(opened(&runs).seen_from(&around).1.runs.as_deref(), Some("runs"));
    }
}
