//! The size of a picture, from the head of its file.

use std::io::BufReader;
use std::path::Path;

use ::image::metadata::Orientation;
use ::image::{ImageDecoder, ImageReader};

use super::{ImageError, load_image, undecoded};

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
    // A file whose orientation cannot be read is the right way up for `load_image`, too.
    let is_lying = matches!(
        decoder.orientation().unwrap_or(Orientation::NoTransforms),
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    );
    Ok(if is_lying { (height, width) } else { (width, height) })
}
