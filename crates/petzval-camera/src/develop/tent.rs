//! Colour filling for any colour filter array: means weighted by a tent as wide as the tile.
//!
//! A pixel that saw a colour keeps it. Elsewhere the colour is the mean of the pixels that saw it within one tile on every
//! side, with weights `(1 - |dr| / R) (1 - |dc| / C)` for a tile of R x C pixels, divided by their sum; beyond the border
//! there is nothing. For an `RG/GB` tile that is bilinear interpolation. A colour that the array does not have is taken from its
//! clear pixels, so a monochrome sensor gives three equal planes; clear pixels beside all three colours are not used.

use rayon::prelude::*;

use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{CfaPattern, Colour, SensorError};

/// Where each plane of a picture comes from: per place in the tile the offsets and weights of its tent.
pub(super) struct Tents {
    tile: (usize, usize),
    origin: Placement,
    /// Row, column, weight; index `(channel * R + tile row) * C + tile column`.
    taps: Vec<Vec<(isize, isize, f32)>>,
}

impl Tents {
    /// The tents of an array whose mosaic has its top-left pixel at `origin`, for a picture of at least one tile.
    pub fn new(cfa: CfaPattern, origin: Placement, height: usize, width: usize) -> Result<Self, SensorError> {
        let (rows, cols) = (cfa.rows(), cfa.cols());
        if height < rows || width < cols {
            return Err(SensorError::Shape {
                what: "mosaic",
                expected: format!("at least one tile of {cfa}, {rows}x{cols} pixels"),
                got: format!("{height}x{width} pixels"),
            });
        }
        let mut taps = Vec::with_capacity(CHANNELS * rows * cols);
        for colour in [Colour::Red, Colour::Green, Colour::Blue] {
            let seen = cfa.colours();
            let source = [colour, Colour::Clear].into_iter().find(|c| seen.contains(c));
            let source = source.ok_or(SensorError::UnseenColour { cfa, colour: name(colour) })?;
            taps.extend((0..rows * cols).map(|i| tent(cfa, source, i / cols, i % cols)));
        }
        Ok(Self { tile: (rows, cols), origin, taps })
    }

    /// Hands each pixel of the mosaic that `(channel, row, col)` is made of, with its share, to `take`.
    fn each(
        &self,
        channel: usize,
        (row, col): (usize, usize),
        (height, width): (usize, usize),
        mut take: impl FnMut(usize, f32),
    ) {
        let (rows, cols) = self.tile;
        let (r, c) = ((self.origin.row + row) % rows, (self.origin.col + col) % cols);
        let inside = |&(dr, dc, weight): &(isize, isize, f32)| {
            let (r, c) = (row.checked_add_signed(dr)?, col.checked_add_signed(dc)?);
            (r < height && c < width).then_some((r * width + c, weight))
        };
        let taps = &self.taps[(channel * rows + r) * cols + c];
        let sum: f32 = taps.iter().filter_map(inside).map(|(_, weight)| weight).sum();
        taps.iter().filter_map(inside).for_each(|(i, weight)| take(i, weight / sum));
    }

    /// The three planes of a mosaic.
    pub fn fill(&self, mosaic: &[f32], height: usize, width: usize) -> LinearImage {
        let mut out = LinearImage::zeros(CHANNELS, height, width);
        out.data.par_chunks_exact_mut(width).enumerate().for_each(|(line, values)| {
            for (col, value) in values.iter_mut().enumerate() {
                self.each(line / height, (line % height, col), (height, width), |i, w| {
                    *value += w * mosaic[i];
                });
            }
        });
        out
    }

    /// Transpose of [`Self::fill`].
    pub fn gather(&self, d_rgb: &LinearImage) -> Vec<f32> {
        let (height, width) = (d_rgb.height, d_rgb.width);
        let of = |channel: usize| {
            let mut sum = vec![0.0f32; height * width];
            for (at, &g) in d_rgb.plane(channel).iter().enumerate() {
                self.each(channel, (at / width, at % width), (height, width), |i, w| sum[i] += w * g);
            }
            sum
        };
        let planes: Vec<Vec<f32>> = (0..CHANNELS).into_par_iter().map(of).collect();
        (0..height * width).map(|i| planes[0][i] + planes[1][i] + planes[2][i]).collect()
    }
}

/// Offsets and weights with which pixels of colour `source` make up the pixel at `(row, col)` of the tile.
fn tent(cfa: CfaPattern, source: Colour, row: usize, col: usize) -> Vec<(isize, isize, f32)> {
    if cfa.colour(row, col) == source {
        return vec![(0, 0, 1.0)];
    }
    let (rows, cols) = (cfa.rows() as isize, cfa.cols() as isize);
    let mut taps = Vec::new();
    for dr in 1 - rows..rows {
        for dc in 1 - cols..cols {
            let at = |i: usize, d: isize, len: isize| (i as isize + d).rem_euclid(len) as usize;
            if cfa.colour(at(row, dr, rows), at(col, dc, cols)) == source {
                let side = |d: isize, len: isize| 1.0 - d.abs() as f32 / len as f32;
                taps.push((dr, dc, side(dr, rows) * side(dc, cols)));
            }
        }
    }
    taps
}

fn name(colour: Colour) -> &'static str {
    match colour {
        Colour::Red => "red",
        Colour::Green => "green",
        Colour::Blue => "blue",
        Colour::Clear => "clear",
    }
}
