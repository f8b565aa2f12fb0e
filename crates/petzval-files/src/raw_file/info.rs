//! Metadata of a raw frame.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use petzval_camera::isp::Companding;
use petzval_camera::sensor::{CfaPattern, OutOfRange};

/// Most bits of a digital number.
pub const MOST_BITS: u32 = 24;

/// Most bits of a digital number in files whose frames are measured.
pub(super) const MOST_NARROW_BITS: u32 = 16;

/// Camera and exposure of a frame, as far as the file and its sidecar give them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RawInfo {
    /// Name of the sensor or camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// Bits of the numbers in the file, 0..2^bits - 1: those of the converter, or of a merged frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
    /// Colour filter array, from the frame's first pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cfa: Option<CfaPattern>,
    /// Digital number without light at the camera's settings, DN; of a companded frame the expanded one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_level_dn: Option<f64>,
    /// The same for each pixel of the tile of the mosaic, row by row, DN, where they differ; the level above is then their mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_tile_dn: Option<Vec<f64>>,
    /// Digital number of saturation, DN; of a companded frame the expanded one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_level_dn: Option<f64>,
    /// Exposure time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure_s: Option<f64>,
    /// Linear analogue gain, 1 = the sensor's system gain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear_gain: Option<f64>,
    /// Pixel pitch, um.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_um: Option<f64>,
    /// Temperature of the sensor, degrees Celsius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// How the developed picture is turned, as EXIF numbers it, 1 to 8: 1 as the frame is stored, 3 by half a turn, 6 by a quarter clockwise, 8 by a
    /// quarter anticlockwise. The digital numbers are never turned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation: Option<u8>,
    /// Expansion of companded digital numbers; none where they are linear in light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub companding: Option<Companding>,
    /// File of the frame's [calibration](super::FrameCalibration), from the folder of the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
}

impl RawInfo {
    /// Checks that every given number is finite and in its physical range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let is_narrow = self.companding.is_none() && self.bits.is_none_or(|bits| bits <= MOST_NARROW_BITS);
        let most_dn = f64::from(largest_dn(if is_narrow { MOST_NARROW_BITS } else { MOST_BITS }));
        let checks = [
            (
                "bits",
                self.bits.map(f64::from),
                1.0,
                MOST_BITS.into(),
                "the bits of a digital number, 1 to 24",
            ),
            ("black_level_dn", self.black_level_dn, 0.0, most_dn, "the black level in DN"),
            ("white_level_dn", self.white_level_dn, 1.0, most_dn, "the digital number of saturation"),
            ("exposure_s", self.exposure_s, 0.0, 1e6, "the exposure time in seconds"),
            ("linear_gain", self.linear_gain, 1e-6, 1e6, "the linear gain, 1 for 0 dB"),
            ("pixel_um", self.pixel_um, 0.1, 1000.0, "the pixel pitch in um"),
            ("temperature_c", self.temperature_c, -273.15, 1000.0, "the temperature in degrees Celsius"),
            (
                "orientation",
                self.orientation.map(f64::from),
                1.0,
                8.0,
                "the orientation as EXIF numbers it: 1 to keep the picture as it is stored",
            ),
        ];
        let tile = self.black_tile_dn.iter().flatten();
        let tile = tile.map(|dn| ("black_level_dn", Some(*dn), 0.0, most_dn, "the black levels in DN"));
        for (key, value, low, high, meaning) in checks.into_iter().chain(tile) {
            if let Some(value) = value.filter(|v| !(low..=high).contains(v)) {
                return Err(OutOfRange { key, value, low, high, meaning });
            }
        }
        Ok(())
    }

    /// Checks the levels against each other and against the bits of the numbers: black lies below saturation, and a number that is not companded
    /// is at most 2^bits - 1.
    pub fn validate_levels(&self) -> Result<(), OutOfRange> {
        let bits = self.bits.filter(|_| self.companding.is_none()).unwrap_or(MOST_BITS);
        let most_dn = f64::from(largest_dn(bits));
        let levels = self.black_tile_dn.iter().flatten().copied().chain(self.black_level_dn);
        let black_dn = levels.reduce(f64::max);
        let least_white_dn = black_dn.unwrap_or(0.0) + 1.0;
        let checks = [
            (
                "black_level_dn",
                black_dn,
                0.0,
                most_dn - 1.0,
                "a black level below the largest number of the bits",
            ),
            (
                "white_level_dn",
                self.white_level_dn,
                least_white_dn,
                most_dn,
                "the digital number of saturation: above the black level, and at most 2^bits - 1",
            ),
        ];
        for (key, value, low, high, meaning) in checks {
            if let Some(value) = value.filter(|v| !(low..=high).contains(v)) {
                return Err(OutOfRange { key, value, low, high, meaning });
            }
        }
        Ok(())
    }

    /// This metadata, with missing values taken from `other`.
    pub fn or(self, other: Self) -> Self {
        Self {
            sensor: self.sensor.or(other.sensor),
            bits: self.bits.or(other.bits),
            cfa: self.cfa.or(other.cfa),
            // A level that is stated replaces the tile of the file.
            black_tile_dn: self
                .black_tile_dn
                .or(other.black_tile_dn.filter(|_| self.black_level_dn.is_none())),
            black_level_dn: self.black_level_dn.or(other.black_level_dn),
            white_level_dn: self.white_level_dn.or(other.white_level_dn),
            exposure_s: self.exposure_s.or(other.exposure_s),
            linear_gain: self.linear_gain.or(other.linear_gain),
            pixel_um: self.pixel_um.or(other.pixel_um),
            temperature_c: self.temperature_c.or(other.temperature_c),
            orientation: self.orientation.or(other.orientation),
            companding: self.companding.or(other.companding),
            calibration: self.calibration.or(other.calibration),
        }
    }
}

