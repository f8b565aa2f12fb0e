//! Frames with a mirrored border on a device: their sizes, the place of a pixel in them, and the steps of Menon's method.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

use crate::image::CHANNELS;

/// Border around a frame, even so that it keeps the phase of the array: as far as the farthest-reaching method looks.
pub const BORDER: usize = 12;

/// Numbers of one capture: dark level, light per digital number of red, green, blue, and the offset of the square root.
pub const NUMBERS: usize = 5;

/// Planes of a frame's cotangents: red, green, blue, and the mosaic.
pub const BARS: usize = CHANNELS + 1;

/// Distance from the edge of the bordered frame at which each step of Menon's method begins.
pub const GREEN: usize = 6;
pub const CHROMA_AT_GREEN: usize = 7;
pub const OPPOSITE: usize = 8;
pub const REFINED_GREEN: usize = 9;
pub const REFINED_CHROMA: usize = 10;
pub const REFINED_OPPOSITE: usize = 11;

/// Step of an adjoint, in the order of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    Green,
    ChromaAtGreen,
    Opposite,
    RefinedGreen,
    RefinedChroma,
    RefinedOpposite,
}

/// Where a step begins.
pub fn margin_of(step: Step) -> usize {
    match step {
        Step::Green => GREEN,
        Step::ChromaAtGreen => CHROMA_AT_GREEN,
        Step::Opposite => OPPOSITE,
        Step::RefinedGreen => REFINED_GREEN,
        Step::RefinedChroma => REFINED_CHROMA,
        Step::RefinedOpposite => REFINED_OPPOSITE,
    }
}

/// Pixels of a frame without its border.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub struct Sizes {
    pub height: usize,
    pub width: usize,
}

/// A pixel of a bordered frame.
#[derive(CubeType, Clone, Copy)]
pub struct Place {
    pub frame: usize,
    pub row: usize,
    pub col: usize,
    /// Index in the frame's plane.
    pub i: usize,
    /// Elements of a row, and of a plane.
    pub stride: usize,
    pub plane: usize,
    pub rows: usize,
    /// Whether the pixel is in a row, and in a column, with red.
    pub in_red_row: bool,
    pub in_red_col: bool,
}

#[cube]
pub fn place(at: usize, words: &[u32], sizes: &Sizes) -> Place {
    let stride = sizes.width + 2 * BORDER;
    let rows = sizes.height + 2 * BORDER;
    let plane = rows * stride;
    let frame = at / plane;
    let i = at % plane;
    let row = i / stride;
    let col = i % stride;
    // The border is even: it does not change the phase.
    let in_red_row = row % 2 == words[2 * frame] as usize;
    let in_red_col = col % 2 == words[2 * frame + 1] as usize;
    Place { frame, row, col, i, stride, plane, rows, in_red_row, in_red_col }
}

/// Whether a pixel is at least `margin` from the edge of its bordered frame.
#[cube]
pub fn is_within(place: &Place, row: usize, col: usize, margin: usize) -> bool {
    row >= margin && row < place.rows - margin && col >= margin && col < place.stride - margin
}

/// The pixel at which position `at` of a bordered line lands when the outermost pixels are mirrors.
#[cube]
pub fn mirrored(at: usize, len: usize) -> usize {
    let period = 2 * (len - 1);
    // Whole periods keep the number positive.
    let in_period = (at + BORDER * period - BORDER) % period;
    min(in_period, period - in_period)
}

/// The colour that a pixel measured: 0, 1, 2.
#[cube]
pub fn colour(in_red_row: bool, in_red_col: bool) -> usize {
    let mut colour = 1usize;
    if in_red_row && in_red_col {
        colour = 0usize;
    }
    if !in_red_row && !in_red_col {
        colour = 2usize;
    }
    colour
}
