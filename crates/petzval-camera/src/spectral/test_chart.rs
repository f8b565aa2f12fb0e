//! A chart for the picture that a camera makes: the 24 patches of a ColorChecker, and slanted edges of three contrasts over the field.
//!
//! The frame is divided into 5 x 7 cells. Eleven of them hold an edge target: a dark square on a light one, inclined by 5 degrees. Its
//! sides are measured as ISO 12233 measures slanted edges. The other cells hold the patches, row by row, on mid gray.

use rayon::prelude::*;

use super::colour_checker::{ChartData, colour_checker};
use super::reflectance_scene::{ReflectanceScene, SUPERSAMPLING};
use crate::render::{Placement, Window};

/// Cells of the chart.
const ROWS: usize = 5;
const COLUMNS: usize = 7;

/// Inclination of the squares, degrees.
const EDGE_DEG: f64 = 5.0;

/// Sides as shares of the shorter side of a cell: a patch, the light and the dark square of an edge target.
const PATCH: f64 = 0.7;
const SURROUND: f64 = 0.94;
const SQUARE: f64 = 0.5;

/// What is measured: the side of the middle of a patch, the length along an edge, and the reach to either side of it.
const MEASURED_PATCH: f64 = 0.4;
const MEASURED_EDGE: f64 = 0.32;
const EDGE_REACH: f64 = 0.17;

/// Patches of the ColorChecker that targets are made of.
const WHITE: u8 = 18;
const GRAY_65: u8 = 20;
const GRAY_5: u8 = 21;
const GRAY_35: u8 = 22;
const BLACK: u8 = 23;

/// Lightness on both sides of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeContrast {
    /// Neutral 6.5 and neutral 5: 1.9 to 1.
    Low,
    /// Neutral 6.5 and neutral 3.5: 4.1 to 1, as ISO 12233 requires.
    Standard,
    /// White and black: 29 to 1.
    High,
}

impl EdgeContrast {
    /// The light and the dark patch.
    fn patches(self) -> (u8, u8) {
        match self {
            Self::Low => (GRAY_65, GRAY_5),
            Self::Standard => (GRAY_65, GRAY_35),
            Self::High => (WHITE, BLACK),
        }
    }

    /// Its name in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "1.9:1",
            Self::Standard => "4.1:1",
            Self::High => "29:1",
        }
    }
}

/// Cells with an edge target, `(row, column)`: the middle, beside it two other contrasts, the middles of the sides, and the corners.
const TARGETS: [(usize, usize, EdgeContrast); 11] = [
    (2, 3, EdgeContrast::Standard),
    (2, 2, EdgeContrast::Low),
    (2, 4, EdgeContrast::High),
    (0, 3, EdgeContrast::Standard),
    (4, 3, EdgeContrast::Standard),
    (2, 0, EdgeContrast::Standard),
    (2, 6, EdgeContrast::Standard),
    (0, 0, EdgeContrast::Standard),
    (0, 6, EdgeContrast::Standard),
    (4, 0, EdgeContrast::Standard),
    (4, 6, EdgeContrast::Standard),
];

/// The chart on a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestChart {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

/// An edge target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeTarget {
    /// Lightness on both sides.
    pub contrast: EdgeContrast,
    /// Distance of its middle from the middle of the frame, as a share of half of the frame's diagonal.
    pub field: f64,
    /// Windows about its left and right side, whose edges are nearly vertical.
    pub upright: [Window; 2],
    /// Windows about its upper and lower side.
    pub lying: [Window; 2],
}

impl TestChart {
    /// The window in the middle of each of the 24 patches, dark skin first.
    pub fn patches(&self) -> Vec<Window> {
        let side = MEASURED_PATCH * self.side();
        let patch = |(row, col)| window(self.centre(row, col), [side, side]);
        patch_cells().map(patch).collect()
    }

    /// The edge targets; the first is that in the middle of the frame.
    pub fn targets(&self) -> Vec<EdgeTarget> {
        let cell = self.side();
        let (along, across, out) = (MEASURED_EDGE * cell, 2.0 * EDGE_REACH * cell, 0.5 * SQUARE * cell);
        let middle = [0.5 * self.height as f64, 0.5 * self.width as f64];
        let target = |(row, col, contrast): (usize, usize, EdgeContrast)| {
            let [y, x] = self.centre(row, col);
            let field = (y - middle[0]).hypot(x - middle[1]) / middle[0].hypot(middle[1]);
            let upright = [-out, out].map(|by| window([y, x + by], [along, across]));
            let lying = [-out, out].map(|by| window([y + by, x], [across, along]));
            EdgeTarget { contrast, field, upright, lying }
        };
        TARGETS.into_iter().map(target).collect()
    }

