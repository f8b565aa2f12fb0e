//! Restoration with the PSF of every place: a Wiener filter that varies over the sensor as the blur does.
//!
//! Each patch has the filter `G = conj(K) / (|K|^2 + P)` of its own kernel K. P stands for the spectrum of the noise over that of natural
//! pictures, which falls with about the square of the frequency f (cycles per pixel):
//!
//! `P_c(f) = noise (10 f)^power exp(s_c(f))`,
//!
//! where `s_c` is a curve of the colour c, piecewise linear in `log2 f` between [`KNOTS`] octaves, that training can bend; 0 by default. The
//! filters are turned into kernels on the pixel grid and applied by the renderer, which blends them from patch to patch without seams.

use petzval_base::Cancel;
use petzval_fourier::Complex32;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spectrum::{Scratch, TilePlan, fast_len, forward, plans};
use super::{
    PatchKernels, Placement, RenderError, RenderGeometry, Window, check_placement, patch_kernels,
    render_kernels_unless,
};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::PsfBank;

/// Least side of the transform of a kernel, pixels: filters reach half as far.
const LEAST_SIDE: usize = 64;

/// Knots of a regularisation curve, an octave apart; the last is at half a cycle per pixel, the first at 1/64. Outside them the curve is
/// constant.
pub const KNOTS: usize = 6;

/// The curves `s_c` at their knots, from low to high frequency: natural logarithms of factors of the regularisation.
pub type Curves = [[f32; KNOTS]; CHANNELS];

/// How strongly a restoration trusts what it sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Wiener {
    /// Power of noise over that of the picture at a tenth of a cycle per pixel.
    pub noise: f32,
    /// Power of the frequency with which this grows.
    pub power: f32,
    /// Natural logarithms of the factors by which red, green and blue depart from this, at 1/64, 1/32, .. 1/2 cycles per pixel.
    pub curves: Curves,
}

impl Default for Wiener {
    /// For pictures of 16,000 electrons of white.
    fn default() -> Self {
        Self { noise: 3e-3, power: 2.0, curves: [[0.0; KNOTS]; CHANNELS] }
    }
}

/// Derivatives of a loss by the two inputs of [`Wiener::filters`].
#[derive(Clone, Debug, PartialEq)]
pub struct WienerGradient {
    /// By the kernels.
    pub kernels: PatchKernels,
    /// By [`Wiener::curves`].
    pub curves: Curves,
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
    ///
    /// A call that is cancelled ends within the time of a tile, with [`RenderError::Stopped`].
    pub fn restore(
        &self,
        geometry: &RenderGeometry,
        bank: &PsfBank,
        picture: &LinearImage,
        placement: Placement,
        cancel: &Cancel,
    ) -> Result<LinearImage, RenderError> {
        let layout = bank.layout();
        geometry.validate()?;
        check_placement(geometry, placement, picture.height, picture.width)?;
        let window = Window { placement, height: picture.height, width: picture.width };
        let active = geometry.active_patches(&window);
        let kernels = patch_kernels(geometry, &layout, &bank.values, &active)?;
        let filters = self.filters(&kernels);
        cancel.check()?;
        let padded = picture.pad_replicate(filters.radius);
        render_kernels_unless(cancel, geometry, &filters, &padded, placement)
    }

    /// The filters of kernels.
    pub fn filters(&self, kernels: &PatchKernels) -> PatchKernels {
        let n = side(kernels.radius);
        let plan = &plans(std::iter::once((n, n)))[&(n, n)];
        let spectrum_of_noise = Regularisation::new(self, n);
        let reach = n / 2 - 1;
        let (per_kernel, per_filter) = (kernels.size().pow(2), (2 * reach + 1).pow(2));
        let mut values = vec![0.0; kernels.values.len() / per_kernel * per_filter];
        let pairs = kernels.values.par_chunks_exact(per_kernel).zip(values.par_chunks_exact_mut(per_filter));
        pairs.enumerate().for_each_init(Scratch::default, |scratch, (i, (kernel, filter))| {
            let mut spectrum = transform(plan, kernel, kernels.radius, scratch);
            for (k, p) in spectrum.iter_mut().zip(&spectrum_of_noise.values[i % CHANNELS]) {
                *k = k.conj() / (k.norm_sqr() + p);
            }
            back(plan, &mut spectrum, reach, scratch, filter);
        });
        PatchKernels { radius: reach, patches: kernels.patches.clone(), values }
    }

