//! A strip of a mosaic with a mirrored border: what demosaicing works on.

use crate::render::Placement;
use crate::sensor::{CfaPattern, Colour};

/// Rows of a strip.
pub const STRIP_ROWS: usize = 128;

/// Border around a strip, even so that it keeps the phase of the array: as far as the farthest-reaching method looks.
pub const BORDER: usize = 12;

/// What a pixel measured, and where the other colours are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    Red,
    Blue,
    /// Green with red pixels left and right of it.
    GreenByRed,
    /// Green with blue pixels left and right of it.
    GreenByBlue,
}

impl Site {
    pub fn is_green(self) -> bool {
        matches!(self, Self::GreenByRed | Self::GreenByBlue)
    }

    /// Of a green pixel, the steps to its red and to its blue neighbours, where `stride` is that to the next row.
    pub fn chroma_steps(self, stride: usize) -> Option<[usize; 2]> {
        match self {
            Self::GreenByRed => Some([1, stride]),
            Self::GreenByBlue => Some([stride, 1]),
            Self::Red | Self::Blue => None,
        }
    }
}

/// A plane of values, `stride` to a row.
#[derive(Clone)]
pub struct Plane {
    pub data: Vec<f32>,
    pub stride: usize,
}

impl Plane {
    pub fn zeros(tile: &Tile) -> Self {
        Self { data: vec![0.0; tile.mosaic.data.len()], stride: tile.mosaic.stride }
    }
}

/// A strip of a mosaic with its border.
pub struct Tile {
    pub mosaic: Plane,
    pub rows: usize,
    pub cols: usize,
    /// What the pixels of the first two rows and columns measured; the rest repeats them.
    sites: [[Site; 2]; 2],
}

/// The pixel at which position `at` lands when the outermost pixels are mirrors.
fn mirrored(at: isize, len: usize) -> usize {
    let period = 2 * (len as isize - 1);
    let at = at.rem_euclid(period);
    at.min(period - at) as usize
}

impl Tile {
    /// Rows `first..first + rows` of a mosaic of a Bayer array.
    pub fn cut(
        mosaic: &[f32],
        (height, width): (usize, usize),
        (first, rows): (usize, usize),
        cfa: CfaPattern,
        placement: Placement,
    ) -> Self {
        let stride = width + 2 * BORDER;
        let mut data = vec![0.0; (rows + 2 * BORDER) * stride];
        for (r, line) in data.chunks_exact_mut(stride).enumerate() {
            let from = mirrored((first + r) as isize - BORDER as isize, height);
            let source = &mosaic[from * width..(from + 1) * width];
            line[BORDER..BORDER + width].copy_from_slice(source);
            for k in (0..BORDER).chain(BORDER + width..stride) {
                line[k] = source[mirrored(k as isize - BORDER as isize, width)];
            }
        }
        // The border is even: it does not change the phase.
        let colour = |r: usize, c: usize| cfa.colour(placement.row + first + r, placement.col + c);
        let site = |r: usize, c: usize| match colour(r, c) {
            Colour::Red => Site::Red,
            Colour::Blue => Site::Blue,
            _ if colour(r, c + 1) == Colour::Red => Site::GreenByRed,
            _ => Site::GreenByBlue,
        };
        let sites = [0, 1].map(|r| [0, 1].map(|c| site(r, c)));
        Self { mosaic: Plane { data, stride }, rows, cols: width, sites }
    }

    /// What the pixels of a row measured, even and odd columns.
    pub fn sites(&self, row: usize) -> [Site; 2] {
        self.sites[row % 2]
    }

    /// Calls `f` with the site and the index of every pixel that is at least `margin` from the edge of the strip and its border.
    pub fn each(&self, margin: usize, mut f: impl FnMut(Site, usize)) {
        let stride = self.mosaic.stride;
        let rows = self.rows + 2 * BORDER;
        for row in margin..rows - margin {
            let sites = self.sites(row);
            for col in margin..stride - margin {
                f(sites[col % 2], row * stride + col);
            }
        }
    }

    /// A plane of the values of the strip, with a border of zeros.
    pub fn framed(&self, values: &[f32]) -> Plane {
        let mut out = Plane::zeros(self);
        for (row, line) in values.chunks_exact(self.cols).enumerate() {
            out.data[(row + BORDER) * out.stride + BORDER..][..self.cols].copy_from_slice(line);
        }
        out
    }

    /// Adds the cotangent of strip and border to that of the mosaic: the transpose of [`Tile::cut`] at row `first`.
    pub fn fold(&self, bar: &Plane, first: usize, (height, width): (usize, usize), mosaic: &mut [f32]) {
        for (r, line) in bar.data.chunks_exact(bar.stride).enumerate() {
            let row = mirrored((first + r) as isize - BORDER as isize, height) * width;
            for (c, value) in line.iter().enumerate() {
                mosaic[row + mirrored(c as isize - BORDER as isize, width)] += value;
            }
        }
    }

    /// A plane without its border.
    pub fn inside(&self, plane: &Plane) -> Vec<f32> {
        let mut out = Vec::with_capacity(self.rows * self.cols);
        for row in BORDER..BORDER + self.rows {
            out.extend_from_slice(&plane.data[row * plane.stride + BORDER..][..self.cols]);
        }
        out
    }
}
