//! The pixels about an edge, turned so that the edge stands and its bright side is on the right.

use petzval_camera::render::Window;

use super::dead_lines::dead_lines;
use super::error::SfrError;
use super::limits::LEAST_SIDE;
use super::plane::Plane;

/// A window of a plane as it lies in the picture.
pub struct Pixels {
    pub height: usize,
    pub width: usize,
    pub values: Vec<f64>,
    /// Whether a pixel lies on a dead row or column.
    pub is_dead: Vec<bool>,
}

impl Pixels {
    /// The pixels of a window; an error if it leaves the plane, is too small, or holds values that are no numbers.
    pub fn of(plane: &Plane, window: &Window) -> Result<Self, SfrError> {
        let (top, left) = (window.placement.row, window.placement.col);
        let (height, width) = (window.height, window.width);
        let is_inside = left.checked_add(width).is_some_and(|right| right <= plane.width)
            && top
                .checked_add(height)
                .and_then(|bottom| bottom.checked_mul(plane.width))
                .is_some_and(|end| end <= plane.values.len());
        if !is_inside {
            return Err(SfrError::Outside);
        }
        if height.min(width) < LEAST_SIDE {
            return Err(SfrError::Small { along: height.min(width), across: width.min(height) / 2 });
        }
        let rows = (top..top + height).map(|row| &plane.values[row * plane.width + left..][..width]);
        let values: Vec<f64> = rows.flatten().map(|v| f64::from(*v)).collect();
        if values.iter().any(|v| !v.is_finite()) {
            return Err(SfrError::NotFinite);
        }
        let is_dead = dead_lines(&values, height, width);
        Ok(Self { height, width, values, is_dead })
    }
}

/// The same pixels, turned: `x` grows from the dark side to the bright one, `y` along the edge. The middle of the first pixel is at 1/2.
pub struct Region {
    pub height: usize,
    pub width: usize,
    pub values: Vec<f64>,
    /// Whether a pixel lies on a dead row or column.
    pub is_dead: Vec<bool>,
    /// Whether rows are rows of the picture; otherwise they are its columns.
    pub is_upright: bool,
    /// Whether the rows run backwards.
    pub is_mirrored: bool,
}

impl Region {
    /// Turns the pixels.
    pub fn turned(pixels: &Pixels, is_upright: bool, is_mirrored: bool) -> Self {
        let (height, width) =
            if is_upright { (pixels.height, pixels.width) } else { (pixels.width, pixels.height) };
        let source = |i: usize| {
            let (row, col) = (i / width, i % width);
            let col = if is_mirrored { width - 1 - col } else { col };
            let (row, col) = if is_upright { (row, col) } else { (col, row) };
            row * pixels.width + col
        };
        let sources = || (0..height * width).map(source);
        Self {
            height,
            width,
            values: sources().map(|i| pixels.values[i]).collect(),
            is_dead: sources().map(|i| pixels.is_dead[i]).collect(),
            is_upright,
            is_mirrored,
        }
    }

    /// `x` and `y` of the middle of a pixel.
    pub fn middle(&self, i: usize) -> [f64; 2] {
        [(i % self.width) as f64 + 0.5, (i / self.width) as f64 + 0.5]
    }

    /// A place as row and column of the window, in pixels from its upper left corner.
    pub fn in_window(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let x = if self.is_mirrored { self.width as f64 - x } else { x };
        if self.is_upright { [y, x] } else { [x, y] }
    }
}
