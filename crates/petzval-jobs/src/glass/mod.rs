//! `glass`: looks glasses up, finds those with a given index and dispersion, and reads the user's catalogues.

mod catalogs;
pub mod find;
pub mod list;
pub mod show;

use std::sync::Arc;

use petzval_design::library::Library;
use petzval_optics::glass::{Glass, LINE_C_UM, LINE_F_UM, LINE_G_UM};

use crate::error::{JobError, Result};
use crate::finite::finite;

pub use catalogs::{ChosenGlasses, context_with, library_with, read_glasses};

/// The glass of a name, or of `MAKER:NAME`.
pub fn named(name: &str, library: &Library) -> Result<Arc<Glass>> {
    library.catalog()?.get(name).map_err(|unknown| {
        let nearest = unknown.nearest.join(", ");
        let hint = format!("the nearest names are {nearest}; `petzval glass list` shows every glass");
        JobError::input(unknown.reason(), hint)
    })
}

/// Whether a glass is of a maker, by any part of the maker's name in upper or lower case; without a maker every glass is.
fn is_made_by(glass: &Glass, maker: Option<&str>) -> bool {
    maker.is_none_or(|maker| glass.maker.to_lowercase().contains(&maker.to_lowercase()))
}

/// A figure of a glass that takes the index at these lines, um; `None` where its formula does not hold at one of them, as at the d line for a glass
/// of the infrared.
fn at_lines(glass: &Glass, lines_um: &[f64], value: f64) -> Option<f64> {
    finite(value).filter(|_| !lines_um.iter().any(|um| glass.is_outside_range(*um)))
}

/// Partial dispersion from the g to the F line.
fn p_gf(glass: &Glass) -> Option<f64> {
    at_lines(glass, &[LINE_G_UM, LINE_F_UM, LINE_C_UM], glass.partial_dispersion_gf())
}

/// How the maker offers a glass, as the word of glass files: preferred, standard, special, obsolete or melt.
fn status(glass: &Glass) -> Option<String> {
    glass.status.map(|status| status.word().to_owned())
}
