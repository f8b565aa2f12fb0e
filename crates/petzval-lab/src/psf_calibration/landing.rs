//! The light of a finely sampled PSF on the pixels of a window.

use petzval_camera::image::CHANNELS;

/// The PSF of one field on cells much smaller than a pixel, per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct FinePsf {
    /// Cells along one side; the image point (the reference chief ray) is in the middle of the grid.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// `[channel][row * grid + col]`, unit sum; rows run away from the axis.
    pub values: [Vec<f64>; CHANNELS],
    /// Light of each channel, in any one unit (electrons/s in captures).
    pub light: [f64; CHANNELS],
    /// Diameter of the source's image, um; 0 for a point.
    pub disc_um: f64,
}

/// Position and direction of a PSF on a window of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Row of the image point in the window; whole numbers are pixel centres.
    pub row: f64,
    /// Its column.
    pub col: f64,
    /// Direction away from the axis, rad from the columns towards higher rows.
    pub azimuth_rad: f64,
}

/// Shares of PSF cells that fall on pixels: a sparse matrix, pixels x cells.
///
/// A turned cell keeps an axis-parallel box of its own size. The box is shared among the pixels under it in proportion to the area. The
/// renderer does exactly the same (`render/kernel.rs`), so cells that are fitted through a landing render back. What falls outside the
/// window is lost.
#[derive(Debug, Clone, PartialEq)]
pub struct Landing {
    /// Rows of the window.
    pub height: usize,
    /// Columns of the window.
    pub width: usize,
    cells: usize,
    shares: Vec<(u32, u32, f64)>,
}

/// Places and weights of a quadrature over a disc of radius 1 whose diameter is `diameter_px` pixels.
///
/// Up to a pixel: the centre and six points, exact to fifth degree (Abramowitz & Stegun 25.4.61). A larger disc needs
/// more points, or seven separate images would appear: rings of equal cells, half a pixel apart, with exact second
/// moment. Ring k of n has `3 (2k - 1)` points at radius `sqrt(k^2 - k + 1/2) / n`.
fn disc_points(diameter_px: f64) -> Vec<(f64, f64, f64)> {
    if diameter_px <= 0.0 {
        return vec![(0.0, 0.0, 1.0)];
    }
    let at = |radius: f64, turn: f64| {
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        (radius * cos, radius * sin)
    };
    if diameter_px <= 1.0 {
        let ring = (0..6).map(|k| at((2.0f64 / 3.0).sqrt(), f64::from(k) / 6.0));
        return std::iter::once((0.0, 0.0, 0.25)).chain(ring.map(|(x, y)| (x, y, 0.125))).collect();
    }
    let rings = diameter_px.ceil().min(MOST_RINGS) as usize;
    let weight = 1.0 / (3 * rings * rings) as f64;
    (1..=rings)
        .flat_map(|k| {
            let count = 3 * (2 * k - 1);
            let radius = ((k * k - k) as f64 + 0.5).sqrt() / rings as f64;
            (0..count).map(move |i| at(radius, (i as f64 + 0.5 * (k % 2) as f64) / count as f64))
        })
        .map(|(x, y)| (x, y, weight))
        .collect()
}

/// Largest number of rings; a disc that would need more is wider than any window, and is sampled coarsely.
const MOST_RINGS: f64 = 32.0;

