//! Paths as text. Experiments, runs and searches keep the paths of their inputs in files of text, which is UTF-8.

use std::path::{Component, Path, PathBuf};

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

/// A path without the steps upwards that take a folder away again: `seg/a` for `runs/one/../../seg/a`. The path as it is where that would lead
/// elsewhere, as it may behind a link.
pub fn without_detours(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        let takes_away = part == Component::ParentDir
            && matches!(plain.components().next_back(), Some(Component::Normal(_)));
        if takes_away {
            plain.pop();
        } else {
            plain.push(part);
        }
    }
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    if real(&plain).is_some_and(|place| real(path) == Some(place)) { plain } else { path.to_owned() }
}

/// The way from a folder to a path, both absolute and without links: through the folder that they share, or the path itself where they share none.
pub fn relative_path(path: &Path, folder: &Path) -> PathBuf {
    let shared = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    // Volumes of Windows.
    if !matches!(path.components().next(), Some(first) if shared > 0 && folder.components().next() == Some(first))
    {
        return path.to_path_buf();
    }
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(path.components().skip(shared)).collect()
}

#[cfg(all(test, unix))]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    use super::*;

    #[test]
    fn a_path_has_no_detours_unless_it_needs_them() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir_all(root.join("runs/one")).unwrap();
        std::fs::create_dir_all(root.join("seg/a")).unwrap();
        assert_eq!(without_detours(&root.join("runs/one/../../seg/a")), root.join("seg/a"));
        assert_eq!(without_detours(&root.join("seg/a")), root.join("seg/a"));
        // What is not there stays as it is written.
        let nowhere = root.join("runs/one/../../seg/b");
        assert_eq!(without_detours(&nowhere), nowhere);
        // Upwards from a link leads to the folder above its target.
        std::os::unix::fs::symlink(root.join("runs/one"), root.join("link")).unwrap();
        let behind = root.join("link/../one");
        assert_eq!(without_detours(&behind), behind);
    }

    #[test]
    fn a_path_is_found_from_a_folder_beside_it() {
        for (path, folder, way) in [
            ("/a/photos", "/a/runs/one", "../../photos"),
            ("/a/runs/one/photos", "/a/runs/one", "photos"),
            ("/b/photos", "/a", "../b/photos"),
            ("/a", "/a/b", ".."),
        ] {
            let found = relative_path(Path::new(path), Path::new(folder));
            assert_eq!(found, Path::new(way), "{path} from {folder}");
        }
    }

    #[test]
    fn only_a_text_that_leads_to_the_path_is_one() {
        assert_eq!(path_text(Path::new("a/Gauß\n")).unwrap(), "a/Gauß\n");
        let refused = path_text(Path::new(OsStr::from_bytes(b"a/b\xff"))).unwrap_err();
        assert!(refused.is_input() && refused.to_string().contains("a/b\u{fffd}: the path is not UTF-8"));
    }
}
