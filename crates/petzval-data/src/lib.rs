//! The files that Petzval carries: lenses, glasses, sensors, spectra, ISPs, tasks, experiments, studies, photographs and network weights. An
//! installed program works from any folder.
//!
//! Photographs and weights have licences of their own, see `data/photos/README.md` and `data/weights/README.md`.

use include_dir::{Dir, include_dir};

/// All files, by their paths below `data/`.
pub static ALL: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/data");

/// Spectra, as CSV: a wavelength in nm, and a column for each curve.
pub mod spectra {
    /// Colour-matching functions of the CIE 1931 observer.
    pub const CIE_1931: &str = include_str!("../data/spectra/cie1931.csv");

    /// Reflectances of the ColorChecker's fields by Ohta.
    pub const COLORCHECKER_OHTA: &str = include_str!("../data/spectra/colorchecker-ohta.csv");

    /// Reflectances of the ColorChecker's fields by BabelColor.
    pub const COLORCHECKER_BABELCOLOR: &str = include_str!("../data/spectra/colorchecker-babelcolor.csv");

    /// Illuminants.
    pub const ILLUMINANTS: &str = include_str!("../data/spectra/illuminants.csv");

    /// Three smooth reflectances whose mixtures give linear sRGB.
    pub const SRGB_BASIS: &str = include_str!("../data/spectra/srgb-basis.csv");
}

/// Tasks with their classes, as TOML.
pub mod tasks {
    /// The files by their names.
    pub const PRESETS: [(&str, &str); 3] = [
        ("pedestrian-vehicle", include_str!("../data/tasks/pedestrian-vehicle.toml")),
        ("traffic-light", include_str!("../data/tasks/traffic-light.toml")),
        ("street-segmentation", include_str!("../data/tasks/street-segmentation.toml")),
    ];
}
