//! Gray TIFF files, in which each page is a frame.

use std::io::{ErrorKind, Read, Seek, SeekFrom};

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{PhotometricInterpretation, Tag};
use tiff::{ColorType, TiffError, TiffUnsupportedError};

use super::frame::{AnyFrame, MOST_EXPANSION, MOST_PIXELS, RawFrame, Unreadable, WORK_SPACE, check_memory};
use super::info::{MOST_BITS, RawInfo, largest_dn, turning};

const HINT: &str = "a raw frame is a gray TIFF of whole numbers, 8, 16 or 32 bits a sample";

/// Bits of `NewSubfileType` that mark a picture as a reduced copy or a mask of another.
const THUMBNAIL_OR_MASK: u32 = 0b101;

/// Whether bytes start a TIFF or a BigTIFF, in either byte order.
pub(super) fn is_tiff(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(*magic))
}

/// Indices of the full pictures in a file, without thumbnails and masks. If there are only those, the first.
pub(super) fn pages(file: impl Read + Seek) -> Result<Vec<usize>, Unreadable> {
    let mut tiff = open(file)?;
    let said = tiff.decoder.get_tag_ascii_string(Tag::ImageDescription).ok().as_deref().and_then(images_said);
    let mut pages = Vec::new();
    for place in 0.. {
        let kind = tiff.decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).ok().flatten().unwrap_or(0);
        if kind & THUMBNAIL_OR_MASK == 0 {
            pages.push(place);
        }
        if !tiff.decoder.more_images() {
            break;
        }
        tiff.decoder.next_image().map_err(|error| tiff.unreadable(error))?;
    }
    if pages.is_empty() {
        pages.push(0);
    }
    if let Some(said) = said.filter(|said| *said > pages.len()) {
        return Err(cut_off(&format!(
            "its description says {said} images, and the file has {}",
            pages.len()
        )));
    }
    Ok(pages)
}

/// How many images the description of a stack says it has: `images=N` by ImageJ, `{"shape": [N, rows, columns]}` by tifffile.
fn images_said(description: &str) -> Option<usize> {
    if description.starts_with("ImageJ") {
        let line = description.lines().find_map(|line| line.trim().strip_prefix("images="));
        return line?.trim().parse().ok();
    }
    let shape = description.split_once("\"shape\":")?.1.trim_start().strip_prefix('[')?.split_once(']')?.0;
    let sides: Vec<usize> = shape.split(',').map(|side| side.trim().parse().ok()).collect::<Option<_>>()?;
    (sides.len() == 3).then(|| sides[0])
}

/// Reads the picture at a place of [`pages`]. The caller holds `held_bytes` of the file in memory.
pub(super) fn decode_page(
    file: impl Read + Seek,
    place: usize,
    held_bytes: u64,
) -> Result<AnyFrame, Unreadable> {
    let mut tiff = open(file)?;
    if place > 0 {
        tiff.decoder.seek_to_image(place).map_err(|error| tiff.unreadable(error))?;
    }
    // Memory for a number; those of 8 bits become 16.
    let sample = u64::from(tiff.kept_bits()? / 8);
    let each = sample.max(2);
    let (width, height) = tiff.decoder.dimensions().map_err(|error| tiff.unreadable(error))?;
    let pixels = u64::from(width) * u64::from(height);
    // A damaged header can claim any size: limit the picture to what the file's bytes can expand to.
    let most = MOST_EXPANSION.saturating_mul(tiff.bytes).min(each * MOST_PIXELS) + WORK_SPACE;
    if each * pixels > most {
        return Err(refused(format!(
            "{width} x {height} pixels do not fit in a file of {} bytes",
            tiff.bytes
        )));
    }
    tiff.check_length()?;
    // Numbers of 8 bits are copied to 16, those of 32 as well if they fit; signed ones to 32 bits first.
    let copies = match (sample, tiff.is_signed()) {
        (2, false) => 0,
        (_, false) => 2,
        (_, true) => 6,
    };
    check_memory((width.into(), height.into()), held_bytes, sample + copies)?;
    let orientation = tiff.decoder.find_tag_unsigned(Tag::Orientation).ok().flatten().and_then(turning);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = most as usize;
    limits.intermediate_buffer_size = most as usize;
    tiff.decoder = tiff.decoder.with_limits(limits);
    let (height, width) = (height as usize, width as usize);
    let check_count = |count: usize| {
        if count > 0 && count == height * width {
            Ok(())
        } else {
            Err(refused(format!("{count} numbers for {width} x {height} pixels")))
        }
    };
    let narrow = |dn: Vec<u16>, bits| {
        check_count(dn.len())?;
        let info = RawInfo { bits, orientation, ..RawInfo::default() };
        Ok(AnyFrame::Narrow(RawFrame { height, width, dn, info }))
    };
    let wide = |dn: Vec<u32>| {
        check_count(dn.len())?;
        let frame = RawFrame { height, width, dn, info: RawInfo { orientation, ..RawInfo::default() } };
        match frame.beyond(MOST_BITS) {
            None => Ok(AnyFrame::of(frame)),
            Some((row, col, dn)) => Err(refused(format!(
                "the value {dn} at row {row}, column {col} is above {}",
                largest_dn(MOST_BITS)
            ))),
        }
    };
    match tiff.decoder.read_image() {
        Ok(DecodingResult::U16(dn)) => narrow(dn, None),
        Ok(DecodingResult::U8(dn)) => narrow(dn.into_iter().map(u16::from).collect(), Some(8)),
        Ok(DecodingResult::U32(dn)) => wide(dn),
        Ok(DecodingResult::I8(dn)) => wide(not_negative(&dn, width)?),
        Ok(DecodingResult::I16(dn)) => wide(not_negative(&dn, width)?),
        Ok(DecodingResult::I32(dn)) => wide(not_negative(&dn, width)?),
        Ok(_) => Err(refused("samples that are not whole numbers of 8, 16 or 32 bits".to_owned())),
        Err(error) => Err(tiff.unreadable(error)),
    }
}

