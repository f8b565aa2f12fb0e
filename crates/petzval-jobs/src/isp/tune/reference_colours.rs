//! What the colours of a reference show: a picture in colour, a gray one, or the mosaic of a raw frame that was saved in colour.

use petzval_camera::image::LinearImage;
use petzval_camera::sensor::CfaPattern;

/// Arrays whose mosaics are recognised.
const BAYER: [CfaPattern; 4] = [CfaPattern::RGGB, CfaPattern::GRBG, CfaPattern::GBRG, CfaPattern::BGGR];

/// Largest difference of equal colours of a pixel, sRGB-encoded: one and a half steps of 8 bits. A JPEG rounds by one step, and the noise of a gray
/// scene that was photographed in colour exceeds it somewhere.
const EQUAL: f32 = 1.5 / 255.0;

/// Share of the values that lie in the colours of a tile, above which each pixel has one colour. A picture has one half at most: that of pure green.
const OF_TILE: f64 = 0.8;

/// Difference of the mean values at two places of a tile, over the larger, above which a gray picture is a mosaic: neighbours of a picture differ
/// by less in the mean.
const TILE_CONTRAST: f64 = 0.1;

/// What the colours of a picture show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReferenceColours {
    /// A picture in colour.
    Several,
    /// All three colours are equal at every pixel.
    Gray,
    /// Each pixel has one value, that of its place in a Bayer tile: in the colour of the place, or in gray.
    Mosaic,
}

impl ReferenceColours {
    /// Those of an sRGB-encoded picture of three planes.
    pub fn of(picture: &LinearImage) -> Self {
        let sums = tile_sums(picture);
        let all: f64 = sums.iter().flatten().sum();
        if BAYER.iter().any(|cfa| own_sum(&sums, cfa) > OF_TILE * all) {
            return Self::Mosaic;
        }
        if !is_gray(picture) {
            return Self::Several;
        }
        let brightness = sums.map(|colours| colours.iter().sum::<f64>());
        let (low, high) =
            brightness.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
        if high - low > TILE_CONTRAST * high { Self::Mosaic } else { Self::Gray }
    }
}

/// Sums of the values of each colour at each of the four places of a 2 x 2 tile, row by row.
fn tile_sums(picture: &LinearImage) -> [[f64; 3]; 4] {
    let mut sums = [[0.0; 3]; 4];
    for colour in 0..3 {
        for (row, line) in picture.plane(colour).chunks_exact(picture.width.max(1)).enumerate() {
            for (col, value) in line.iter().enumerate() {
                sums[row % 2 * 2 + col % 2][colour] += f64::from(*value);
            }
        }
    }
    sums
}

/// The sum of the values in the colours of a mosaic.
fn own_sum(sums: &[[f64; 3]; 4], cfa: &CfaPattern) -> f64 {
    let own = |(place, colours): (usize, &[f64; 3])| Some(colours[cfa.colour(place / 2, place % 2).plane()?]);
    sums.iter().enumerate().filter_map(own).sum()
}

/// Whether all three colours are equal at every pixel.
fn is_gray(picture: &LinearImage) -> bool {
    let [red, green, blue] = [0, 1, 2].map(|colour| picture.plane(colour));
    red.iter().zip(green).zip(blue).all(|((r, g), b)| r.max(*g).max(*b) - r.min(*g).min(*b) <= EQUAL)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEIGHT: usize = 32;
    const WIDTH: usize = 48;

    /// A picture of eight bits with these values of colour, row and column.
    fn picture(value: impl Fn(usize, usize, usize) -> f32) -> LinearImage {
        let mut picture = LinearImage::zeros(3, HEIGHT, WIDTH);
        for colour in 0..3 {
            for row in 0..HEIGHT {
                for col in 0..WIDTH {
                    picture.set(colour, row, col, (255.0 * value(colour, row, col)).round() / 255.0);
                }
            }
        }
        picture
    }

    /// A ramp whose colours differ.
    fn scene(colour: usize, _row: usize, col: usize) -> f32 {
        [0.6, 1.0, 0.7][colour] * (0.1 + 0.8 * col as f32 / WIDTH as f32)
    }

    fn gray(row: usize, col: usize) -> f32 {
        // Values of eight bits that lie halfway between two would round either way.
        0.102 + 0.01 * row as f32 + 0.01 * col as f32
    }

    #[test]
    fn mosaics_that_are_saved_in_colour_are_no_pictures() {
        for cfa in BAYER {
            let own = |row, col| cfa.colour(row, col).plane().unwrap();
            let in_gray = picture(|_, row, col| scene(own(row, col), row, col));
            assert_eq!(ReferenceColours::of(&in_gray), ReferenceColours::Mosaic, "{cfa}");
            let in_colour = picture(
                |colour, row, col| if colour == own(row, col) { scene(colour, row, col) } else { 0.0 },
            );
            assert_eq!(ReferenceColours::of(&in_colour), ReferenceColours::Mosaic, "{cfa}");
        }
    }

    #[test]
    fn colours_that_differ_by_one_step_are_gray_and_those_of_noise_are_not() {
        assert_eq!(ReferenceColours::of(&picture(scene)), ReferenceColours::Several);
        // A scene of pure green has half of its values in the tile.
        let green = picture(|colour, row, col| if colour == 1 { gray(row, col) } else { 0.0 });
        assert_eq!(ReferenceColours::of(&green), ReferenceColours::Several);
        let hash = |colour: usize, row: usize, col: usize| (7 * colour + 13 * row + 29 * col) % 5;
        for (steps, wanted) in [
            (0.0_f32, ReferenceColours::Gray),
            (0.25, ReferenceColours::Gray),
            (1.0, ReferenceColours::Several),
        ] {
            let noisy = |colour, row, col| gray(row, col) + steps * hash(colour, row, col) as f32 / 255.0;
            assert_eq!(ReferenceColours::of(&picture(noisy)), wanted, "{steps}");
        }
        assert_eq!(ReferenceColours::of(&picture(|_, _, _| 0.0)), ReferenceColours::Gray);
    }
}
