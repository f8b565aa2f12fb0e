//! Pictures as the bytes of PNG files, and as data URLs for a page.

use std::io::Cursor;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbImage};

/// A picture as the bytes of a PNG file.
pub(crate) fn encode(picture: &RgbImage) -> Vec<u8> {
    let mut png = Cursor::new(Vec::new());
    // Writing to memory fails only for a picture without pixels; the page then shows its alt text.
    let _ = picture.write_to(&mut png, ImageFormat::Png);
    png.into_inner()
}

/// A PNG as a data URL, so that the page is self-contained.
pub(crate) fn address(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

/// A gray picture, row by row, as a data URL; none if it has no pixels or the wrong number of them.
pub(crate) fn gray_png(values: &[u8], width: usize, height: usize) -> Option<String> {
    let rgb = values.iter().flat_map(|v| [*v; 3]).collect();
    let picture = RgbImage::from_raw(width as u32, height as u32, rgb)?;
    (width > 0 && height > 0).then(|| address(&encode(&picture)))
}

/// A JPEG as a data URL.
pub(crate) fn jpeg_address(jpeg: &[u8]) -> String {
    format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg))
}
