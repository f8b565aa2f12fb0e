//! Reads and writes raw frames: digital numbers, without a display curve.
//!
//! | file | read | written | metadata in the file |
//! |---|---|---|---|
//! | `.tif`, `.tiff` | gray, 8, 16 or 32 bits | 16 bits | size |
//! | `.png` | gray, 8 or 16 bits | 16 bits | size |
//! | `.raw`, `.bin` | any [`Packing`], with a sidecar | any [`Packing`] | none |
//! | `.npy` | two axes of whole numbers | `<u2` | size |
//! | `.exr` | no | one channel `Y` of 32-bit floats | size |
//! | `.dng` | with the cargo feature `dng` | no | size, mosaic, black and white level |
//!
//! Each page of a TIFF file is a frame ([`page_count`], [`load_raw_page`]).
//!
//! [`load_raw`] reads frames that are measured: 16 bits, linear in light. [`load_any_raw`] reads those of up to 24 bits and companded
//! ones, too, which an image signal processor takes.
//!
//! All other metadata of a frame ([`RawInfo`]) are in a [`Sidecar`]: a TOML file whose name is that of the frame with `.toml`
//! appended. The sidecar overrides the file.

mod calibration;
mod calibration_file;
#[cfg(feature = "dng")]
mod dng;
mod error;
mod format;
mod frame;
mod info;
mod npy;
mod packing;
mod pages;
mod picture;
mod sidecar;
mod statistics;

use std::io::{BufRead, BufReader};
use std::path::Path;

pub use calibration::{BlackAtGain, FrameCalibration};
pub use error::RawFileError;
pub use format::RawFormat;
use frame::{AnyFrame, Unreadable};
pub use frame::{RawFrame, shortest};
pub use info::{BlackLevels, MOST_BITS, RawInfo};
pub use packing::{PackedLayout, Packing, PackingError};
pub(crate) use sidecar::Keys as SidecarKeys;
pub use sidecar::{Sidecar, sidecar_path};
pub use statistics::{ColourStatistics, colour_statistics};

use petzval_base::{create_whole, write_whole};

use crate::picture_file::MOST_PICTURE_BYTES;

/// Reads a frame of digital numbers of at most 16 bits that are linear in light. The file's first bytes or its extension determine the
/// format; a packed frame needs a sidecar.
pub fn load_raw(path: &Path) -> Result<RawFrame, RawFileError> {
    measurable(path, load(path)?)
}

/// Reads a frame of digital numbers of up to 24 bits, companded or not.
pub fn load_any_raw(path: &Path) -> Result<RawFrame<u32>, RawFileError> {
    Ok(load(path)?.widened())
}

/// Refuses a frame whose numbers are not linear in light, or have more than 16 bits.
fn measurable(path: &Path, frame: AnyFrame) -> Result<RawFrame, RawFileError> {
    let hint =
        "develop it with `petzval isp develop`, or give a frame of up to 16 bits that is linear in light";
    let refused = |reason: String| Err(RawFileError::content(path, reason, hint));
    let frame = match frame {
        AnyFrame::Narrow(frame) => frame,
        AnyFrame::Wide(frame) => {
            let (row, col, dn) = frame.first_above(u16::MAX.into()).unwrap_or_default();
            return refused(format!("the value {dn} at row {row}, column {col} has more than 16 bits"));
        }
    };
    match &frame.info {
        RawInfo { companding: Some(_), .. } => refused("its digital numbers are companded".to_owned()),
        RawInfo { bits: Some(bits @ 17..), .. } => refused(format!("digital numbers of {bits} bits")),
        _ => Ok(frame),
    }
}

