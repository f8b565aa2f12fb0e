//! The built-in library with the glasses that the user of the command chose.

use std::sync::OnceLock;

use petzval_design::assets::Assets;
use petzval_optics::glass::Catalog;

/// What [`choose_glasses`] was called with.
static CHOSEN: OnceLock<Catalog> = OnceLock::new();

/// Lets these glasses win over the built-in ones in every library from now on. Only the first call has an effect: it is for
/// programs with a command line, whose user chooses once.
pub fn choose_glasses(glasses: Catalog) {
    let _ = CHOSEN.set(glasses);
}

/// The built-in library of lenses, glasses, sensors, experiments, photographs and weights, with the glasses that were
/// chosen.
pub fn built_in_assets() -> Assets {
    petzval_jobs::built_in_assets().with_glasses(CHOSEN.get().cloned().unwrap_or_default())
}