    /// The derivatives by kernels and curves from those by their [filters](Wiener::filters).
    ///
    /// With `D = |K|^2 + P`: `dG = conj(dK) P / D^2 - conj(K)^2 dK / D^2 - conj(K) dP / D^2` and `dP = P ds`. The derivatives by the
    /// kernels are zero unless `with_kernels`.
    pub fn filters_adjoint(
        &self,
        kernels: &PatchKernels,
        d_filters: &PatchKernels,
        with_kernels: bool,
    ) -> WienerGradient {
        let n = side(kernels.radius);
        let plan = &plans(std::iter::once((n, n)))[&(n, n)];
        let spectrum_of_noise = Regularisation::new(self, n);
        let (per_kernel, per_filter) = (kernels.size().pow(2), d_filters.size().pow(2));
        let mut values = vec![0.0; kernels.values.len()];
        let sources =
            kernels.values.par_chunks_exact(per_kernel).zip(d_filters.values.par_chunks_exact(per_filter));
        let pull = |scratch: &mut Scratch, i: usize, kernel: &[f32], bar: &[f32], out: &mut [f32]| {
            let prior = &spectrum_of_noise.values[i % CHANNELS];
            let spectrum = transform(plan, kernel, kernels.radius, scratch);
            let mut by_spectrum = transform(plan, bar, d_filters.radius, scratch);
            let mut by_knot = [0.0f64; KNOTS];
            for (j, (bar, k)) in by_spectrum.iter_mut().zip(&spectrum).enumerate() {
                let square = (k.norm_sqr() + prior[j]).powi(2);
                // Every frequency that is not its own mirror image stands for two.
                let twice = if j / n == 0 || j / n == n / 2 { 1.0 } else { 2.0 };
                let by_curve = -twice * (*bar * *k).re * prior[j] / square;
                let (knot, upper) = spectrum_of_noise.between[j];
                by_knot[knot] += f64::from((1.0 - upper) * by_curve);
                by_knot[knot + 1] += f64::from(upper * by_curve);
                // The conjugate of the derivative, so that the inverse transform stands for the forward one.
                *bar = (*bar * prior[j] - bar.conj() * k.conj() * k.conj()).conj() / square;
            }
            if with_kernels {
                back(plan, &mut by_spectrum, kernels.radius, scratch, out);
            }
            (i % CHANNELS, by_knot)
        };
        let parts: Vec<(usize, [f64; KNOTS])> = (sources.zip(values.par_chunks_exact_mut(per_kernel)))
            .enumerate()
            .map_init(Scratch::default, |scratch, (i, ((kernel, bar), out))| {
                pull(scratch, i, kernel, bar, out)
            })
            .collect();
        // Add the patches in fixed order.
        let mut sums = [[0.0f64; KNOTS]; CHANNELS];
        for (colour, by_knot) in parts {
            sums[colour].iter_mut().zip(by_knot).for_each(|(sum, part)| *sum += part);
        }
        let curves = sums.map(|curve| curve.map(|sum| (sum / (n * n) as f64) as f32));
        WienerGradient { kernels: PatchKernels { values, ..kernels.clone() }, curves }
    }
}

/// The transform in which kernels of a radius are inverted, for those who invert them elsewhere.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub(crate) struct WienerGrid {
    /// Side of the transform, even.
    pub side: usize,
    /// P without curves over a half spectrum, `[column bin][row]`.
    pub prior: Vec<f32>,
    /// The knot below each frequency, and the weight of the knot above it.
    pub between: Vec<(usize, f32)>,
}

