//! Sensor coordinates, the grid of patches over them, and the blending weights between patches.

use super::error::{OffSensor, RenderError};
use super::limits::{MAX_PATCHES, MAX_SIDE};
use crate::image::{CHANNELS, LinearImage};

/// Size of the sensor, and the number of patches. Each patch has one kernel.
///
/// Pixel `(r, c)` has its centre at `x = (c - (W-1)/2) pixel_um`, `y = (r - (H-1)/2) pixel_um`: the optical axis meets the
/// middle of the sensor. The default is the paper's camera: 1200x1920 pixels of 5.86 um, 7x7 patches.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderGeometry {
    /// Sensor rows.
    pub sensor_height: usize,
    /// Sensor columns.
    pub sensor_width: usize,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// Patch rows and columns.
    pub patches: (usize, usize),
}

impl Default for RenderGeometry {
    fn default() -> Self {
        Self { sensor_height: 1200, sensor_width: 1920, pixel_um: 5.86, patches: (7, 7) }
    }
}

/// Sensor position of a picture's top-left pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Placement {
    /// Sensor row.
    pub row: usize,
    /// Sensor column.
    pub col: usize,
}

/// A rectangle of sensor pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Its top-left pixel.
    pub placement: Placement,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

impl Window {
    /// Whether it lies on a sensor of these rows and columns.
    pub fn lies_on(&self, (rows, cols): (usize, usize)) -> bool {
        let fits =
            |start: usize, len: usize, size: usize| start.checked_add(len).is_some_and(|end| end <= size);
        fits(self.placement.row, self.height, rows) && fits(self.placement.col, self.width, cols)
    }

    /// The window, unless it leaves a sensor of these rows and columns; `what` it shows is for the error.
    pub(crate) fn checked(self, sensor: (usize, usize), what: &'static str) -> Result<Self, OffSensor> {
        let (size, at) = ([self.height, self.width], [self.placement.row, self.placement.col]);
        if self.lies_on(sensor) { Ok(self) } else { Err(OffSensor { what, size, at, sensor }) }
    }

    /// The window of `height` x `width` pixels in the middle of a sensor. It is moved up and left by less than one tile of
    /// `(rows, columns)` pixels, so that it starts with a whole tile of the colour filter array. `None` if the sensor is smaller.
    pub fn middle(
        (sensor_height, sensor_width): (usize, usize),
        tile: (usize, usize),
        height: usize,
        width: usize,
    ) -> Option<Self> {
        let start = |whole: usize, part: usize, tile: usize| Some(whole.checked_sub(part)? / 2 / tile * tile);
        let (row, col) = (start(sensor_height, height, tile.0)?, start(sensor_width, width, tile.1)?);
        Some(Self { placement: Placement { row, col }, height, width })
    }

    /// The same part of the sensor where `samples` x `samples` pixels stand in place of each.
    pub fn finer(&self, samples: usize) -> Self {
        let Placement { row, col } = self.placement;
        Self {
            placement: Placement { row: row * samples, col: col * samples },
            height: self.height * samples,
            width: self.width * samples,
        }
    }

    /// Cuts the scene that [`render`](super::render) needs for this window out of a picture of the whole sensor: the window and
    /// `border` pixels around it. Outside the sensor the picture's edge is repeated.
    pub fn scene(&self, sensor_picture: &LinearImage, border: usize) -> LinearImage {
        let start = |at: usize| at as isize - border as isize;
        let (height, width) = (self.height + 2 * border, self.width + 2 * border);
        sensor_picture.window_replicate(start(self.placement.row), start(self.placement.col), height, width)
    }
}

impl RenderGeometry {
    /// Checks that sizes, pitch and patch counts are positive, with at most [`MAX_SIDE`] pixels and [`MAX_PATCHES`]
    /// patches along an axis.
    pub fn validate(&self) -> Result<(), RenderError> {
        let (patch_rows, patch_cols) = self.patches;
        let in_range = |n: usize, most: usize| (1..=most).contains(&n);
        let sizes = in_range(self.sensor_height, MAX_SIDE) && in_range(self.sensor_width, MAX_SIDE);
        let patches = in_range(patch_rows, MAX_PATCHES) && in_range(patch_cols, MAX_PATCHES);
        if !sizes || !patches || !self.pixel_um.is_finite() || self.pixel_um <= 0.0 {
            let (height, width, pixel_um) = (self.sensor_height, self.sensor_width, self.pixel_um);
            return Err(RenderError::Geometry { height, width, pixel_um, patch_rows, patch_cols });
        }
        Ok(())
    }

    /// Number of patches.
    pub fn patch_count(&self) -> usize {
        self.patches.0 * self.patches.1
    }

