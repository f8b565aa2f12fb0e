//! The colour filter array: the colour that each pixel measures.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The light that a pixel's filter passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Colour {
    /// Red light.
    Red,
    /// Green light.
    Green,
    /// Blue light.
    Blue,
    /// No colour filter: a monochrome or "white" pixel.
    Clear,
}

impl Colour {
    /// All colours, in the order red, green, blue, clear.
    pub const ALL: [Self; 4] = [Self::Red, Self::Green, Self::Blue, Self::Clear];

    /// Plane of an RGB picture that holds this colour; `None` for clear pixels, which measure all three together.
    pub fn plane(self) -> Option<usize> {
        match self {
            Self::Red => Some(0),
            Self::Green => Some(1),
            Self::Blue => Some(2),
            Self::Clear => None,
        }
    }

    /// Its name in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Clear => "clear",
        }
    }

    /// Letter in the name of a pattern; `W` is clear.
    pub fn letter(self) -> char {
        match self {
            Self::Red => 'R',
            Self::Green => 'G',
            Self::Blue => 'B',
            Self::Clear => 'W',
        }
    }

    fn from_letter(letter: char) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.letter() == letter.to_ascii_uppercase())
    }
}

/// Longest side of a tile, pixels; X-Trans mosaics have 6, quad Bayer mosaics 4.
const MAX_SIDE: usize = 8;

/// Colour filter array: a tile of colours that repeats over the sensor from its pixel (0, 0).
///
/// Its text form lists the rows from top to bottom, in letters `R`, `G`, `B`, `W` (clear), with `/` between rows: `RG/GB`,
/// `RRGG/RRGG/GGBB/GGBB` (quad Bayer), `WR/GW`. Four letters without `/` are a 2x2 tile (`RGGB`); `mono` means `W`. A tile
/// has at most 8x8 pixels.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[schemars(with = "String")]
#[serde(try_from = "String", into = "String")]
pub struct CfaPattern {
    rows: usize,
    cols: usize,
    /// Row by row. Entries beyond `rows * cols` are clear, so that equal patterns compare equal.
    tile: [Colour; MAX_SIDE * MAX_SIDE],
}

/// A text that does not describe a colour filter array.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnknownPattern {
    /// No rows of colours.
    #[error(
        "`{0}` is not a colour filter array; give its rows from the top, as RGGB, GRBG, RG/GB, RRGG/RRGG/GGBB/GGBB, or mono \
         (letters R, G, B, W for clear; up to 8x8)"
    )]
    NoRows(String),
    /// The colours of a Bayer array in an order that is no Bayer array.
    #[error(
        "`{name}` is no Bayer array: its greens would share a column. LibRaw lists colours as RGBG (cdesc), and its raw_pattern says \
         where they are: give RGGB, GRBG, GBRG or BGGR, from the first pixel; rows with / between them, as RG/BG, are taken as they are"
    )]
    NoBayer {
        /// The letters.
        name: String,
    },
}

impl CfaPattern {
    /// Red, green / green, blue.
    pub const RGGB: Self = Self::bayer([Colour::Red, Colour::Green, Colour::Green, Colour::Blue]);
    /// Green, red / blue, green.
    pub const GRBG: Self = Self::bayer([Colour::Green, Colour::Red, Colour::Blue, Colour::Green]);
    /// Green, blue / red, green.
    pub const GBRG: Self = Self::bayer([Colour::Green, Colour::Blue, Colour::Red, Colour::Green]);
    /// Blue, green / green, red.
    pub const BGGR: Self = Self::bayer([Colour::Blue, Colour::Green, Colour::Green, Colour::Red]);
    /// No filters.
    pub const MONO: Self = Self { rows: 1, cols: 1, tile: [Colour::Clear; MAX_SIDE * MAX_SIDE] };

    const fn bayer(colours: [Colour; 4]) -> Self {
        let mut tile = [Colour::Clear; MAX_SIDE * MAX_SIDE];
        let mut i = 0;
        while i < 4 {
            tile[i] = colours[i];
            i += 1;
        }
        Self { rows: 2, cols: 2, tile }
    }

    /// Rows of the tile.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of the tile.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Colour of the sensor pixel `(row, col)`.
    pub fn colour(&self, row: usize, col: usize) -> Colour {
        self.tile[row % self.rows * self.cols + col % self.cols]
    }

    /// The array of a frame whose first pixel is the sensor's `(row, col)`.
    pub fn starting_at(&self, row: usize, col: usize) -> Self {
        let mut tile = [Colour::Clear; MAX_SIDE * MAX_SIDE];
        for (i, colour) in tile.iter_mut().take(self.rows * self.cols).enumerate() {
            *colour = self.colour(row % self.rows + i / self.cols, col % self.cols + i % self.cols);
        }
        Self { tile, ..*self }
    }

    /// True for the four arrangements of the 2x2 Bayer tile.
    pub fn is_bayer(&self) -> bool {
        [Self::RGGB, Self::GRBG, Self::GBRG, Self::BGGR].contains(self)
    }

    /// Whether a row of a Bayer array begins with green, and whether its other colour is red.
    #[inline(always)]
    pub fn row_kind(&self, row: usize) -> (bool, bool) {
        let green_first = self.colour(row, 0) == Colour::Green;
        (green_first, self.colour(row, usize::from(green_first)) == Colour::Red)
    }

