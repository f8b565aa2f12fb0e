//! The class of every pixel of a window.

/// A class for each pixel, by its number, or [`IGNORED`](super::IGNORED).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassMap {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// The class of each pixel, row by row.
    pub classes: Vec<u8>,
}

impl ClassMap {
    /// A map of classes, row by row.
    ///
    /// # Panics
    /// Panics if there is not one class for each pixel.
    pub fn new(height: usize, width: usize, classes: Vec<u8>) -> Self {
        assert_eq!(classes.len(), height * width, "a class for each pixel");
        Self { height, width, classes }
    }

    /// The square of `side` pixels whose first row and column are `first`.
    ///
    /// # Panics
    /// Panics if it does not lie in the map.
    pub fn part(&self, first: [usize; 2], side: usize) -> Self {
        let rows = self.classes.chunks_exact(self.width).skip(first[0]).take(side);
        let classes = rows.flat_map(|row| &row[first[1]..first[1] + side]).copied().collect();
        Self::new(side, side, classes)
    }

    /// The map as a mirror shows it.
    pub fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        mirrored.classes.chunks_exact_mut(self.width).for_each(<[u8]>::reverse);
        mirrored
    }
}
