//! The description of a network that takes the place of ray tracing, beside its weights and its lens.

use petzval_base::FileError;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A network that gives the PSFs of the lenses of one design space, and how far they are from exact ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpticsProxyFile {
    /// What it is, for readers.
    pub about: String,
    /// File of the lens whose bounds span the lenses, relative to this one.
    pub lens: String,
    /// File of the weights, relative to this one.
    pub weights: String,
    /// Wavelengths of the red, green and blue channel, um.
    pub wavelengths_um: [f64; 3],
    /// Cells a side of a PSF.
    pub grid: usize,
    /// Size of a cell, um.
    pub pitch_um: f64,
    /// Image radius of the outermost field, mm.
    pub corner_mm: f64,
    /// Half-range of the image plane around the paraxial focus, mm.
    pub defocus_mm: f64,
    /// Width of the two hidden layers.
    pub hidden: usize,
    /// Channels of the decoder.
    pub channels: usize,
    /// Means of the inputs: the coordinates of the lens in the order of its variables (a curvature for a radius), the defocus, the field.
    pub mean: Vec<f64>,
    /// Their standard deviations.
    pub deviation: Vec<f64>,
    /// How it was trained, for readers.
    #[serde(default)]
    pub training: Table,
    /// How far it is from exact tracing, for readers.
    #[serde(default)]
    pub gap: Table,
}

impl OpticsProxyFile {
    /// Reads a description.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let file: Self = FileError::read_toml(text)?;
        if file.mean.len() != file.deviation.len() {
            return Err(FileError::at_key(text, &["deviation"], "there must be as many as means"));
        }
        match file.deviation.iter().find(|d| !(**d > 0.0 && d.is_finite())) {
            Some(d) => Err(FileError::at_key(text, &["deviation"], format!("{d}: must be positive"))),
            None => Ok(file),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_comes_back_and_a_damaged_one_is_refused() {
        let file = OpticsProxyFile {
            about: "a network".into(),
            lens: "lens.toml".into(),
            weights: "weights.bin".into(),
            wavelengths_um: [0.62, 0.55, 0.486],
            grid: 128,
            pitch_um: 1.0,
            corner_mm: 6.633 + 1.0 / 3.0,
            defocus_mm: 0.5,
            hidden: 128,
            channels: 64,
            mean: vec![0.1, 2.0],
            deviation: vec![0.01, 1.0],
            training: Table::new(),
            gap: Table::new(),
        };
        let text = toml::to_string(&file).unwrap();
        assert_eq!(OpticsProxyFile::parse(&text).unwrap(), file);
        for (from, to, wanted) in [
            ("[0.01, 1.0]", "[0.01]", "as many as means"),
            ("[0.01, 1.0]", "[0.0, 1.0]", "must be positive"),
            ("grid = 128", "gird = 128", "gird"),
        ] {
            let error = OpticsProxyFile::parse(&text.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
