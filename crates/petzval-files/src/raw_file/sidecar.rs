//! The sidecar of a raw file: a TOML file with metadata that the raw file does not contain.

use std::path::{Path, PathBuf};

use petzval_base::{FileError, InFile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::info::{BlackLevels, MOST_BITS, largest_dn};
use super::packing::{check_length, unpack};
use super::{PackedLayout, Packing, RawFileError, RawFrame, RawInfo};
use petzval_camera::isp::Companding;
use petzval_camera::sensor::CfaPattern;

/// Hint for a missing sidecar.
pub(super) const EXAMPLE: &str = "write one beside it, with lines such as: height = 1200, width = 1920, bits = 12, \
                                  packing = \"mipi\" (or \"lsb\", \"u16le\", \"u16be\")";

/// Hint for a packed file whose length is not that of its layout.
const COMPARE: &str = "compare height, width, bits, packing, row_stride_bytes, header_bytes and footer_bytes of the sidecar \
                       with what the camera wrote";

/// Largest sidecar that is read, bytes.
const MOST_BYTES: u64 = 1 << 20;

/// The content of a sidecar: the layout of a packed file, and camera and exposure of any raw file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sidecar {
    /// Rows, if given.
    pub height: Option<usize>,
    /// Columns, if given.
    pub width: Option<usize>,
    /// Layout of a packed file.
    pub layout: Option<PackedLayout>,
    /// Camera and exposure.
    pub info: RawInfo,
    /// The file's text, for errors that quote it.
    text: String,
    /// The file from which it was read.
    path: PathBuf,
}

/// The keys of the file, in the order in which they are written; TOML leaves out what is none.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Keys {
    /// Built-in name or file of the sensor.
    sensor: Option<String>,
    /// Rows of a packed file.
    height: Option<usize>,
    /// Columns of a packed file.
    width: Option<usize>,
    /// Bits of a pixel.
    bits: Option<u32>,
    /// How the pixels of a packed file are laid out.
    packing: Option<Packing>,
    /// Bytes from one row to the next. Unit: bytes.
    row_stride_bytes: Option<usize>,
    /// Bytes in front of the pixels. Unit: bytes.
    header_bytes: Option<usize>,
    /// Bytes behind the pixels. Unit: bytes.
    footer_bytes: Option<usize>,
    /// Colours of the mosaic.
    cfa: Option<CfaPattern>,
    /// Black level: one, or one for each pixel of the tile of the mosaic, row by row. Unit: DN.
    black_level_dn: Option<BlackLevels>,
    /// Digital number at which pixels are saturated. Unit: DN.
    white_level_dn: Option<f64>,
    /// Exposure time. Unit: s.
    exposure_s: Option<f64>,
    /// Linear gain, 1 for the sensor's system gain.
    linear_gain: Option<f64>,
    /// Distance of pixels. Unit: um.
    pixel_um: Option<f64>,
    /// Temperature of the sensor. Unit: degrees Celsius.
    temperature_c: Option<f64>,
    /// How the developed picture is turned, as EXIF numbers it: 1 as the frame is stored, 3 by half a turn, 6 by a quarter clockwise, 8 by a
    /// quarter anticlockwise.
    orientation: Option<u8>,
    /// File of what an ISP may know of the frame, beside this one.
    calibration: Option<String>,
    /// Curve by which the camera compressed its digital numbers.
    companding: Option<Companding>,
}

/// Path of the sidecar of a raw file: the same name with `.toml` appended.
pub fn sidecar_path(raw: &Path) -> PathBuf {
    let mut name = raw.as_os_str().to_owned();
    name.push(".toml");
    PathBuf::from(name)
}

