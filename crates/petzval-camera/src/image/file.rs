//! Pictures from and to files: PNG, JPEG, TIFF.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use ::image::{DynamicImage, ExtendedColorType, GenericImageView, ImageFormat, ImageReader};

use super::{CHANNELS, LinearImage, srgb_decode};
use crate::whole_file::write_whole;

/// Why a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The content is not a PNG, JPEG or TIFF picture that we can decode.
    #[error("{name}: cannot decode the picture: {reason}; hint: give a PNG, JPEG or TIFF file")]
    Decode {
        /// The file or the name of the buffer.
        name: String,
        /// What the decoder said.
        reason: String,
    },
    /// The picture cannot be encoded.
    #[error("{name}: cannot encode the picture: {reason}")]
    Encode {
        /// The file.
        name: String,
        /// What the encoder said.
        reason: String,
    },
    /// The picture has no pixels.
    #[error("{name}: the picture is empty ({height}x{width})")]
    Empty {
        /// The file or the name of the buffer.
        name: String,
        /// Rows.
        height: u32,
        /// Columns.
        width: u32,
    },
}

/// Reads a picture file into linear light, three planes.
///
/// Integer samples are taken as sRGB-encoded, floating-point samples as linear. Gray is copied to three planes; alpha is
/// composited over black in linear light. Embedded colour profiles are ignored.
pub fn load_image(path: &Path) -> Result<LinearImage, ImageError> {
    let bytes = std::fs::read(path).map_err(|source| ImageError::Io { path: path.to_owned(), source })?;
    load_image_bytes(&bytes, &path.display().to_string())
}

/// Reads a picture from memory as [`load_image`] does; `name` appears in errors.
pub fn load_image_bytes(bytes: &[u8], name: &str) -> Result<LinearImage, ImageError> {
    let decode = |reason: String| ImageError::Decode { name: name.to_owned(), reason };
    let reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| decode(e.to_string()))?;
    let picture = reader.decode().map_err(|e| decode(e.to_string()))?;
    let (width, height) = picture.dimensions();
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { name: name.to_owned(), height, width });
    }

    // Undo the display curve of integer samples; floating-point files already hold linear light.
    let linear_file = matches!(picture, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let eight_bit = picture.color().bytes_per_pixel() == picture.color().channel_count();
    let table: Vec<f32> = (0..256).map(|v| srgb_decode(v as f32 / 255.0)).collect();
    let light = |v: f32| if linear_file { v } else { srgb_decode(v) };
    let (width, height) = (width as usize, height as usize);
    let mut out = LinearImage::zeros(CHANNELS, height, width);
    let plane = height * width;
    if eight_bit {
        for (i, pixel) in picture.to_rgba8().pixels().enumerate() {
            for c in 0..CHANNELS {
                out.data[c * plane + i] = table[pixel[c] as usize] * (pixel[3] as f32 / 255.0);
            }
        }
    } else {
        for (i, pixel) in picture.to_rgba32f().pixels().enumerate() {
            for c in 0..CHANNELS {
                out.data[c * plane + i] = light(pixel[c]) * pixel[3];
            }
        }
    }
    Ok(out)
}

/// Encodes a linear image as an 8-bit sRGB PNG; one plane gives a gray picture, otherwise the first three planes are
/// red, green, blue.
pub fn png_bytes(image: &LinearImage) -> Result<Vec<u8>, ImageError> {
    let planes = if image.channels >= CHANNELS { CHANNELS } else { 1 };
    let display = image.to_srgb();
    let n = image.height * image.width;
    let bytes: Vec<u8> = (0..n)
        .flat_map(|i| (0..planes).map(move |c| (c, i)))
        .map(|(c, i)| (display[c * n + i] * 255.0).round() as u8)
        .collect();
    let color = if planes == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
    encode(&bytes, image.height, image.width, color, ImageFormat::Png, "PNG buffer")
}

/// Writes a linear image as an 8-bit sRGB PNG file.
pub fn save_png(image: &LinearImage, path: &Path) -> Result<(), ImageError> {
    write(path, &png_bytes(image)?)
}

fn encode(
    bytes: &[u8],
    height: usize,
    width: usize,
    color: ExtendedColorType,
    format: ImageFormat,
    name: &str,
) -> Result<Vec<u8>, ImageError> {
    let mut out = Cursor::new(Vec::new());
    ::image::write_buffer_with_format(&mut out, bytes, width as u32, height as u32, color, format)
        .map_err(|e| ImageError::Encode { name: name.to_owned(), reason: e.to_string() })?;
    Ok(out.into_inner())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    write_whole(path, bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use ::image::ImageBuffer;

    use super::*;

    #[test]
    fn png_round_trip_keeps_eight_bits() {
        let data = (0..3 * 4 * 5).map(|i| srgb_decode(((i * 4) % 256) as f32 / 255.0)).collect();
        let image = LinearImage::from_data(3, 4, 5, data).unwrap();
        let back = load_image_bytes(&png_bytes(&image).unwrap(), "round trip").unwrap();
        for (a, b) in image.data.iter().zip(&back.data) {
            assert!((a - b).abs() < 1e-6);
        }
    }

    #[test]
    fn gray_and_alpha_become_three_planes() {
        let mut bytes = Cursor::new(Vec::new());
        let gray = ::image::LumaA([255u8, 51]);
        DynamicImage::ImageLumaA8(ImageBuffer::from_pixel(2, 1, gray))
            .write_to(&mut bytes, ImageFormat::Png)
            .unwrap();
        let image = load_image_bytes(bytes.get_ref(), "gray").unwrap();
        assert_eq!((image.channels, image.height, image.width), (3, 1, 2));
        assert!(image.data.iter().all(|v| (v - 0.2).abs() < 1e-6));
    }

    #[test]
    fn errors_name_the_file_and_the_reason() {
        let missing = load_image(Path::new("no/such/picture.png")).unwrap_err().to_string();
        assert!(missing.starts_with("no/such/picture.png: "), "{missing}");
        let garbage = load_image_bytes(b"not a picture", "note.txt").unwrap_err().to_string();
        assert!(garbage.starts_with("note.txt: cannot decode"), "{garbage}");
    }
}
