//! `glass`: looks glasses up, finds those with a given index and dispersion, and reads the user's catalogues.

mod catalogs;
pub mod find;
pub mod list;
pub mod show;

use petzval_optics::glass::Glass;

pub use catalogs::{ChosenGlasses, read_glasses};

/// Whether a glass is of a maker, by any part of the maker's name in upper or lower case; without a maker every glass is.
fn is_made_by(glass: &Glass, maker: Option<&str>) -> bool {
    maker.is_none_or(|maker| glass.maker.to_lowercase().contains(&maker.to_lowercase()))
}

/// How the maker offers a glass, as the word of glass files: preferred, standard, special, obsolete or melt.
fn status(glass: &Glass) -> Option<String> {
    glass.status.map(|status| status.word().to_owned())
}
