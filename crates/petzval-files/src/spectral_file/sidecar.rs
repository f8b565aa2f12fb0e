//! The sidecar of an array file: wavelengths, order of the axes, unit.

use std::path::{Path, PathBuf};

use petzval_base::FileError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The unit of all spectral images.
pub const UNIT: &str = "W m-2 sr-1 nm-1";

/// Order of the axes of an array.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axes {
    /// `[bands, rows, columns]`.
    #[default]
    BandsFirst,
    /// `[rows, columns, bands]`.
    BandsLast,
}

/// The file `NAME.toml` beside `NAME.npy` or `NAME.tif`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// Wavelength of each band, um, ascending.
    pub wavelength_um: Vec<f64>,
    /// Order of the axes; not used for TIFF.
    #[serde(default)]
    pub axes: Axes,
    /// Factor from the file's values to radiance in W m-2 sr-1 nm-1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Unit of the values after the factor; only `W m-2 sr-1 nm-1`.
    #[serde(default = "unit")]
    pub unit: String,
}

fn one() -> f64 {
    1.0
}

fn unit() -> String {
    UNIT.to_owned()
}

/// The keys that are used in the sidecar of an OpenEXR file. Its channel names hold the wavelengths; wavelengths in the
/// sidecar belong to an array of the same name.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Scale {
    #[serde(default, rename = "wavelength_um")]
    _wavelength_um: Option<serde::de::IgnoredAny>,
    #[serde(default, rename = "axes")]
    _axes: Option<serde::de::IgnoredAny>,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default = "unit")]
    unit: String,
}

/// Reads the factor in the sidecar of an OpenEXR file.
pub(super) fn parse_scale(text: &str) -> Result<f64, FileError> {
    let read: Scale = FileError::read_toml(text)?;
    check_unit(text, read.scale, &read.unit)?;
    Ok(read.scale)
}

fn check_unit(text: &str, scale: f64, unit: &str) -> Result<(), FileError> {
    if !(scale.is_finite() && scale > 0.0) {
        return Err(FileError::at_key(text, &["scale"], "the factor is not positive".to_owned())
            .hint("leave it out if the values are in the unit".to_owned()));
    }
    if unit != UNIT {
        return Err(FileError::at_key(text, &["unit"], format!("only `{UNIT}` is read"))
            .hint("give the factor to that unit as `scale`".to_owned()));
    }
    Ok(())
}

/// The sidecar of an image: the same name with the ending `.toml`.
pub fn sidecar_path(image: &Path) -> PathBuf {
    image.with_extension("toml")
}

impl Sidecar {
    /// Reads and checks a sidecar.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let sidecar: Self = FileError::read_toml(text)?;
        let wrong = |key: &str, message: &str, hint: &str| {
            Err(FileError::at_key(text, &[key], message.to_owned()).hint(hint.to_owned()))
        };
        let um = &sidecar.wavelength_um;
        let ascending = um.windows(2).all(|w| w[0] < w[1]);
        if um.len() < 2 || !ascending || !um.iter().all(|v| (0.01..=100.0).contains(v)) {
            let message = "these are not at least two ascending wavelengths in um";
            return wrong("wavelength_um", message, "400 nm are 0.4 um");
        }
        check_unit(text, sidecar.scale, &sidecar.unit)?;
        Ok(sidecar)
    }
}
