//! Restoration on a device: Wiener filters of the kernels of patches by Fourier sums, and their convolution with the pictures.
//!
//! Transforms are sums by rows and columns with a table of the unit circle: those of a few hundred small kernels cost less than the
//! convolution with the filters that they give. Spectra are half ones, `[column bin][row]`, real and imaginary part in turn.

use burn::backend::{DispatchTensor, TensorMetadata};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::convolve::{Blend, whole};
use super::draws::exp;
use super::render::by_psfs;
use super::{buffers, empty, given, groups, numbers, read, taken, words};
use crate::image::CHANNELS;
use crate::render::{KNOTS, PatchKernels, WienerGrid, patch_kernels};
use crate::tape::render_op::CHECKED;
use crate::tape::restore_op::RestoreKernel;
use crate::tape::{BackwardPass, DeviceForm, Restoration};

/// Kernels, filters and what leads from ones to the others.
struct Filters {
    blend: Blend,
    patches: Vec<usize>,
    radius: usize,
    grid: Grid,
    /// Of the kernels, and of their regularisation for each colour.
    spectra: CubeTensor,
    regularisation: CubeTensor,
    filters: CubeTensor,
}

/// A transform of `n` x `n`.
struct Grid {
    n: usize,
    /// How far filters reach.
    reach: usize,
    circle: CubeTensor,
    /// Regularisation without curves, and the knot below each frequency with the weight of the one above it.
    prior: CubeTensor,
    knots: CubeTensor,
    uppers: CubeTensor,
}

impl Grid {
    fn new(like: &CubeTensor, of: &WienerGrid) -> Self {
        let n = of.side;
        let turn = |i: usize| (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
        let circle: Vec<f32> = (0..n).map(turn).flat_map(|(sin, cos)| [cos as f32, sin as f32]).collect();
        let knots: Vec<u32> = of.between.iter().map(|b| b.0 as u32).collect();
        let uppers: Vec<f32> = of.between.iter().map(|b| b.1).collect();
        Self {
            n,
            reach: n / 2 - 1,
            circle: numbers(like, &circle),
            prior: numbers(like, &of.prior),
            knots: words(like, &knots),
            uppers: numbers(like, &uppers),
        }
    }

    /// Frequencies of a half spectrum.
    fn len(&self) -> usize {
        (self.n / 2 + 1) * self.n
    }

    /// Half spectra of kernels of a radius about their middles.
    fn transformed(&self, kernels: &CubeTensor, count: usize, radius: usize) -> CubeTensor {
        let (bins, side) = (self.n / 2 + 1, 2 * radius + 1);
        let lines = empty(kernels, [count * bins * side * 2]);
        let (cubes, dim) = groups(kernels, count * bins * side);
        let [from, circle, to] = buffers([kernels, &self.circle, &lines]);
        rows_forward::launch(&lines.client, cubes, dim, from, circle, to, self.n, radius);
        let spectra = empty(kernels, [count * self.len() * 2]);
        let (cubes, dim) = groups(kernels, count * self.len());
        let [from, circle, to] = buffers([&lines, &self.circle, &spectra]);
        cols_forward::launch(&lines.client, cubes, dim, from, circle, to, self.n, radius);
        spectra
    }

    /// The kernels of half spectra about their middles, as far as `radius`.
    fn back(&self, spectra: &CubeTensor, count: usize, radius: usize) -> CubeTensor {
        let (bins, side) = (self.n / 2 + 1, 2 * radius + 1);
        let lines = empty(spectra, [count * bins * side * 2]);
        let (cubes, dim) = groups(spectra, count * bins * side);
        let [from, circle, to] = buffers([spectra, &self.circle, &lines]);
        cols_inverse::launch(&lines.client, cubes, dim, from, circle, to, self.n, radius);
        let kernels = empty(spectra, [count * side * side]);
        let (cubes, dim) = groups(spectra, count * side * side);
        let [from, circle, to] = buffers([&lines, &self.circle, &kernels]);
        rows_inverse::launch(&lines.client, cubes, dim, from, circle, to, self.n, radius);
        kernels
    }
}

impl RestoreKernel {
    fn filters(&self, pictures: &CubeTensor, inputs: &[DispatchTensor]) -> Filters {
        let Restoration { wiener, layout, geometry, ready, placements } = &self.restoration;
        let [_, _, height, width] = self.shape;
        let made = match ready {
            Some(ready) => ready.of_patches(&self.active),
            None => patch_kernels(geometry, layout, &read(&taken(&inputs[1])), &self.active).expect(CHECKED),
        };
        let grid = Grid::new(pictures, &wiener.grid(made.radius));
        let kernels = numbers(pictures, &made.values);
        let count = made.patches.len() * CHANNELS;
        let regularisation = empty(pictures, [CHANNELS * grid.len()]);
        let (cubes, dim) = groups(pictures, CHANNELS * grid.len());
        let [curves, prior] = buffers([&taken(&inputs[3]), &grid.prior]);
        let [knots, uppers, to] = buffers([&grid.knots, &grid.uppers, &regularisation]);
        regularise::launch(&kernels.client, cubes, dim, curves, prior, knots, uppers, to);
        let spectra = grid.transformed(&kernels, count, made.radius);
        let inverse = empty(pictures, [count * grid.len() * 2]);
        let (cubes, dim) = groups(pictures, count * grid.len());
        let [of, by, to] = buffers([&spectra, &regularisation, &inverse]);
        invert::launch(&kernels.client, cubes, dim, of, by, to);
        let filters = grid.back(&inverse, count, grid.reach);
        let blend = Blend::new(pictures, geometry, &made.patches, placements, [height, width]);
        let (radius, patches) = (made.radius, made.patches);
        Filters { blend, patches, radius, grid, spectra, regularisation, filters }
    }

