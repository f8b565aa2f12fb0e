//! Luma and colour differences of a developed picture, in whole numbers as a chip sends them.
//!
//! With the shares kr and kb of a standard and encoded colours R, G, B of 0..1 (ITU-R BT.601-7, BT.709-6; full range: ITU-T T.871, JFIF):
//!
//! ```text
//! Y = kr R + (1 - kr - kb) G + kb B,   Cb = (B - Y) / (2 (1 - kb)),   Cr = (R - Y) / (2 (1 - kr))
//! limited range, n bits:  2^(n-8) (219 Y + 16),  2^(n-8) (224 C + 128)
//! full range, n bits:     (2^n - 1) Y,           (2^n - 1) C + 2^(n-1)
//! ```
//!
//! Colour differences of 4:2:2 and 4:2:0 lie on the left of each pair of columns, where the standards put them. They are the means
//! `(1 2 1) / 4` over the three columns about it. In 4:2:0 they lie halfway between two rows and are the means of both. Every value is
//! rounded once.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::stage::output::{BT601, BT709};
use super::{IspError, RgbPicture};

/// The standard of luma.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Standard {
    /// ITU-R BT.601: standard definition, and JPEG.
    Bt601,
    /// ITU-R BT.709: high definition, and sRGB.
    #[default]
    Bt709,
}

/// The codes between black and white.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Range {
    /// All of them.
    Full,
    /// 16 to 235 for luma and 16 to 240 for colour differences, of 8 bits.
    #[default]
    Limited,
}

/// How many colour differences there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Chroma {
    /// 4:4:4: one for each pixel.
    #[serde(rename = "444")]
    Every,
    /// 4:2:2: one for two pixels of a row.
    #[serde(rename = "422")]
    HalfWidth,
    /// 4:2:0: one for two by two pixels.
    #[default]
    #[serde(rename = "420")]
    HalfBoth,
}

/// How a picture is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct YcbcrFormat {
    /// The standard.
    pub standard: Standard,
    /// The range.
    pub range: Range,
    /// The colour differences.
    pub chroma: Chroma,
    /// Bits of a value, 8 or 10.
    pub bits: u32,
}

/// A picture of luma and colour differences.
#[derive(Clone, Debug, PartialEq)]
pub struct YcbcrPicture {
    /// Rows of luma.
    pub height: usize,
    /// Columns of luma.
    pub width: usize,
    /// How its values are meant.
    pub format: YcbcrFormat,
    /// Y, Cb and Cr, row by row.
    pub planes: [Vec<u16>; 3],
}

/// Bits behind the point of the coefficients, for input and output of equal bits.
const COEFFICIENT_BITS: u32 = 16;

impl Standard {
    /// Shares of red and blue in luma.
    pub fn shares(self) -> [f64; 2] {
        match self {
            Self::Bt601 => BT601,
            Self::Bt709 => BT709,
        }
    }
}

impl Chroma {
    /// Columns and rows of luma for one colour difference.
    fn pixels(self) -> (usize, usize) {
        match self {
            Self::Every => (1, 1),
            Self::HalfWidth => (2, 1),
            Self::HalfBoth => (2, 2),
        }
    }

    /// Rows and columns of the colour differences of a picture.
    pub fn size(self, height: usize, width: usize) -> (usize, usize) {
        let (columns, rows) = self.pixels();
        (height.div_ceil(rows), width.div_ceil(columns))
    }
}

/// Coefficients of one output value, [`Registers::fraction`] bits behind the point, and its offset and limits.
struct Row {
    of_rgb: [i64; 3],
    offset: i64,
    limits: [i64; 2],
}

/// What a driver writes into the stage.
struct Registers {
    rows: [Row; 3],
    fraction: u32,
}

impl Registers {
    fn new(format: YcbcrFormat, input_bits: u32) -> Self {
        let bits = format.bits;
        let fraction = COEFFICIENT_BITS + input_bits.saturating_sub(bits);
        let [kr, kb] = format.standard.shares();
        let step = 1_i64 << (bits - 8);
        let last = (1 << bits) - 1;
        let (steps, offset, limits) = match format.range {
            Range::Limited => {
                let limits = [[16, 235], [16, 240]].map(|of| of.map(|code| code * step));
                ([219 * step, 224 * step], [16 * step, 128 * step], limits)
            }
            Range::Full => ([last; 2], [0, 128 * step], [[0, last]; 2]),
        };
        let white = f64::from((1_u32 << input_bits) - 1);
        let whole = |share: f64, steps: i64| {
            (share * steps as f64 / white * (1_i64 << fraction) as f64).round() as i64
        };
        // Green takes what is missing to the sum, so that white is white and grays have no colour.
        let row = |k: usize, red: f64, blue: f64, sum: f64| {
            let (red, blue, sum) = (whole(red, steps[k]), whole(blue, steps[k]), whole(sum, steps[k]));
            Row { of_rgb: [red, sum - red - blue, blue], offset: offset[k], limits: limits[k] }
        };
        let rows = [
            row(0, kr, kb, 1.0),
            row(1, -kr / (2.0 * (1.0 - kb)), 0.5, 0.0),
            row(1, 0.5, -kb / (2.0 * (1.0 - kr)), 0.0),
        ];
        Self { rows, fraction }
    }
}

