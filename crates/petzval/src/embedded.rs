//! The `data/` folder, built into the program: an installed `petzval` works from any folder.

use std::borrow::Cow;
use std::path::Path;
use std::sync::OnceLock;

use include_dir::{Dir, include_dir};
use petzval_design::assets::Assets;
use petzval_files::Loss;
use petzval_optics::glass::Catalog;

static DATA: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/../../data");

/// What [`choose_glasses`] was called with.
static CHOSEN: OnceLock<Catalog> = OnceLock::new();

/// Lets these glasses win over the built-in ones in every library from now on. The first call counts; it is there for
/// programs with a command line, whose user chooses once.
pub fn choose_glasses(glasses: Catalog) {
    let _ = CHOSEN.set(glasses);
}

/// The built-in library of lenses, glasses, sensors, experiments, photographs and weights, with the glasses that were
/// chosen. What lenses of other programs lose when they are read, and what is odd about the glasses of any lens, is told
/// on stderr.
pub fn built_in_assets() -> Assets {
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
    Assets::new(files)
        .with_glasses(CHOSEN.get().cloned().unwrap_or_default())
        .telling_losses(|path, loss| eprintln!("warning: {}", told(path, loss)))
        .telling_glass_warnings(|path, warning| eprintln!("warning: {}: {warning}", path.display()))
}

/// A loss with the file it is from, as `FILE:LINE: ...`.
pub fn told(path: &Path, loss: &Loss) -> String {
    let placeless = Loss { line: None, ..loss.clone() };
    match loss.line {
        Some(line) => format!("{}:{line}: {placeless}", path.display()),
        None => format!("{}: {placeless}", path.display()),
    }
}