impl Sidecar {
    /// Reads the sidecar of a raw file, if there is one.
    pub fn beside(raw: &Path) -> Result<Option<Self>, RawFileError> {
        let path = sidecar_path(raw);
        let bytes = match petzval_base::read_at_most(&path, MOST_BYTES) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(RawFileError::io(&path)(error)),
        };
        let Ok(text) = String::from_utf8(bytes) else {
            return Err(RawFileError::content(&path, "the sidecar is not UTF-8 text".to_owned(), EXAMPLE));
        };
        let sidecar = Self::from_toml(&text).map_err(InFile::at(&path))?;
        Ok(Some(Self { path, ..sidecar }))
    }

    /// Reads and checks the text of a sidecar.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let keys: Keys = FileError::read_toml(text)?;
        let info = RawInfo {
            sensor: keys.sensor,
            bits: keys.bits,
            cfa: keys.cfa,
            black_level_dn: keys.black_level_dn.as_ref().and_then(BlackLevels::mean_dn),
            black_tile_dn: keys.black_level_dn.as_ref().and_then(BlackLevels::tile_dn).map(<[f64]>::to_vec),
            white_level_dn: keys.white_level_dn,
            exposure_s: keys.exposure_s,
            linear_gain: keys.linear_gain,
            pixel_um: keys.pixel_um,
            temperature_c: keys.temperature_c,
            orientation: keys.orientation,
            companding: keys.companding,
            calibration: keys.calibration,
        };
        if let Some(levels) = &keys.black_level_dn {
            check_black(text, levels, &info)?;
        }
        check_companding(text, &info)?;
        info.validate().and_then(|()| info.validate_levels()).map_err(|wrong| {
            FileError::at_key(text, &[wrong.key], wrong.to_string()).hint(format!("give {}", wrong.meaning))
        })?;
        let missing = |key: &str| {
            FileError::at_key(text, &[key], format!("a packed file needs the key `{key}`"))
                .hint(format!("add a line `{key} = ...`"))
        };
        let layout = match keys.packing {
            Some(packing) => {
                let height = keys.height.ok_or_else(|| missing("height"))?;
                let width = keys.width.ok_or_else(|| missing("width"))?;
                let bits = keys.bits.ok_or_else(|| missing("bits"))?;
                let tight = PackedLayout::tight(height, width, bits, packing);
                let layout = PackedLayout {
                    row_stride_bytes: keys.row_stride_bytes.unwrap_or(tight.row_stride_bytes),
                    header_bytes: keys.header_bytes.unwrap_or(0),
                    footer_bytes: keys.footer_bytes.unwrap_or(0),
                    ..tight
                };
                layout.file_bytes().map_err(|error| layout_error(text, &error))?;
                Some(layout)
            }
            None => {
                let lost = [
                    ("row_stride_bytes", keys.row_stride_bytes),
                    ("header_bytes", keys.header_bytes),
                    ("footer_bytes", keys.footer_bytes),
                ];
                if let Some((key, _)) = lost.iter().find(|(_, value)| value.is_some()) {
                    let message = "this key belongs to packed files, but `packing` is missing";
                    return Err(FileError::at_key(text, &[key], message).hint(
                        "add packing = \"mipi\", \"lsb\", \"u16le\" or \"u16be\", or remove the line",
                    ));
                }
                None
            }
        };
        let (height, width, path) = (keys.height, keys.width, PathBuf::new());
        Ok(Self { height, width, layout, info, text: text.to_owned(), path })
    }

    /// The sidecar of a frame in a format that defines its own layout.
    pub fn of(frame: &RawFrame) -> Self {
        let info = frame.info.clone();
        Self { height: Some(frame.height), width: Some(frame.width), info, ..Self::default() }
    }

    /// The text of the file.
    pub fn to_toml(&self) -> String {
        let tight = self.layout.map(|l| PackedLayout::tight(l.height, l.width, l.bits, l.packing));
        let differs = |of: fn(&PackedLayout) -> usize| {
            self.layout.as_ref().map(of).filter(|value| tight.as_ref().map(of) != Some(*value))
        };
        let keys = Keys {
            sensor: self.info.sensor.clone(),
            height: self.layout.map(|l| l.height).or(self.height),
            width: self.layout.map(|l| l.width).or(self.width),
            bits: self.layout.map(|l| l.bits).or(self.info.bits),
            packing: self.layout.map(|l| l.packing),
            row_stride_bytes: differs(|l| l.row_stride_bytes),
            header_bytes: differs(|l| l.header_bytes),
            footer_bytes: differs(|l| l.footer_bytes),
            cfa: self.info.cfa,
            black_level_dn: match &self.info.black_tile_dn {
                Some(tile) => Some(BlackLevels::Tile(tile.clone())),
                None => self.info.black_level_dn.map(BlackLevels::One),
            },
            white_level_dn: self.info.white_level_dn,
            exposure_s: self.info.exposure_s,
            linear_gain: self.info.linear_gain,
            pixel_um: self.info.pixel_um,
            temperature_c: self.info.temperature_c,
            orientation: self.info.orientation,
            calibration: self.info.calibration.clone(),
            companding: self.info.companding.clone(),
        };
        // A table of numbers and short texts is always TOML.
        toml::to_string(&keys).unwrap_or_default()
    }

    /// The layout of a packed file.
    fn packed(&self) -> Result<&PackedLayout, RawFileError> {
        self.layout.as_ref().ok_or_else(|| {
            let error = FileError::at_key(&self.text, &["packing"], "a packed file needs the key `packing`");
            InFile::at(&self.path)(error.hint(EXAMPLE)).into()
        })
    }

    /// Refuses a packed file whose length contradicts the sidecar, before any of it is read.
    pub(super) fn check_length(&self, raw: &Path, bytes: u64) -> Result<(), RawFileError> {
        check_length(self.packed()?, bytes).map_err(|e| RawFileError::content(raw, e.to_string(), COMPARE))
    }

    /// Unpacks a file according to the sidecar.
    pub(super) fn unpack(&self, raw: &Path, bytes: &[u8]) -> Result<RawFrame, RawFileError> {
        let layout = self.packed()?;
        let dn = unpack(layout, bytes).map_err(|e| RawFileError::content(raw, e.to_string(), COMPARE))?;
        let frame = RawFrame { height: layout.height, width: layout.width, dn, info: self.info.clone() };
        self.check_knots(raw, frame)
    }

    /// Refuses a companded frame with numbers beyond the last knot, whose light is unknown.
    fn check_knots<T: Copy + Into<u32>>(
        &self,
        raw: &Path,
        frame: RawFrame<T>,
    ) -> Result<RawFrame<T>, RawFileError> {
        let last = frame.info.companding.as_ref().and_then(|c| c.companded_dn.last());
        match last.and_then(|last| frame.first_above(*last)) {
            None => Ok(frame),
            Some((row, col, dn)) => {
                let message = format!("{} has the value {dn} at row {row}, column {col}", raw.display());
                let error = FileError::at_key(&self.text, &["companding", "companded_dn"], message);
                let error = error.hint("give knots up to the largest number that the camera sends");
                Err(InFile::at(&self.path)(error).into())
            }
        }
    }

    /// Adds the metadata of the sidecar to a frame in a format that defines its own layout. The sidecar overrides the file. Fails
    /// if the two contradict each other in size, layout or bits.
    pub(super) fn apply<T: Copy + Into<u32>>(
        &self,
        raw: &Path,
        frame: RawFrame<T>,
    ) -> Result<RawFrame<T>, RawFileError> {
        let at = |key: &str, message: String, hint: &str| {
            let error = FileError::at_key(&self.text, &[key], message).hint(hint);
            Err(InFile::at(&self.path)(error).into())
        };
        let name = raw.display();
        if self.layout.is_some() {
            let message = format!("{name} is not a packed file: its format defines the layout");
            return at("packing", message, "remove `packing` and the keys of the layout");
        }
        for (key, said, is) in [("height", self.height, frame.height), ("width", self.width, frame.width)] {
            if said.is_some_and(|said| said != is) {
                let hint = "is this the sidecar of another frame?";
                return at(key, format!("{name} has the {key} {is}"), hint);
            }
        }
        let frame = RawFrame { info: self.info.clone().or(frame.info), ..frame };
        if let Some((row, col, dn)) = frame.info.bits.and_then(|bits| frame.beyond(bits)) {
            let message = format!("{name} has the value {dn} at row {row}, column {col}");
            return at("bits", message, "give the bits of the numbers in the file; are they shifted up?");
        }
        self.check_knots(raw, frame)
    }
}

