//! Restoration with the PSF of every place: a Wiener filter that varies over the sensor as the blur does.
//!
//! Each patch has the filter `G = conj(K) / (|K|^2 + P)` of its own kernel K, where `P(f) = noise (10 f)^power` stands for the spectrum of the
//! noise over that of natural pictures, which falls with about the square of the frequency f (cycles per pixel). The filters are turned
//! into kernels on the pixel grid and applied by the renderer, which blends them from patch to patch without seams.

use rayon::prelude::*;
use realfft::num_complex::Complex32;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spectrum::{Scratch, TilePlan, fast_len, forward, plans};
use super::{
    PatchKernels, Placement, RenderError, RenderGeometry, Window, check_placement, patch_kernels,
    render_kernels,
};
use crate::image::LinearImage;
use crate::psf::PsfBank;

/// Least side of the transform of a kernel, pixels: filters reach half as far.
const LEAST_SIDE: usize = 64;

/// How strongly a restoration trusts what it sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Wiener {
    /// Power of noise over that of the picture at a tenth of a cycle per pixel.
    pub noise: f32,
    /// Power of the frequency with which this grows.
    pub power: f32,
}

impl Default for Wiener {
    /// For pictures of 16,000 electrons of white.
    fn default() -> Self {
        Self { noise: 3e-3, power: 2.0 }
    }
}

/// The side of the transform in which kernels of a radius are inverted.
fn side(radius: usize) -> usize {
    fast_len((4 * radius).max(LEAST_SIDE))
}

/// Position of a kernel's row or column in the transform, whose first element is the kernel's middle.
fn wrapped(k: usize, radius: usize, side: usize) -> usize {
    (k + side - radius) % side
}

impl Wiener {
    /// The picture without the blur of its lens, as far as the noise allows.
    ///
    /// `picture` is a window of the sensor at `placement`, corrected for shading, three planes; beyond its border its edge is repeated.
    pub fn restore(
        &self,
        geometry: &RenderGeometry,
        bank: &PsfBank,
        picture: &LinearImage,
        placement: Placement,
    ) -> Result<LinearImage, RenderError> {
        let layout = bank.layout();
        geometry.validate()?;
        check_placement(geometry, placement, picture.height, picture.width)?;
        let window = Window { placement, height: picture.height, width: picture.width };
        let active = geometry.active_patches(&window);
        let kernels = patch_kernels(geometry, &layout, &bank.values, &active)?;
        let filters = self.filters(&kernels);
        render_kernels(geometry, &filters, &picture.pad_replicate(filters.radius), placement)
    }

    /// The filters of kernels; patches without a kernel have none.
    pub fn filters(&self, kernels: &PatchKernels) -> PatchKernels {
        let n = side(kernels.radius);
        let plan = &plans(std::iter::once((n, n)))[&(n, n)];
        let reach = n / 2 - 1;
        let size = 2 * reach + 1;
        let filter = |scratch: &mut Scratch, kernel: &[f32]| {
            let mut out = vec![0.0; size * size];
            if kernel.iter().all(|v| *v == 0.0) {
                return out;
            }
            let mut spectrum = transform(plan, kernel, kernels.radius, scratch);
            for (i, k) in spectrum.iter_mut().enumerate() {
                *k = k.conj() / (k.norm_sqr() + self.prior(i, n));
            }
            back(plan, &mut spectrum, reach, scratch, &mut out);
            out
        };
        let per_kernel = kernels.size() * kernels.size();
        let filters: Vec<Vec<f32>> =
            (kernels.values.par_chunks_exact(per_kernel)).map_init(Scratch::default, filter).collect();
        PatchKernels { radius: reach, values: filters.concat() }
    }

    /// The cotangent of kernels from that of their [filters](Wiener::filters).
    ///
    /// With `D = |K|^2 + P`: `dG = conj(dK) P / D^2 - conj(K)^2 dK / D^2`.
    pub fn filters_adjoint(&self, kernels: &PatchKernels, d_filters: &PatchKernels) -> PatchKernels {
        let n = side(kernels.radius);
        let plan = &plans(std::iter::once((n, n)))[&(n, n)];
        let (per_kernel, per_filter) = (kernels.size().pow(2), d_filters.size().pow(2));
        let pull = |scratch: &mut Scratch, (kernel, bar): (&[f32], &[f32])| {
            let mut out = vec![0.0; per_kernel];
            if kernel.iter().all(|v| *v == 0.0) {
                return out;
            }
            let spectrum = transform(plan, kernel, kernels.radius, scratch);
            let mut by_spectrum = transform(plan, bar, d_filters.radius, scratch);
            for (i, (bar, k)) in by_spectrum.iter_mut().zip(&spectrum).enumerate() {
                let prior = self.prior(i, n);
                let square = (k.norm_sqr() + prior).powi(2);
                // The conjugate of the derivative, so that the inverse transform stands for the forward one.
                *bar = (*bar * prior - bar.conj() * k.conj() * k.conj()).conj() / square;
            }
            back(plan, &mut by_spectrum, kernels.radius, scratch, &mut out);
            out
        };
        let pairs =
            kernels.values.par_chunks_exact(per_kernel).zip(d_filters.values.par_chunks_exact(per_filter));
        let all: Vec<Vec<f32>> = pairs.map_init(Scratch::default, pull).collect();
        PatchKernels { radius: kernels.radius, values: all.concat() }
    }

