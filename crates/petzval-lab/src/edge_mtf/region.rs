//! A region of a frame, as a user names it.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A rectangle of a frame's pixels. As text: `ROW,COL,HEIGHT,WIDTH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// First row, from 0.
    pub row: usize,
    /// First column, from 0.
    pub col: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

impl Region {
    /// Whether a frame has all of its pixels.
    pub fn is_inside(&self, height: usize, width: usize) -> bool {
        let ends =
            |start: usize, size: usize, whole: usize| start.checked_add(size).is_some_and(|end| end <= whole);
        ends(self.row, self.height, height) && ends(self.col, self.width, width)
    }

    /// Whether two regions share pixels.
    pub fn overlaps(&self, other: &Self) -> bool {
        let meet = |a: usize, b: usize, c: usize, d: usize| a < c + d && c < a + b;
        meet(self.row, self.height, other.row, other.height)
            && meet(self.col, self.width, other.col, other.width)
    }
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},{}", self.row, self.col, self.height, self.width)
    }
}

impl FromStr for Region {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<usize>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        match numbers.as_deref() {
            Ok([row, col, height, width]) => {
                Ok(Self { row: *row, col: *col, height: *height, width: *width })
            }
            _ => Err("give four whole numbers: ROW,COL,HEIGHT,WIDTH".to_owned()),
        }
    }
}
