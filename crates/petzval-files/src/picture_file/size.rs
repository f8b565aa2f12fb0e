//! The size of a picture, from the head of its file.

use std::io::{BufReader, Cursor};
use std::path::Path;

use ::image::metadata::Orientation;
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::{CUT_OFF, ImageError, is_cut_off, load_image, load_image_bytes, undecoded};

/// Columns and rows of a picture as [`load_image`] reads it, the right way up. Pixels are not decoded, except those of OpenEXR files
/// and of older Radiance files.
pub fn picture_size(path: &Path) -> Result<(u32, u32), ImageError> {
    let io = |source| ImageError::Io { path: path.to_owned(), source };
    let name = || path.display().to_string();
    let file = petzval_base::open_file(path).map_err(io)?;
    let reader = ImageReader::new(BufReader::new(file)).with_guessed_format().map_err(io)?;
    let mut decoder = match reader.format() {
        None | Some(::image::ImageFormat::OpenExr | ::image::ImageFormat::Hdr) => {
            let light = load_image(path)?.light;
            return Ok((light.width as u32, light.height as u32));
        }
        Some(_) => {
            reader.into_decoder().map_err(|e| ImageError::Decode { name: name(), reason: undecoded(&e) })?
        }
    };
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { name: name(), height: height as usize, width: width as usize });
    }
    Ok(turned(&mut decoder, (width, height)))
}

/// [`picture_size`] of a file that is decoded from its first byte to its last: [`load_image`] does not fail with it.
pub(crate) fn decoded_size(path: &Path) -> Result<(u32, u32), ImageError> {
    let bytes =
        petzval_base::read_whole(path).map_err(|source| ImageError::Io { path: path.to_owned(), source })?;
    let name = path.display().to_string();
    // The samples of the two common kinds are numbers in any case: turning them into light would take most of the time.
    if !matches!(::image::guess_format(&bytes), Ok(ImageFormat::Png | ImageFormat::Jpeg)) {
        let light = load_image_bytes(&bytes, &name)?.light;
        return Ok((light.width as u32, light.height as u32));
    }
    let decode = |reason: String| ImageError::Decode { name: name.clone(), reason };
    if is_cut_off(&bytes) {
        return Err(decode(CUT_OFF.to_owned()));
    }
    let reader =
        ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(|e| decode(e.to_string()))?;
    let mut decoder = reader.into_decoder().map_err(|e| decode(undecoded(&e)))?;
    let size = decoder.dimensions();
    let size = turned(&mut decoder, size);
    DynamicImage::from_decoder(decoder).map_err(|e| decode(undecoded(&e)))?;
    Ok(size)
}

/// Columns and rows the right way up. A file whose orientation cannot be read is the right way up for [`load_image`], too.
fn turned(decoder: &mut impl ImageDecoder, (width, height): (u32, u32)) -> (u32, u32) {
    let is_lying = matches!(
        decoder.orientation().unwrap_or(Orientation::NoTransforms),
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    );
    if is_lying { (height, width) } else { (width, height) }
}
