//! Encoded planes as a picture of a page.

use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};

/// The picture of three encoded planes, 0..1, with 8 bits; missing values are black.
pub(crate) fn rgb_picture(encoded: &[f32], height: usize, width: usize) -> RgbImage {
    let pixels = height * width;
    let value = |c: usize, i: usize| {
        let value = encoded.get(c * pixels + i).copied().unwrap_or(0.0);
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    RgbImage::from_fn(width as u32, height as u32, |col, row| {
        let i = row as usize * width + col as usize;
        Rgb([0, 1, 2].map(|c| value(c, i)))
    })
}

/// The picture, at most `most` pixels wide.
pub(crate) fn shrunk(picture: &RgbImage, most: u32) -> RgbImage {
    let (width, height) = picture.dimensions();
    if width <= most {
        return picture.clone();
    }
    resize(picture, most, (height * most / width).max(1), FilterType::Triangle)
}