fn load(path: &Path) -> Result<AnyFrame, RawFileError> {
    // The sidecar comes first: a packed file that contradicts it is not read.
    let sidecar = Sidecar::beside(path)?;
    let is_packed = matches!(RawFormat::of(path, &[]), Some(RawFormat::Packed(_)));
    if is_packed {
        let Some(sidecar) = &sidecar else {
            // A file that is not there is the nearer cause.
            petzval_base::open_file(path).map_err(RawFileError::io(path))?;
            return Err(RawFileError::content(
                path,
                format!("no sidecar {} describes how its numbers are packed", sidecar_path(path).display()),
                sidecar::EXAMPLE,
            ));
        };
        let file = petzval_base::open_file(path).map_err(RawFileError::io(path))?;
        sidecar.check_length(path, file.metadata().map_err(RawFileError::io(path))?.len())?;
        let bytes = petzval_base::read_whole(path).map_err(RawFileError::io(path))?;
        return Ok(AnyFrame::Narrow(sidecar.unpack(path, &bytes)?));
    }
    let bytes = petzval_base::read_at_most(path, MOST_PICTURE_BYTES).map_err(RawFileError::io(path))?;
    let said = |frame: AnyFrame| with_sidecar(path, sidecar.as_ref(), frame);
    let content = |error: Unreadable| RawFileError::content(path, error.reason, error.hint);
    match RawFormat::of(path, &bytes) {
        Some(RawFormat::Npy) => said(npy::decode(&bytes).map_err(content)?),
        Some(RawFormat::Dng) => said(AnyFrame::Narrow(decode_dng(&bytes).map_err(content)?)),
        Some(RawFormat::Exr) => Err(RawFileError::content(
            path,
            "OpenEXR files are written, not read, as raw frames".to_owned(),
            "convert from the TIFF, PNG, NPY or packed file",
        )),
        Some(RawFormat::Tiff | RawFormat::Png | RawFormat::Packed(_)) | None => {
            said(picture::decode(&bytes).map_err(content)?)
        }
    }
}

/// A frame with what its sidecar says.
fn with_sidecar(path: &Path, sidecar: Option<&Sidecar>, frame: AnyFrame) -> Result<AnyFrame, RawFileError> {
    Ok(match (sidecar, frame) {
        (Some(sidecar), AnyFrame::Narrow(frame)) => AnyFrame::Narrow(sidecar.apply(path, frame)?),
        (Some(sidecar), AnyFrame::Wide(frame)) => AnyFrame::Wide(sidecar.apply(path, frame)?),
        (None, frame) => frame,
    })
}

/// Whether [`load_raw`] is the reader of a file: every raw format, and TIFF and PNG of gray integers. Pictures in colour or of floats are
/// not digital numbers, and [`load_image`](crate::load_image) reads them.
pub fn holds_digital_numbers(path: &Path) -> Result<bool, RawFileError> {
    let mut file = BufReader::new(petzval_base::open_file(path).map_err(RawFileError::io(path))?);
    let format = RawFormat::of(path, file.fill_buf().map_err(RawFileError::io(path))?);
    Ok(match format {
        Some(RawFormat::Packed(_) | RawFormat::Npy | RawFormat::Dng) => true,
        Some(RawFormat::Tiff | RawFormat::Png) => picture::gray_bits(file).is_some(),
        Some(RawFormat::Exr) | None => false,
    })
}

/// Camera and exposure as the sidecar and the head of a TIFF or PNG file state them, before its numbers are read. `None` of other files.
pub fn stated_info(path: &Path) -> Result<Option<RawInfo>, RawFileError> {
    let sidecar = Sidecar::beside(path)?;
    let mut file = BufReader::new(petzval_base::open_file(path).map_err(RawFileError::io(path))?);
    let format = RawFormat::of(path, file.fill_buf().map_err(RawFileError::io(path))?);
    let is_picture = matches!(format, Some(RawFormat::Tiff | RawFormat::Png));
    let Some(stored) = is_picture.then(|| picture::gray_bits(file)).flatten() else { return Ok(None) };
    // The numbers of a 16-bit file may have fewer bits.
    let of_file = RawInfo { bits: (stored == 8).then_some(8), ..RawInfo::default() };
    Ok(Some(sidecar.map(|sidecar| sidecar.info).unwrap_or_default().or(of_file)))
}

/// Number of frames in a file: for a TIFF its pages without thumbnails and masks, for every other file 1.
pub fn page_count(path: &Path) -> Result<usize, RawFileError> {
    let mut file = BufReader::new(petzval_base::open_file(path).map_err(RawFileError::io(path))?);
    let head = file.fill_buf().map_err(RawFileError::io(path))?;
    // A DNG looks like a TIFF, but has its own reader.
    if !pages::is_tiff(head) || RawFormat::of(path, head) == Some(RawFormat::Dng) {
        return Ok(1);
    }
    let content = |error: Unreadable| RawFileError::content(path, error.reason, error.hint);
    Ok(pages::pages(file).map_err(content)?.len())
}

