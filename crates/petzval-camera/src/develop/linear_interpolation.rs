//! Demosaicing for any colour filter array: linear interpolation between the nearest pixels of a colour.
//!
//! - A pixel keeps the colour that it measured.
//! - Elsewhere the colour is interpolated between the nearest pixels of that colour, at the distances d on one side and d'
//!   on the other, with the shares `d' / (d + d')` and `d / (d + d')`. If both the row and the column have the colour, both
//!   are used, weighted by the inverse of the error of linear interpolation of a curve, `1 / (d d')`.
//! - If row and column both lack the colour, interpolate along each of the nearest rows that have it, and then between those rows. Do the
//!   same for the nearest columns, and take the mean of both results.
//!
//! A linear ramp of brightness is reproduced exactly by any array. For an `RG/GB` tile this is bilinear interpolation. In
//! binned arrays, pixels of a colour lie at uneven distances; there it is linear interpolation on that uneven grid.
//!
//! At the border the shares of the pixels inside are divided by their sum. A colour without a filter in the array is taken
//! from the clear pixels, so a monochrome sensor gives three equal planes. Clear pixels of an array with all three colours
//! are not used.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{CfaPattern, Colour, SensorError};

/// A neighbour of the interpolated pixel: its offset in rows and columns, and its share.
type Tap = (isize, isize, f32);

/// The taps of each plane of a picture: for each place in the tile, the pixels that it is interpolated from.
pub(super) struct LinearInterpolation {
    tile: (usize, usize),
    origin: Placement,
    /// Index `(channel * R + tile row) * C + tile column`.
    taps: Vec<Vec<Tap>>,
}

/// The filters that give red, green and blue: the colour itself, or clear if the array does not have the colour.
pub(super) fn sources(cfa: CfaPattern) -> Result<[Colour; CHANNELS], SensorError> {
    let seen = cfa.colours();
    let mut sources = [Colour::Red, Colour::Green, Colour::Blue];
    for colour in &mut sources {
        let source = [*colour, Colour::Clear].into_iter().find(|c| seen.contains(c));
        *colour = source.ok_or(SensorError::UnseenColour { cfa, colour: colour.name() })?;
    }
    Ok(sources)
}

impl LinearInterpolation {
    /// The interpolation of an array whose mosaic has its top-left pixel at `origin`, for a picture of at least one tile.
    pub fn new(cfa: CfaPattern, origin: Placement, height: usize, width: usize) -> Result<Self, SensorError> {
        let (rows, cols) = (cfa.rows(), cfa.cols());
        if height < rows || width < cols {
            let expected = format!("at least one tile of {cfa}, {rows}x{cols} pixels");
            return Err(SensorError::shape("mosaic", expected, format!("{height}x{width} pixels")));
        }
        let place = |i: usize| (i / cols, i % cols);
        let of_source =
            |source| (0..rows * cols).map(move |i| nearest(cfa, source, place(i)).into_iter().collect());
        let taps = sources(cfa)?.into_iter().flat_map(of_source).collect();
        Ok(Self { tile: (rows, cols), origin, taps })
    }

    /// Calls `take` with the index and the share of each mosaic pixel that contributes to `(channel, row, col)`.
    fn each(
        &self,
        channel: usize,
        (row, col): (usize, usize),
        (height, width): (usize, usize),
        mut take: impl FnMut(usize, f32),
    ) {
        let (rows, cols) = self.tile;
        let (r, c) = ((self.origin.row + row) % rows, (self.origin.col + col) % cols);
        let inside = |&(dr, dc, weight): &Tap| {
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

/// The pixels of colour `source` that contribute to the place `(row, col)` of the tile. The tile has at least one of them.
fn nearest(cfa: CfaPattern, source: Colour, (row, col): (usize, usize)) -> Vec<Tap> {
    let (rows, cols) = (cfa.rows(), cfa.cols());
    let at = |i: usize, d: isize, len: usize| (i as isize + d).rem_euclid(len as isize) as usize;
    let is = |dr: isize, dc: isize| cfa.colour(at(row, dr, rows), at(col, dc, cols)) == source;
    let in_row = |dr: isize| between(cols, |dc| is(dr, dc));
    let in_column = |dc: isize| between(rows, |dr| is(dr, dc));
    let mut shares: BTreeMap<(isize, isize), f32> = BTreeMap::new();
    let mut add = |dr, dc, share| *shares.entry((dr, dc)).or_default() += share;
    match (in_row(0), in_column(0)) {
        (None, None) => {
            // Interpolate along the nearest rows and columns that have the colour, then between them.
            for (dr, share) in between(rows, |dr| in_row(dr).is_some()).into_iter().flat_map(|l| l.taps) {
                let along = in_row(dr).into_iter().flat_map(|line| line.taps);
                along.for_each(|(dc, part)| add(dr, dc, 0.5 * share * part));
            }
            for (dc, share) in between(cols, |dc| in_column(dc).is_some()).into_iter().flat_map(|l| l.taps) {
                let along = in_column(dc).into_iter().flat_map(|line| line.taps);
                along.for_each(|(dr, part)| add(dr, dc, 0.5 * share * part));
            }
        }
        (row, column) => {
            let weight = |line: &Option<Line>| line.as_ref().map_or(0.0, |line| 1.0 / line.miss);
            // A pixel of the colour itself needs no interpolation.
            let own = is(0, 0);
            let of_row = if own { 1.0 } else { weight(&row) / (weight(&row) + weight(&column)) };
            row.into_iter().flat_map(|line| line.taps).for_each(|(dc, share)| add(0, dc, of_row * share));
            let along = column.filter(|_| !own).into_iter().flat_map(|line| line.taps);
            along.for_each(|(dr, share)| add(dr, 0, (1.0 - of_row) * share));
        }
    }
    shares.into_iter().map(|((dr, dc), share)| (dr, dc, share)).collect()
}

/// Linear interpolation along a line: offsets and shares, and the scale `d d'` of its error for a curve.
struct Line {
    taps: Vec<(isize, f32)>,
    miss: f32,
}

/// LinearInterpolation on a line of the given period between the nearest places on both sides for which `has` holds. If `has(0)`
/// holds, the place itself is the only tap. `None` if `has` holds nowhere.
fn between(period: usize, has: impl Fn(isize) -> bool) -> Option<Line> {
    if has(0) {
        return Some(Line { taps: vec![(0, 1.0)], miss: 0.0 });
    }
    let near = |side: isize| (1..period as isize).find(|d| has(side * d));
    let (before, after) = (near(-1)?, near(1)?);
    let gap = (before + after) as f32;
    let taps = vec![(-before, after as f32 / gap), (after, before as f32 / gap)];
    Some(Line { taps, miss: (before * after) as f32 })
}