    /// The chart as a scene of reflectances (Ohta's measurement).
    pub fn draw(&self) -> ReflectanceScene {
        let cell = self.side();
        let patches: Vec<(usize, usize)> = patch_cells().collect();
        let cell_of =
            |y: f64, len: usize, cells: usize| ((y * cells as f64 / len as f64) as usize).min(cells - 1);
        let (sin, cos) = EDGE_DEG.to_radians().sin_cos();
        let pixel = |i: usize| {
            let (r, c) = ((i / self.width) as f64, (i % self.width) as f64);
            let (row, col) = (cell_of(r + 0.5, self.height, ROWS), cell_of(c + 0.5, self.width, COLUMNS));
            let [y, x] = self.centre(row, col);
            let within = |side: f64| (r + 0.5 - y).abs().max((c + 0.5 - x).abs()) < 0.5 * side * cell;
            if let Some(patch) = patches.iter().position(|at| *at == (row, col)) {
                return (if within(PATCH) { patch as u8 } else { GRAY_5 }, 0, 0.0);
            }
            let contrast = TARGETS.iter().find(|t| (t.0, t.1) == (row, col)).map(|t| t.2);
            let Some((light, dark)) = contrast.map(EdgeContrast::patches).filter(|_| within(SURROUND)) else {
                return (GRAY_5, 0, 0.0);
            };
            // The share of the pixel that lies in the inclined square.
            let inside = |k: &usize| {
                let at = |k: usize| (k as f64 + 0.5) / SUPERSAMPLING as f64;
                let (down, right) = (r + at(k / SUPERSAMPLING) - y, c + at(k % SUPERSAMPLING) - x);
                let turned = [cos * down - sin * right, sin * down + cos * right];
                turned[0].abs().max(turned[1].abs()) < 0.5 * SQUARE * cell
            };
            let points = SUPERSAMPLING * SUPERSAMPLING;
            (light, dark, (0..points).filter(inside).count() as f32 / points as f32)
        };
        let pixels = (0..self.height * self.width).into_par_iter().map(pixel).collect();
        let materials = colour_checker(ChartData::Ohta).iter().map(|(_, curve)| curve.clone()).collect();
        ReflectanceScene { height: self.height, width: self.width, materials, pixels }
    }

    /// The shorter side of a cell, pixels.
    fn side(&self) -> f64 {
        (self.height as f64 / ROWS as f64).min(self.width as f64 / COLUMNS as f64)
    }

    /// The middle of a cell, row and column of pixels from the upper left corner.
    fn centre(&self, row: usize, col: usize) -> [f64; 2] {
        [
            (row as f64 + 0.5) * self.height as f64 / ROWS as f64,
            (col as f64 + 0.5) * self.width as f64 / COLUMNS as f64,
        ]
    }
}

/// The cells without an edge target, row by row.
fn patch_cells() -> impl Iterator<Item = (usize, usize)> {
    let all = (0..ROWS * COLUMNS).map(|i| (i / COLUMNS, i % COLUMNS));
    all.filter(|cell| !TARGETS.iter().any(|target| (target.0, target.1) == *cell))
}

/// The window of `[height, width]` pixels about a place.
fn window([y, x]: [f64; 2], [height, width]: [f64; 2]) -> Window {
    let first = |at: f64, side: f64| (at - 0.5 * side).round().max(0.0) as usize;
    let placement = Placement { row: first(y, height), col: first(x, width) };
    Window { placement, height: height.round() as usize, width: width.round() as usize }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHART: TestChart = TestChart { height: 600, width: 960 };

    fn materials(window: &Window) -> Vec<(u8, u8, f32)> {
        let scene = CHART.draw();
        let of = |i: usize| {
            let (row, col) =
                (window.placement.row + i / window.width, window.placement.col + i % window.width);
            scene.pixels[row * CHART.width + col]
        };
        (0..window.height * window.width).map(of).collect()
    }

    #[test]
    fn every_patch_is_in_its_window_alone() {
        let windows = CHART.patches();
        assert_eq!(windows.len(), 24);
        for (patch, window) in windows.iter().enumerate().step_by(5) {
            assert!(window.height * window.width > 2000);
            assert!(materials(window).iter().all(|m| m.0 == patch as u8 && m.2 == 0.0), "{patch}");
        }
    }

    #[test]
    fn every_window_of_an_edge_shows_half_of_both_sides() {
        let targets = CHART.targets();
        assert_eq!((targets.len(), targets[0].field, targets[0].contrast), (11, 0.0, EdgeContrast::Standard));
        let furthest = targets.iter().map(|target| target.field).fold(0.0, f64::max);
        assert!((furthest - 0.8415).abs() < 1e-3, "{furthest}");
        for target in [targets[0], targets[2], targets[10]] {
            for window in target.upright.iter().chain(&target.lying) {
                let seen = materials(window);
                assert!(seen.iter().all(|m| (m.0, m.1) == target.contrast.patches()));
                let dark = seen.iter().map(|m| m.2).sum::<f32>() / seen.len() as f32;
                assert!((dark - 0.5).abs() < 0.02, "{dark}");
            }
        }
    }
}