#[cfg(any(feature = "wgpu", feature = "cuda"))]
impl Wiener {
    /// The grid of kernels of a radius.
    pub(crate) fn grid(&self, radius: usize) -> WienerGrid {
        let plain = Self { curves: [[0.0; KNOTS]; CHANNELS], ..*self };
        let Regularisation { values: [prior, ..], between } = Regularisation::new(&plain, side(radius));
        WienerGrid { side: side(radius), prior, between }
    }
}

/// P of the three colours over a half spectrum, `[column bin][row]`.
struct Regularisation {
    values: [Vec<f32>; CHANNELS],
    /// The knot below each frequency, and the weight of the knot above it.
    between: Vec<(usize, f32)>,
}

impl Regularisation {
    /// The regularisation for transforms of `n` x `n`.
    fn new(wiener: &Wiener, n: usize) -> Self {
        let frequency = |i: usize| {
            let (bin, row) = (i / n, i % n);
            (bin as f32).hypot(row.min(n - row) as f32) / n as f32
        };
        let frequencies: Vec<f32> = (0..(n / 2 + 1) * n).map(frequency).collect();
        let knot = |f: &f32| {
            let position = (f.log2() + KNOTS as f32).clamp(0.0, (KNOTS - 1) as f32);
            let lower = (position as usize).min(KNOTS - 2);
            (lower, position - lower as f32)
        };
        let between: Vec<(usize, f32)> = frequencies.iter().map(knot).collect();
        let values = wiener.curves.map(|curve| {
            let at = |(f, (knot, upper)): (&f32, &(usize, f32))| {
                let bend = (1.0 - upper) * curve[*knot] + upper * curve[knot + 1];
                wiener.noise * (10.0 * f).powf(wiener.power) * bend.exp()
            };
            frequencies.iter().zip(&between).map(at).collect()
        });
        Self { values, between }
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
        let restored = Wiener { noise: 1e-4, ..Wiener::default() }
            .restore(&GEOMETRY, &bank, &blurred, Placement::default(), &Cancel::default())
            .unwrap();
        let inner = |image: &LinearImage| image.crop(12, 12, 72, 104).unwrap().data;
        let before = psnr(&inner(&scene), &inner(&blurred)).unwrap();
        let after = psnr(&inner(&scene), &inner(&restored)).unwrap();
        assert!(after > before + 5.0, "{before} {after}");
        // Flat light stays as it is.
        let flat = LinearImage { data: vec![0.4; 3 * 96 * 128], ..scene };
        let same = Wiener::default()
            .restore(&GEOMETRY, &bank, &flat, Placement::default(), &Cancel::default())
            .unwrap();
        assert!(same.data.iter().all(|v| (v - 0.4).abs() < 4e-3));
    }

    #[test]
    fn a_window_with_surroundings_is_restored_as_the_whole_frame() {
        let bank = bank(6.0, 1.6);
        let border = kernel_radius(&GEOMETRY, &bank.layout()).unwrap();
        let blurred = render(&GEOMETRY, &bank, &scene(96, 128).pad_replicate(border), Placement::default());
        let blurred = blurred.unwrap();
        let restore = |picture: &LinearImage, placement: Placement| {
            Wiener::default().restore(&GEOMETRY, &bank, picture, placement, &Cancel::default()).unwrap()
        };
        let whole = restore(&blurred, Placement::default()).crop(32, 48, 32, 32).unwrap().data;
        let of_window = |surround: usize| {
            let (row, col, side) = (32 - surround, 48 - surround, 32 + 2 * surround);
            let window = blurred.crop(row, col, side, side).unwrap();
            restore(&window, Placement { row, col }).crop(surround, surround, 32, 32).unwrap().data
        };
        // Repeating the edge of a bare window is wrong; with surroundings the error is far below that of any picture.
        let error = |surround: usize| psnr(&whole, &of_window(surround)).unwrap();
        let found = [0, 4, 8, 16].map(error);
        assert!(found[0] < 50.0 && found[2] > 55.0 && found[3] > 70.0, "{found:?}");
    }