    /// Distance of pixel `(row, col)` from the optical axis, mm.
    pub fn radius_mm(&self, row: usize, col: usize) -> f64 {
        let (x, y) = self.position_um(row as f64, col as f64);
        // Sensors are far too small for a square to overflow.
        (x * x + y * y).sqrt() * 1e-3
    }

    /// Centre `(x, y)` of a patch in sensor coordinates, um. Patches are numbered row by row.
    pub fn patch_centre_um(&self, patch: usize) -> (f64, f64) {
        let (rows, cols) = self.patches;
        let row = patch_centre(self.sensor_height, rows, patch / cols);
        let col = patch_centre(self.sensor_width, cols, patch % cols);
        self.position_um(row, col)
    }

    /// The same sensor and patches with `samples` x `samples` pixels in place of each.
    pub fn finer(&self, samples: usize) -> Self {
        Self {
            sensor_height: self.sensor_height.saturating_mul(samples),
            sensor_width: self.sensor_width.saturating_mul(samples),
            pixel_um: self.pixel_um / samples as f64,
            patches: self.patches,
        }
    }

    /// The patches that have a weight somewhere in a window, ascending.
    pub fn patches_in(&self, window: &Window) -> Vec<usize> {
        let active = self.active_patches(window);
        (0..active.len()).filter(|patch| active[*patch]).collect()
    }

    /// Marks the patches that have a weight somewhere in a window.
    pub(super) fn active_patches(&self, window: &Window) -> Vec<bool> {
        let (rows, cols) = (self.row_tiles(window), self.col_tiles(window));
        let mut active = vec![false; self.patch_count()];
        for row in &rows {
            for col in &cols {
                for patch in tile_patches(row, col, self.patches.1) {
                    active[patch] = true;
                }
            }
        }
        active
    }

    pub(super) fn row_tiles(&self, window: &Window) -> Vec<AxisTile> {
        axis_tiles(self.sensor_height, self.patches.0, window.placement.row, window.height)
    }

    pub(super) fn col_tiles(&self, window: &Window) -> Vec<AxisTile> {
        axis_tiles(self.sensor_width, self.patches.1, window.placement.col, window.width)
    }

    /// Position `(x, y)` of a row and a column, um from the optical axis.
    pub fn position_um(&self, row: f64, col: f64) -> (f64, f64) {
        let x = (col - 0.5 * (self.sensor_width as f64 - 1.0)) * self.pixel_um;
        let y = (row - 0.5 * (self.sensor_height as f64 - 1.0)) * self.pixel_um;
        (x, y)
    }
}

/// The output window of a scene with a border of `radius` pixels, checked against the sensor.
pub(super) fn output_window(
    geometry: &RenderGeometry,
    scene: &LinearImage,
    radius: usize,
    placement: Placement,
) -> Result<Window, RenderError> {
    geometry.validate()?;
    if scene.channels != CHANNELS || scene.data.len() != CHANNELS * scene.height * scene.width {
        return Err(RenderError::Channels { what: "scene", channels: scene.channels });
    }
    if scene.height <= 2 * radius || scene.width <= 2 * radius {
        return Err(RenderError::SceneTooSmall { height: scene.height, width: scene.width, border: radius });
    }
    check_window(geometry, placement, scene.height - 2 * radius, scene.width - 2 * radius)
}

/// A window of the sensor, or an error if it extends beyond the sensor.
pub(super) fn check_window(
    geometry: &RenderGeometry,
    placement: Placement,
    height: usize,
    width: usize,
) -> Result<Window, RenderError> {
    geometry.validate()?;
    let sensor = (geometry.sensor_height, geometry.sensor_width);
    Ok(Window { placement, height, width }.checked(sensor, "output")?)
}

/// Pixel coordinate of the centre of patch `i` of `patches` along an axis of `len` pixels.
fn patch_centre(len: usize, patches: usize, i: usize) -> f64 {
    (i as f64 + 0.5) * len as f64 / patches as f64 - 0.5
}

/// Hat weight along one axis: the lower of the two patches around pixel `k`, and the weight of the upper patch. Outside the
/// outer patch centres the weight is constant.
pub(crate) fn hat(len: usize, patches: usize, k: usize) -> (usize, f32) {
    let spacing = len as f64 / patches as f64;
    let position = ((k as f64 - patch_centre(len, patches, 0)) / spacing).clamp(0.0, (patches - 1) as f64);
    let lo = (position as usize).min(patches.saturating_sub(2));
    (lo, (position - lo as f64) as f32)
}