    /// Pictures with the surroundings that filters of a radius reach: their edges repeated.
    fn surrounded_on(&self, pictures: &CubeTensor, radius: usize) -> CubeTensor {
        let [batch, _, height, width] = self.shape;
        let out = empty(pictures, [batch, CHANNELS, height + 2 * radius, width + 2 * radius]);
        let (cubes, dim) = groups(pictures, out.shape().num_elements());
        let [from, to] = buffers([pictures, &out]);
        repeat_edges::launch(&out.client, cubes, dim, from, to, height, width, radius);
        out
    }
}

impl DeviceForm for RestoreKernel {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let pictures = taken(&inputs[0]);
        let Filters { blend, grid, filters, .. } = self.filters(&pictures, inputs);
        let seen = self.surrounded_on(&pictures, grid.reach);
        given(blend.convolved(&seen, &filters, grid.reach, whole(grid.reach)))
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { gradient, wanted, .. } = at;
        let Restoration { layout, geometry, .. } = &self.restoration;
        let [_, _, height, width] = self.shape;
        let (pictures, bar) = (taken(&inputs[0]), taken(gradient));
        let Filters { blend, patches, radius, grid, spectra, regularisation, filters } =
            self.filters(&pictures, inputs);
        let reach = grid.reach;
        // By the pictures: the transpose of the convolution, and of the repeated edges.
        let by_pictures = wanted[0].then(|| {
            let by_seen = blend.by_scenes(&bar, &filters, reach, whole(reach));
            let out = empty(&pictures, self.shape);
            let (cubes, dim) = groups(&pictures, self.shape.iter().product());
            let [from, to] = buffers([&by_seen, &out]);
            fold_edges::launch(&out.client, cubes, dim, from, to, height, width, reach);
            given(out)
        });
        if !wanted[1..].contains(&true) {
            return vec![by_pictures, None, None, None];
        }
        // By the filters, then by their spectra.
        let by_filters = blend.by_kernels(&self.surrounded_on(&pictures, reach), &bar, reach);
        let count = patches.len() * CHANNELS;
        let by_spectra = grid.transformed(&by_filters, count, reach);
        // By the curves: what each frequency of each kernel adds to the knots around it, summed along columns, then over all.
        let by_curves = wanted[3].then(|| {
            let bins = grid.n / 2 + 1;
            let parts = empty(&pictures, [count * bins * KNOTS]);
            let (cubes, dim) = groups(&pictures, count * bins);
            let [bars, of, by] = buffers([&by_spectra, &spectra, &regularisation]);
            let [knots, uppers, to] = buffers([&grid.knots, &grid.uppers, &parts]);
            curves_back::launch(&parts.client, cubes, dim, bars, of, by, knots, uppers, to, grid.n);
            let out = empty(&pictures, [CHANNELS, KNOTS]);
            let (cubes, dim) = groups(&pictures, CHANNELS * KNOTS);
            let [from, to] = buffers([&parts, &out]);
            add_curves::launch(&out.client, cubes, dim, from, to, bins, 1.0 / (grid.n * grid.n) as f32);
            given(out)
        });
        let [mut by_values, mut by_radii] = [None, None];
        if wanted[1] || wanted[2] {
            let by_kernels = empty(&pictures, [count * grid.len() * 2]);
            let (cubes, dim) = groups(&pictures, count * grid.len());
            let [bars, of, by, to] = buffers([&by_spectra, &spectra, &regularisation, &by_kernels]);
            invert_back::launch(&by_kernels.client, cubes, dim, bars, of, by, to);
            drop((by_spectra, spectra, regularisation));
            let values = read(&grid.back(&by_kernels, count, radius));
            let d_kernels = PatchKernels { radius, patches, values };
            [by_values, by_radii] =
                by_psfs(&taken(&inputs[1]), (geometry, layout), &d_kernels, [wanted[1], wanted[2]]);
        }
        vec![by_pictures, by_values, by_radii, by_curves]
    }
}

