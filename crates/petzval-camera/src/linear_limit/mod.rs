//! How well the scene can be known from raw frames, before any network: the expected squared error that the best linear restoration leaves.
//!
//! A scene of three colours x is blurred by the lens, sampled through the colour filter array, and disturbed by noise. Natural scenes have a
//! known spectrum, so the linear restoration W of least expected error is known too, and so is that error (`alias.rs` has the formulas).
//! It undoes blur and mosaic at once, better than a demosaic with a Wiener filter behind it can. The error judges lens, filter array,
//! exposure and sensor together, in milliseconds, with a gradient by the PSFs: a merit for joint design without training (Robinson and Stork,
//! "Joint design of lens systems and digital image processing", Proc. SPIE 6342, 2006).
//!
//! All colours count alike, and so does every part of the sensor.

mod alias;
mod prior;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use petzval_fourier::{Complex64, Fft};
use rayon::prelude::*;

use crate::develop::Electrons;
use crate::image::CHANNELS;
use crate::psf::PsfBank;
use crate::render::{PatchKernels, RenderError, RenderGeometry, patch_kernels, patch_kernels_adjoint};
use crate::sensor::{Exposure, SensorModel};

use alias::{Mosaic, PatchLimit};
pub use prior::NaturalScenes;

/// Patches along each side of the sensor at which the error is taken; by symmetry those of one quadrant are enough.
const PATCHES: usize = 8;

/// Least side of the transform of a kernel, pixels.
const LEAST_SIDE: usize = 64;

/// The error of the best linear restoration of the frames of a sensor at an exposure.
#[derive(Clone, Debug)]
pub struct LinearLimit {
    geometry: RenderGeometry,
    mosaic: Mosaic,
    scenes: NaturalScenes,
}

/// The expected squared error, and its derivatives by the PSFs.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitGradient {
    /// Of red, green and blue, in squares of white.
    pub mean_square: [f64; CHANNELS],
    /// Derivatives of the mean over the colours by [`PsfBank::values`].
    pub by_values: Vec<f32>,
    /// By [`PsfBank::illumination`].
    pub by_illumination: Vec<f32>,
    /// By [`PsfBank::field_radius_mm`], 1/mm.
    pub by_radius: Vec<f64>,
}

/// What patches need of a bank: kernels and relative illumination.
struct Patches {
    kernels: PatchKernels,
    /// Fields and weights of the interpolation in image radius, by patch.
    brackets: Vec<(usize, f64, f64)>,
}

impl LinearLimit {
    /// The limit for the frames of a sensor at an exposure.
    pub fn new(sensor: &SensorModel, exposure: &Exposure, scenes: NaturalScenes) -> Self {
        let (sensor_height, sensor_width) = (sensor.height, sensor.width);
        let geometry = RenderGeometry {
            sensor_height,
            sensor_width,
            pixel_um: sensor.pixel_um,
            patches: (PATCHES, PATCHES),
        };
        let dark_e2 = Electrons::of_sensor(sensor, exposure).dark;
        let response = |row: usize, col: usize| sensor.response(sensor.cfa.colour(row, col)).map(f64::from);
        let mosaic = Mosaic::new(sensor.cfa, response, f64::from(exposure.white_e), dark_e2);
        Self { geometry, mosaic, scenes }
    }

    /// The expected squared error of red, green and blue, in squares of white: the mean over the sensor.
    pub fn mean_square(&self, bank: &PsfBank) -> Result<[f64; CHANNELS], RenderError> {
        let patches = self.patches(bank)?;
        let parts = self.limits(bank, &patches, false);
        Ok(mean(&parts))
    }

    /// [`LinearLimit::mean_square`] with the gradient of its mean over the colours.
    pub fn gradient(&self, bank: &PsfBank) -> Result<LimitGradient, RenderError> {
        let patches = self.patches(bank)?;
        let parts = self.limits(bank, &patches, true);
        let share = 1.0 / (parts.len() * CHANNELS) as f64;
        let mut by_kernels = patches.kernels.clone();
        let per_patch = by_kernels.values.len() / parts.len();
        for (out, part) in by_kernels.values.chunks_exact_mut(per_patch).zip(&parts) {
            out.iter_mut().zip(&part.by_kernels).for_each(|(out, by)| *out = (share * by) as f32);
        }
        let psfs =
            patch_kernels_adjoint(&self.geometry, &bank.layout(), &bank.values, &by_kernels, [true; 2])?;
        // The illumination of a patch lies between those of two fields, which move with their radii.
        let fields = bank.field_radius_mm.len();
        let mut by_illumination = vec![0.0f32; fields * CHANNELS];
        let mut by_radius = psfs.radius;
        for ((lower, w_lower, w_upper), part) in patches.brackets.iter().zip(&parts) {
            let upper = (lower + 1).min(fields - 1);
            let mut slope = 0.0;
            for c in 0..CHANNELS {
                let by = share * part.by_illumination[c];
                by_illumination[lower * CHANNELS + c] += (w_lower * by) as f32;
                by_illumination[upper * CHANNELS + c] += (w_upper * by) as f32;
                let [low, high] = [*lower, upper].map(|f| f64::from(bank.illumination[f * CHANNELS + c]));
                slope += by * (high - low);
            }
            let span = bank.field_radius_mm[upper] - bank.field_radius_mm[*lower];
            if span > 0.0 && *w_upper > 0.0 && *w_lower > 0.0 {
                by_radius[*lower] -= slope * w_lower / span;
                by_radius[upper] -= slope * w_upper / span;
            }
        }
        Ok(LimitGradient { mean_square: mean(&parts), by_values: psfs.values, by_illumination, by_radius })
    }

