//! The file in a folder of results from which a job that was interrupted goes on.

use std::path::Path;

use serde::de::DeserializeOwned;

use crate::error::{JobError, Result, make_folder};

/// Makes the folder of new work; refuses one whose `state` shows that it already holds such work, which is `what` in words.
pub(crate) fn make_new_folder(root: &Path, state: &Path, what: &str) -> Result<()> {
    if state.exists() {
        let message = format!("this folder already holds a {what}");
        let hint = "continue it with --resume, or choose another folder";
        return Err(JobError::setting("out", root.display(), message, hint));
    }
    make_folder(root)
}

/// Reads the state of the work in a folder, and removes what killed processes have left there.
pub(crate) fn read_state<K: DeserializeOwned>(root: &Path, state: &Path, hint: &str) -> Result<K> {
    let wrong = |message: String| JobError::input(format!("{}: {message}", state.display()), hint);
    let text = petzval_base::read_text(state).map_err(|e| wrong(e.to_string()))?;
    let kept = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    petzval_base::sweep_parts(root);
    Ok(kept)
}
