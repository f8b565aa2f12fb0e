//! Reads pictures from PNG, JPEG and TIFF files, and writes PNG.

use std::error::Error;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use ::image::error::UnsupportedErrorKind;
use ::image::{DynamicImage, ExtendedColorType, GenericImageView, ImageFormat, ImageReader};

use petzval_base::write_whole;
use petzval_camera::image::{CHANNELS, LinearImage, srgb_decode};

/// Why a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The content is not a PNG, JPEG or TIFF picture that we can decode.
    #[error("{name}: cannot decode the picture: {reason}; hint: give a PNG, JPEG or TIFF file")]
    Decode {
        /// The file or the name of the buffer.
        name: String,
        /// The error of the decoder.
        reason: String,
    },
    /// The picture cannot be encoded.
    #[error("{name}: cannot encode the picture: {reason}")]
    Encode {
        /// The file.
        name: String,
        /// The error of the encoder.
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
    let picture = reader.decode().map_err(|e| decode(undecoded(&e)))?;
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

/// The reason of a decoder's error, in terms of the picture.
pub(crate) fn undecoded(error: &::image::ImageError) -> String {
    if let ::image::ImageError::Unsupported(unsupported) = error
        && let UnsupportedErrorKind::Color(ExtendedColorType::Unknown(bits)) = unsupported.kind()
    {
        return format!("it has pixels of {bits} bits of a kind that is not read, such as gray floats");
    }
    // An I/O error is the decoder's error itself or one of its causes.
    let is_end = |io: &std::io::Error| io.kind() == std::io::ErrorKind::UnexpectedEof;
    let mut is_cut_off = matches!(error, ::image::ImageError::IoError(io) if is_end(io));
    let mut cause = error.source();
    while let Some(error) = cause {
        is_cut_off |= error.downcast_ref().is_some_and(is_end);
        cause = error.source();
    }
    if is_cut_off {
        return "the file ends before the picture does: it is cut off".to_owned();
    }
    error.to_string()
}

/// Encodes a linear image as an 8-bit sRGB PNG. Three or more planes give a colour picture of the first three; fewer give a
/// gray picture of the first.
pub fn png_bytes(image: &LinearImage) -> Result<Vec<u8>, ImageError> {
    let LinearImage { channels, height, width, .. } = *image;
    encoded_png_bytes(&LinearImage { channels, height, width, data: image.to_srgb() })
}

/// [`png_bytes`] of a picture whose values are sRGB-encoded already.
pub fn encoded_png_bytes(encoded: &LinearImage) -> Result<Vec<u8>, ImageError> {
    let (planes, n) = (planes(encoded), encoded.height * encoded.width);
    let sample = |k: usize| (encoded.data[k % planes * n + k / planes].clamp(0.0, 1.0) * 255.0).round() as u8;
    let bytes: Vec<u8> = (0..n * planes).map(sample).collect();
    let color = if planes == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
    encode(&bytes, encoded.height, encoded.width, color, ImageFormat::Png, "PNG buffer")
}

/// Planes of a picture file: 1 for gray, 3 for red, green and blue.
fn planes(image: &LinearImage) -> usize {
    if image.channels >= CHANNELS { CHANNELS } else { 1 }
}

/// sRGB samples in 0..1, pixel by pixel.
fn display_samples(image: &LinearImage) -> impl Iterator<Item = f32> {
    let (display, planes, n) = (image.to_srgb(), planes(image), image.height * image.width);
    (0..n * planes).map(move |k| display[k % planes * n + k / planes])
}

/// Writes a linear image as a 16-bit sRGB PNG file, planes as in [`png_bytes`].
pub fn save_png16(image: &LinearImage, path: &Path) -> Result<(), ImageError> {
    // The encoder takes 16-bit samples in the machine's byte order and writes them in that of PNG.
    let sample = |v: f32| ((v * 65535.0).round() as u16).to_ne_bytes();
    let bytes: Vec<u8> = display_samples(image).flat_map(sample).collect();
    let color = if planes(image) == 1 { ExtendedColorType::L16 } else { ExtendedColorType::Rgb16 };
    write(path, &encode(&bytes, image.height, image.width, color, ImageFormat::Png, "PNG buffer")?)
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
    fn a_sixteen_bit_png_keeps_differences_below_one_of_256_levels() {
        let folder = tempfile::tempdir().unwrap();
        let data: Vec<f32> = (0..3 * 8 * 8).map(|i| srgb_decode(0.2 + i as f32 / 2000.0)).collect();
        let image = LinearImage::from_data(3, 8, 8, data).unwrap();
        let path = folder.path().join("fine.png");
        save_png16(&image, &path).unwrap();
        let back = load_image(&path).unwrap();
        for (a, b) in image.to_srgb().iter().zip(back.to_srgb()) {
            assert!((a - b).abs() <= 0.6 / 65535.0, "{a} {b}");
        }
        let samples = ::image::open(&path).unwrap();
        assert_eq!(samples.color(), ::image::ColorType::Rgb16);
    }

    #[test]
    fn the_error_of_a_truncated_picture_says_that_it_is_cut_off() {
        let noise = (0..3 * 64 * 64).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
        let bytes = png_bytes(&LinearImage::from_data(3, 64, 64, noise).unwrap()).unwrap();
        let error = load_image_bytes(&bytes[..bytes.len() / 2], "half.png").unwrap_err().to_string();
        assert!(error.contains("half.png") && error.contains("it is cut off"), "{error}");
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
