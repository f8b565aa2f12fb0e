//! Text on pictures of pixels.

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Height of a line, px.
pub(crate) const LINE_PX: u32 = RasterHeight::Size16.val() as u32;

/// Width of a character, px.
pub(crate) const CHARACTER_PX: u32 = get_raster_width(FontWeight::Regular, RasterHeight::Size16) as u32;

/// Draws a text with its upper left corner at a place, over what is there; what lies outside of the picture is left out.
pub(crate) fn draw_text(picture: &mut RgbImage, [left, top]: [u32; 2], text: &str, Rgb(colour): Rgb<u8>) {
    let mut x = left;
    for c in text.chars() {
        let glyph =
            [c, '?'].into_iter().find_map(|c| get_raster(c, FontWeight::Regular, RasterHeight::Size16));
        for (row, intensities) in glyph.iter().flat_map(|glyph| glyph.rows().enumerate()) {
            for (column, intensity) in intensities.iter().enumerate() {
                let Some(pixel) = picture.get_pixel_mut_checked(x + column as u32, top + row as u32) else {
                    continue;
                };
                let share = f32::from(*intensity) / 255.0;
                for (value, ink) in pixel.0.iter_mut().zip(colour) {
                    *value = (f32::from(*value) + share * (f32::from(ink) - f32::from(*value))).round() as u8;
                }
            }
        }
        x += CHARACTER_PX;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Rgb<u8> = Rgb([10, 10, 10]);
    const INK: Rgb<u8> = Rgb([250, 240, 230]);

    fn drawn(text: &str) -> RgbImage {
        let mut picture = RgbImage::from_pixel(60, 20, PAPER);
        draw_text(&mut picture, [2, 2], text, INK);
        picture
    }

    #[test]
    fn every_character_of_a_label_has_a_shape_of_its_own_in_its_cell() {
        let shapes: Vec<RgbImage> = "0123456789.°µm".chars().map(|c| drawn(&c.to_string())).collect();
        for (i, shape) in shapes.iter().enumerate() {
            assert!(shapes[..i].iter().all(|other| other != shape), "two characters look alike");
            for (x, y, pixel) in shape.enumerate_pixels() {
                let is_inside = (2..2 + CHARACTER_PX).contains(&x) && (2..2 + LINE_PX).contains(&y);
                assert!(is_inside || *pixel == PAPER);
            }
            // Thin strokes are blended, but at least half way to the ink.
            assert!(shape.pixels().any(|p| p[0] > 130));
        }
    }

    #[test]
    fn text_beyond_the_edge_is_left_out() {
        let long = drawn(&"8".repeat(50));
        assert_eq!(long.dimensions(), (60, 20));
    }
}
