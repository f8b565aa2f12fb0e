//! Which paths lead to one file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Looks up the places of files. Each folder is looked up once.
#[derive(Debug, Default)]
pub(crate) struct Places(HashMap<PathBuf, PathBuf>);

impl Places {
    /// The place of a file: its name in its folder, whatever the way to that folder. `a/../x.png`, `./x.png` and `x.png` have one place. A link to a
    /// file has a place of its own. None for a path without a name.
    pub fn of(&mut self, path: &Path) -> Option<PathBuf> {
        let (folder, name) = (path.parent()?, path.file_name()?);
        if let Some(real) = self.0.get(folder) {
            return Some(real.join(name));
        }
        let real = real_folder(folder);
        let place = real.join(name);
        self.0.insert(folder.to_owned(), real);
        Some(place)
    }
}

/// The folder itself, without steps upwards and links; as written where it cannot be found.
fn real_folder(folder: &Path) -> PathBuf {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned())
}
