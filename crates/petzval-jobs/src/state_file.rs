//! The file in a folder of results from which a job that was interrupted goes on, and the lock that keeps other processes from that folder.

use std::fs::TryLockError;
use std::path::Path;

use petzval_base::{WorkLock, hex};
use petzval_design::error::DesignError;
use petzval_design::run::Holder;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::error::{JobError, Result, json, make_folder};

/// The file in a folder of results that the process at work holds locked; it goes with the lock.
const LOCK: &str = "work.lock";

/// Captures of a camera, as the work in a folder.
pub(crate) const CAPTURES: &str = "series of captures";

/// Keeps other processes from the work in a folder, which is `what` in words, until the lock is dropped.
pub(crate) fn lock_folder(root: &Path, what: &str) -> Result<WorkLock> {
    let path = root.join(LOCK);
    WorkLock::passing(&path, json(Holder::own())?.as_bytes()).map_err(|error| match error {
        TryLockError::WouldBlock => {
            let message = format!("{}: another process is working on this {what}", root.display());
            JobError::input(message, "wait for it to end, or choose another folder with --out")
        }
        TryLockError::Error(error) => DesignError::io(&path)(error).into(),
    })
}

/// Makes the folder of new work and locks it; refuses one whose `state` shows that it already holds such work, which is `what` in words.
pub(crate) fn make_new_folder(root: &Path, state: &Path, what: &str) -> Result<WorkLock> {
    let check = || {
        if state.exists() {
            let message = format!("this folder already holds a {what}");
            let hint = "continue it with --resume, or choose another folder";
            return Err(JobError::setting("out", root.display(), message, hint));
        }
        Ok(())
    };
    check()?;
    make_folder(root)?;
    let lock = lock_folder(root, what)?;
    // Another process may have worked here since the first look.
    check()?;
    Ok(lock)
}

/// How a state with a digest begins.
const DIGEST: &str = "{\"sha256\":\"";

/// What to do where a state was changed.
pub(crate) const CHANGED_STATE: &str =
    "it was changed since it was written: put it back from a copy, or begin again with another --out";

/// A state, which is a JSON object with keys, with its SHA-256 as the first key.
pub(crate) fn with_digest(state: &str) -> String {
    let digest = hex(&Sha256::digest(state.as_bytes()));
    format!("{DIGEST}{digest}\",{}", state.strip_prefix('{').unwrap_or(state))
}

/// The state in a text of [`with_digest`]; `None` if it was changed. That of an earlier version has no digest, and is taken as it is.
pub(crate) fn without_digest(text: &str) -> Option<String> {
    let Some((digest, rest)) = text.strip_prefix(DIGEST).and_then(|text| text.split_once("\",")) else {
        return Some(text.to_owned());
    };
    let state = format!("{{{rest}");
    (hex(&Sha256::digest(state.as_bytes())) == digest).then_some(state)
}

/// Locks the folder of work, which is `what` in words, reads its state, and removes what killed processes have left there.
pub(crate) fn read_state<K: DeserializeOwned>(
    root: &Path,
    state: &Path,
    what: &str,
    hint: &str,
) -> Result<(K, WorkLock)> {
    let wrong = |message: String| JobError::input(format!("{}: {message}", state.display()), hint);
    let read = || petzval_base::read_text(state).map_err(|e| wrong(e.to_string()));
    // Nothing is made in a folder that holds no such work.
    read()?;
    let lock = lock_folder(root, what)?;
    let text = without_digest(&read()?).ok_or_else(|| {
        let message = format!("{}: is not as the {what} wrote it", state.display());
        JobError::input(message, CHANGED_STATE)
    })?;
    let kept = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    petzval_base::sweep_parts(root);
    Ok((kept, lock))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_that_was_changed_is_not_believed() {
        let place = tempfile::tempdir().unwrap();
        let state = place.path().join("search.json");
        let read = |text: &str| {
            std::fs::write(&state, text).unwrap();
            read_state::<serde_json::Value>(place.path(), &state, "search", "a hint").map(|(kept, _)| kept)
        };
        let text = with_digest(r#"{"best": 1.5, "next": "a\",b"}"#);
        assert_eq!(read(&text).unwrap()["best"], 1.5);
        // Other readers find the same keys.
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap()["next"], "a\",b");
        let error = read(&text.replace("1.5", "9.5")).unwrap_err().to_string();
        assert!(error.contains("search.json: is not as the search wrote it"), "{error}");
        // An earlier version wrote no digest.
        assert_eq!(read(r#"{"best": 1.5}"#).unwrap()["best"], 1.5);
    }

    #[test]
    fn one_process_at_a_time_works_in_a_folder() {
        let place = tempfile::tempdir().unwrap();
        let (root, state) = (place.path().join("out"), place.path().join("out/search.json"));
        let refused = |result: Result<WorkLock>| result.unwrap_err().to_string();
        let first = make_new_folder(&root, &state, "search").unwrap();
        let error = refused(make_new_folder(&root, &state, "search"));
        assert!(error.contains("another process is working on this search"), "{error}");
        // The first writes its state; nobody goes on from it before the first ends.
        std::fs::write(&state, "[3]").unwrap();
        let going_on = || read_state::<Vec<u8>>(&root, &state, "search", "a hint").map(|(_, lock)| lock);
        let error = refused(going_on());
        assert!(error.contains("another process is working on this search"), "{error}");
        drop(first);
        assert_eq!(std::fs::read_dir(&root).unwrap().count(), 1);
        let error = refused(make_new_folder(&root, &state, "search"));
        assert!(error.contains("already holds a search"), "{error}");
        drop(going_on().unwrap());
        assert_eq!(std::fs::read_dir(&root).unwrap().count(), 1);
    }
}
