//! Paths as text. Experiments, runs and searches keep the paths of their inputs in files of text, which is UTF-8.

use std::path::Path;

use crate::error::{DesignError, Result};

/// A path as the text that leads to it. Fails if it is not UTF-8: with other characters in their place the path would lead elsewhere.
pub fn path_text(path: &Path) -> Result<String> {
    path.to_str().map(str::to_owned).ok_or_else(|| {
        let message = "the path is not UTF-8, and is kept in files of text";
        let hint =
            "rename it, or the folders above it; a run can also be opened from inside its folder, as `.`";
        DesignError::misfit(path, &message, hint)
    })
}

#[cfg(all(test, unix))]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    use super::*;

    #[test]
    fn only_a_text_that_leads_to_the_path_is_one() {
        assert_eq!(path_text(Path::new("a/Gauß\n")).unwrap(), "a/Gauß\n");
        let refused = path_text(Path::new(OsStr::from_bytes(b"a/b\xff"))).unwrap_err();
        assert!(refused.is_input() && refused.to_string().contains("a/b\u{fffd}: the path is not UTF-8"));
    }
}
