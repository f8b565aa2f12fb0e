//! Pictures as a display shows them: sRGB-encoded, 8 bits a colour, pixel by pixel; and how their values are spread.
//!
//! While a lens is dragged, a picture is encoded some thirty times a second. A power for each of its values would take as long as its convolution:
//! the byte of a light is looked up, and is the one that the formula gives.

use std::sync::LazyLock;

use rayon::prelude::*;

use super::{CHANNELS, LinearImage, srgb_encode};

/// Parts of equal width between black and white. The table has a byte to begin with for each. A part is narrower than any byte: the light of
/// the narrowest ones, near black, is `1 / (12.92 * 255)` wide.
const PARTS: usize = 4096;

/// Bytes of linear light.
struct Bytes {
    /// The least light of each byte; behind them what no light reaches.
    least: [f32; 257],
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
            least: std::array::from_fn(|byte| match byte {
                0 => 0.0,
                1..=255 => least(byte as u8),
                _ => f32::INFINITY,
            }),
            first: std::array::from_fn(|part| encoded(part as f32 / PARTS as f32)),
        }
    }

    /// The byte of a light. What is no number is black.
    fn of(&self, light: f32) -> u8 {
        let light = light.clamp(0.0, 1.0);
        let byte = self.first[(light * PARTS as f32) as usize];
        // At most one byte begins within a part. Without a branch: noise would mislead it.
        byte + u8::from(light >= self.least[usize::from(byte) + 1])
    }
}

/// A picture in linear light, of which `white` is shown as white.
pub fn display_bytes(picture: &LinearImage, white: f32) -> Vec<u8> {
    let (pixels, columns, table) = (picture.height * picture.width, picture.width, &*BYTES);
    let mut bytes = vec![0; CHANNELS * pixels];
    bytes.par_chunks_mut((CHANNELS * columns).max(1)).enumerate().for_each(|(row, bytes)| {
        let line = |channel: usize| &picture.data[channel * pixels + row * columns..][..columns];
        let (red, green, blue) = (line(0), line(1), line(2));
        for (((bytes, red), green), blue) in bytes.chunks_exact_mut(CHANNELS).zip(red).zip(green).zip(blue) {
            for (byte, light) in bytes.iter_mut().zip([red, green, blue]) {
                *byte = table.of(light / white);
            }
        }
    });
    bytes
}

/// How many values of each channel lie in each of `bins` parts of equal width, of values of 8 bits that are given pixel by pixel.
pub fn spread(values: &[u8], channels: usize, bins: usize) -> Vec<Vec<u32>> {
    let of_channel = |channel: usize| {
        let mut counts = [0_u32; 256];
        for pixel in values.chunks_exact(channels) {
            counts[usize::from(pixel[channel])] += 1;
        }
        let mut spread = vec![0; bins];
        for (value, count) in counts.into_iter().enumerate() {
            spread[value * bins / counts.len()] += count;
        }
        spread
    };
    (0..channels).into_par_iter().map(of_channel).collect()
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
        assert!(table.first.windows(2).all(|pair| pair[1] - pair[0] <= 1));
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

    #[test]
    fn each_value_of_a_channel_lies_in_its_bin() {
        let values = [0, 3, 4, 255, 252, 251, 127, 128, 129];
        let spread = spread(&values, 3, 64);
        let filled = |c: usize| -> Vec<(usize, u32)> {
            spread[c].iter().copied().enumerate().filter(|(_, count)| *count > 0).collect()
        };
        assert_eq!(filled(0), [(0, 1), (31, 1), (63, 1)]);
        assert_eq!(filled(1), [(0, 1), (32, 1), (63, 1)]);
        assert_eq!(filled(2), [(1, 1), (32, 1), (62, 1)]);
    }
}
