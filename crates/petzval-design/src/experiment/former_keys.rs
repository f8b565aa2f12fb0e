//! Keys of experiments of earlier versions that have another name now, or none.

use petzval_base::FileError;

/// A key that a table of experiments had in an earlier version, and has no more.
struct FormerKey {
    table: &'static str,
    key: &'static str,
    /// Its name today, in the same table; none where no key takes its place.
    now: Option<&'static str>,
}

/// All of them.
const FORMER: &[FormerKey] = &[
    FormerKey { table: "scoring", key: "places", now: Some("places_per_side") },
    FormerKey { table: "spot", key: "steps", now: Some("iterations") },
    FormerKey { table: "spot", key: "learning_rate", now: None },
    FormerKey { table: "spot", key: "final_learning_rate", now: None },
];

impl FormerKey {
    fn hint(&self) -> String {
        let Self { key, now, .. } = self;
        match now {
            Some(now) => format!("`{key}` is now `{now}`"),
            None => format!("`{key}` is gone: leave it out"),
        }
    }
}

/// What became of the key at a path; `None` of keys that no earlier version had.
pub(super) fn hint_at(path: &[String]) -> Option<String> {
    let [table, key] = path else { return None };
    FORMER.iter().find(|former| former.table == table && former.key == key).map(FormerKey::hint)
}

/// The error about the text of an experiment; if it is about a former key, with what became of it as the hint.
pub(super) fn with_hint(error: FileError, text: &str) -> FileError {
    let is_meant = |former: &&FormerKey| {
        let place = || FileError::at_key(text, &[former.table, former.key], "").line;
        former.key == error.key && error.line.is_some() && place() == error.line
    };
    match FORMER.iter().find(is_meant) {
        Some(former) => error.hint(former.hint()),
        None => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Experiment, Settings, WithSettings};

    #[test]
    fn every_former_key_says_what_became_of_it_in_a_file_and_as_a_setting() {
        let today = Experiment::default();
        let keys = today.values();
        for former in FORMER {
            let FormerKey { table, key, now } = former;
            let path = format!("{table}.{key}");
            assert!(!keys.contains_key(&path), "{path} is a key");
            if let Some(now) = now {
                assert!(keys.contains_key(&format!("{table}.{now}")), "{table}.{now} is no key");
            }
            for text in [format!("[{table}]\n{key} = 5\n"), format!("\n{table}.{key} = 5\n")] {
                let error = Experiment::read(&text).unwrap_err();
                assert_eq!((error.line, error.hint), (Some(2), Some(former.hint())), "{text}");
            }
            let settings = Settings::from([(path.clone(), 5.into())]);
            let wrong = WithSettings::new("", &today, &settings).err().unwrap();
            assert_eq!(wrong.hint, former.hint(), "{path}");
        }
        let hint = |text: &str| Experiment::read(text).unwrap_err().hint.unwrap();
        assert_eq!(hint("[spot]\nsteps = 500\n"), "`steps` is now `iterations`");
        assert_eq!(hint("[spot]\nlearning_rate = 0.03\n"), "`learning_rate` is gone: leave it out");
        // The same word in a table that never had it is a misspelling as before.
        assert!(hint("[psf]\nlearning_rate = 0.03\n").starts_with("the keys here are"));
    }
}
