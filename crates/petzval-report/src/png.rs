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

/// A JPEG as a data URL.
pub(crate) fn jpeg_address(jpeg: &[u8]) -> String {
    format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg))
}