impl RenderGeometry {
    /// The patches that a pixel of the sensor blends, at most four, and their weights, which are positive and sum to 1.
    pub(super) fn patches_at(&self, row: usize, col: usize) -> impl Iterator<Item = (usize, f32)> {
        let (rows, cols) = self.patches;
        let along = |len: usize, patches: usize, k: usize| {
            let (lo, upper) = hat(len, patches, k);
            [(lo, 1.0 - upper), (lo + 1, upper)]
        };
        let by_col = along(self.sensor_width, cols, col);
        let by_row = along(self.sensor_height, rows, row).into_iter();
        by_row
            .flat_map(move |(i, wr)| by_col.map(|(j, wc)| (i * cols + j, wr * wc)))
            .filter(|(_, weight)| *weight > 0.0)
    }
}

/// A run of pixels along one axis that blends the same one or two patches.
#[derive(Debug, Clone)]
pub(super) struct AxisTile {
    /// First pixel, counted from the window.
    pub start: usize,
    /// Number of pixels.
    pub len: usize,
    /// The patches, by index along the axis, each with its weight per pixel.
    pub weights: Vec<(usize, Vec<f32>)>,
}

/// Longest run, pixels. It bounds the FFT size when patches are large.
const MAX_TILE: usize = 320;

/// Cuts the window at the patch centres, so that a tile blends at most two patches per axis.
fn axis_tiles(len: usize, patches: usize, origin: usize, count: usize) -> Vec<AxisTile> {
    // Segment s lies between the centres of patches s-1 and s. Outside the outer centres only one patch has weight.
    let spacing = len as f64 / patches as f64;
    let segment = |k: usize| {
        let position = ((origin + k) as f64 - patch_centre(len, patches, 0)) / spacing;
        if position <= 0.0 { 0 } else { (position as usize + 1).min(patches) }
    };
    let mut tiles = Vec::new();
    let mut start = 0;
    while start < count {
        // Find the run of pixels in one segment, and split it into pieces of at most MAX_TILE.
        let s = segment(start);
        let end = (start..count).find(|&k| segment(k) != s).unwrap_or(count);
        let pieces = (end - start).div_ceil(MAX_TILE);
        for piece in 0..pieces {
            let (from, to) =
                (start + (end - start) * piece / pieces, start + (end - start) * (piece + 1) / pieces);
            let upper: Vec<f32> = (from..to).map(|k| hat(len, patches, origin + k).1).collect();
            let weights = if s == 0 || s == patches {
                vec![(s.saturating_sub(1).min(patches - 1), vec![1.0; to - from])]
            } else {
                vec![(s - 1, upper.iter().map(|w| 1.0 - w).collect()), (s, upper)]
            };
            tiles.push(AxisTile { start: from, len: to - from, weights });
        }
        start = end;
    }
    tiles
}

/// The patches that a tile blends.
pub(super) fn tile_patches(row: &AxisTile, col: &AxisTile, patch_cols: usize) -> Vec<usize> {
    let rows = row.weights.iter().map(|w| w.0);
    rows.flat_map(|i| col.weights.iter().map(move |(j, _)| i * patch_cols + j)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hat_weights_are_linear_between_centres_and_constant_outside() {
        // 40 pixels, 4 patches: centres at 4.5, 14.5, 24.5, 34.5.
        assert_eq!(hat(40, 4, 0), (0, 0.0));
        assert_eq!(hat(40, 4, 39), (2, 1.0));
        assert_eq!(hat(40, 4, 5), (0, 0.05));
        assert_eq!(hat(40, 4, 16).0, 1);
        assert_eq!(hat(40, 1, 12), (0, 0.0));
    }

    #[test]
    fn tiles_cover_the_window_once_and_their_weights_agree_with_the_hat() {
        for (len, patches, origin, count) in
            [(1200, 7, 0, 1200), (1920, 7, 333, 256), (50, 1, 3, 40), (40, 40, 0, 40)]
        {
            let mut next = 0;
            for tile in axis_tiles(len, patches, origin, count) {
                assert_eq!(tile.start, next);
                next += tile.len;
                for k in 0..tile.len {
                    let (lo, w_hi) = hat(len, patches, origin + tile.start + k);
                    for (patch, weights) in &tile.weights {
                        let expected = if *patch == lo {
                            1.0 - w_hi
                        } else if *patch == lo + 1 {
                            w_hi
                        } else {
                            0.0
                        };
                        assert!((weights[k] - expected).abs() < 1e-6, "{len} {patches} {k}");
                    }
                }
            }
            assert_eq!(next, count);
        }
    }

    #[test]
    fn the_middle_patch_is_centred_on_the_axis() {
        let (x, y) = RenderGeometry::default().patch_centre_um(24);
        assert!(x.abs() < 1e-9 && y.abs() < 1e-9);
    }
}
