//! The bounds of an object in a picture.

use serde::{Deserialize, Serialize};

/// An axis-parallel rectangle in pixels. Place (0, 0) is the upper left corner of the picture, so that the first pixel covers 0..1.
/// Files hold it as `[x, y, width, height]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 4]", into = "[f64; 4]")]
pub struct Bounds {
    /// Left edge, px.
    pub x: f64,
    /// Upper edge, px.
    pub y: f64,
    /// Width, px.
    pub width: f64,
    /// Height, px.
    pub height: f64,
}

impl Bounds {
    /// The rectangle between two corners.
    pub fn between(left: f64, top: f64, right: f64, bottom: f64) -> Self {
        Self { x: left, y: top, width: right - left, height: bottom - top }
    }

    /// The smallest rectangle that holds these points, `[x, y]`; `None` without a point.
    pub fn around(points: impl IntoIterator<Item = [f64; 2]>) -> Option<Self> {
        let all = points.into_iter().map(|[x, y]| [x, y, x, y]);
        let corners = all.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]);
        corners.map(|[left, top, right, bottom]| Self::between(left, top, right, bottom))
    }

    /// The smallest upright rectangle around this one, rotated about its middle. The sense of the rotation makes no difference.
    pub fn around_rotated(&self, radians: f64) -> Self {
        let (sine, cosine) = radians.sin_cos();
        let (sine, cosine) = (sine.abs(), cosine.abs());
        let width = self.width * cosine + self.height * sine;
        let height = self.width * sine + self.height * cosine;
        let (x, y) = (self.x + 0.5 * (self.width - width), self.y + 0.5 * (self.height - height));
        Self { x, y, width, height }
    }

    /// Area, px^2.
    pub fn area(&self) -> f64 {
        self.width * self.height
    }

    /// Whether it is narrower or lower than a pixel.
    pub fn is_thin(&self) -> bool {
        self.width.min(self.height) < 1.0
    }

    /// The part inside a picture; `None` if none is.
    pub fn clipped(&self, width: f64, height: f64) -> Option<Self> {
        let (left, right) = (self.x.max(0.0), (self.x + self.width).min(width));
        let (top, bottom) = (self.y.max(0.0), (self.y + self.height).min(height));
        // A rectangle that is inside keeps its numbers to the last bit.
        let inside = Self {
            x: left,
            y: top,
            width: if left == self.x && right < width { self.width } else { right - left },
            height: if top == self.y && bottom < height { self.height } else { bottom - top },
        };
        (inside.width > 0.0 && inside.height > 0.0).then_some(inside)
    }

    /// How far the rectangle reaches out of a picture, px; 0 if it is inside.
    pub fn overhang(&self, width: f64, height: f64) -> f64 {
        let right = self.x + self.width - width;
        let bottom = self.y + self.height - height;
        (-self.x).max(-self.y).max(right).max(bottom).max(0.0)
    }
}

impl From<[f64; 4]> for Bounds {
    fn from([x, y, width, height]: [f64; 4]) -> Self {
        Self { x, y, width, height }
    }
}

impl From<Bounds> for [f64; 4] {
    fn from(b: Bounds) -> Self {
        [b.x, b.y, b.width, b.height]
    }
}

impl std::fmt::Display for Bounds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, width, height] = <[f64; 4]>::from(*self).map(short);
        write!(f, "[{x}, {y}, {width}, {height}]")
    }
}

/// A number for people: with a power of ten where it is very large or very small, which may take hundreds of digits.
pub(super) fn short(value: f64) -> String {
    let is_plain = value == 0.0 || (1e-6..1e9).contains(&value.abs()) || !value.is_finite();
    if is_plain { value.to_string() } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upright_rectangles_hold_points_and_rotated_rectangles() {
        assert_eq!(Bounds::around([]), None);
        let points = [[3.0, 4.0], [1.0, 6.0], [2.0, 9.0]];
        assert_eq!(Bounds::around(points), Some(Bounds::from([1.0, 4.0, 2.0, 5.0])));
        // A square of side 2 that stands on a corner is 2 sqrt(2) wide and high.
        let square = Bounds::from([4.0, 6.0, 2.0, 2.0]).around_rotated(std::f64::consts::FRAC_PI_4);
        let side = 8f64.sqrt();
        for (found, wanted) in
            <[f64; 4]>::from(square).into_iter().zip([5.0 - side / 2.0, 7.0 - side / 2.0, side, side])
        {
            assert!((found - wanted).abs() < 1e-12, "{square}");
        }
        let upright = Bounds::from([4.0, 6.0, 2.0, 4.0]).around_rotated(-std::f64::consts::FRAC_PI_2);
        assert!((upright.width - 4.0).abs() < 1e-12 && (upright.x - 3.0).abs() < 1e-12, "{upright}");
    }

    #[test]
    fn clipping_keeps_what_is_inside() {
        let inside = Bounds::from([0.1, 0.2, 0.3, 0.7]);
        assert_eq!(inside.clipped(10.0, 10.0), Some(inside));
        assert_eq!(inside.overhang(10.0, 10.0), 0.0);
        let over = Bounds::from([-2.0, 8.0, 5.0, 5.0]);
        assert_eq!(over.clipped(10.0, 10.0), Some(Bounds::from([0.0, 8.0, 3.0, 2.0])));
        assert_eq!(over.overhang(10.0, 10.0), 3.0);
        assert_eq!(Bounds::from([10.0, 0.0, 5.0, 5.0]).clipped(10.0, 10.0), None);
    }
}
