//! The diffraction PSF: the Fourier transform of the wave over direction cosines, on any grid of the image plane.
//!
//! The transform is two matrix products whose rows are the points of the image grid. It needs no interpolation, and the
//! sampling of the pupil does not determine the pitch (Soummer et al., Opt. Express 15, 15935 (2007)).

use std::f64::consts::TAU;

use super::map::{WaveMap, WavePoint, WavePointBar};
use super::matrix::Complex;
use crate::gradient::LensGradient;
use crate::trace::Sequence;

/// Period of the sampled wave's image, divided by the extent of the image.
const ROOM: f64 = 2.5;

/// Half-width of the soft rim of the stop, in nodes of a pupil that fills the grid.
const SOFT_NODES: f64 = 0.7;

/// Least such ratio: with a smaller one, light from one edge would appear at the other.
const LEAST_ROOM: f64 = 2.0;

/// Least and greatest number of nodes across the pupil. The greatest is enough for a lens of f/3.3 whose rays land up to 1 mm from the
/// chief ray, the grid of the PSF included; time and memory grow with its square.
const NODES: [usize; 2] = [224, 1536];

/// Largest distance of the samples over which a pixel is averaged, as a share of `wavelength / (2 NA)`, the finest
/// detail of a PSF.
const FINEST: f64 = 0.5;

/// A grid on the image plane about an origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageGrid {
    pub cells: usize,
    pub pitch_mm: f64,
}

/// One wavelength.
pub(crate) struct WaveChannel {
    pub(super) map: WaveMap,
    /// Nodes a side.
    pub(super) nodes: usize,
    /// 2 pi over the wavelength, 1/mm.
    pub(super) wavenumber: f64,
}

/// The wave on the nodes of the pupil grid.
pub(super) struct Nodes {
    pub points: Vec<WavePoint>,
    /// `(column, row)`
    pub wave: Complex,
}

/// The PSF of a channel.
pub(crate) struct Shown {
    /// Energy per pixel, row by row; the whole PSF has 1.
    pub values: Vec<f64>,
    /// Light per ideal image area.
    pub density: f64,
}

impl WaveChannel {
    /// A wave whose image is free of repetitions up to `beyond_mm` from the rays. `None` if polynomials do not describe
    /// the wave, see [`WaveMap::new`], or if it spreads over more than the finest grid can hold.
    pub fn new(
        sequence: &Sequence,
        field_rad: f64,
        stop_radius_mm: f64,
        chief_mm: [f64; 2],
        beyond_mm: f64,
        like: Option<&Self>,
    ) -> Option<Self> {
        let like = like.map(|channel| &channel.map);
        let map = WaveMap::new(sequence, field_rad, stop_radius_mm, chief_mm, like)?;
        // Choose the spacing of the nodes: the image repeats after wavelength / spacing, and one period must contain
        // the grid and all rays.
        let reach = (0..2).map(|axis| {
            let of = [&map.samples.x, &map.samples.y][axis];
            of.iter().map(|v| (v - chief_mm[axis]).abs()).fold(0.0, f64::max) + beyond_mm
        });
        let reach = reach.fold(0.0, f64::max);
        let wavelength_mm = 1e-3 * sequence.wavelength_um;
        let spacing = wavelength_mm / (map.n_image.abs() * ROOM * reach);
        let needed = map.scale.iter().map(|s| (2.0 * s / spacing).ceil() as usize).max()?;
        if needed as f64 > NODES[1] as f64 * ROOM / LEAST_ROOM {
            return None;
        }
        // Round the number of nodes up to a multiple of 16, so that small changes of a lens do not change it.
        let nodes = needed.next_multiple_of(16).clamp(NODES[0], NODES[1]);
        Some(Self { map, nodes, wavenumber: TAU / wavelength_mm })
    }