/// The regularisation of three colours: the prior, bent by the curves.
#[cube(launch)]
fn regularise(curves: &[f32], prior: &[f32], knots: &[u32], uppers: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at < out.len() {
        let j = at % prior.len();
        let curve = at / prior.len() * KNOTS + knots[j] as usize;
        let bend = curves[curve] + uppers[j] * (curves[curve + 1] - curves[curve]);
        out[at] = prior[j] * exp(bend);
    }
}

/// Transform along the rows of kernels: `[kernel][bin][row of the kernel]`.
#[cube(launch)]
fn rows_forward(kernels: &[f32], circle: &[f32], lines: &mut [f32], n: usize, radius: usize) {
    let at = ABSOLUTE_POS;
    if 2 * at < lines.len() {
        let side = 2 * radius + 1;
        let bins = n / 2 + 1;
        let row = at % side;
        let bin = at / side % bins;
        let from = (at / (side * bins) * side + row) * side;
        let mut real = 0.0f32;
        let mut imaginary = 0.0f32;
        for col in 0..side {
            let turn = bin * (col + n - radius) % n;
            real += kernels[from + col] * circle[2 * turn];
            imaginary -= kernels[from + col] * circle[2 * turn + 1];
        }
        lines[2 * at] = real;
        lines[2 * at + 1] = imaginary;
    }
}

/// Transform along the columns: `[kernel][bin][row of the transform]`.
#[cube(launch)]
fn cols_forward(lines: &[f32], circle: &[f32], spectra: &mut [f32], n: usize, radius: usize) {
    let at = ABSOLUTE_POS;
    if 2 * at < spectra.len() {
        let side = 2 * radius + 1;
        let frequency = at % n;
        let from = at / n * side;
        let mut real = 0.0f32;
        let mut imaginary = 0.0f32;
        for row in 0..side {
            let turn = frequency * (row + n - radius) % n;
            let cos = circle[2 * turn];
            let sin = circle[2 * turn + 1];
            let a = lines[2 * (from + row)];
            let b = lines[2 * (from + row) + 1];
            real += a * cos + b * sin;
            imaginary += b * cos - a * sin;
        }
        spectra[2 * at] = real;
        spectra[2 * at + 1] = imaginary;
    }
}

/// Inverse transform along the columns, not normalised: `[kernel][bin][row of the kernel]`.
#[cube(launch)]
fn cols_inverse(spectra: &[f32], circle: &[f32], lines: &mut [f32], n: usize, radius: usize) {
    let at = ABSOLUTE_POS;
    if 2 * at < lines.len() {
        let side = 2 * radius + 1;
        let row = at % side;
        let from = at / side * n;
        let mut real = 0.0f32;
        let mut imaginary = 0.0f32;
        for frequency in 0..n {
            let turn = frequency * (row + n - radius) % n;
            let cos = circle[2 * turn];
            let sin = circle[2 * turn + 1];
            let a = spectra[2 * (from + frequency)];
            let b = spectra[2 * (from + frequency) + 1];
            real += a * cos - b * sin;
            imaginary += b * cos + a * sin;
        }
        lines[2 * at] = real;
        lines[2 * at + 1] = imaginary;
    }
}

/// Inverse transform along the rows, normalised: the kernels.
#[cube(launch)]
fn rows_inverse(lines: &[f32], circle: &[f32], kernels: &mut [f32], n: usize, radius: usize) {
    let at = ABSOLUTE_POS;
    if at < kernels.len() {
        let side = 2 * radius + 1;
        let bins = n / 2 + 1;
        let col = at % side;
        let row = at / side % side;
        let from = at / (side * side) * bins * side + row;
        let mut sum = 0.0f32;
        for bin in 0..bins {
            let turn = bin * (col + n - radius) % n;
            let i = 2 * (from + bin * side);
            // Every bin that is not its own mirror image stands for two. The ends are real.
            let mut part = lines[i] * circle[2 * turn];
            if bin > 0 && bin < n / 2 {
                part = 2.0f32 * (part - lines[i + 1] * circle[2 * turn + 1]);
            }
            sum += part;
        }
        kernels[at] = sum / f32::cast_from((n * n) as u32);
    }
}

/// The spectra of filters: `conj(K) / (|K|^2 + P)`.
#[cube(launch)]
fn invert(spectra: &[f32], regularisation: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if 2 * at < spectra.len() {
        let len = regularisation.len() / CHANNELS;
        let p = regularisation[at / len % CHANNELS * len + at % len];
        let real = spectra[2 * at];
        let imaginary = spectra[2 * at + 1];
        let divisor = real * real + imaginary * imaginary + p;
        out[2 * at] = real / divisor;
        out[2 * at + 1] = -imaginary / divisor;
    }
}

