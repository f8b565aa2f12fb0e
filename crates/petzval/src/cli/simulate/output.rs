//! What a simulation writes: the raw frame with its sidecar, and the developed picture.

use std::path::Path;

use clap::ValueEnum;
use petzval::camera::image::{ImageError, LinearImage, save_exr, save_npy, save_png};
use petzval::camera::raw_file::{Packing, RawFormat, RawFrame, save_raw, sidecar_path};
use petzval::camera::sensor::{Raw, SensorModel};
use petzval::design::error::DesignError;
use serde_json::{Value, json};

use super::Failure;

/// How the raw frame is written.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum RawAs {
    /// 16-bit gray TIFF.
    Tiff,
    /// 16-bit gray PNG.
    Png,
    /// `.raw`, packed as MIPI CSI-2 does where the sensor has 8, 10, 12 or 14 bits, else contiguous bits.
    Packed,
    /// NumPy array, uint16.
    Npy,
}

/// How the developed picture is written.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum PictureAs {
    /// 8-bit sRGB PNG.
    Png,
    /// OpenEXR, 32-bit floats, linear light.
    Exr,
    /// NumPy array, float32 [plane, row, column], linear light.
    Npy,
}

impl RawAs {
    fn format(self, bits: u32) -> RawFormat {
        match self {
            Self::Tiff => RawFormat::Tiff,
            Self::Png => RawFormat::Png,
            Self::Packed => RawFormat::Packed(Packing::for_bits(bits)),
            Self::Npy => RawFormat::Npy,
        }
    }
}

/// Formats of the results.
#[derive(Debug, clap::Args)]
pub struct Formats {
    /// Format of the raw frame
    #[arg(long, value_enum, default_value = "tiff", value_name = "FORMAT")]
    raw_format: RawAs,
    /// Format of the developed picture
    #[arg(long, value_enum, default_value = "png", value_name = "FORMAT")]
    picture_format: PictureAs,
}

/// Writes the results of one image as NAME-raw.* and NAME-developed.* and says where they are.
pub fn write(
    formats: &Formats,
    folder: &Path,
    name: &str,
    raw: &Raw,
    sensor: &SensorModel,
    developed: &LinearImage,
) -> Result<serde_json::Map<String, Value>, Failure> {
    let format = formats.raw_format.format(sensor.bits);
    let raw_path = folder.join(format!("{name}-raw.{}", format.extension()));
    save_raw(&RawFrame::from_raw(raw, sensor), &raw_path, format)?;
    let (extension, save): (_, fn(&LinearImage, &Path) -> Result<(), ImageError>) =
        match formats.picture_format {
            PictureAs::Png => ("png", save_png),
            PictureAs::Exr => ("exr", save_exr),
            PictureAs::Npy => ("npy", save_npy),
        };
    let developed_path = folder.join(format!("{name}-developed.{extension}"));
    save(developed, &developed_path).map_err(DesignError::from)?;
    let facts = [
        ("image", json!(name)),
        ("raw", json!(raw_path.display().to_string())),
        ("sidecar", json!(sidecar_path(&raw_path).display().to_string())),
        ("developed", json!(developed_path.display().to_string())),
        ("black_level_dn", json!(sensor.black_level_dn)),
        ("cfa", json!(sensor.cfa)),
    ];
    Ok(facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}
