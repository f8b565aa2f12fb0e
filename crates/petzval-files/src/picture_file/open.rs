//! The decoder of a picture, by the first bytes of its file.

use std::io::{BufRead, Read, Result, Seek, SeekFrom};

use ::image::{ImageDecoder, ImageFormat, ImageReader, ImageResult};

use super::gray_floats::GrayFloats;
use super::head::decoder_limits;

/// Bytes by which formats are distinguished.
const START_BYTES: u64 = 16;

/// How TIFF files for more than 4 GB begin, in either byte order. The image crate reads them, but does not know them by this.
const BIG_TIFF: [&[u8]; 2] = [b"II\x2b\0", b"MM\0\x2b"];

/// The format of a picture by its first bytes; none for formats that no decoder knows.
pub(crate) fn format_of(bytes: &[u8]) -> Option<ImageFormat> {
    if BIG_TIFF.iter().any(|start| bytes.starts_with(start)) {
        return Some(ImageFormat::Tiff);
    }
    ::image::guess_format(bytes).ok()
}

/// A reader of a file from its start, with its format and the limits of decoders.
pub(crate) fn reader_of<R: BufRead + Seek>(mut source: R) -> Result<ImageReader<R>> {
    let mut start = Vec::new();
    Read::by_ref(&mut source).take(START_BYTES).read_to_end(&mut start)?;
    source.seek(SeekFrom::Start(0))?;
    let mut reader = ImageReader::new(source);
    if let Some(format) = format_of(&start) {
        reader.set_format(format);
    }
    reader.limits(decoder_limits());
    Ok(reader)
}

/// The decoder of a picture.
pub(super) fn decoder_of<'a, R: BufRead + Seek + 'a>(
    reader: ImageReader<R>,
) -> ImageResult<Box<dyn ImageDecoder + 'a>> {
    if reader.format() != Some(ImageFormat::Tiff) {
        return Ok(Box::new(reader.into_decoder()?));
    }
    let mut source = reader.into_inner();
    let is_gray_floats = GrayFloats::is_in(&mut source);
    source.seek(SeekFrom::Start(0))?;
    if is_gray_floats {
        return Ok(Box::new(GrayFloats::new(source)?));
    }
    let mut reader = ImageReader::with_format(source, ImageFormat::Tiff);
    reader.limits(decoder_limits());
    Ok(Box::new(reader.into_decoder()?))
}
