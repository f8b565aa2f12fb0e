//! The built-in files, the glasses of the catalogue, and texts of lenses.

use std::fs;
use std::path::{Path, PathBuf};

use petzval_optics::glass::Catalog;

pub fn data(folder: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data").join(folder);
    let files = fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

pub fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

pub fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    for path in data("glasses") {
        let one =
            petzval_files::parse_catalog(&read(&path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        catalog.merge(one);
    }
    catalog
}

pub fn nominal() -> String {
    read(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/lenses/cooke-triplet-nominal.toml"),
    )
}

/// Finite doubles of every exponent, from bits by xorshift.
pub fn odd_number(state: &mut u64) -> f64 {
    loop {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        let value = f64::from_bits(*state);
        if value.is_finite() {
            return value;
        }
    }
}

/// A stop of 10 mm, and 20 mm behind it a plate.
pub const PLATE: &str = "name = \"plate\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 10.0\n[wavelengths]\num = [0.55]\n\
    [fields]\nangle_deg = [0.0, 20.0]\n[[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 20.0\n\
    [[surface]]\nradius_mm = inf\nthickness_mm = 2.0\nglass = \"N-BK7\"\n\
    [[surface]]\nradius_mm = inf\nthickness_mm = 30.0\nsemi_diameter_mm = 9.0\n";