impl Row {
    fn sum(&self, rgb: [i64; 3]) -> i64 {
        (0..3).map(|c| self.of_rgb[c] * rgb[c]).sum()
    }

    /// The code of a sum with so many bits behind the point.
    fn code(&self, sum: i64, fraction: u32) -> u16 {
        let rounded = (sum + (1 << (fraction - 1))) >> fraction;
        (rounded + self.offset).clamp(self.limits[0], self.limits[1]) as u16
    }
}

impl RgbPicture {
    /// The picture as luma and colour differences.
    pub fn to_ycbcr(&self, format: YcbcrFormat) -> Result<YcbcrPicture, IspError> {
        if !matches!(format.bits, 8 | 10) {
            let got = format.bits.to_string();
            return Err(IspError::Input { what: "bits of luma", got, need: "8 or 10" });
        }
        let Self { height, width, bits, .. } = *self;
        let Registers { rows: [luma, cb, cr], fraction } = Registers::new(format, bits);
        let size = height * width;
        let rgb = |row: usize, col: usize| {
            let i = row * width + col;
            [0, 1, 2].map(|c| i64::from(self.data[c * size + i]))
        };
        let y = (0..size).map(|i| luma.code(luma.sum(rgb(i / width, i % width)), fraction)).collect();

        let (chroma_height, chroma_width) = format.chroma.size(height, width);
        let (across, down) = format.chroma.pixels();
        // Weights of the columns about a colour difference; at the border the outermost column is repeated.
        let taps: &[(isize, i64)] = if across == 2 { &[(-1, 1), (0, 2), (1, 1)] } else { &[(0, 1)] };
        let extra = across.ilog2() * 2 + down.ilog2();
        let plane = |of: &Row| -> Vec<u16> {
            let value = |i: usize| {
                let (top, left) = (i / chroma_width * down, i % chroma_width * across);
                let mut sum = 0;
                for row in top..top + down {
                    for (by, weight) in taps {
                        let col = left.saturating_add_signed(*by).min(width - 1);
                        sum += weight * of.sum(rgb(row.min(height - 1), col));
                    }
                }
                of.code(sum, fraction + extra)
            };
            (0..chroma_height * chroma_width).map(value).collect()
        };
        let planes = [y, plane(&cb), plane(&cr)];
        Ok(YcbcrPicture { height, width, format, planes })
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::stage::output::ycbcr;
    use super::*;

    const FORMATS: [(Standard, Range); 4] = [
        (Standard::Bt601, Range::Full),
        (Standard::Bt601, Range::Limited),
        (Standard::Bt709, Range::Full),
        (Standard::Bt709, Range::Limited),
    ];

    fn format((standard, range): (Standard, Range), chroma: Chroma, bits: u32) -> YcbcrFormat {
        YcbcrFormat { standard, range, chroma, bits }
    }

    /// A picture of random colours, among them the corners of the cube.
    fn colours(bits: u32) -> RgbPicture {
        let (height, width) = (30, 40);
        let white = (1_u32 << bits) - 1;
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut data: Vec<u16> =
            (0..3 * height * width).map(|_| rng.random_range(0..=white) as u16).collect();
        for corner in 0..8 {
            for c in 0..3 {
                data[c * height * width + corner] = if corner >> c & 1 == 1 { white as u16 } else { 0 };
            }
        }
        RgbPicture { height, width, bits, data }
    }

    /// Codes of the formula, before rounding.
    fn wanted(rgb: [f64; 3], format: YcbcrFormat) -> [f64; 3] {
        let [y, cb, cr] = ycbcr(rgb, format.standard.shares());
        let step = f64::from(1 << (format.bits - 8));
        let full = f64::from((1 << format.bits) - 1);
        match format.range {
            Range::Limited => [219.0 * y + 16.0, 224.0 * cb + 128.0, 224.0 * cr + 128.0].map(|v| v * step),
            Range::Full => [full * y, full * cb + 128.0 * step, full * cr + 128.0 * step],
        }
    }

    #[test]
    fn codes_are_those_of_the_formula_rounded() {
        for pair in FORMATS {
            for (input_bits, bits) in [(8, 8), (10, 8), (16, 8), (8, 10), (10, 10), (16, 10)] {
                let (picture, format) = (colours(input_bits), format(pair, Chroma::Every, bits));
                let found = picture.to_ycbcr(format).unwrap();
                let (encoded, size) = (picture.encoded(), picture.height * picture.width);
                for i in 0..size {
                    let rgb = [0, 1, 2].map(|c| f64::from(encoded[c * size + i]));
                    for (plane, wanted) in found.planes.iter().zip(wanted(rgb, format)) {
                        let last = f64::from((1 << bits) - 1);
                        let apart = f64::from(plane[i]) - wanted.clamp(0.0, last);
                        // A half is rounding, the rest that of the coefficients.
                        assert!(apart.abs() < 0.6, "{format:?} {input_bits}: {apart}");
                    }
                }
            }
        }
    }

    #[test]
    fn black_white_and_gray_are_exact_and_limits_are_kept() {
        for pair in FORMATS {
            for bits in [8, 10] {
                let step = 1 << (bits - 8);
                let format = format(pair, Chroma::Every, bits);
                let gray = |v: u16| {
                    let picture = RgbPicture { height: 1, width: 1, bits: 16, data: vec![v; 3] };
                    picture.to_ycbcr(format).unwrap().planes.map(|plane| plane[0])
                };
                let (black, white) = match format.range {
                    Range::Limited => (16 * step, 235 * step),
                    Range::Full => (0, 256 * step - 1),
                };
                assert_eq!(gray(0), [black, 128 * step, 128 * step]);
                assert_eq!(gray(65535), [white, 128 * step, 128 * step]);
                assert_eq!(gray(30_000)[1..], [128 * step; 2]);
                let found = colours(16).to_ycbcr(format).unwrap();
                let [lowest, highest] = match format.range {
                    Range::Limited => [16 * step, 240 * step],
                    // The lowest is half a code above 0.
                    Range::Full => [1, 256 * step - 1],
                };
                for plane in &found.planes[1..] {
                    let ends = (plane.iter().min().unwrap(), plane.iter().max().unwrap());
                    assert_eq!(ends, (&lowest, &highest), "{format:?}: pure colours reach both ends");
                }
            }
        }
    }

    #[test]
    fn colour_differences_lie_on_the_left_columns_between_two_rows() {
        // Blue grows by 1000 codes of 16 bits from column to column, and by 3000 from row to row.
        let (height, width) = (9, 13);
        let mut data = vec![20_000; 3 * height * width];
        for i in 0..height * width {
            data[2 * height * width + i] = 20_000 + (1000 * (i % width) + 3000 * (i / width)) as u16;
        }
        let picture = RgbPicture { height, width, bits: 16, data };
        let pair = (Standard::Bt709, Range::Limited);
        let [whole, half_width, half_both] = [Chroma::Every, Chroma::HalfWidth, Chroma::HalfBoth]
            .map(|chroma| picture.to_ycbcr(format(pair, chroma, 10)).unwrap());
        assert_eq!((half_width.planes[1].len(), half_both.planes[1].len()), (9 * 7, 5 * 7));
        assert_eq!(whole.planes[0], half_both.planes[0]);
        let cb = |row: usize, col: usize| f64::from(whole.planes[1][row * width + col]);
        for col in 1..6 {
            for row in 0..height {
                let apart = f64::from(half_width.planes[1][row * 7 + col]) - cb(row, 2 * col);
                assert!(apart.abs() <= 1.0, "{row} {col}: {apart}");
            }
            for row in 0..4 {
                let between = 0.5 * (cb(2 * row, 2 * col) + cb(2 * row + 1, 2 * col));
                let apart = f64::from(half_both.planes[1][row * 7 + col]) - between;
                assert!(apart.abs() <= 1.0, "{row} {col}: {apart}");
            }
        }
        // An odd last row stands for itself.
        assert!((f64::from(half_both.planes[1][4 * 7 + 2]) - cb(8, 4)).abs() <= 1.0);
    }

    #[test]
    fn other_bits_are_refused() {
        let of = format(FORMATS[0], Chroma::Every, 12);
        assert!(colours(8).to_ycbcr(of).unwrap_err().to_string().contains("8 or 10"));
    }
}
