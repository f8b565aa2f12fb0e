//! PSFs as a picture: one column a field, the channels together in colour and then each alone.

use image::{Rgb, RgbImage};
use petzval_optics::psf::FieldPsf;

use crate::png;

/// Pixels between two PSFs.
const GAP: usize = 4;

/// Draws PSFs on one sheet, a PNG: rows are colour, red, green, blue; brightness is the square root of the
/// value relative to the largest of its field, so that cores and tails are both visible.
pub fn psf_sheet(psfs: &[FieldPsf], grid: usize) -> Vec<u8> {
    let step = grid + GAP;
    let mut sheet =
        RgbImage::from_pixel((psfs.len() * step + GAP) as u32, (4 * step + GAP) as u32, Rgb([32, 32, 32]));
    for (column, psf) in psfs.iter().enumerate() {
        let largest = psf.values.iter().flatten().fold(0.0_f64, |a, b| a.max(*b)).max(f64::MIN_POSITIVE);
        let tone = |channel: usize, cell: usize| {
            let value = psf.values.get(channel).map_or(0.0, |v| v[cell]);
            (255.0 * (value / largest).sqrt()).round() as u8
        };
        for row in 0..grid {
            for x in 0..grid {
                // Draw y upwards, as in lens drawings.
                let cell = (grid - 1 - row) * grid + x;
                let rgb = [tone(0, cell), tone(1, cell), tone(2, cell)];
                let left = (GAP + column * step + x) as u32;
                let mut put = |line: usize, colour: [u8; 3]| {
                    sheet.put_pixel(left, (GAP + line * step + row) as u32, Rgb(colour));
                };
                put(0, rgb);
                put(1, [rgb[0], 0, 0]);
                put(2, [0, rgb[1], 0]);
                put(3, [rgb[2] / 3, rgb[2] / 2, rgb[2]]);
            }
        }
    }
    png::encode(&sheet)
}