/// Reads one page, counted from 0, of a TIFF file. The sidecar of the file applies to every page.
pub fn load_raw_page(path: &Path, page: usize) -> Result<RawFrame, RawFileError> {
    let content = |error: Unreadable| RawFileError::content(path, error.reason, error.hint);
    let open = || petzval_base::open_file(path).map(BufReader::new).map_err(RawFileError::io(path));
    let places = pages::pages(open()?).map_err(content)?;
    let Some(place) = places.get(page) else {
        let reason = format!("the file has {} pages, and page {} was requested", places.len(), page + 1);
        let hint = "has the file changed since its pages were counted?";
        return Err(RawFileError::content(path, reason, hint));
    };
    let frame = pages::decode_page(open()?, *place, 0).map_err(content)?;
    measurable(path, with_sidecar(path, Sidecar::beside(path)?.as_ref(), frame)?)
}

/// Writes a frame and its sidecar. `format` decides the format, not the file's name.
///
/// The sidecar is always written, so that an old sidecar of another frame of the same name is replaced.
pub fn save_raw(frame: &RawFrame, path: &Path, format: RawFormat) -> Result<(), RawFileError> {
    save_with(write_whole, frame, path, format)
}

/// The same where no file is; fails with `AlreadyExists` of the system if there is one.
pub fn create_raw(frame: &RawFrame, path: &Path, format: RawFormat) -> Result<(), RawFileError> {
    save_with(create_whole, frame, path, format)
}

fn save_with(
    write: impl Fn(&Path, &[u8]) -> std::io::Result<()>,
    frame: &RawFrame,
    path: &Path,
    format: RawFormat,
) -> Result<(), RawFileError> {
    let (bytes, sidecar) = encode(frame, path, format)?;
    let beside = sidecar_path(path);
    write(path, &bytes).map_err(RawFileError::io(path))?;
    write_whole(&beside, sidecar.to_toml().as_bytes()).map_err(RawFileError::io(&beside))
}

/// Writes a frame without a sidecar, for frames whose metadata are listed elsewhere. A packed frame cannot be read without
/// its sidecar.
pub fn save_raw_alone(frame: &RawFrame, path: &Path, format: RawFormat) -> Result<(), RawFileError> {
    let (bytes, _) = encode(frame, path, format)?;
    write_whole(path, &bytes).map_err(RawFileError::io(path))
}

/// The bytes of a file, and its sidecar.
fn encode(frame: &RawFrame, path: &Path, format: RawFormat) -> Result<(Vec<u8>, Sidecar), RawFileError> {
    let content = |error: Unreadable| RawFileError::content(path, error.reason, error.hint);
    if frame.height == 0 || frame.width == 0 || frame.dn.len() != frame.height * frame.width {
        let reason =
            format!("{} numbers do not fill {} x {} pixels", frame.dn.len(), frame.width, frame.height);
        return Err(RawFileError::content(path, reason, "give one number per pixel, and at least one pixel"));
    }
    let mut sidecar = Sidecar::of(frame);
    let bytes = match format {
        RawFormat::Tiff => picture::encode(frame, ::image::ImageFormat::Tiff).map_err(content)?,
        RawFormat::Png => picture::encode(frame, ::image::ImageFormat::Png).map_err(content)?,
        RawFormat::Npy => npy::encode(frame).map_err(content)?,
        RawFormat::Exr => {
            let values: Vec<f32> = frame.dn.iter().map(|v| f32::from(*v)).collect();
            crate::exr_bytes(frame.height, frame.width, &[("Y", &values)])
                .map_err(|reason| RawFileError::content(path, reason, "write a TIFF"))?
        }
        RawFormat::Packed(packing) => {
            let bits = frame.info.bits.unwrap_or(16);
            let layout = PackedLayout::tight(frame.height, frame.width, bits, packing);
            sidecar.layout = Some(layout);
            let fits = "give a packing and a number of bits that hold every digital number";
            packing::pack(&layout, &frame.dn)
                .map_err(|error| RawFileError::content(path, error.to_string(), fits))?
        }
        RawFormat::Dng => {
            let hint = "write .tiff, .png, .npy or .raw";
            return Err(RawFileError::content(path, "DNG files are read, not written".to_owned(), hint));
        }
    };
    Ok((bytes, sidecar))
}

#[cfg(feature = "dng")]
fn decode_dng(bytes: &[u8]) -> Result<RawFrame, Unreadable> {
    dng::decode(bytes)
}

#[cfg(not(feature = "dng"))]
fn decode_dng(_: &[u8]) -> Result<RawFrame, Unreadable> {
    Err(Unreadable {
        reason: "this build does not read DNG files".to_owned(),
        hint: "build with the cargo feature `dng`, or convert the file to a 16-bit gray TIFF without any curve",
    })
}

#[cfg(test)]
mod tests;
