//! The bounds of a mask in a file of COCO.
//!
//! A mask is `{"size": [rows, columns], "counts": ...}`. It lists runs of pixels, column by column from the upper left corner. The first run is
//! outside the object, the next inside, and so on. `counts` holds their lengths as a list, or as a text of the characters `0` to `o`.
//!
//! <https://github.com/cocodataset/cocoapi/blob/master/common/maskApi.h>

use super::bounds::Bounds;

/// Runs of a mask that are read. A picture of 16 million pixels has at most as many in a mask without two equal neighbours.
pub(super) const MOST_RUNS: usize = 1 << 24;

/// Where a mask has pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mask {
    /// Rows and columns of the picture.
    pub size: [u32; 2],
    /// The smallest box that holds every pixel of the object.
    pub bounds: Bounds,
}

impl Mask {
    /// Of a picture's `size`, rows and columns, and the lengths of the runs. `None` if no run is inside the object, or if the runs do not cover
    /// the picture exactly.
    pub fn of_runs(size: [u32; 2], runs: &[u64]) -> Option<Self> {
        let [rows, columns] = size.map(u64::from);
        let (mut start, mut bounds) = (0u64, None::<[u64; 4]>);
        for (i, length) in runs.iter().enumerate() {
            let end = start.checked_add(*length)?;
            if i % 2 == 1 && *length > 0 && rows > 0 {
                let (left, right) = (start / rows, (end - 1) / rows);
                // A run over the end of a column holds the last row of one and the first row of the next.
                let is_in_one_column = left == right;
                let top = if is_in_one_column { start % rows } else { 0 };
                let bottom = if is_in_one_column { (end - 1) % rows } else { rows - 1 };
                let run = [left, top, right, bottom];
                let around = bounds.unwrap_or(run);
                bounds = Some([
                    around[0].min(run[0]),
                    around[1].min(run[1]),
                    around[2].max(run[2]),
                    around[3].max(run[3]),
                ]);
            }
            start = end;
        }
        let [left, top, right, bottom] = bounds?.map(|pixel| pixel as f64);
        let is_whole = start == rows * columns;
        // Pixel 0 covers 0 to 1.
        is_whole.then(|| Self { size, bounds: Bounds::between(left, top, right + 1.0, bottom + 1.0) })
    }
}

/// The lengths of the runs of a text. From the fourth on, each is written as its difference from the one two before. `None` if the text holds
/// another character, ends within a number, or gives a negative length.
///
/// A number is written in groups of five bits, the lowest first. A character is its group, plus 32 where another follows, plus 48. Bit 16 of
/// the last group is the sign.
pub(super) fn runs_of_text(text: &str) -> Option<Vec<u64>> {
    let mut runs: Vec<u64> = Vec::new();
    let (mut value, mut bits) = (0i64, 0u32);
    for character in text.bytes() {
        let code = character.checked_sub(48).filter(|code| *code < 64)?;
        // Seven groups hold more than any picture has pixels.
        if bits > 30 || runs.len() >= MOST_RUNS {
            return None;
        }
        value |= i64::from(code & 31) << bits;
        bits += 5;
        if code & 32 != 0 {
            continue;
        }
        if code & 16 != 0 {
            value -= 1 << bits;
        }
        let two_before = if runs.len() > 2 { runs[runs.len() - 2] } else { 0 };
        runs.push(two_before.checked_add_signed(value)?);
        (value, bits) = (0, 0);
    }
    (bits == 0).then_some(runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_has_the_box_around_its_pixels() {
        // A picture of 4 rows and 5 columns; the object is in columns 1 and 2, rows 1 and 2.
        let of = |size, runs: &[u64]| Mask::of_runs(size, runs).map(|mask| <[f64; 4]>::from(mask.bounds));
        assert_eq!(of([4, 5], &[5, 2, 2, 2, 9]), Some([1.0, 1.0, 2.0, 2.0]));
        // From row 3 of column 0 to row 0 of column 1: every row, as far as a box knows.
        assert_eq!(of([4, 5], &[3, 2, 15]), Some([0.0, 0.0, 2.0, 4.0]));
        assert_eq!(of([4, 5], &[0, 20]), Some([0.0, 0.0, 5.0, 4.0]));
        for (size, runs) in [
            ([4, 5], &[5, 2, 2, 2, 8][..]),
            ([4, 5], &[20]),
            ([4, 5], &[]),
            ([4, 5], &[7, 0, 13]),
            ([0, 5], &[0, 3]),
        ] {
            assert_eq!(of(size, runs), None, "{size:?} {runs:?}");
        }
        assert_eq!(of([1, 1], &[u64::MAX, 2]), None);
    }

    #[test]
    fn texts_hold_the_lengths_of_runs() {
        // What `mask.encode` and `mask.toBbox` of pycocotools 2.0.11 give: a square, three pieces, and an ellipse.
        assert_eq!(runs_of_text("52207").unwrap(), [5, 2, 2, 2, 9]);
        assert_eq!(runs_of_text("o24g?f0]@0i`0WO").unwrap(), [95, 4, 503, 26, 4, 26, 541, 1]);
        let ellipse = "ifm0o0W8<E:H6I8J4K6K4L4L4L4M2M4M2N2M4M2O0O2N2N2O0O2O0O2O00000000000000000001N101N101N2N2N101N3L3N2N3L3N\
                       3L4L4L4L5J5L6H7J8F;DYVV2";
        for (size, text, wanted) in [
            ([4, 5], "52207", [1.0, 1.0, 2.0, 2.0]),
            ([30, 40], "o24g?f0]@0i`0WO", [3.0, 2.0, 37.0, 28.0]),
            ([300, 400], ellipse, [101.0, 81.0, 59.0, 119.0]),
        ] {
            let mask = Mask::of_runs(size, &runs_of_text(text).unwrap()).unwrap();
            assert_eq!(<[f64; 4]>::from(mask.bounds), wanted);
        }
        for bad in ["5 2", "P", "5\u{e9}", "ooooooooo0", "O"] {
            assert_eq!(runs_of_text(bad), None, "{bad}");
        }
    }
}