impl Landing {
    /// The shares of `grid` x `grid` cells of `pitch_um` on `height` x `width` pixels of `pixel_um`, the middle of the grid at
    /// `spot`, for a source whose image is a disc of `disc_um`.
    pub fn new(
        (grid, pitch_um): (usize, f64),
        spot: Spot,
        disc_um: f64,
        pixel_um: f64,
        (height, width): (usize, usize),
    ) -> Self {
        let (sin, cos) = spot.azimuth_rad.sin_cos();
        let cell = pitch_um / pixel_um;
        let centre = 0.5 * (grid as f64 - 1.0);
        let points = disc_points(disc_um / pixel_um);
        let mut shares = Vec::new();
        for index in 0..grid * grid {
            let y_psf = ((index / grid) as f64 - centre) * cell;
            let x_psf = ((index % grid) as f64 - centre) * cell;
            // The PSF's rows point away from the axis, its columns a right angle back from there.
            let (x, y) = (spot.col + x_psf * sin + y_psf * cos, spot.row - x_psf * cos + y_psf * sin);
            for (dx, dy, weight) in &points {
                let reach = 0.5 * disc_um / pixel_um;
                let (x, y) = (x + reach * dx, y + reach * dy);
                for (row, share_y) in spans(y, cell, height) {
                    for (col, share_x) in spans(x, cell, width) {
                        shares.push((index as u32, (row * width + col) as u32, weight * share_y * share_x));
                    }
                }
            }
        }
        Self { height, width, cells: grid * grid, shares }
    }

    /// The landing on some pixels alone. What it lands on them, and gathers from them, has the bits of the whole landing.
    ///
    /// # Panics
    /// Panics if a pixel is not in the window.
    pub(super) fn on(&self, pixels: impl IntoIterator<Item = usize>) -> Self {
        let mut is_kept = vec![false; self.height * self.width];
        pixels.into_iter().for_each(|pixel| is_kept[pixel] = true);
        let kept = self.shares.iter().filter(|(_, pixel, _)| is_kept[*pixel as usize]);
        Self { shares: kept.copied().collect(), ..*self }
    }

    /// Light on every pixel, given the light of every cell.
    pub fn land(&self, cells: &[f64]) -> Vec<f64> {
        let mut pixels = vec![0.0; self.height * self.width];
        for (cell, pixel, share) in &self.shares {
            pixels[*pixel as usize] += share * cells[*cell as usize];
        }
        pixels
    }

    /// Transpose of [`Landing::land`].
    pub fn gather(&self, pixels: &[f64]) -> Vec<f64> {
        let mut cells = vec![0.0; self.cells];
        for (cell, pixel, share) in &self.shares {
            cells[*cell as usize] += share * pixels[*pixel as usize];
        }
        cells
    }
}

/// Pixels under a box of size `cell` around `u` and the share of the box on each; pixel k spans k - 1/2 to k + 1/2.
fn spans(u: f64, cell: f64, count: usize) -> impl Iterator<Item = (usize, f64)> {
    let (from, to) = (u - 0.5 * cell, u + 0.5 * cell);
    let first = (from + 0.5).floor().max(0.0) as usize;
    let last = (to + 0.5).floor().min(count as f64 - 1.0);
    let after = if last < 0.0 { 0 } else { last as usize + 1 };
    (first..after.max(first)).filter_map(move |k| {
        let share = ((k as f64 + 0.5).min(to) - (k as f64 - 0.5).max(from)) / cell;
        (share > 0.0).then_some((k, share))
    })
}

impl FinePsf {
    /// Light of each channel on every pixel of a window, `[channel][row * width + col]`.
    pub fn land(&self, spot: Spot, pixel_um: f64, size: (usize, usize)) -> [Vec<f64>; CHANNELS] {
        let landing = Landing::new((self.grid, self.pitch_um), spot, self.disc_um, pixel_um, size);
        std::array::from_fn(|c| {
            landing.land(&self.values[c]).into_iter().map(|v| v * self.light[c]).collect()
        })
    }

    /// Centroid of a channel from the middle of the grid: (across, outwards), um.
    pub fn centroid_um(&self, channel: usize) -> [f64; 2] {
        let centre = 0.5 * (self.grid as f64 - 1.0);
        let mut sum = [0.0; 2];
        for (i, v) in self.values[channel].iter().enumerate() {
            sum[0] += v * ((i % self.grid) as f64 - centre);
            sum[1] += v * ((i / self.grid) as f64 - centre);
        }
        sum.map(|s| s * self.pitch_um)
    }
}