    /// P at an element of a half spectrum, `[column bin][row]`.
    fn prior(&self, i: usize, n: usize) -> f32 {
        let (bin, row) = (i / n, i % n);
        let f = (bin as f32).hypot(row.min(n - row) as f32) / n as f32;
        self.noise * (10.0 * f).powf(self.power)
    }
}

/// The half spectrum of a kernel about its middle.
fn transform(plan: &TilePlan, kernel: &[f32], radius: usize, scratch: &mut Scratch) -> Vec<Complex32> {
    let (n, size) = (plan.rows, 2 * radius + 1);
    forward(plan, n, scratch, |row, line| {
        // The row of the kernel that lies in this row of the transform, if any.
        let k = (row + radius) % n;
        if k < size {
            for (c, value) in kernel[k * size..(k + 1) * size].iter().enumerate() {
                line[wrapped(c, radius, n)] = *value;
            }
        }
    })
}

/// The kernel of a half spectrum about its middle, as far as `radius`.
fn back(plan: &TilePlan, spectrum: &mut [Complex32], radius: usize, scratch: &mut Scratch, out: &mut [f32]) {
    let (n, size) = (plan.rows, 2 * radius + 1);
    plan.cols_inverse(spectrum, scratch);
    plan.rows_inverse(0, n, spectrum, scratch, |row, line| {
        let k = (row + radius) % n;
        if k < size {
            for (c, value) in out[k * size..(k + 1) * size].iter_mut().enumerate() {
                *value = line[wrapped(c, radius, n)];
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::image::CHANNELS;
    use crate::quality::psnr;
    use crate::render::{kernel_radius, render};

    const GEOMETRY: RenderGeometry =
        RenderGeometry { sensor_height: 96, sensor_width: 128, pixel_um: 5.0, patches: (3, 4) };

    /// Gauss curves of `sigma_um` on the axis and of `growth` times that at the corner.
    fn bank(sigma_um: f64, growth: f64) -> PsfBank {
        let (grid, pitch_um) = (64, 1.0);
        let mut values = Vec::new();
        for sigma_um in [sigma_um, sigma_um * growth] {
            let cell = |i: usize| (-0.5 * ((i as f64 - 31.5) * pitch_um / sigma_um).powi(2)).exp();
            let psf: Vec<f64> = (0..grid * grid).map(|i| cell(i / grid) * cell(i % grid)).collect();
            let sum: f64 = psf.iter().sum();
            (0..CHANNELS).for_each(|_| values.extend(psf.iter().map(|v| (v / sum) as f32)));
        }
        PsfBank { field_radius_mm: vec![0.0, 0.4], grid, pitch_um, values, illumination: vec![1.0; 6] }
    }

    fn scene(height: usize, width: usize) -> LinearImage {
        let mut image = LinearImage::zeros(CHANNELS, height, width);
        for (i, v) in image.data.iter_mut().enumerate() {
            let (x, y) = ((i % width) as f32, (i / width % height) as f32);
            let disc = if (x - 60.0).hypot(y - 50.0) % 17.0 < 8.0 { 0.25 } else { 0.0 };
            *v = 0.3 + disc + 0.1 * (0.31 * x + 0.2 * y).sin();
        }
        image
    }

    #[test]
    fn blur_that_varies_over_the_sensor_is_undone_and_light_kept() {
        let bank = bank(4.0, 1.7);
        let border = kernel_radius(&GEOMETRY, &bank.layout()).unwrap();
        let scene = scene(96, 128);
        let blurred = render(&GEOMETRY, &bank, &scene.pad_replicate(border), Placement::default()).unwrap();
        let restored = Wiener { noise: 1e-4, power: 2.0 }
            .restore(&GEOMETRY, &bank, &blurred, Placement::default())
            .unwrap();
        let inner = |image: &LinearImage| image.crop(12, 12, 72, 104).unwrap().data;
        let before = psnr(&inner(&scene), &inner(&blurred)).unwrap();
        let after = psnr(&inner(&scene), &inner(&restored)).unwrap();
        assert!(after > before + 5.0, "{before} {after}");
        // Flat light stays as it is.
        let flat = LinearImage { data: vec![0.4; 3 * 96 * 128], ..scene };
        let same = Wiener::default().restore(&GEOMETRY, &bank, &flat, Placement::default()).unwrap();
        assert!(same.data.iter().all(|v| (v - 0.4).abs() < 4e-3));
    }

    #[test]
    fn filters_have_the_gradient_of_differences() {
        let bank = bank(3.5, 1.4);
        let kernels = patch_kernels(&GEOMETRY, &bank.layout(), &bank.values, &[true; 12]).unwrap();
        let wiener = Wiener { noise: 0.03, power: 2.0 };
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut noise = |n: usize| -> Vec<f32> { (0..n).map(|_| random.random::<f32>() - 0.5).collect() };
        let filters = wiener.filters(&kernels);
        let bar = PatchKernels { values: noise(filters.values.len()), ..filters.clone() };
        let change = noise(kernels.values.len());
        let found: f64 = (wiener.filters_adjoint(&kernels, &bar).values.iter().zip(&change))
            .map(|(a, b)| f64::from(*a) * f64::from(*b))
            .sum();
        let loss = |step: f32| -> f64 {
            let values = kernels.values.iter().zip(&change).map(|(k, d)| k + step * d).collect();
            let moved = wiener.filters(&PatchKernels { values, ..kernels.clone() });
            moved.values.iter().zip(&bar.values).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let wanted = (loss(1e-3) - loss(-1e-3)) / 2e-3;
        assert!((found / wanted - 1.0).abs() < 0.01, "{found} {wanted}");
    }
}
