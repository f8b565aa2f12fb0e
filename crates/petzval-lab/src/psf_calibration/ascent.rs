//! Fits cells to the pixels of the mosaic by the method of Richardson and Lucy with read noise. The cells are sums of
//! blobs.
//!
//! `u <- u B'[(y + b)/(B u + b)] / B'1` with `b = var(y) T - y` in electrons (Snyder et al., J. Opt. Soc. Am. A 10, 1014, 1993).
//! The cells are `x = G u` with Gaussian blobs G, and `B = A G` (method of sieves, Snyder & Miller 1985). u is kept symmetric
//! about the field's own axis.

use super::landing::{Landing, Spot};
use super::measure::CROP;
use super::place::{CELLS_PER_PIXEL, GRID, Place};

/// A pixel of the mosaic, in electrons over its whole exposure time.
pub(super) struct Datum {
    /// Index in the window.
    pub pixel: usize,
    /// Signal.
    pub value: f64,
    /// Its variance.
    pub variance: f64,
    /// Part of the variance that is not shot noise of the signal.
    offset: f64,
    /// Exposure time of all its frames, s.
    pub time_s: f64,
}

/// Pixels of the crop with the channel's colour that were not saturated.
pub(super) fn pixels(place: &Place, channel: usize) -> Vec<Datum> {
    let (row, col) = place.measured.psf.corner;
    let of_crop = (0..CROP * CROP).map(|i| (row + i / CROP) * place.frame.width + col + i % CROP);
    let usable = of_crop.filter(|i| place.frame.is_colour(*i, channel) && !place.merged.saturated[*i]);
    usable
        .map(|pixel| {
            let time_s = place.merged.time_s[pixel];
            let value = place.measured.mosaic_e_per_s[pixel] * time_s;
            let variance = place.merged.variance[pixel] * time_s * time_s;
            Datum { pixel, value, variance, offset: (variance - value.max(0.0)).max(1e-3 * variance), time_s }
        })
        .collect()
}

/// The renderer's operator for one position: cells to pixels of the window, the middle of the grid at (row, column).
pub(super) fn landing(place: &Place, [row, col]: [f64; 2], pixel_um: f64) -> Landing {
    let spot = Spot { row, col, azimuth_rad: place.azimuth_rad };
    let size = (place.frame.height, place.frame.width);
    Landing::new((GRID, pixel_um / CELLS_PER_PIXEL as f64), spot, 0.0, pixel_um, size)
}

/// State of the fit of one colour.
pub(super) struct Ascent {
    /// Each on its fitted pixels alone: those of one colour are at most half of a mosaic.
    landings: Vec<Landing>,
    /// Pixels of each landing.
    data: Vec<Vec<Datum>>,
    /// Standard deviation of a blob, cells.
    blob: f64,
    blobs: Vec<f64>,
    landed: Vec<Vec<f64>>,
    sensitivity: Vec<f64>,
    /// Light of each cell, electrons/s.
    pub cells: Vec<f64>,
}

impl Ascent {
    /// Starts from `start`, the light of each cell.
    pub fn new(landings: &[Landing], data: Vec<Vec<Datum>>, blob: f64, start: Vec<f64>) -> Self {
        let cells = blurred(&start, blob);
        let on_its_pixels =
            |(landing, data): (&Landing, &Vec<Datum>)| landing.on(data.iter().map(|datum| datum.pixel));
        let landings: Vec<Landing> = landings.iter().zip(&data).map(on_its_pixels).collect();
        let landed = landings.iter().map(|l| l.land(&cells)).collect();
        let mut ascent = Self { landings, data, blob, blobs: start, landed, sensitivity: Vec::new(), cells };
        ascent.sensitivity = ascent.gather(|_, _| 1.0);
        ascent
    }

    /// `B'` of a value per pixel, computed from the datum and the expected electrons of the cells.
    fn gather(&self, value: impl Fn(&Datum, f64) -> f64) -> Vec<f64> {
        let mut sum = vec![0.0; GRID * GRID];
        for ((landing, data), landed) in self.landings.iter().zip(&self.data).zip(&self.landed) {
            let mut window = vec![0.0; landing.height * landing.width];
            data.iter().for_each(|d| window[d.pixel] = d.time_s * value(d, d.time_s * landed[d.pixel]));
            sum.iter_mut().zip(landing.gather(&window)).for_each(|(s, p)| *s += p);
        }
        mirrored(blurred(&sum, self.blob))
    }

    /// One iteration.
    pub fn advance(&mut self) {
        let ratio =
            self.gather(|d, light| (d.value + d.offset).max(0.0) / (light + d.offset).max(f64::MIN_POSITIVE));
        for ((light, ratio), sensitivity) in self.blobs.iter_mut().zip(&ratio).zip(&self.sensitivity) {
            *light *= if *sensitivity > 0.0 { ratio / sensitivity } else { 0.0 };
        }
        self.cells = blurred(&self.blobs, self.blob);
        self.landed = self.landings.iter().map(|l| l.land(&self.cells)).collect();
    }