    /// The colours that occur, in the order red, green, blue, clear.
    pub fn colours(&self) -> Vec<Colour> {
        let tile = &self.tile[..self.rows * self.cols];
        Colour::ALL.into_iter().filter(|c| tile.contains(c)).collect()
    }
}

impl FromStr for CfaPattern {
    type Err = UnknownPattern;

    fn from_str(text: &str) -> Result<Self, UnknownPattern> {
        let unknown = || UnknownPattern::NoRows(text.chars().take(80).collect());
        let name = text.trim();
        if name.eq_ignore_ascii_case("mono") {
            return Ok(Self::MONO);
        }
        let rows: Vec<String> = match name.contains('/') {
            true => name.split('/').map(str::to_owned).collect(),
            // Of four letters without rows, RGBG is how LibRaw lists the colours of any Bayer array.
            false if is_list_of_colours(name) => {
                return Err(UnknownPattern::NoBayer { name: name.to_owned() });
            }
            false if name.chars().count() == 4 => {
                let letters: Vec<char> = name.chars().collect();
                letters.chunks(2).map(|row| row.iter().collect()).collect()
            }
            false => vec![name.to_owned()],
        };
        let cols = rows[0].chars().count();
        if rows.len() > MAX_SIDE || !(1..=MAX_SIDE).contains(&cols) {
            return Err(unknown());
        }
        let mut tile = [Colour::Clear; MAX_SIDE * MAX_SIDE];
        for (r, row) in rows.iter().enumerate() {
            if row.chars().count() != cols {
                return Err(unknown());
            }
            for (c, letter) in row.chars().enumerate() {
                tile[r * cols + c] = Colour::from_letter(letter).ok_or_else(unknown)?;
            }
        }
        Ok(Self { rows: rows.len(), cols, tile })
    }
}

/// Whether four letters are those of a Bayer array with the greens in one column: as a list of colours, not of places.
fn is_list_of_colours(name: &str) -> bool {
    matches!(name.to_ascii_uppercase().as_str(), "RGBG" | "BGRG" | "GRGB" | "GBGR")
}

impl TryFrom<String> for CfaPattern {
    type Error = UnknownPattern;

    fn try_from(text: String) -> Result<Self, UnknownPattern> {
        text.parse()
    }
}

impl From<CfaPattern> for String {
    fn from(pattern: CfaPattern) -> Self {
        pattern.to_string()
    }
}

impl fmt::Display for CfaPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::MONO {
            return f.write_str("mono");
        }
        for row in 0..self.rows {
            if row > 0 && !self.is_bayer() {
                f.write_str("/")?;
            }
            for col in 0..self.cols {
                write!(f, "{}", self.colour(row, col).letter())?;
            }
        }
        Ok(())
    }
}

impl fmt::Debug for CfaPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CfaPattern({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letters_of_a_bayer_name_are_the_colours_of_the_tile() {
        for (pattern, name) in [
            (CfaPattern::RGGB, "RGGB"),
            (CfaPattern::GRBG, "GRBG"),
            (CfaPattern::GBRG, "GBRG"),
            (CfaPattern::BGGR, "BGGR"),
        ] {
            let read: String = (0..4).map(|i| pattern.colour(i / 2, i % 2).letter()).collect();
            assert_eq!(read, name);
            assert_eq!(pattern.colour(0, 0), pattern.colour(6, 4));
            assert_eq!((name.parse(), pattern.to_string()), (Ok(pattern), name.to_owned()));
        }
        assert_eq!("RG/GB".parse(), Ok(CfaPattern::RGGB));
        // LibRaw's list of colours is no arrangement; rows are taken as they are.
        for list in ["RGBG", "gbgr", " GRGB "] {
            let error = list.parse::<CfaPattern>().unwrap_err().to_string();
            assert!(error.contains("no Bayer array") && error.contains("raw_pattern"), "{error}");
        }
        assert!(!"RG/BG".parse::<CfaPattern>().unwrap().is_bayer());
        assert_eq!("w".parse(), Ok(CfaPattern::MONO));
    }

    #[test]
    fn a_moved_frame_starts_the_array_at_its_first_pixel() {
        assert_eq!(CfaPattern::RGGB.starting_at(1, 0), CfaPattern::GBRG);
        assert_eq!(CfaPattern::RGGB.starting_at(860, 1381), CfaPattern::GRBG);
        let x_trans: CfaPattern = "GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG".parse().unwrap();
        let moved = x_trans.starting_at(8, 3);
        for (row, col) in [(0, 0), (1, 4), (5, 5), (7, 11)] {
            assert_eq!(moved.colour(row, col), x_trans.colour(8 + row, 3 + col));
        }
    }

    #[test]
    fn any_tile_parses_from_its_name_and_prints_it() {
        for name in
            ["RRGG/RRGG/GGBB/GGBB", "GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG", "WR/GW", "RGB", "mono"]
        {
            let pattern: CfaPattern = name.parse().unwrap();
            assert_eq!(pattern.to_string(), name);
            assert!(!pattern.is_bayer());
        }
        for wrong in ["", "RG/G", "RGXB", "/", "RGGBRGGBR", "R/G/B/R/G/B/R/G/B"] {
            assert!(wrong.parse::<CfaPattern>().is_err(), "{wrong}");
        }
    }
}
