//! Boxes of a picture, and how far two of them agree.

use serde::{Deserialize, Serialize};

/// A box along the axes of a picture, pixels; x to the right, y down, the corner of the first pixel at (0, 0). Nothing is added to width
/// and height: a box around one pixel is 1 wide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BBox {
    /// Left side.
    pub x1: f32,
    /// Upper side.
    pub y1: f32,
    /// Right side, at least `x1`.
    pub x2: f32,
    /// Lower side, at least `y1`.
    pub y2: f32,
}

impl BBox {
    /// The box between two corners.
    pub const fn new(x1: f32, y1: f32, x2: f32, y2: f32) -> Self {
        Self { x1, y1, x2, y2 }
    }

    /// Width, pixels.
    pub fn width(&self) -> f32 {
        self.x2 - self.x1
    }

    /// Height, pixels.
    pub fn height(&self) -> f32 {
        self.y2 - self.y1
    }

    /// Area, square pixels.
    pub fn area(&self) -> f32 {
        self.width() * self.height()
    }

    /// Centre, `[x, y]`.
    pub fn centre(&self) -> [f32; 2] {
        [self.x1 + 0.5 * self.width(), self.y1 + 0.5 * self.height()]
    }

    /// Area that lies in both boxes.
    pub fn intersection(&self, other: &Self) -> f32 {
        let width = self.x2.min(other.x2) - self.x1.max(other.x1);
        let height = self.y2.min(other.y2) - self.y1.max(other.y1);
        width.max(0.0) * height.max(0.0)
    }

    /// Intersection over union, 0..1; 0 where both boxes are empty.
    pub fn iou(&self, other: &Self) -> f32 {
        let shared = self.intersection(other);
        let union = self.area() + other.area() - shared;
        if union > 0.0 { shared / union } else { 0.0 }
    }

    /// The part of the box inside a picture of this height and width.
    pub fn clipped(&self, [height, width]: [usize; 2]) -> Self {
        let (height, width) = (height as f32, width as f32);
        let (x1, x2) = (self.x1.clamp(0.0, width), self.x2.clamp(0.0, width));
        Self { x1, y1: self.y1.clamp(0.0, height), x2, y2: self.y2.clamp(0.0, height) }
    }

    /// Whether both sides are at least `side` pixels.
    pub fn is_at_least(&self, side: f32) -> bool {
        self.width() >= side && self.height() >= side
    }

    /// The box moved right and down.
    pub fn moved(&self, [right, down]: [f32; 2]) -> Self {
        Self { x1: self.x1 + right, y1: self.y1 + down, x2: self.x2 + right, y2: self.y2 + down }
    }

    /// The box in a picture whose sides are multiplied by these factors, `[x, y]`.
    pub fn scaled(&self, [x, y]: [f32; 2]) -> Self {
        Self { x1: self.x1 * x, y1: self.y1 * y, x2: self.x2 * x, y2: self.y2 * y }
    }
}