/// The conjugate of the derivative by the spectrum of a kernel, from that by the spectrum of its filter: see
/// [`Wiener::filters_adjoint`](crate::render::Wiener::filters_adjoint).
#[cube(launch)]
fn invert_back(bars: &[f32], spectra: &[f32], regularisation: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if 2 * at < spectra.len() {
        let len = regularisation.len() / CHANNELS;
        let p = regularisation[at / len % CHANNELS * len + at % len];
        let a = spectra[2 * at];
        let b = spectra[2 * at + 1];
        let x = bars[2 * at];
        let y = bars[2 * at + 1];
        let divisor = a * a + b * b + p;
        let square = divisor * divisor;
        // conj(K)^2, and with it conj(bar) conj(K)^2.
        let c = a * a - b * b;
        let d = -2.0f32 * a * b;
        out[2 * at] = (x * p - (x * c + y * d)) / square;
        out[2 * at + 1] = -(y * p - (x * d - y * c)) / square;
    }
}

/// What the frequencies of one bin of one kernel add to the derivatives by the knots.
#[cube(launch)]
fn curves_back(
    bars: &[f32],
    spectra: &[f32],
    regularisation: &[f32],
    knots: &[u32],
    uppers: &[f32],
    parts: &mut [f32],
    n: usize,
) {
    let at = ABSOLUTE_POS;
    if at * KNOTS < parts.len() {
        let len = regularisation.len() / CHANNELS;
        let bins = n / 2 + 1;
        let bin = at % bins;
        let kernel = at / bins;
        let twice = select(bin == 0 || bin == n / 2, 1.0f32, 2.0f32);
        for knot in 0..KNOTS {
            parts[at * KNOTS + knot] = 0.0f32;
        }
        for frequency in 0..n {
            let j = bin * n + frequency;
            let i = 2 * (kernel * len + j);
            let p = regularisation[kernel % CHANNELS * len + j];
            let a = spectra[i];
            let b = spectra[i + 1];
            let divisor = a * a + b * b + p;
            let by_curve = -twice * (bars[i] * a - bars[i + 1] * b) * p / (divisor * divisor);
            let knot = at * KNOTS + knots[j] as usize;
            parts[knot] += (1.0f32 - uppers[j]) * by_curve;
            parts[knot + 1] += uppers[j] * by_curve;
        }
    }
}

/// The derivative by one knot of one colour: the sum over patches and bins.
#[cube(launch)]
fn add_curves(parts: &[f32], out: &mut [f32], bins: usize, scale: f32) {
    let at = ABSOLUTE_POS;
    if at < out.len() {
        let colour = at / KNOTS;
        let patches = parts.len() / (CHANNELS * bins * KNOTS);
        let mut sum = 0.0f32;
        for patch in 0..patches {
            let mut of_patch = 0.0f32;
            for bin in 0..bins {
                of_patch += parts[((patch * CHANNELS + colour) * bins + bin) * KNOTS + at % KNOTS];
            }
            sum += of_patch;
        }
        out[at] = sum * scale;
    }
}

/// Pictures with a border of repeated edges.
#[cube(launch)]
fn repeat_edges(pictures: &[f32], out: &mut [f32], height: usize, width: usize, radius: usize) {
    let at = ABSOLUTE_POS;
    if at < out.len() {
        let stride = width + 2 * radius;
        let rows = height + 2 * radius;
        let col = min(max(at % stride, radius) - radius, width - 1);
        let row = min(max(at / stride % rows, radius) - radius, height - 1);
        out[at] = pictures[(at / (stride * rows) * height + row) * width + col];
    }
}

/// The transpose of [`repeat_edges`]: an edge gathers what repeats it.
#[cube(launch)]
fn fold_edges(bars: &[f32], out: &mut [f32], height: usize, width: usize, radius: usize) {
    let at = ABSOLUTE_POS;
    if at < out.len() {
        let stride = width + 2 * radius;
        let rows = height + 2 * radius;
        let col = at % width;
        let row = at / width % height;
        let base = at / (width * height) * rows * stride;
        let first_row = select(row == 0, 0, row + radius);
        let end_row = select(row == height - 1, rows, row + radius + 1);
        let first_col = select(col == 0, 0, col + radius);
        let end_col = select(col == width - 1, stride, col + radius + 1);
        let mut sum = 0.0f32;
        for r in first_row..end_row {
            for c in first_col..end_col {
                sum += bars[base + r * stride + c];
            }
        }
        out[at] = sum;
    }
}
