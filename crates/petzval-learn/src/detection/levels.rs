//! Which level of the pyramid a box is looked at on.

use serde::Serialize;

use super::BBox;

/// Levels by size of box (Lin 2017, equation 1): `floor(canonical_level + log2(sqrt(area) / canonical_size + 1e-6))`, kept within the
/// levels that there are. Level `k` is `2^k` times smaller than the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelOfBox {
    /// The finest level.
    pub finest: usize,
    /// The coarsest level.
    pub coarsest: usize,
    /// Side of a box that belongs to the canonical level, pixels.
    pub canonical_size: f32,
    /// That level.
    pub canonical_level: usize,
}

impl LevelOfBox {
    /// The level of a box, counted from the finest.
    pub fn of(&self, bbox: &BBox) -> usize {
        let octaves = (bbox.area().sqrt() / self.canonical_size + 1e-6).log2();
        let level = (self.canonical_level as f32 + octaves).floor();
        level.clamp(self.finest as f32, self.coarsest as f32) as usize - self.finest
    }
}
