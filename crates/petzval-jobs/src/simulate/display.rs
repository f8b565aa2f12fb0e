//! Pictures as a display shows them: sRGB-encoded, 8 bits a colour, pixel by pixel.
//!
//! While a lens is dragged, a picture is encoded some thirty times a second. A power for each of its values would take as long as its convolution:
//! the byte of a light is looked up, and is the one that the formula gives.

use std::sync::LazyLock;

use petzval_camera::image::{CHANNELS, LinearImage, srgb_encode};
use rayon::prelude::*;

/// Parts of equal width between black and white, for each of which the table has a byte to begin with.
const PARTS: usize = 1024;

/// Bytes of linear light.
struct Bytes {
    /// The least light of each byte.
    least: [f32; 256],
    /// The byte at the lower end of each part, and at white.
    first: [u8; PARTS + 1],
}

static BYTES: LazyLock<Bytes> = LazyLock::new(Bytes::new);

/// The byte of a light: `round(255 srgb(light))`, with the light clipped to [0, 1].
fn encoded(light: f32) -> u8 {
    (255.0 * srgb_encode(light.clamp(0.0, 1.0))).round() as u8
}

impl Bytes {
    fn new() -> Self {
        // Numbers of 32 bits that are not negative are in the order of their bits: halve the bits between black and white.
        let least = |byte: u8| {
            let (mut below, mut at) = (0, 1.0_f32.to_bits());
            while at - below > 1 {
                let middle = below + (at - below) / 2;
                if encoded(f32::from_bits(middle)) < byte { below = middle } else { at = middle }
            }
            f32::from_bits(at)
        };
        Self {
            least: std::array::from_fn(|byte| if byte == 0 { 0.0 } else { least(byte as u8) }),
            first: std::array::from_fn(|part| encoded(part as f32 / PARTS as f32)),
        }
    }

    /// The byte of a light. What is no number is black.
    fn of(&self, light: f32) -> u8 {
        let light = light.clamp(0.0, 1.0);
        let mut byte = self.first[(light * PARTS as f32) as usize];
        while byte < 255 && light >= self.least[usize::from(byte) + 1] {
            byte += 1;
        }
        byte
    }
}

/// A picture in linear light, of which `white` is shown as white.
pub fn display_bytes(picture: &LinearImage, white: f32) -> Vec<u8> {
    let (pixels, columns, table) = (picture.height * picture.width, picture.width, &*BYTES);
    let mut bytes = vec![0; CHANNELS * pixels];
    bytes.par_chunks_mut((CHANNELS * columns).max(1)).enumerate().for_each(|(row, bytes)| {
        for channel in 0..CHANNELS {
            let from = channel * pixels + row * columns;
            let values = &picture.data[from..from + columns];
            for (column, light) in values.iter().enumerate() {
                bytes[CHANNELS * column + channel] = table.of(light / white);
            }
        }
    });
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_of_the_table_are_those_of_the_formula() {
        let table = &*BYTES;
        // Every number next to a change of the byte, and many between.
        let next = table.least.iter().flat_map(|least| {
            let bits = least.to_bits();
            (bits.saturating_sub(3)..bits + 4).map(f32::from_bits)
        });
        let many = (0..2_000_000).map(|i| i as f32 / 1_900_000.0 - 0.01);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, f32::MIN_POSITIVE, 1.0, 2.0];
        for light in next.chain(many).chain(odd) {
            assert_eq!(table.of(light), encoded(light), "{light}");
        }
    }

    #[test]
    fn channels_become_pixels_and_white_is_white() {
        let picture = LinearImage::from_data(3, 1, 2, vec![0.0, 4.0, 1.0, 4.0, 9.0, 4.0]).unwrap();
        assert_eq!(display_bytes(&picture, 4.0), [0, encoded(0.25), 255, 255, 255, 255]);
    }
}
