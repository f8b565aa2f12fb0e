//! Reads pictures from PNG, JPEG, TIFF, WebP, BMP, OpenEXR and Radiance HDR files, and writes PNG.

mod cut_off;
mod error;
mod exr_file;
mod gray_floats;
mod head;
mod ignored;
mod notes;
mod open;
mod size;

use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;
use ::image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageFormat};

use petzval_base::write_whole;
use petzval_camera::image::{CHANNELS, LinearImage, srgb_decode};

pub(crate) use self::cut_off::{CUT_OFF, is_cut_off};
pub use self::error::ImageError;
use self::error::NO_FORMAT;
pub(crate) use self::error::{MOST_PICTURE_BYTES, damaged, undecoded};
use self::head::OLD_HDR;
pub(crate) use self::head::PictureHead;
pub(crate) use self::ignored::{animation_note, tiff_notes};
use self::ignored::{hdr_notes, png_notes, profile_note, webp_notes};
pub use self::notes::PictureNotes;
use self::open::decoder_of;
pub(crate) use self::open::{format_of, reader_of};
pub(crate) use self::size::{check_decodes, head_of, picture_head};
pub use self::size::{is_picture_turned, picture_size, picture_statements};

/// Endings of the pictures that a folder is searched for, in lower case.
pub const PICTURE_ENDINGS: [&str; 7] = ["png", "jpg", "jpeg", "tif", "tiff", "webp", "bmp"];

/// Rows that are turned into light at a time.
const STRIP_ROWS: u32 = 64;

/// A picture, and the statements of its file that were ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Linear light, three planes, 1 = white; every value is finite and at least 0.
    pub light: LinearImage,
    /// Whether the file holds linear light; otherwise the sRGB curve of its integers was undone.
    pub is_linear: bool,
    /// Statements of the file that are ignored, such as its colour profile; one clause each, without the name of the file.
    pub notes: Vec<String>,
}

/// Reads a picture file into linear light, three planes, the right way up.
///
/// Integer samples are taken as sRGB-encoded. Floating-point samples (TIFF, OpenEXR, Radiance HDR) are linear and may exceed 1;
/// below zero they are taken as 0, which is noted, and values that are not finite are refused. Gray is copied to three planes; alpha
/// is composited over black in linear light, which is noted. Of a file with several pages or layers one is read. The orientation of EXIF and TIFF is
/// obeyed, colour profiles and other statements about colour are not; the notes name them. A picture whose reading takes more than 2 GB of
/// memory is refused before it is decoded: its file twice, its samples, and 12 bytes of light for each pixel.
pub fn load_image(path: &Path) -> Result<Picture, ImageError> {
    load_image_bytes(&picture_bytes(path)?, &path.display().to_string())
}

/// The bytes of a picture file.
pub(crate) fn picture_bytes(path: &Path) -> Result<Vec<u8>, ImageError> {
    let io = |source| ImageError::Io { path: path.to_owned(), source };
    petzval_base::read_at_most(path, MOST_PICTURE_BYTES).map_err(io)
}

/// Reads a picture from memory as [`load_image`] does; `name` appears in errors.
pub fn load_image_bytes(bytes: &[u8], name: &str) -> Result<Picture, ImageError> {
    let decode = |reason: String| ImageError::Decode { name: name.to_owned(), reason };
    let undecodable = |e: ::image::ImageError| decode(undecoded(&e));
    let reader = reader_of(Cursor::new(bytes)).map_err(|e| decode(e.to_string()))?;
    let mut picture = match reader.format() {
        Some(ImageFormat::OpenExr) => {
            exr_file::head(Cursor::new(bytes), bytes.len() as u64).map_err(decode)?.checked(name)?;
            let (light, notes) = exr_file::read(bytes).map_err(decode)?;
            Picture { light, is_linear: true, notes }
        }
        Some(ImageFormat::Hdr) => read_hdr(bytes, name)?,
        None if bytes.starts_with(OLD_HDR) => read_hdr(bytes, name)?,
        format => {
            if is_cut_off(bytes) {
                return Err(decode(CUT_OFF.to_owned()));
            }
            if format.is_none() {
                return Err(decode(NO_FORMAT.to_owned()));
            }
            let mut decoder = decoder_of(reader).map_err(undecodable)?;
            let mut notes = statements(Cursor::new(bytes), format, &mut decoder);
            let head = PictureHead::of(&mut decoder, format, bytes.len() as u64).checked(name)?;
            let Decoded { light, is_linear, transparent } = decoded(decoder, head).map_err(undecodable)?;
            notes.extend(transparent.note(light.height * light.width));
            Picture { light, is_linear, notes }
        }
    };
    let LinearImage { height, width, .. } = picture.light;
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { name: name.to_owned(), height, width });
    }
    let plane = height * width;
    if let Some(at) = picture.light.data.iter().position(|v| !v.is_finite()) {
        let (row, column) = (at % plane / width, at % width);
        let (name, value) = (name.to_owned(), picture.light.data[at]);
        return Err(ImageError::NotFinite { name, value, row, column });
    }
    let below = picture.light.data.iter().filter(|v| **v < 0.0).count();
    if below > 0 {
        let lowest = picture.light.data.iter().copied().fold(0.0, f32::min);
        picture.light.data.iter_mut().for_each(|v| *v = v.max(0.0));
        picture.notes.push(format!(
            "{below} of its {} values are negative, down to {lowest}, and taken as 0",
            CHANNELS * plane
        ));
    }
    Ok(picture)
}

