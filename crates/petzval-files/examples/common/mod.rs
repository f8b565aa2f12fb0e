//! Reads a lens file with the glass catalogues of the neighbouring folder.

use std::error::Error;
use std::path::Path;

use petzval_files::{LensFile, parse_lens};
use petzval_optics::glass::Catalog;

/// The lens file at `path`, with glasses from the folder `../glasses` relative to the file's folder.
pub fn read_lens(path: &str) -> Result<LensFile, Box<dyn Error>> {
    let mut catalog = Catalog::default();
    for entry in std::fs::read_dir(Path::new(path).with_file_name("../glasses"))? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "toml") {
            catalog.merge(petzval_files::parse_catalog(&std::fs::read_to_string(path)?)?);
        }
    }
    Ok(parse_lens(&std::fs::read_to_string(path)?, &catalog)?)
}
