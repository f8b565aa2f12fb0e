//! The folder of a studio: nothing that a request names lies outside of it.

use std::path::{Component, Path, PathBuf};

use petzval_jobs::is_lens_text;
use serde_json::Value;

/// Longest path that a system takes: no longer text is one.
const LONGEST_PATH: usize = 4096;

/// Keys of requests that hold the text of a file.
const TEXTS: [&str; 2] = ["toml", "text"];

/// Keys of requests under which an experiment stands, and the job in which `from` is one as well.
const EXPERIMENTS: [&str; 2] = ["experiment", "classes_of"];
const FROM: (&str, &str) = ("init", "from");

/// Jobs in which the text of a lens may stand for an experiment, which is then fitted to it. A lens names no files.
const FITTING: [&str; 3] = ["design", "design-check", "design-config"];

/// Endings of lens files.
const LENSES: [&str; 4] = ["toml", "zmx", "seq", "json"];

/// Most files that are listed.
const MOST_LISTED: usize = 500;

/// A folder by its real path.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// The folder, which must exist.
    pub fn new(path: &Path) -> std::io::Result<Self> {
        let path = path.canonicalize()?;
        if path.is_dir() { Ok(Self { path }) } else { Err(std::io::ErrorKind::NotADirectory.into()) }
    }

    /// Its real path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The first text of a request that is a path out of the folder. Any text counts as a path, whatever its key, except those of files.
    pub fn way_out<'a>(&self, request: &'a Value) -> Option<&'a str> {
        match request {
            Value::String(text) => (!self.holds(text)).then_some(text),
            Value::Array(values) => values.iter().find_map(|value| self.way_out(value)),
            Value::Object(keys) => keys
                .iter()
                .filter(|(key, _)| !TEXTS.contains(&key.as_str()))
                .find_map(|(_, v)| self.way_out(v)),
            Value::Null | Value::Bool(_) | Value::Number(_) => None,
        }
    }

    /// Whether a text leads to a place in the folder when it is taken for a path, through whatever links.
    pub fn holds(&self, text: &str) -> bool {
        if text.len() > LONGEST_PATH {
            return true;
        }
        let joined = self.path.join(text);
        let mut lexical = PathBuf::new();
        for part in joined.components() {
            match part {
                Component::ParentDir => {
                    lexical.pop();
                }
                Component::CurDir => {}
                part => lexical.push(part),
            }
        }
        // What is there is looked at as the system would find it; of what is to be made, the folder that is there.
        let real = joined.ancestors().find_map(|there| there.canonicalize().ok());
        lexical.starts_with(&self.path) && real.is_some_and(|real| real.starts_with(&self.path))
    }

    /// Names of the lens files directly in the folder, in the order of the alphabet.
    pub fn lens_files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.path).into_iter().flatten().flatten();
        let files = entries.filter(|entry| entry.path().is_file());
        let mut names: Vec<String> = files
            .filter_map(|entry| entry.file_name().into_string().ok())
            .filter(|name| {
                let ending =
                    Path::new(name).extension().map(|ending| ending.to_string_lossy().to_lowercase());
                ending.is_some_and(|ending| LENSES.contains(&ending.as_str()))
            })
            .collect();
        names.sort();
        names.truncate(MOST_LISTED);
        names
    }
}

/// The key under which the request of a job holds an experiment itself, in place of its name. An experiment names folders of pictures, weights and
/// programs, which may lie anywhere: a page names one, and its user decides what stands in the folder. Requests of calls within the request, such as
/// those of units, are looked at as those of their own jobs.
pub fn inline_experiment(job: &str, request: &Value) -> Option<&'static str> {
    let (init, from) = FROM;
    if job == init && request.get(from).is_some_and(Value::is_object) {
        return Some(from);
    }
    match request {
        Value::Array(values) => values.iter().find_map(|value| inline_experiment(job, value)),
        Value::Object(keys) => {
            let is_inline = |of: &Value| of.is_object() && !(FITTING.contains(&job) && is_lens(of));
            let own = EXPERIMENTS.into_iter().find(|key| keys.get(*key).is_some_and(is_inline));
            let job = keys.get("job").and_then(Value::as_str).unwrap_or(job);
            own.or_else(|| keys.values().find_map(|value| inline_experiment(job, value)))
        }
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => None,
    }
}

