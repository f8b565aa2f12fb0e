//! The `data/` folder, built into the program: an installed `petzval` works from any folder.

use std::borrow::Cow;

use include_dir::{Dir, include_dir};
use petzval_design::assets::Assets;
use petzval_design::library::Library;

static DATA: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/../../data");

/// The built-in library of lenses, glasses, sensors, experiments, photographs and weights.
pub fn built_in_assets() -> Library {
    let (mut files, mut open) = (Vec::new(), vec![&DATA]);
    while let Some(folder) = open.pop() {
        open.extend(folder.dirs());
        files.extend(
            folder
                .files()
                .map(|f| (f.path().to_string_lossy().replace('\\', "/"), Cow::Borrowed(f.contents()))),
        );
    }
    files.sort();
    Assets::new(files).into()
}
