//! Means of parts of a picture without its defect pixels, to see light that is not uniform.
//!
//! A pixel that is stuck at 4095 raises the mean of a block of 600 pixels by 6.7 DN, as a light leak does.

use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Blocks a side into which a frame is divided to look for light that is not uniform or moves.
pub const BLOCKS: usize = 8;

/// Means of 8x8 blocks of the mean frame of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockMeans {
    /// Mean of each block that has pixels, DN.
    pub means_dn: Vec<f64>,
    /// Largest variance of such a mean from the spread of the pixels in its block, DN^2.
    pub variance_dn2: f64,
}

/// Standard deviations from the median of a block beyond which a pixel is a defect.
const SIGMAS: f64 = 6.0;

/// Least distance of a defect from the median, DN: the step of the converter.
const LEAST_DN: f64 = 1.0;

/// Largest share of defects in a block. What covers more of it is a part of the picture.
const MOST: f64 = 0.05;

/// The blocks of a picture that is the sum of `frames` frames.
pub fn block_means(sum_dn: &[u32], frames: usize, [height, width]: [usize; 2]) -> BlockMeans {
    let mut found = BlockMeans { means_dn: Vec::new(), variance_dn2: 0.0 };
    let span =
        |block: usize, size: usize| (block * size).div_ceil(BLOCKS)..((block + 1) * size).div_ceil(BLOCKS);
    for rows in (0..BLOCKS).map(|block| span(block, height)) {
        for columns in (0..BLOCKS).map(|block| span(block, width)) {
            let line = |row: usize| &sum_dn[row * width..][columns.clone()];
            let pixels = rows.clone().flat_map(line).map(|sum| f64::from(*sum) / frames as f64);
            let pixels = without_defects(pixels.collect());
            let n = pixels.len() as f64;
            if pixels.is_empty() {
                continue;
            }
            let mean = pixels.iter().sum::<f64>() / n;
            let spread = pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / n;
            found.means_dn.push(mean);
            found.variance_dn2 = found.variance_dn2.max(spread / n);
        }
    }
    found
}

/// The pixels of a block, DN, but a few that lie off the others.
fn without_defects(pixels: Vec<f64>) -> Vec<f64> {
    let middle = median(pixels.iter().copied());
    let distance = median(pixels.iter().map(|p| (p - middle).abs()));
    let limit = LEAST_DN.max(SIGMAS * SIGMA_OVER_MEDIAN * distance);
    let good: Vec<f64> = pixels.iter().copied().filter(|p| (p - middle).abs() <= limit).collect();
    let defects = (pixels.len() - good.len()) as f64;
    if defects > MOST * pixels.len() as f64 { pixels } else { good }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [80, 160];

    /// Sums of two frames of a picture of 100 or 101 DN.
    fn means(change: impl Fn(usize, usize, u32) -> u32) -> Vec<f64> {
        let pixel = |i: usize| {
            let (row, col) = (i / SIZE[1], i % SIZE[1]);
            2 * change(row, col, 100 + (row * 7 + col * 3) as u32 % 2)
        };
        block_means(&(0..SIZE[0] * SIZE[1]).map(pixel).collect::<Vec<_>>(), 2, SIZE).means_dn
    }

    #[test]
    fn stuck_pixels_are_left_out_and_bright_parts_are_not() {
        let even = means(|_, _, dn| dn);
        assert!(even.len() == 64 && even.iter().all(|m| (m - 100.5).abs() < 1e-9), "{even:?}");
        let stuck = means(|row, col, dn| if row % 10 == 3 && col % 20 == 7 { 4095 } else { dn });
        assert!(stuck.iter().all(|m| (m - 100.5).abs() < 0.01), "{stuck:?}");
        // Two rows of bright pixels are a fifth of a block.
        let leak = means(|row, _, dn| if row < 2 { dn + 50 } else { dn });
        assert!((leak[0] - 110.5).abs() < 1e-9 && (leak[8] - 100.5).abs() < 1e-9, "{leak:?}");
    }
}