/// A decoder, and the length of its file.
struct Tiff<R: Read + Seek> {
    decoder: Decoder<R>,
    bytes: u64,
}

fn open<R: Read + Seek>(mut file: R) -> Result<Tiff<R>, Unreadable> {
    let length = file.seek(SeekFrom::End(0)).and_then(|bytes| file.rewind().map(|()| bytes));
    let bytes = length.map_err(|error| refused(error.to_string()))?;
    let decoder = Decoder::new(file).map_err(|error| reason_of(error, bytes))?;
    Ok(Tiff { decoder, bytes })
}

impl<R: Read + Seek> Tiff<R> {
    fn unreadable(&self, error: TiffError) -> Unreadable {
        reason_of(error, self.bytes)
    }

    /// Refuses pictures whose samples the decoder would change: it packs samples of fewer than 8 bits, and inverts those in which
    /// white is zero. Also refuses samples that are not digital numbers. Returns the bits of a sample.
    fn kept_bits(&mut self) -> Result<u8, Unreadable> {
        let mut tag = |tag| self.decoder.find_tag_unsigned_vec::<u16>(tag).ok().flatten();
        let meaning = tag(Tag::PhotometricInterpretation).and_then(|all| all.first().copied());
        let format = tag(Tag::SampleFormat).and_then(|all| all.first().copied());
        if meaning == Some(PhotometricInterpretation::WhiteIsZero.to_u16()) {
            return Err(refused("white is zero in its numbers (PhotometricInterpretation 0)".to_owned()));
        }
        let colour = self.decoder.colortype().map_err(|error| self.unreadable(error))?;
        let ColorType::Gray(bits) = colour else {
            let kind = match colour {
                ColorType::GrayA(bits) => format!("a gray picture with transparency of {bits} bits a sample"),
                ColorType::RGB(bits) | ColorType::RGBA(bits) => {
                    format!("a colour picture of {bits} bits a sample")
                }
                ColorType::Palette(_) => "a picture with a palette".to_owned(),
                _ => "a picture of several samples a pixel".to_owned(),
            };
            return Err(refused(format!("{kind}, not digital numbers")));
        };
        match (format, bits) {
            (Some(3), _) => Err(refused(format!("floating-point samples of {bits} bits (SampleFormat 3)"))),
            (_, 8 | 16 | 32) => Ok(bits),
            _ => Err(refused(format!("samples of {bits} bits"))),
        }
    }

    /// Whether samples may be negative, as far as the file says.
    fn is_signed(&mut self) -> bool {
        let format = self.decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).ok().flatten();
        format.is_some_and(|all| all.first() == Some(&2))
    }

    /// Refuses a file that ends before the samples that it lists.
    fn check_length(&mut self) -> Result<(), Unreadable> {
        let mut list = |tag| self.decoder.find_tag_unsigned_vec::<u64>(tag).ok().flatten();
        for (offsets, counts) in
            [(Tag::StripOffsets, Tag::StripByteCounts), (Tag::TileOffsets, Tag::TileByteCounts)]
        {
            let (Some(offsets), Some(counts)) = (list(offsets), list(counts)) else { continue };
            let end = offsets.iter().zip(&counts).map(|(at, n)| at.saturating_add(*n)).max().unwrap_or(0);
            if end > self.bytes {
                let has = self.bytes;
                return Err(cut_off(&format!("its samples reach to byte {end}, the file has {has} bytes")));
            }
        }
        Ok(())
    }
}

/// Signed samples, none of which may be negative: software writes digital numbers so, too.
fn not_negative<T: Copy + Into<i64>>(samples: &[T], width: usize) -> Result<Vec<u32>, Unreadable> {
    let number = |(at, sample): (usize, &T)| {
        let value: i64 = (*sample).into();
        u32::try_from(value).map_err(|_| {
            let (row, col) = (at / width.max(1), at % width.max(1));
            refused(format!(
                "the value {value} at row {row}, column {col} is no digital number: it is below 0"
            ))
        })
    };
    samples.iter().enumerate().map(number).collect()
}

fn reason_of(error: TiffError, bytes: u64) -> Unreadable {
    match error {
        TiffError::IoError(io) if io.kind() == ErrorKind::UnexpectedEof => {
            cut_off(&format!("the file ends after {bytes} bytes, before the data that its header lists"))
        }
        TiffError::UnsupportedError(TiffUnsupportedError::UnknownInterpretation) => Unreadable {
            reason: "its samples have a meaning that is not read (PhotometricInterpretation)".to_owned(),
            hint: "write a mosaic, which has 32803 there, as a gray TIFF with 1, and `cfa` in its sidecar; name a DNG .dng",
        },
        other => refused(other.to_string()),
    }
}

fn refused(reason: String) -> Unreadable {
    Unreadable { reason, hint: HINT }
}

fn cut_off(what: &str) -> Unreadable {
    Unreadable { reason: format!("cut off: {what}"), hint: "copy the file again; it is incomplete" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_images_of_a_stack_are_those_of_its_description() {
        assert_eq!(images_said("ImageJ=1.53t\nimages=100\nslices=100\n"), Some(100));
        assert_eq!(images_said("{\"shape\": [12, 480, 640]}"), Some(12));
        for other in ["{\"shape\": [480, 640]}", "a camera", "", "images=3", "ImageJ=1\n", "\"shape\": ["] {
            assert_eq!(images_said(other), None, "{other}");
        }
    }
}