    #[test]
    fn filters_have_the_gradient_of_differences() {
        let bank = bank(3.5, 1.4);
        let kernels = patch_kernels(&GEOMETRY, &bank.layout(), &bank.values, &[true; 12]).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut noise = |n: usize| -> Vec<f32> { (0..n).map(|_| random.random::<f32>() - 0.5).collect() };
        let mut curves = |scale: f32| -> Curves {
            let mut curves = [[0.0; KNOTS]; CHANNELS];
            curves.as_flattened_mut().copy_from_slice(&noise(CHANNELS * KNOTS));
            curves.map(|curve| curve.map(|v| scale * v))
        };
        let wiener = Wiener { noise: 0.03, curves: curves(1.0), ..Wiener::default() };
        let bent = curves(2.0);
        let filters = wiener.filters(&kernels);
        let bar = PatchKernels { values: noise(filters.values.len()), ..filters.clone() };
        let change = noise(kernels.values.len());
        let dot = |a: &[f32], b: &[f32]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let loss = |values: Vec<f32>, wiener: &Wiener| {
            dot(&wiener.filters(&PatchKernels { values, ..kernels.clone() }).values, &bar.values)
        };
        let found = wiener.filters_adjoint(&kernels, &bar, true);
        // By the kernels, along one direction.
        let moved = |step: f32| {
            let values = kernels.values.iter().zip(&change).map(|(k, d)| k + step * d).collect();
            loss(values, &wiener)
        };
        let (found_kernels, wanted) =
            (dot(&found.kernels.values, &change), (moved(1e-3) - moved(-1e-3)) / 2e-3);
        assert!((found_kernels / wanted - 1.0).abs() < 0.01, "{found_kernels} {wanted}");
        // By the curves: along one direction, and at every knot of a colour.
        let along = |direction: &Curves, h: f32| {
            let mut curves = wiener.curves;
            let flat = curves.as_flattened_mut().iter_mut().zip(direction.as_flattened());
            flat.for_each(|(v, d)| *v += h * d);
            loss(kernels.values.clone(), &Wiener { curves, ..wiener })
        };
        let difference = |direction: &Curves| (along(direction, 0.02) - along(direction, -0.02)) / 0.04;
        let (found_curves, wanted) =
            (dot(found.curves.as_flattened(), bent.as_flattened()), difference(&bent));
        assert!((found_curves / wanted - 1.0).abs() < 0.01, "{found_curves} {wanted}");
        for knot in 0..KNOTS {
            let mut one = [[0.0; KNOTS]; CHANNELS];
            one[2][knot] = 1.0;
            let (found, wanted) = (f64::from(found.curves[2][knot]), difference(&one));
            assert!((found - wanted).abs() < 0.01 * wanted.abs() + 0.02, "{knot}: {found} {wanted}");
        }
    }

    #[test]
    fn a_bent_curve_restores_less_where_it_is_higher() {
        let bank = bank(4.0, 1.0);
        let kernels = patch_kernels(&GEOMETRY, &bank.layout(), &bank.values, &[true; 12]).unwrap();
        // The gain of the filter at some cycles per pixel along a row.
        let gain = |wiener: &Wiener, colour: usize, f: f32| {
            let filters = wiener.filters(&kernels);
            let (size, reach) = (filters.size(), filters.radius as f32);
            let at = |i: usize, v: &f32| v * (std::f32::consts::TAU * f * ((i % size) as f32 - reach)).cos();
            filters.kernel(5, colour).iter().enumerate().map(|(i, v)| at(i, v)).sum::<f32>()
        };
        let plain = Wiener { noise: 0.01, ..Wiener::default() };
        let mut curves = plain.curves;
        curves[1] = [0.0, 0.0, 0.0, 2.0, 2.0, 2.0];
        let bent = Wiener { curves, ..plain };
        for colour in 0..CHANNELS {
            assert!((gain(&bent, colour, 0.0) - 1.0).abs() < 0.01);
            let (before, after) = (gain(&plain, colour, 0.15), gain(&bent, colour, 0.15));
            assert!(if colour == 1 { after < 0.8 * before } else { after == before }, "{before} {after}");
        }
    }
}
