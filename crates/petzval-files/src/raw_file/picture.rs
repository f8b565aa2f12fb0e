//! Raw frames as gray TIFF and PNG pictures.

use std::io::{BufRead, Cursor, Seek};

use super::frame::{AnyFrame, MOST_EXPANSION, MOST_PIXELS, RawFrame, Unreadable, WORK_SPACE, check_memory};
use super::info::{RawInfo, turning};
use super::pages::{decode_page, is_tiff, pages};
use crate::picture_file::reader_of;
use crate::undecoded;
use ::image::{ColorType, DynamicImage, ImageBuffer, ImageDecoder, ImageFormat, ImageReader, Limits, Luma};

/// What a raw frame may be.
const HINT: &str = "a raw frame is a gray TIFF or PNG of 8 or 16 bits, a NumPy array of whole numbers (.npy), packed numbers with a \
                    sidecar (.raw), or a DNG";

/// Reads the only picture of a file, gray with 8 or 16 bits, or a TIFF with 32.
pub(super) fn decode(bytes: &[u8]) -> Result<AnyFrame, Unreadable> {
    if is_tiff(bytes) {
        return match pages(Cursor::new(bytes))?[..] {
            [place] => decode_page(Cursor::new(bytes), place, bytes.len() as u64),
            ref all => Err(Unreadable {
                reason: format!("a TIFF file of {} pages, but a raw frame is one page", all.len()),
                hint: "split it; only in the captures of a characterisation are the pages of a file frames of a point",
            }),
        };
    }
    let unreadable = |reason: String| Unreadable { reason, hint: HINT };
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| unreadable(e.to_string()))?;
    check_kept(bytes, reader.format()).map_err(unreadable)?;
    // A damaged header can claim any size: limit the picture to what the file's bytes can expand to.
    let mut limits = Limits::default();
    let held = bytes.len() as u64;
    let expanded = MOST_EXPANSION.saturating_mul(held);
    check_head(bytes, expanded)?;
    let most = expanded.min(2 * MOST_PIXELS);
    limits.max_alloc = Some(most + WORK_SPACE);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| unreadable(undecoded(&e)))?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let (dn, bits): (Vec<u16>, _) = match picture {
        DynamicImage::ImageLuma16(gray) => (gray.into_raw(), None),
        DynamicImage::ImageLuma8(gray) => (gray.into_raw().into_iter().map(u16::from).collect(), Some(8)),
        other => {
            let colour = other.color();
            let kind =
                if colour.has_color() { "a colour picture" } else { "a gray picture with transparency" };
            let bits = 8 * u32::from(colour.bytes_per_pixel()) / u32::from(colour.channel_count().max(1));
            return Err(unreadable(format!("{kind} of {bits} bits a sample, not digital numbers")));
        }
    };
    if dn.is_empty() {
        return Err(unreadable("the picture is empty".to_owned()));
    }
    let info = RawInfo { bits, orientation: orientation(bytes), ..RawInfo::default() };
    Ok(AnyFrame::Narrow(RawFrame { height, width, dn, info }))
}

/// Refuses a picture whose head says that reading it takes too much memory, if the file can expand to so many bytes. Errors of a damaged head are
/// those of the decoder.
fn check_head(bytes: &[u8], expanded: u64) -> Result<(), Unreadable> {
    let decoder = reader_of(Cursor::new(bytes)).ok().and_then(|reader| reader.into_decoder().ok());
    let Some(decoder) = decoder.filter(|decoder| decoder.total_bytes() <= expanded) else { return Ok(()) };
    let (width, height) = decoder.dimensions();
    let sample = u64::from(decoder.color_type().bytes_per_pixel());
    // Numbers of 8 bits are copied to 16.
    let copy = if sample == 1 { 2 } else { 0 };
    check_memory((width.into(), height.into()), bytes.len() as u64, sample + copy)
}

/// The orientation in the EXIF data of a picture, if it turns the picture.
fn orientation(bytes: &[u8]) -> Option<u8> {
    let mut decoder = reader_of(Cursor::new(bytes)).ok()?.into_decoder().ok()?;
    turning(decoder.orientation().ok()?.to_exif().into())
}

/// Bits of the gray integers of a TIFF or PNG file, 8 or 16, as far as its header says; none of others.
pub(super) fn gray_bits(file: impl BufRead + Seek) -> Option<u32> {
    let decoder = reader_of(file).ok().and_then(|reader| reader.into_decoder().ok())?;
    match decoder.color_type() {
        ColorType::L8 => Some(8),
        ColorType::L16 => Some(16),
        _ => None,
    }
}

/// Refuses PNG pictures of fewer than 8 bits, which the decoder would spread to 8 bits, and all other formats, such as JPEG.
fn check_kept(bytes: &[u8], format: Option<ImageFormat>) -> Result<(), String> {
    match format {
        // Byte 24 holds the bits per sample, after signature, length and name of the header, width and height.
        Some(ImageFormat::Png) => match *bytes.get(24).ok_or("the file ends in its header")? {
            8 | 16 => Ok(()),
            bits => Err(format!("samples of {bits} bits")),
        },
        _ => Err("neither a TIFF nor a PNG picture".to_owned()),
    }
}

/// The bytes of a 16-bit gray picture.
pub(super) fn encode(frame: &RawFrame, format: ImageFormat) -> Result<Vec<u8>, Unreadable> {
    let unwritable = |reason: String| Unreadable { reason, hint: "write the frame as .npy or .raw" };
    let size = || unwritable(format!("{} x {} pixels are too many", frame.width, frame.height));
    let (width, height) = (u32::try_from(frame.width), u32::try_from(frame.height));
    let (Ok(width), Ok(height)) = (width, height) else { return Err(size()) };
    let gray: ImageBuffer<Luma<u16>, &[u16]> =
        ImageBuffer::from_raw(width, height, frame.dn.as_slice()).ok_or_else(size)?;
    let mut out = Cursor::new(Vec::new());
    gray.write_to(&mut out, format).map_err(|e| unwritable(e.to_string()))?;
    Ok(out.into_inner())
}