    /// The patches of one quadrant.
    fn patches(&self, bank: &PsfBank) -> Result<Patches, RenderError> {
        let layout = bank.layout();
        let half = PATCHES / 2;
        let active: Vec<bool> =
            (0..PATCHES * PATCHES).map(|p| p / PATCHES >= half && p % PATCHES >= half).collect();
        let kernels = patch_kernels(&self.geometry, &layout, &bank.values, &active)?;
        let bracket = |patch: &usize| {
            let (x, y) = self.geometry.patch_centre_um(*patch);
            layout.bracket(1e-3 * x.hypot(y))
        };
        let brackets = kernels.patches.iter().map(bracket).collect();
        Ok(Patches { kernels, brackets })
    }

    /// The limit at every patch, with derivatives if `with_gradient`.
    fn limits(&self, bank: &PsfBank, patches: &Patches, with_gradient: bool) -> Vec<PatchLimit> {
        let kernels = &patches.kernels;
        let side = self.mosaic.fitting_side((4 * kernels.radius).max(LEAST_SIDE));
        let (transform, size) = (Transform::new(side), kernels.size());
        let per_patch = CHANNELS * size * size;
        let last = bank.field_radius_mm.len() - 1;
        let each = kernels.values.par_chunks_exact(per_patch).zip(&patches.brackets);
        each.map(|(kernel, (lower, w_lower, w_upper))| {
            let spectra: Vec<Vec<Complex64>> =
                kernel.chunks_exact(size * size).map(|k| transform.of_kernel(k, kernels.radius)).collect();
            let at = |field: usize, c: usize| f64::from(bank.illumination[field * CHANNELS + c]);
            let illumination =
                [0, 1, 2].map(|c| w_lower * at(*lower, c) + w_upper * at((lower + 1).min(last), c));
            let mut limit = self.mosaic.limit(&self.scenes, side, &spectra, illumination, with_gradient);
            let back = |by: &Vec<Complex64>| transform.to_kernel(by.clone(), kernels.radius);
            limit.by_kernels = limit.by_spectra.iter().flat_map(back).collect();
            limit
        })
        .collect()
    }
}

/// The mean over patches of equal area.
fn mean(parts: &[PatchLimit]) -> [f64; CHANNELS] {
    [0, 1, 2].map(|c| parts.iter().map(|part| part.mean_square[c]).sum::<f64>() / parts.len() as f64)
}

/// Fourier transforms of kernels in a square of pixels, about the kernel's middle.
struct Transform {
    side: usize,
    forward: Arc<dyn Fft<f64>>,
}

impl Transform {
    fn new(side: usize) -> Self {
        Self { side, forward: petzval_fourier::forward(side) }
    }

    /// Rows, then columns; the result is transposed, `[column][row]`.
    fn forward(&self, mut values: Vec<Complex64>) -> Vec<Complex64> {
        let n = self.side;
        self.forward.process(&mut values);
        let mut turned: Vec<Complex64> = (0..n * n).map(|i| values[i % n * n + i / n]).collect();
        self.forward.process(&mut turned);
        turned
    }

    /// `K(f) = sum k(x) exp(-2 pi i f x)`, `[row][column]` of f.
    fn of_kernel(&self, kernel: &[f32], radius: usize) -> Vec<Complex64> {
        let (n, size) = (self.side, 2 * radius + 1);
        let mut values = vec![Complex64::default(); n * n];
        for (i, value) in kernel.iter().enumerate() {
            let [row, col] = [i / size, i % size].map(|k| (k + n - radius) % n);
            // Transposed, as the result is.
            values[col * n + row] = Complex64::from(f64::from(*value));
        }
        self.forward(values)
    }

    /// The transpose of [`Transform::of_kernel`]: from the derivatives `dE = Re sum by(f) dK(f)` to those by the kernel.
    fn to_kernel(&self, by: Vec<Complex64>, radius: usize) -> Vec<f64> {
        let (n, size) = (self.side, 2 * radius + 1);
        let all = self.forward(by);
        let at = |i: usize| {
            let [row, col] = [i / size, i % size].map(|k| (k + n - radius) % n);
            all[col * n + row].re
        };
        (0..size * size).map(at).collect()
    }
}