impl RawInfo {
    /// The black level of a pixel of a frame, DN, if it is known.
    pub fn black_at_dn(&self, row: usize, col: usize) -> Option<f64> {
        match (&self.black_tile_dn, self.cfa) {
            (Some(tile), Some(cfa)) => {
                tile.get(row % cfa.rows() * cfa.cols() + col % cfa.cols()).copied().or(self.black_level_dn)
            }
            _ => self.black_level_dn,
        }
    }
}

/// Black levels as a file states them: one, or one for each pixel of the tile of the mosaic, row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum BlackLevels {
    /// One level of all pixels, DN.
    One(f64),
    /// One of each pixel of the tile, DN.
    Tile(Vec<f64>),
}

impl BlackLevels {
    /// Mean level, DN; none of no level.
    pub fn mean_dn(&self) -> Option<f64> {
        match self {
            Self::One(dn) => Some(*dn),
            Self::Tile(dn) => (!dn.is_empty()).then(|| dn.iter().sum::<f64>() / dn.len() as f64),
        }
    }

    /// The levels of the tile where they differ.
    pub fn tile_dn(&self) -> Option<&[f64]> {
        match self {
            Self::Tile(dn) if dn.iter().any(|level| *level != dn[0]) => Some(dn),
            _ => None,
        }
    }

    /// Each level.
    pub fn each_dn(&self) -> &[f64] {
        match self {
            Self::One(dn) => std::slice::from_ref(dn),
            Self::Tile(dn) => dn,
        }
    }
}

/// The orientation of a file, if it turns the picture: 2 to 8. A file that keeps it says nothing, and neither does one with another number.
pub(super) fn turning(exif: u64) -> Option<u8> {
    u8::try_from(exif).ok().filter(|exif| (2..=8).contains(exif))
}

/// Largest digital number of so many bits, `2^bits - 1`.
pub(super) fn largest_dn(bits: u32) -> u32 {
    (1 << bits.min(MOST_BITS)) - 1
}
