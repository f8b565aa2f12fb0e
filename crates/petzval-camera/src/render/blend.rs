//! How exact the blend of patches is, and how many patches an accuracy needs.

use rayon::prelude::*;

use super::kernel::{kernel_at, kernel_radius};
use super::{RenderError, RenderGeometry, geometry};
use crate::image::CHANNELS;
use crate::psf::PsfBank;
use petzval_base::statistics::median;

/// Places of the sensor at which the blend is compared.
const PLACES: usize = 48;

/// Patch rows that are tried, from few to many.
const ROWS: [usize; 10] = [7, 9, 11, 13, 17, 21, 27, 33, 41, 51];

/// Difference between the PSF that the renderer blends at a place and that of the place itself: the sum of absolute differences over
/// the pixels, both of unit sum, mean of the colours. 2 is the largest possible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlendError {
    /// Median over places spread evenly over the sensor.
    pub median: f64,
    /// The largest of them.
    pub largest: f64,
}

/// The error of the blend of a bank's PSFs, at the same places for every geometry of one sensor.
pub fn blend_error(geometry: &RenderGeometry, bank: &PsfBank) -> Result<BlendError, RenderError> {
    let layout = bank.layout();
    let radius = kernel_radius(geometry, &layout)?;
    // A sequence that fills the sensor evenly: multiples of the powers of 1 / 1.3247..., the root of x^3 = x + 1.
    let along = |i: usize, step: f64, pixels: usize| ((i as f64 * step).fract() * pixels as f64) as usize;
    let places: Vec<(usize, usize)> = (1..=PLACES)
        .map(|i| {
            let row = along(i, 0.754_877_666_246_692_7, geometry.sensor_height);
            (row, along(i, 0.569_840_290_998_053_2, geometry.sensor_width))
        })
        .collect();
    let kernel = |at: (f64, f64)| kernel_at(geometry, &layout, &bank.values, radius, at);
    let errors: Vec<f64> = places
        .par_iter()
        .map(|&(row, col)| {
            let mut difference = kernel(geometry.position_um(row as f64, col as f64));
            let (rows, cols) = geometry.patches;
            let (row_lo, row_hi) = geometry::hat(geometry.sensor_height, rows, row);
            let (col_lo, col_hi) = geometry::hat(geometry.sensor_width, cols, col);
            for (i, by_row) in [(row_lo, 1.0 - row_hi), (row_lo + 1, row_hi)] {
                for (j, by_col) in [(col_lo, 1.0 - col_hi), (col_lo + 1, col_hi)] {
                    let weight = f64::from(by_row * by_col);
                    if weight > 0.0 {
                        let patch = kernel(geometry.patch_centre_um(i * cols + j));
                        difference.iter_mut().zip(patch).for_each(|(d, v)| *d -= weight * v);
                    }
                }
            }
            difference.iter().map(|d| d.abs()).sum::<f64>() / CHANNELS as f64
        })
        .collect();
    let largest = errors.iter().fold(0.0_f64, |a, b| a.max(*b));
    Ok(BlendError { median: median(errors), largest })
}

/// The geometry of the same sensor with the fewest patches whose [`blend_error`] has a median of at most `error`, and that error;
/// with the most patches that are tried where none reaches it. Patches are about square.
pub fn with_patches_for(
    geometry: &RenderGeometry,
    bank: &PsfBank,
    error: f64,
) -> Result<(RenderGeometry, BlendError), RenderError> {
    geometry.validate()?;
    let aspect = geometry.sensor_width as f64 / geometry.sensor_height as f64;
    let mut last = None;
    for rows in ROWS {
        let cols = ((rows as f64 * aspect).round() as usize).clamp(1, super::MAX_PATCHES);
        let patches = (rows.min(geometry.sensor_height), cols.min(geometry.sensor_width));
        let tried = RenderGeometry { patches, ..geometry.clone() };
        let found = blend_error(&tried, bank)?;
        let is_enough = found.median <= error;
        last = Some((tried, found));
        if is_enough {
            break;
        }
    }
    last.map_or_else(|| Ok((geometry.clone(), blend_error(geometry, bank)?)), Ok)
}