/// Notes on what a file says about its pixels, before they are decoded. `source`: the file from its start.
fn statements(
    source: impl BufRead + Seek,
    format: Option<ImageFormat>,
    decoder: &mut impl ImageDecoder,
) -> Vec<String> {
    let mut notes = match format {
        Some(ImageFormat::Png) => png_notes(source),
        Some(ImageFormat::Tiff) => tiff_notes(source),
        Some(ImageFormat::WebP) => webp_notes(source),
        _ => Vec::new(),
    };
    match decoder.icc_profile() {
        Ok(profile) => notes.extend(profile.and_then(|profile| profile_note(&profile))),
        Err(error) => notes.push(format!("its ICC profile cannot be read ({error}) and is ignored")),
    }
    notes
}

/// Reads a Radiance HDR file: linear light with a common exponent.
fn read_hdr(bytes: &[u8], name: &str) -> Result<Picture, ImageError> {
    let undecodable =
        |e: ::image::ImageError| ImageError::Decode { name: name.to_owned(), reason: undecoded(&e) };
    let is_strict = bytes.starts_with(b"#?RADIANCE");
    let mut decoder = HdrDecoder::with_strictness(Cursor::new(bytes), is_strict).map_err(undecodable)?;
    let head = PictureHead::of(&mut decoder, Some(ImageFormat::Hdr), bytes.len() as u64).checked(name)?;
    let notes = hdr_notes(&decoder.metadata());
    let Decoded { light, is_linear, .. } = decoded(decoder, head).map_err(undecodable)?;
    Ok(Picture { light, is_linear, notes })
}

/// Pixels of a picture whose alpha is below its largest value.
#[derive(Default)]
struct Transparent {
    /// All of them.
    pixels: usize,
    /// Those whose alpha is 0.
    clear: usize,
}

impl Transparent {
    /// Counts those of a picture.
    fn of(picture: &DynamicImage) -> Self {
        match picture {
            DynamicImage::ImageLumaA8(gray) => Self::among(gray.pixels().map(|pixel| pixel[1]), u8::MAX),
            DynamicImage::ImageLumaA16(gray) => Self::among(gray.pixels().map(|pixel| pixel[1]), u16::MAX),
            DynamicImage::ImageRgba8(colour) => Self::among(colour.pixels().map(|pixel| pixel[3]), u8::MAX),
            DynamicImage::ImageRgba16(colour) => Self::among(colour.pixels().map(|pixel| pixel[3]), u16::MAX),
            DynamicImage::ImageRgba32F(colour) => Self::among(colour.pixels().map(|pixel| pixel[3]), 1.0),
            _ => Self::default(),
        }
    }

    /// Counts alphas, of which `opaque` is the largest and 0 that of a clear pixel.
    fn among<A: PartialOrd + Default>(alphas: impl Iterator<Item = A>, opaque: A) -> Self {
        let mut found = Self::default();
        for alpha in alphas {
            found.pixels += usize::from(alpha < opaque);
            found.clear += usize::from(alpha == A::default());
        }
        found
    }

    /// What is to say of a picture of so many pixels.
    fn note(&self, all: usize) -> Option<String> {
        if self.pixels == 0 {
            return None;
        }
        if self.clear == all {
            return Some("every pixel is transparent, and the picture is black; remove its alpha".to_owned());
        }
        let percent = 100.0 * self.pixels as f64 / all as f64;
        Some(format!(
            "{} of its {all} pixels ({percent:.2} %) are transparent and darkened as over black; remove its alpha to keep their light",
            self.pixels
        ))
    }
}

/// The light of a picture, turned the right way up.
struct Decoded {
    light: LinearImage,
    /// Whether the file holds linear light.
    is_linear: bool,
    transparent: Transparent,
}

/// Decodes a picture.
fn decoded(decoder: impl ImageDecoder, head: PictureHead) -> ::image::ImageResult<Decoded> {
    let mut picture = DynamicImage::from_decoder(decoder)?;
    picture.apply_orientation(head.orientation);

    // Undo the display curve of integer samples; floating-point files already hold linear light.
    let linear_file = matches!(picture, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let eight_bit = picture.color().bytes_per_pixel() == picture.color().channel_count();
    let table: Vec<f32> = (0..256).map(|v| srgb_decode(v as f32 / 255.0)).collect();
    let light = |v: f32| if linear_file { v } else { srgb_decode(v) };
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let mut out = LinearImage::zeros(CHANNELS, height, width);
    let plane = height * width;
    let transparent = Transparent::of(&picture);
    // Turn a strip at a time into four samples a pixel, which would otherwise be a second picture in memory.
    for top in (0..picture.height()).step_by(STRIP_ROWS as usize) {
        let strip = picture.crop_imm(0, top, picture.width(), STRIP_ROWS.min(picture.height() - top));
        let first = top as usize * width;
        if eight_bit {
            for (i, pixel) in (first..).zip(strip.to_rgba8().pixels()) {
                let alpha = pixel[3] as f32 / 255.0;
                for c in 0..CHANNELS {
                    out.data[c * plane + i] = table[pixel[c] as usize] * alpha;
                }
            }
        } else {
            for (i, pixel) in (first..).zip(strip.to_rgba32f().pixels()) {
                for c in 0..CHANNELS {
                    out.data[c * plane + i] = light(pixel[c]) * pixel[3];
                }
            }
        }
    }
    Ok(Decoded { light: out, is_linear: linear_file, transparent })
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

/// Encodes samples, row by row, as a file; `name` appears in errors.
pub(crate) fn encode(
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
mod tests;
