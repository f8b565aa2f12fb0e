//! The size of a picture file and the memory that it takes, before its pixels are light.

use std::io::{BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;
use ::image::codecs::jpeg::JpegDecoder;
use ::image::{DynamicImage, ImageFormat, ImageResult};

use super::cut_off::{CUT_OFF, is_cut_off};
use super::error::{ImageError, NO_FORMAT, undecoded};
use super::head::{OLD_HDR, PictureHead};
use super::open::{decoder_of, format_of, reader_of};
use super::{Transparent, exr_file, load_image_bytes, statements};

/// Bytes of a JPEG in which its head usually ends.
const JPEG_HEAD_BYTES: u64 = 1 << 16;

/// Columns and rows of a picture as [`load_image`](super::load_image) reads it, the right way up. Pixels are not decoded.
pub fn picture_size(path: &Path) -> Result<(u32, u32), ImageError> {
    Ok(picture_head(path)?.upright())
}

/// What a picture file says about its pixels that is not obeyed. Pixels are not decoded: transparent ones, and light below zero, are not counted,
/// and OpenEXR and Radiance files give none. Of a JPEG the whole file is read, of others the head.
pub fn picture_statements(path: &Path) -> Result<Vec<String>, ImageError> {
    let open = || {
        let io = |source| ImageError::Io { path: path.to_owned(), source };
        petzval_base::open_file(path).map(BufReader::new).map_err(io)
    };
    let decode = |reason: String| ImageError::Decode { name: path.display().to_string(), reason };
    let reader = reader_of(open()?).map_err(|e| decode(e.to_string()))?;
    let format = reader.format();
    if matches!(format, None | Some(ImageFormat::OpenExr | ImageFormat::Hdr)) {
        return Ok(Vec::new());
    }
    let mut decoder = decoder_of(reader).map_err(|e| decode(undecoded(&e)))?;
    Ok(statements(open()?, format, &mut decoder))
}

/// Whether EXIF turns or mirrors a picture: [`load_image`](super::load_image) gives its pixels in another order than the file has them.
pub fn is_picture_turned(path: &Path) -> Result<bool, ImageError> {
    Ok(picture_head(path)?.is_turned())
}

/// The head of a picture file. Fails where the picture is empty or too large to be read.
pub(crate) fn picture_head(path: &Path) -> Result<PictureHead, ImageError> {
    let io = |source| ImageError::Io { path: path.to_owned(), source };
    let file = petzval_base::open_file(path).map_err(io)?;
    let file_bytes = file.metadata().map_err(io)?.len();
    let name = path.display().to_string();
    head_of(BufReader::new(file), file_bytes, &name)?.checked(&name)
}

/// The head of a picture of so many encoded bytes; `name` appears in errors.
pub(crate) fn head_of<R: BufRead + Seek>(
    source: R,
    file_bytes: u64,
    name: &str,
) -> Result<PictureHead, ImageError> {
    let decode = |reason: String| ImageError::Decode { name: name.to_owned(), reason };
    let undecodable = |e: ::image::ImageError| decode(undecoded(&e));
    let system = |e: std::io::Error| decode(e.to_string());
    let reader = reader_of(source).map_err(system)?;
    let format = reader.format();
    match format {
        Some(ImageFormat::OpenExr) => {
            let mut source = reader.into_inner();
            source.seek(SeekFrom::Start(0)).map_err(system)?;
            exr_file::head(source, file_bytes).map_err(decode)
        }
        Some(ImageFormat::Hdr) | None => {
            let mut source = reader.into_inner();
            source.seek(SeekFrom::Start(0)).map_err(system)?;
            let is_old = source.fill_buf().map_err(system)?.starts_with(OLD_HDR);
            if format.is_none() && !is_old {
                return Err(decode(NO_FORMAT.to_owned()));
            }
            let mut decoder = HdrDecoder::with_strictness(source, !is_old).map_err(undecodable)?;
            Ok(PictureHead::of(&mut decoder, Some(ImageFormat::Hdr), file_bytes))
        }
        Some(ImageFormat::Jpeg) => jpeg_head(reader.into_inner(), file_bytes).map_err(undecodable),
        Some(_) => {
            let mut decoder = decoder_of(reader).map_err(undecodable)?;
            Ok(PictureHead::of(&mut decoder, format, file_bytes))
        }
    }
}

/// The head of a JPEG of so many encoded bytes, which `source` gives from the first on. Its decoder reads all that it gets: it gets the first bytes,
/// and more while the head does not end in them.
fn jpeg_head(mut source: impl BufRead, file_bytes: u64) -> ImageResult<PictureHead> {
    let (mut first, mut most) = (Vec::new(), JPEG_HEAD_BYTES);
    loop {
        Read::by_ref(&mut source).take(most - first.len() as u64).read_to_end(&mut first)?;
        let is_whole = (first.len() as u64) < most;
        match JpegDecoder::new(Cursor::new(&first)) {
            Ok(mut decoder) => return Ok(PictureHead::of(&mut decoder, Some(ImageFormat::Jpeg), file_bytes)),
            Err(error) if is_whole => return Err(error),
            Err(_) => most *= 8,
        }
    }
}

/// Decodes a picture from its first byte to its last: [`load_image_bytes`] does not fail with it. Gives its notes. `name` appears in errors.
pub(crate) fn check_decodes(bytes: &[u8], name: &str) -> Result<Vec<String>, ImageError> {
    let format = format_of(bytes);
    // The samples of the two common kinds are numbers in any case: turning them into light would take most of the time.
    if !matches!(format, Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        return load_image_bytes(bytes, name).map(|picture| picture.notes);
    }
    let decode = |reason: String| ImageError::Decode { name: name.to_owned(), reason };
    if is_cut_off(bytes) {
        return Err(decode(CUT_OFF.to_owned()));
    }
    let reader = reader_of(Cursor::new(bytes)).map_err(|e| decode(e.to_string()))?;
    let mut decoder = reader.into_decoder().map_err(|e| decode(undecoded(&e)))?;
    let mut notes = statements(Cursor::new(bytes), format, &mut decoder);
    let picture = DynamicImage::from_decoder(decoder).map_err(|e| decode(undecoded(&e)))?;
    notes.extend(Transparent::of(&picture).note(picture.width() as usize * picture.height() as usize));
    Ok(notes)
}