    /// Mean squared residual of the fitted pixels over their variance.
    pub fn chi2(&self) -> f64 {
        let count = self.data.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let of = |(data, landed): (&Vec<Datum>, &Vec<f64>)| -> f64 {
            data.iter().map(|d| (d.value - d.time_s * landed[d.pixel]).powi(2) / d.variance).sum()
        };
        self.data.iter().zip(&self.landed).map(of).sum::<f64>() / count
    }
}

/// Even light within the circle that the crop holds at any azimuth.
pub(super) fn even(light: f64) -> Vec<f64> {
    let centre = 0.5 * (GRID as f64 - 1.0);
    (0..GRID * GRID)
        .map(|i| ((i / GRID) as f64 - centre).hypot((i % GRID) as f64 - centre))
        .map(|distance| if distance < 0.5 * GRID as f64 { light / (GRID * GRID) as f64 } else { 0.0 })
        .collect()
}

/// The shape of other cells, blurred and moved by `outward` cells away from the axis, plus a hundredth of even light.
pub(super) fn shaped(cells: &[f64], outward: isize, light: f64) -> Vec<f64> {
    let soft = blurred(cells, 1.25);
    let sum = soft.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let from = |i: usize| (i / GRID).checked_add_signed(-outward).filter(|row| *row < GRID);
    let starts = even(0.01 * light).into_iter().enumerate().map(|(i, even)| {
        even + from(i)
            .map_or(0.0, |row| if even > 0.0 { light / sum * soft[row * GRID + i % GRID] } else { 0.0 })
    });
    starts.collect()
}

/// Replaces every cell by a round blob: a Gaussian along rows and columns. The operation is its own transpose as long
/// as no light reaches the rim.
fn blurred(cells: &[f64], blob: f64) -> Vec<f64> {
    let weights = blob_weights(blob);
    let sum: f64 = weights.iter().sum();
    // Along each row: the row itself is added, moved by each step of the blob.
    let mut rows = vec![0.0; cells.len()];
    for (out, row) in rows.chunks_exact_mut(GRID).zip(cells.chunks_exact(GRID)) {
        for (k, weight) in weights.iter().enumerate() {
            let (to, from) = (REACH.saturating_sub(k), k.saturating_sub(REACH));
            out[to..].iter_mut().zip(&row[from..]).for_each(|(out, cell)| *out += weight * cell);
        }
        out.iter_mut().for_each(|out| *out /= sum);
    }
    // Across the rows: whole rows are added.
    let mut both = vec![0.0; cells.len()];
    for (r, out) in both.chunks_exact_mut(GRID).enumerate() {
        for (k, weight) in weights.iter().enumerate() {
            let from = (r + k).checked_sub(REACH).and_then(|row| rows.chunks_exact(GRID).nth(row));
            let Some(row) = from else { continue };
            out.iter_mut().zip(row).for_each(|(out, cell)| *out += weight * cell);
        }
        out.iter_mut().for_each(|out| *out /= sum);
    }
    both
}

/// Cells from the middle of a blob to its edge.
const REACH: usize = 4;

/// Light of a blob along a line, not normalised.
fn blob_weights(blob: f64) -> [f64; 2 * REACH + 1] {
    std::array::from_fn(|k| (-0.5 * ((k as f64 - REACH as f64) / blob).powi(2)).exp())
}

/// The mean of a grid and its mirror image across the field's own axis.
fn mirrored(cells: Vec<f64>) -> Vec<f64> {
    (0..GRID * GRID).map(|i| 0.5 * (cells[i] + cells[i / GRID * GRID + GRID - 1 - i % GRID])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each cell on its own, by the formula.
    fn blurred_plainly(cells: &[f64], blob: f64) -> Vec<f64> {
        let weights = blob_weights(blob);
        let sum: f64 = weights.iter().sum();
        let along = |cells: &[f64], of: fn(usize, isize) -> Option<usize>| -> Vec<f64> {
            let cell = |i: usize| {
                let part =
                    |(k, w): (usize, &f64)| of(i, k as isize - REACH as isize).map(|from| w * cells[from]);
                weights.iter().enumerate().filter_map(part).fold(0.0, |all, part| all + part) / sum
            };
            (0..cells.len()).map(cell).collect()
        };
        let in_row = |i: usize, by: isize| {
            (i % GRID).checked_add_signed(by).filter(|c| *c < GRID).map(|c| i / GRID * GRID + c)
        };
        let in_column = |i: usize, by: isize| {
            (i / GRID).checked_add_signed(by).filter(|r| *r < GRID).map(|r| r * GRID + i % GRID)
        };
        along(&along(cells, in_row), in_column)
    }

    #[test]
    fn whole_rows_are_blurred_as_single_cells_are_to_the_bit() {
        let cells: Vec<f64> = (0..GRID * GRID).map(|i| ((i * 7919) % 1013) as f64 / 1013.0).collect();
        assert_eq!(blurred(&cells, 1.25), blurred_plainly(&cells, 1.25));
    }
}