    /// The degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.map.samples.basis.degree
    }

    /// Coordinate of a node.
    pub(super) fn q(&self, i: usize) -> f64 {
        (2.0 * i as f64 + 1.0) / self.nodes as f64 - 1.0
    }

    fn cell(&self) -> f64 {
        2.0 / self.nodes as f64
    }

    /// Softness of the rim of the stop, as a share of its radius.
    fn soft(&self) -> f64 {
        SOFT_NODES * self.cell()
    }

    /// Softness of the rim of the stop in nodes.
    pub(super) fn soft_nodes(&self) -> f64 {
        SOFT_NODES
    }

    /// Whether the half `q_x > 0` is enough.
    fn is_half(&self) -> bool {
        self.map.samples.sides == crate::pupil::Sides::Mirrored
    }

    /// Columns to evaluate; in a symmetric lens the others are their mirror images.
    pub(super) fn columns(&self) -> std::ops::Range<usize> {
        if self.is_half() { self.nodes / 2..self.nodes } else { 0..self.nodes }
    }

    /// The wave on all nodes.
    pub(super) fn nodes(&self) -> Nodes {
        let n = self.nodes;
        let mut nodes = Nodes { points: vec![WavePoint::default(); n * n], wave: Complex::zeros(n, n) };
        for j in 0..n {
            let row = self.map.row(self.q(j));
            for i in self.columns() {
                let point = self.map.point(&row, self.q(i), self.soft());
                let (sin, cos) = (self.wavenumber * point.path_mm).sin_cos();
                for column in self.images_of(i) {
                    nodes.points[j * n + column] = point;
                    nodes.wave.re[(column, j)] = point.amplitude * cos;
                    nodes.wave.im[(column, j)] = point.amplitude * sin;
                }
            }
        }
        nodes
    }

    /// A column and its mirror image.
    pub(super) fn images_of(&self, column: usize) -> impl Iterator<Item = usize> + use<> {
        let mirrored = self.is_half().then_some(self.nodes - 1 - column);
        std::iter::once(column).chain(mirrored)
    }

    /// Samples per pixel and axis.
    fn samples_per_pixel(&self, grid: ImageGrid) -> usize {
        let aperture = self.map.scale.iter().fold(0.0_f64, |a, b| a.max(*b)) / 1.1;
        let finest = TAU / self.wavenumber / (2.0 * aperture * self.map.n_image.abs());
        ((grid.pitch_mm / (FINEST * finest)).ceil() as usize).max(1)
    }

    /// Phases from nodes to points of the image along one axis: `[point, node]`.
    fn kernel(&self, axis: usize, grid: ImageGrid, per_pixel: usize) -> Complex {
        let places = grid.cells * per_pixel;
        let pitch = grid.pitch_mm / per_pixel as f64;
        let place: Vec<f64> = (0..places)
            .map(|g| (g as f64 - 0.5 * (places as f64 - 1.0)) * pitch * self.wavenumber * self.map.n_image)
            .collect();
        let cosine: Vec<f64> = (0..self.nodes).map(|i| self.map.scale[axis] * self.q(i)).collect();
        Complex::phases(&place, &cosine)
    }

    /// Energy of a unit of `|E|^2` on a sample of the image, as a share of the total energy.
    fn energy_per_sample(&self, grid: ImageGrid, per_pixel: usize) -> f64 {
        let [a, b] = self.map.scale;
        let per_mm = self.wavenumber * self.map.n_image.abs() / TAU;
        // By Parseval's theorem the integral of |E|^2 is that of the light over q, divided by the scales per wavelength.
        let sample = grid.pitch_mm / per_pixel as f64;
        sample * sample * per_mm * per_mm * a * b
    }

    /// The PSF and the light per ideal image area.
    pub fn show(&self, grid: ImageGrid) -> Shown {
        // Transform the wave to the image, and add |E|^2 of the samples of each pixel.
        let nodes = self.nodes();
        let (field, per_pixel) = self.field(&nodes.wave, grid);
        let area = self.cell() * self.cell();
        let density = nodes.points.iter().map(|p| p.light).sum::<f64>() * area;
        let all = nodes.points.iter().map(|p| p.energy).sum::<f64>() * area;
        let unit = self.energy_per_sample(grid, per_pixel) * area * area / all;
        let mut values = vec![0.0; grid.cells * grid.cells];
        for y in 0..grid.cells * per_pixel {
            for x in 0..grid.cells * per_pixel {
                let energy = field.re[(x, y)].powi(2) + field.im[(x, y)].powi(2);
                values[y / per_pixel * grid.cells + x / per_pixel] += unit * energy;
            }
        }
        Shown { values, density }
    }

    /// Amplitudes on the image, without the area of a node: `[x, y]`.
    fn field(&self, wave: &Complex, grid: ImageGrid) -> (Complex, usize) {
        let per_pixel = self.samples_per_pixel(grid);
        let [x, y] = [0, 1].map(|axis| self.kernel(axis, grid, per_pixel));
        (x.times(wave).times(&y.transpose()), per_pixel)
    }

    /// Adds the gradient of a loss whose derivatives by [`Shown::values`] and the light are given; returns the
    /// derivatives by the position of the chief ray and by the stop radius.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        grid: ImageGrid,
        values_bar: &[f64],
        density_bar: f64,
        gradient: &mut LensGradient,
    ) -> ([f64; 2], f64) {
        let nodes = self.nodes();
        let (field, per_pixel) = self.field(&nodes.wave, grid);
        let area = self.cell() * self.cell();
        let all = nodes.points.iter().map(|p| p.energy).sum::<f64>() * area;
        let unit = self.energy_per_sample(grid, per_pixel) * area * area / all;
        // Differentiate |E|^2: E_bar = 2 bar E. The values are also divided by the energy of all nodes.
        let places = grid.cells * per_pixel;
        let (mut field_bar, mut by_all) = (Complex::zeros(places, places), 0.0);
        for y in 0..places {
            for x in 0..places {
                let bar = unit * values_bar[y / per_pixel * grid.cells + x / per_pixel];
                let (re, im) = (field.re[(x, y)], field.im[(x, y)]);
                field_bar.re[(x, y)] = 2.0 * bar * re;
                field_bar.im[(x, y)] = 2.0 * bar * im;
                by_all -= bar * (re * re + im * im);
            }
        }
        // Transform back to the nodes.
        let [x, y] = [0, 1].map(|axis| self.kernel(axis, grid, per_pixel).conjugate());
        let wave_bar = x.transpose().times(&field_bar).times(&y);

        let n = self.nodes;
        let mut sums = self.map.zero_cotangent();
        // The index behind the lens enters the phases k n' x.d. It is constant if the medium is air.
        if (self.map.n_image.abs() - 1.0).abs() > 1e-9 {
            sums.n_image += self.by_index(&nodes.wave, &field_bar, grid, per_pixel)
                + 2.0 * self.energy_by_index(values_bar, &field, unit, grid, per_pixel);
        }
        // From amplitude and phase of each node to the coefficients of the wave.
        for j in 0..n {
            let row = self.map.row(self.q(j));
            let mut row_bar = self.map.zero_row(&row);
            for i in self.columns() {
                let mut bar = WavePointBar::default();
                for column in self.images_of(i) {
                    let point = &nodes.points[j * n + column];
                    let (sin, cos) = (self.wavenumber * point.path_mm).sin_cos();
                    let (re, im) = (wave_bar.re[(column, j)], wave_bar.im[(column, j)]);
                    bar.amplitude += re * cos + im * sin;
                    bar.energy += by_all / all * area;
                    bar.path += self.wavenumber * point.amplitude * (im * cos - re * sin);
                    bar.light += density_bar * area;
                }
                self.map.pull_back_point(&row, self.q(i), self.soft(), bar, &mut row_bar, &mut sums);
            }
            self.map.pull_back_row(&row_bar, self.q(j), &mut sums);
        }
        let by_stop = self.map.pull_back(sequence, &mut sums, gradient);
        (sums.origin, by_stop)
    }

    /// Derivative of the field by the index behind the lens, through the phases from nodes to points of the image.
    fn by_index(&self, wave: &Complex, field_bar: &Complex, grid: ImageGrid, per_pixel: usize) -> f64 {
        // d/dn' of sum A exp(i k n' (x l + y m)), l and m minus their middles.
        let [x, y] = [0, 1].map(|axis| self.kernel(axis, grid, per_pixel));
        let places = grid.cells * per_pixel;
        let pitch = grid.pitch_mm / per_pixel as f64;
        let place = |g: usize| (g as f64 - 0.5 * (places as f64 - 1.0)) * pitch * self.wavenumber;
        let tilted = |axis: usize| {
            let mut tilted = wave.clone();
            for j in 0..self.nodes {
                for i in 0..self.nodes {
                    let cosine = self.map.scale[axis] * self.q(if axis == 0 { i } else { j });
                    tilted.re[(i, j)] *= cosine;
                    tilted.im[(i, j)] *= cosine;
                }
            }
            x.times(&tilted).times(&y.transpose())
        };
        let [by_x, by_y] = [tilted(0), tilted(1)];
        let mut sum = 0.0;
        for h in 0..places {
            for g in 0..places {
                // i (x l + y m): its real and imaginary part.
                let re = -(place(g) * by_x.im[(g, h)] + place(h) * by_y.im[(g, h)]);
                let im = place(g) * by_x.re[(g, h)] + place(h) * by_y.re[(g, h)];
                sum += field_bar.re[(g, h)] * re + field_bar.im[(g, h)] * im;
            }
        }
        sum
    }

    /// Half of the derivative of the energy of a sample by the index behind the lens.
    fn energy_by_index(
        &self,
        values_bar: &[f64],
        field: &Complex,
        unit: f64,
        grid: ImageGrid,
        per_pixel: usize,
    ) -> f64 {
        let mut sum = 0.0;
        for y in 0..grid.cells * per_pixel {
            for x in 0..grid.cells * per_pixel {
                let energy = field.re[(x, y)].powi(2) + field.im[(x, y)].powi(2);
                sum += values_bar[y / per_pixel * grid.cells + x / per_pixel] * unit * energy;
            }
        }
        sum / self.map.n_image
    }
}