/// Whether it is the text of a lens, by which the jobs decide as well.
fn is_lens(value: &Value) -> bool {
    let keys = value.as_object().filter(|keys| keys.len() == 1);
    keys.and_then(|keys| keys.get("toml")?.as_str()).is_some_and(is_lens_text)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn paths_stay_in_the_folder_through_whatever_links() {
        let (outside, inside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let folder = Folder::new(inside.path()).unwrap();
        std::fs::create_dir(inside.path().join("a")).unwrap();
        std::fs::write(outside.path().join("secret"), "x").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(outside.path(), inside.path().join("link")).unwrap();
        let own = inside.path().canonicalize().unwrap().join("a/new.toml").display().to_string();
        for fine in ["N-BK7", "a/new.toml", "a/../b.toml", "scene:flat", "SCHOTT:N-BK7", "", &own] {
            assert_eq!(folder.way_out(&json!({"lens": fine})), None, "{fine}");
        }
        let foreign = outside.path().join("secret").display().to_string();
        for wrong in
            ["/etc/passwd", "..", "a/../../x", "../x", "link/secret", "link/new", "a/../link/x", &foreign]
        {
            if cfg!(unix) || !wrong.contains("link") {
                let request = json!({"start": {"new": {"out": [wrong]}}});
                assert_eq!(folder.way_out(&request), Some(wrong));
            }
        }
        // The text of a file is no path.
        assert_eq!(folder.way_out(&json!({"lens": {"text": "/etc/passwd", "format": "zmx"}})), None);
        assert_eq!(folder.way_out(&json!({"lens": {"toml": "../x"}})), None);
    }

    #[test]
    fn experiments_are_named_and_not_sent() {
        let toml = json!({"toml": "photos = \"/etc\""});
        let lens = json!({"toml": "[[surface]]\nstop = true\n"});
        let unit = |job: &str, request: Value| json!({"units": [{"name": "a", "call": {"job": job, "request": request}}]});
        for (job, request, key) in [
            ("design", json!({"run": {"new": {"experiment": toml}}}), "experiment"),
            ("design", json!({"run": {"new": {"experiment": {"photos": "/etc"}}}}), "experiment"),
            ("task-view", json!({"experiment": {}, "lens": {"toml": "x"}}), "experiment"),
            ("data-check", json!({"folder": "x", "classes_of": toml}), "classes_of"),
            ("init", json!({"from": toml}), "from"),
            ("task-view", json!({"experiment": lens}), "experiment"),
            ("data-check", json!({"classes_of": lens}), "classes_of"),
            (
                "design",
                json!({"run": {"new": {"experiment": {"toml": lens["toml"], "photos": "/etc"}}}}),
                "experiment",
            ),
            ("unit-list", unit("init", json!({"from": toml})), "from"),
            ("unit-list", unit("design", json!({"run": {"new": {"experiment": toml}}})), "experiment"),
            ("unit-list", unit("task-view", json!({"experiment": lens})), "experiment"),
        ] {
            assert_eq!(inline_experiment(job, &request), Some(key), "{request}");
        }
        for (job, request) in [
            ("design", json!({"run": {"new": {"experiment": "own.toml", "changes": {"set": {}}}}})),
            ("task-view", json!({"experiment": "", "start": toml})),
            ("lens-convert", json!({"from": toml, "to": "x.toml"})),
            ("init", json!({"from": "own.toml"})),
            // A lens, to which an experiment is fitted.
            ("design-config", json!({"run": {"experiment": lens}})),
            ("design", json!({"run": {"new": {"experiment": lens}}})),
            ("unit-list", unit("design", json!({"run": {"new": {"experiment": lens}}}))),
            ("unit-list", unit("lens-convert", json!({"from": toml, "to": "x.toml"}))),
        ] {
            assert_eq!(inline_experiment(job, &request), None, "{request}");
        }
    }
}
