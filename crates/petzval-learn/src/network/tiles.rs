//! Frames in tiles, so that the memory of a network does not grow with the frame.

use std::ops::Range;

use burn::prelude::*;

use super::NetworkInput;

/// How far a network looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reach {
    /// The largest distance, in rows or columns, at which a pixel of the input can change a pixel of the output.
    pub pixels: usize,
    /// Pixels that one pixel of the lowest resolution covers in each direction: tiles begin at multiples of it.
    pub unit: usize,
}

/// What `finish` makes of pictures, in tiles of at most about `side` pixels a side.
///
/// Each tile is finished with its surroundings as far as the network reaches, and cropped, so there are no seams: the result is that of
/// the whole pictures but for the rounding of sums. Pictures of up to `side` a side are finished at once.
pub fn in_tiles(
    input: &NetworkInput,
    side: usize,
    reach: Reach,
    finish: impl Fn(&NetworkInput) -> Tensor<4>,
) -> Tensor<4> {
    let [_, _, height, width] = input.developed.dims();
    joined([height, width], side, reach, |rows, columns| finish(&input.window(rows, columns)))
}

/// [`in_tiles`] of a network that sees pictures alone, `[batch, channels, height, width]`.
pub fn in_tiles_of(
    pictures: Tensor<4>,
    side: usize,
    reach: Reach,
    of_tile: impl Fn(Tensor<4>) -> Tensor<4>,
) -> Tensor<4> {
    let [batch, channels, height, width] = pictures.dims();
    joined([height, width], side, reach, |rows, columns| {
        of_tile(pictures.clone().slice([0..batch, 0..channels, rows.clone(), columns.clone()]))
    })
}

/// Makes the tiles of a frame of so many rows and columns, crops them and puts them together.
fn joined(
    [height, width]: [usize; 2],
    side: usize,
    reach: Reach,
    of_tile: impl Fn(&Range<usize>, &Range<usize>) -> Tensor<4>,
) -> Tensor<4> {
    let across = spans(width, side, reach);
    let rows = spans(height, side, reach).into_iter().map(|down| {
        let tiles = across.iter().map(|right| {
            let made = of_tile(&down.seen, &right.seen);
            let [batch, channels, ..] = made.dims();
            made.slice([0..batch, 0..channels, down.kept.clone(), right.kept.clone()])
        });
        Tensor::cat(tiles.collect(), 3)
    });
    Tensor::cat(rows.collect(), 2)
}

/// A part of a row or column of pixels.
struct Span {
    /// The pixels that are seen.
    seen: Range<usize>,
    /// Those of them that are kept, counted from the first one seen.
    kept: Range<usize>,
}

/// Cuts a length into equal parts of at most about `side` pixels.
fn spans(length: usize, side: usize, reach: Reach) -> Vec<Span> {
    if length <= side {
        return vec![Span { seen: 0..length, kept: 0..length }];
    }
    let step = length.div_ceil(length.div_ceil(side)).next_multiple_of(reach.unit);
    let overlap = reach.pixels.next_multiple_of(reach.unit);
    (0..length)
        .step_by(step)
        .map(|first| {
            let (last, from) = ((first + step).min(length), first.saturating_sub(overlap));
            Span { seen: from..(last + overlap).min(length), kept: first - from..last - from }
        })
        .collect()
}
