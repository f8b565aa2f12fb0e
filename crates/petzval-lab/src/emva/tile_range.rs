//! How pixels of one colour differ by their place in a tile: colour filters that the list of the captures does not state.

use petzval_base::statistics::median;
use petzval_camera::sensor::{CfaPattern, Colour};

/// Rows and columns after which colour filter arrays repeat: those of two by two pixels of a colour after four.
const TILE: usize = 4;

/// Most rows of tiles that are looked at, spread evenly over the frame.
const MOST_ROWS: usize = 128;

/// Largest difference between the medians of two places of a tile that have one colour, DN, in a picture that is the sum of `frames` frames.
/// Medians do not see dead pixels and columns. Zero for a stated array that does not repeat in such a tile.
pub fn tile_range_dn(sum_dn: &[u32], frames: usize, [height, width]: [usize; 2], cfa: &CfaPattern) -> f64 {
    if !TILE.is_multiple_of(cfa.rows()) || !TILE.is_multiple_of(cfa.cols()) {
        return 0.0;
    }
    let tiles = height / TILE;
    let step = tiles.div_ceil(MOST_ROWS).max(1);
    let across = width / TILE * TILE;
    let level_dn = |row: usize, col: usize| {
        let rows = (0..tiles).step_by(step).map(|tile| TILE * tile + row);
        let pixels = rows.flat_map(|row| sum_dn[row * width..][..across].iter().skip(col).step_by(TILE));
        median(pixels.map(|sum| f64::from(*sum))) / frames as f64
    };
    let places = (0..TILE * TILE).map(|i| (i / TILE, i % TILE));
    let levels: Vec<_> = places.map(|(row, col)| (cfa.colour(row, col), level_dn(row, col))).collect();
    let range = |colour: Colour| {
        let own = || levels.iter().filter(|(other, _)| *other == colour).map(|(_, dn)| *dn);
        own().fold(f64::NEG_INFINITY, f64::max) - own().fold(f64::INFINITY, f64::min)
    };
    cfa.colours().into_iter().map(range).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_one_colour_are_compared_without_dead_columns() {
        let [height, width] = [40, 36];
        let levels = [[100, 200], [210, 400]];
        let mut sum: Vec<u32> =
            (0..height * width).map(|i| 2 * levels[i / width % 2][i % width % 2]).collect();
        let range = |sum: &[u32], cfa: &str| tile_range_dn(sum, 2, [height, width], &cfa.parse().unwrap());
        assert_eq!(range(&sum, "mono"), 300.0);
        assert_eq!(range(&sum, "RGGB"), 10.0);
        assert_eq!(range(&sum, "GRBG"), 300.0);
        (0..height).for_each(|row| sum[row * width + 5] = 8190);
        assert_eq!(range(&sum, "RGGB"), 10.0);
    }
}
