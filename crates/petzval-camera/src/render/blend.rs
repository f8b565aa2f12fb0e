//! How exact the blend of patches is, and how many patches an accuracy needs.

use std::borrow::Cow;
use std::sync::OnceLock;

use rayon::prelude::*;

use super::kernel::{kernel_at, kernel_radius};
use super::{RenderError, RenderGeometry};
use crate::image::CHANNELS;
use crate::psf::{PsfBank, PsfLayout};
use petzval_base::statistics::median;

/// Places of the sensor at which the blend is compared.
const PLACES: usize = 48;

/// Most patches whose kernels are kept while a blend is compared: places share the kernels of so few, and they fill little memory.
const MOST_KEPT: usize = 2 * PLACES;

/// Patch rows that are tried, from few to many.
const ROWS: [usize; 13] = [1, 3, 5, 7, 9, 11, 13, 17, 21, 27, 33, 41, 51];

/// Difference between the PSF that the renderer blends at a place and that of the place itself: the sum of absolute differences over
/// the pixels, both of unit sum, mean of the colours. 2 is the largest possible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlendError {
    /// Median over places spread evenly over the sensor.
    pub median: f64,
    /// The largest of them.
    pub largest: f64,
}

/// The places at which blends of a bank are compared, and the kernels of these places themselves.
struct Compared<'a> {
    bank: &'a PsfBank,
    layout: PsfLayout,
    radius: usize,
    places: Vec<(usize, usize)>,
    exact: Vec<Vec<f64>>,
}

impl<'a> Compared<'a> {
    fn new(geometry: &RenderGeometry, bank: &'a PsfBank) -> Result<Self, RenderError> {
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
        let of_place = |&(row, col): &(usize, usize)| {
            kernel_at(geometry, &layout, &bank.values, radius, geometry.position_um(row as f64, col as f64))
        };
        let exact = places.par_iter().map(of_place).collect();
        Ok(Self { bank, layout, radius, places, exact })
    }

    /// The error of the blend between the patches of a geometry of the same sensor.
    fn error(&self, geometry: &RenderGeometry) -> BlendError {
        let kept = if geometry.patch_count() <= MOST_KEPT { geometry.patch_count() } else { 0 };
        self.error_keeping(geometry, &vec![OnceLock::new(); kept])
    }

    /// The error of the blend. `kept` holds the kernel of each patch, made by the first place that blends it; each place makes the others.
    fn error_keeping(&self, geometry: &RenderGeometry, kept: &[OnceLock<Vec<f64>>]) -> BlendError {
        let kernel = |patch: usize| {
            let at = geometry.patch_centre_um(patch);
            kernel_at(geometry, &self.layout, &self.bank.values, self.radius, at)
        };
        let errors: Vec<f64> = (self.places.par_iter().zip(&self.exact))
            .map(|(&(row, col), exact)| {
                let mut difference = exact.clone();
                for (patch, weight) in geometry.patches_at(row, col) {
                    let of_patch = match kept.get(patch) {
                        Some(kept) => Cow::Borrowed(kept.get_or_init(|| kernel(patch)).as_slice()),
                        None => Cow::Owned(kernel(patch)),
                    };
                    let pixels = difference.iter_mut().zip(of_patch.iter());
                    pixels.for_each(|(d, v)| *d -= f64::from(weight) * v);
                }
                difference.iter().map(|d| d.abs()).sum::<f64>() / CHANNELS as f64
            })
            .collect();
        let largest = errors.iter().fold(0.0_f64, |a, b| a.max(*b));
        BlendError { median: median(errors), largest }
    }
}

/// The error of the blend of a bank's PSFs, at the same places for every geometry of one sensor.
pub fn blend_error(geometry: &RenderGeometry, bank: &PsfBank) -> Result<BlendError, RenderError> {
    Ok(Compared::new(geometry, bank)?.error(geometry))
}

/// The geometry of the same sensor with the fewest patches whose [`blend_error`] has a median of at most `error`, and that error;
/// with the most patches that are tried where none reaches it. Patches are about square.
pub fn with_patches_for(
    geometry: &RenderGeometry,
    bank: &PsfBank,
    error: f64,
) -> Result<(RenderGeometry, BlendError), RenderError> {
    geometry.validate()?;
    let compared = Compared::new(geometry, bank)?;
    let aspect = geometry.sensor_width as f64 / geometry.sensor_height as f64;
    let with_rows = |rows: usize| {
        let cols = ((rows as f64 * aspect).round() as usize).clamp(1, super::MAX_PATCHES);
        let patches = (rows.min(geometry.sensor_height), cols.min(geometry.sensor_width));
        let tried = RenderGeometry { patches, ..geometry.clone() };
        let found = compared.error(&tried);
        (tried, found)
    };
    let [first, more @ ..] = ROWS;
    let mut found = with_rows(first);
    for rows in more {
        if found.1.median <= error {
            break;
        }
        found = with_rows(rows);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{bank, geometry};
    use super::*;

    #[test]
    fn kernels_that_places_share_change_no_bit_of_the_error() {
        let bank = bank(3);
        for patches in [(1, 2), (3, 4), (12, 17)] {
            let geometry = RenderGeometry { patches, ..geometry() };
            let compared = Compared::new(&geometry, &bank).unwrap();
            let kept = vec![OnceLock::new(); geometry.patch_count()];
            let alone = compared.error_keeping(&geometry, &[]);
            assert_eq!(compared.error_keeping(&geometry, &kept), alone);
            assert_eq!(compared.error(&geometry), alone);
            // Few patches are all blended, and each kernel is there for the next place.
            let made = kept.iter().filter(|kernel| kernel.get().is_some()).count();
            assert!(made == kept.len() || kept.len() > MOST_KEPT, "{made} of {}", kept.len());
        }
    }
}