/// Refuses levels that are not those of the mosaic's tile.
fn check_black(text: &str, levels: &BlackLevels, info: &RawInfo) -> Result<(), FileError> {
    let wrong = |message: String, hint: &str| {
        Err(FileError::at_key(text, &["black_level_dn"], message).without_value().hint(hint))
    };
    let hint = "give one number, or one for each pixel of the tile, row by row: [64, 65, 65, 63] with cfa = \"RGGB\"";
    let BlackLevels::Tile(tile) = levels else { return Ok(()) };
    if tile.len() == 1
        || levels.tile_dn().is_none() && !tile.is_empty() && tile.iter().all(|dn| dn.is_finite())
    {
        return Ok(());
    }
    let pixels = info.cfa.map(|cfa| cfa.rows() * cfa.cols());
    match pixels {
        None => wrong(format!("{} levels, and `cfa` is missing", tile.len()), hint),
        Some(pixels) if pixels != tile.len() => {
            wrong(format!("{} levels for a tile of {pixels} pixels", tile.len()), hint)
        }
        Some(_) if info.companding.is_some() => wrong(
            "levels of the tile of a companded frame".to_owned(),
            "give one level: that after the expansion",
        ),
        Some(_) => Ok(()),
    }
}

/// Refuses knots that are no curve from 0 upwards within the bits of the file and 24 bits of light.
fn check_companding(text: &str, info: &RawInfo) -> Result<(), FileError> {
    let Some(Companding { companded_dn, linear_dn }) = &info.companding else { return Ok(()) };
    let wrong = |key: &str, message: String, hint: &str| {
        Err(FileError::at_key(text, &["companding", key], message).hint(hint))
    };
    for (key, knots, bits) in [
        ("companded_dn", companded_dn, info.bits.unwrap_or(MOST_BITS).min(MOST_BITS)),
        ("linear_dn", linear_dn, MOST_BITS),
    ] {
        let most = largest_dn(bits);
        if knots.len() < 2 || knots[0] != 0 || knots.windows(2).any(|pair| pair[0] >= pair[1]) {
            let hint = "give the knots of the curve as whole numbers, in ascending order from 0";
            return wrong(key, "is not an ascending list from 0 of at least two numbers".to_owned(), hint);
        }
        if let Some(knot) = knots.iter().find(|knot| **knot > most) {
            let hint = "the last knot is the largest number that the camera sends, and its light";
            return wrong(key, format!("the knot {knot} is above {most}, the largest of {bits} bits"), hint);
        }
    }
    if companded_dn.len() != linear_dn.len() {
        let (sent, light) = (companded_dn.len(), linear_dn.len());
        let hint = "give one number of `linear_dn` for each of `companded_dn`";
        return wrong("linear_dn", format!("has {light} knots, and `companded_dn` has {sent}"), hint);
    }
    Ok(())
}

/// The error for an impossible layout, at the key that causes it.
fn layout_error(text: &str, error: &super::PackingError) -> FileError {
    use super::PackingError as E;
    let (key, hint) = match error {
        E::Bits { .. } => ("bits", "give bits that the packing has, or packing = \"lsb\" or \"u16le\""),
        E::Stride { .. } => ("row_stride_bytes", "leave the key out for rows without padding"),
        _ => ("height", "give the rows and columns of the frame"),
    };
    FileError::at_key(text, &[key], error.to_string()).hint(hint)
}
