//! Where a picture has detail: the part that is worth to be enlarged.

use image::{GrayImage, ImageFormat};

/// Mean absolute step between neighbouring pixels of a picture, of 255; 0 if it cannot be decoded.
///
/// Steps are not squared: a texture counts for more than one hard edge.
pub fn detail(png: &[u8]) -> f64 {
    let Some(picture) = gray(png) else { return 0.0 };
    let steps = steps(&picture);
    steps.iter().flatten().sum::<f64>() / f64::from(picture.width() * picture.height()).max(1.0)
}

/// The middle of the part with the most detail, shares of width and height; the part is `share` of the picture's sides. The middle of
/// the picture if it is flat or cannot be decoded.
pub(super) fn focus(png: &[u8], share: f64) -> [f64; 2] {
    let Some(picture) = gray(png) else { return [0.5; 2] };
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let side = |length: usize| ((length as f64 * share).round() as usize).clamp(1, length.max(1));
    let (wide, high) = (side(width), side(height));
    // Sums over the rectangle from the upper left corner give those over every part by four of them.
    let steps = steps(&picture);
    let mut sums = vec![vec![0.0; width + 1]; height + 1];
    for (y, row) in steps.iter().enumerate() {
        for (x, step) in row.iter().enumerate() {
            sums[y + 1][x + 1] = step + sums[y][x + 1] + sums[y + 1][x] - sums[y][x];
        }
    }
    let within =
        |x: usize, y: usize| sums[y + high][x + wide] - sums[y][x + wide] - sums[y + high][x] + sums[y][x];
    let (middle_x, middle_y) = ((width - wide) / 2, (height - high) / 2);
    let mut best = (middle_x, middle_y, within(middle_x, middle_y));
    for y in 0..=height - high {
        for x in 0..=width - wide {
            // A rounding error is no detail.
            if within(x, y) > best.2 * (1.0 + 1e-9) + 1e-9 {
                best = (x, y, within(x, y));
            }
        }
    }
    let (x, y, _) = best;
    [(x as f64 + 0.5 * wide as f64) / width as f64, (y as f64 + 0.5 * high as f64) / height as f64]
}

fn gray(png: &[u8]) -> Option<GrayImage> {
    let picture = image::load_from_memory_with_format(png, ImageFormat::Png).ok()?.to_luma8();
    (picture.width() > 0 && picture.height() > 0).then_some(picture)
}

/// Steps from each pixel to the next ones to the right and below.
fn steps(picture: &GrayImage) -> Vec<Vec<f64>> {
    let at = |x: u32, y: u32| {
        let (x, y) = (x.min(picture.width() - 1), y.min(picture.height() - 1));
        f64::from(picture.get_pixel(x, y)[0])
    };
    let step = |x: u32, y: u32| (at(x + 1, y) - at(x, y)).abs() + (at(x, y + 1) - at(x, y)).abs();
    (0..picture.height()).map(|y| (0..picture.width()).map(|x| step(x, y)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, Rgb, RgbImage};
    use std::io::Cursor;

    /// A flat sky with a chequered house of 16 x 16 pixels, whose left upper corner is given.
    fn house(left: u32, top: u32) -> Vec<u8> {
        let picture = RgbImage::from_fn(64, 48, |x, y| {
            let is_house = (left..left + 16).contains(&x) && (top..top + 16).contains(&y);
            if is_house && (x + y) % 2 == 0 { Rgb([40, 40, 40]) } else { Rgb([180, 200, 220]) }
        });
        let mut png = Cursor::new(Vec::new());
        picture.write_to(&mut png, ImageFormat::Png).unwrap();
        png.into_inner()
    }

    #[test]
    fn the_frame_is_on_the_house_and_not_on_the_sky() {
        for (left, top) in [(4, 30), (44, 2), (20, 16)] {
            let [x, y] = focus(&house(left, top), 0.25);
            let (x, y) = (64.0 * x, 48.0 * y);
            // The whole frame, 16 x 12 pixels, is on the house, to a pixel.
            let inside = |at: f64, half: f64, from: u32| {
                at - half >= f64::from(from) - 1.0 && at + half <= f64::from(from) + 17.0
            };
            assert!(inside(x, 8.0, left) && inside(y, 6.0, top), "{x} {y} for {left} {top}");
        }
        assert!(detail(&house(4, 4)) > 10.0);
    }

    #[test]
    fn a_flat_picture_is_framed_in_its_middle() {
        let mut png = Cursor::new(Vec::new());
        GrayImage::from_pixel(40, 40, Luma([99])).write_to(&mut png, ImageFormat::Png).unwrap();
        let png = png.into_inner();
        assert_eq!((focus(&png, 0.25), detail(&png)), ([0.5; 2], 0.0));
        assert_eq!((focus(&[1, 2], 0.25), detail(&[1, 2])), ([0.5; 2], 0.0));
    }
}
