//! The colour filter array: which colour each pixel sees.

use serde::{Deserialize, Serialize};

/// Arrangement of the 2x2 Bayer tile, read row by row from the sensor's pixel (0, 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum CfaPattern {
    /// Red, green / green, blue.
    Rggb,
    /// Green, red / blue, green.
    Grbg,
    /// Green, blue / red, green.
    Gbrg,
    /// Blue, green / green, red.
    Bggr,
}

impl CfaPattern {
    /// Colour of the sensor pixel `(row, col)`: 0 red, 1 green, 2 blue.
    pub fn channel(self, row: usize, col: usize) -> usize {
        let (red_row, red_col) = match self {
            Self::Rggb => (0, 0),
            Self::Grbg => (0, 1),
            Self::Gbrg => (1, 0),
            Self::Bggr => (1, 1),
        };
        // Red sits on one parity of rows and columns, blue on the opposite of both.
        ((row + red_row) % 2) + ((col + red_col) % 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_read_as_their_names() {
        for (pattern, name) in [
            (CfaPattern::Rggb, "RGGB"),
            (CfaPattern::Grbg, "GRBG"),
            (CfaPattern::Gbrg, "GBRG"),
            (CfaPattern::Bggr, "BGGR"),
        ] {
            let read: String = (0..4).map(|i| ['R', 'G', 'B'][pattern.channel(i / 2, i % 2)]).collect();
            assert_eq!(read, name);
            assert_eq!(pattern.channel(0, 0), pattern.channel(6, 4));
        }
    }
}
