//! Scenes of matt surfaces.

use rayon::prelude::*;

use super::illuminant::Illuminant;
use super::image::SpectralImage;
use crate::spectrum::Spectrum;
use crate::spectrum::bands::{band_mean, ends};

/// Sample points along a pixel's side, for pixels that an edge crosses.
pub(super) const SUPERSAMPLING: usize = 8;

/// A scene of matt surfaces: at every pixel a mixture of two materials.
#[derive(Debug, Clone, PartialEq)]
pub struct ReflectanceScene {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Reflectances, 0..1.
    pub materials: Vec<Spectrum>,
    /// Per pixel the two materials, and the share of the second, 0..1.
    pub pixels: Vec<(u8, u8, f32)>,
}

impl ReflectanceScene {
    /// The scene under `light` with an illuminance of `lux`: radiance `E(l) rho(l) / pi` in the bands `band_um` (um, ascending,
    /// at least two). Each band holds the mean over its hat function.
    pub fn under(&self, light: &Illuminant, lux: f64, band_um: &[f64]) -> SpectralImage {
        let radiance = self.radiance(light, lux, band_um);
        let data = (0..band_um.len()).flat_map(|band| self.plane(&radiance, band)).collect();
        SpectralImage { wavelength_um: band_um.to_vec(), height: self.height, width: self.width, data }
    }

    /// Radiance of each material in each band, W m-2 sr-1 nm-1, `[material][band]`. Outside the measured wavelengths of a
    /// material its reflectance keeps the value at the end of the range.
    pub fn radiance(&self, light: &Illuminant, lux: f64, band_um: &[f64]) -> Vec<Vec<f64>> {
        let white = light.white_radiance(lux);
        let range = ends(band_um);
        let means =
            self.materials.iter().map(|reflectance| band_mean(&[&white, &reflectance.held(range)], band_um));
        means.collect()
    }

    /// Radiance of every pixel in one band, row by row. `radiance` comes from [`radiance`](Self::radiance).
    pub fn plane(&self, radiance: &[Vec<f64>], band: usize) -> Vec<f32> {
        let of: Vec<f32> = radiance.iter().map(|material| material[band] as f32).collect();
        let mixed = |(a, b, share): &(u8, u8, f32)| (1.0 - share) * of[*a as usize] + share * of[*b as usize];
        self.pixels.par_iter().map(mixed).collect()
    }
}
