//! The diffraction PSF: the Fourier transform of the wave over direction cosines, on any grid of the image plane.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::map::WaveMap;
use super::matrix::Complex;
use super::nodes::{NodeGrid, NodeWave, NodeWaveBar};
use super::transform::{Columns, Transform};
use crate::gradient::LensGradient;
use crate::pupil::Sides;
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

    fn cell(&self) -> f64 {
        2.0 / self.nodes as f64
    }

    /// Softness of the rim of the stop in nodes.
    pub(super) fn soft_nodes(&self) -> f64 {
        SOFT_NODES
    }

    /// The nodes of the pupil.
    pub(super) fn grid(&self) -> NodeGrid {
        NodeGrid { nodes: self.nodes, soft: SOFT_NODES * self.cell(), wavenumber: self.wavenumber }
    }

    /// The columns that a wave on the nodes has.
    fn columns(&self) -> Columns {
        match self.map.samples.sides {
            Sides::Mirrored => Columns::Even,
            Sides::Both => Columns::All,
        }
    }

    /// Samples per pixel and axis. One sample is the value at the middle of the pixel, not its mean: at half of the cutoff the MTF is up to 11 %
    /// higher than that of means. Two samples are between. The manual states this; more samples would change PSFs of published results.
    fn samples_per_pixel(&self, grid: ImageGrid) -> usize {
        let aperture = self.map.scale.iter().fold(0.0_f64, |a, b| a.max(*b)) / 1.1;
        let finest = TAU / self.wavenumber / (2.0 * aperture * self.map.n_image.abs());
        ((grid.pitch_mm / (FINEST * finest)).ceil() as usize).max(1)
    }

    /// From the nodes to the samples of a grid.
    fn transform(&self, grid: ImageGrid, per_pixel: usize) -> Transform {
        let step_mm = grid.pitch_mm / per_pixel as f64;
        let wavenumber = self.wavenumber * self.map.n_image;
        Transform::new(grid.cells * per_pixel, step_mm, self.nodes, self.map.scale, wavenumber)
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
        let NodeWave { wave, light, energy } = self.grid().wave(&self.map);
        let per_pixel = self.samples_per_pixel(grid);
        let field = self.transform(grid, per_pixel).field(&wave, self.columns());
        let area = self.cell() * self.cell();
        let (density, all) = (light * area, energy * area);
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
        let NodeWave { wave, energy, .. } = self.grid().wave(&self.map);
        let per_pixel = self.samples_per_pixel(grid);
        let transform = self.transform(grid, per_pixel);
        let field = transform.field(&wave, self.columns());
        let area = self.cell() * self.cell();
        let all = energy * area;
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
        let wave_bar = match self.columns() {
            Columns::All => transform.pull_back(&field_bar),
            Columns::Even | Columns::Odd => transform.pull_back_even(&field_bar),
        };
        let mut sums = self.map.zero_cotangent();
        // The index behind the lens enters the phases k n' x.d. It is constant if the medium is air.
        if (self.map.n_image.abs() - 1.0).abs() > 1e-9 {
            sums.n_image += self.by_index(&wave, &transform, &field_bar, grid.pitch_mm / per_pixel as f64)
                + 2.0 * self.energy_by_index(values_bar, &field, unit, grid, per_pixel);
        }
        // From the wave on the nodes to the coefficients of its polynomials.
        let bar = NodeWaveBar { wave: &wave_bar, light: density_bar * area, energy: by_all / all * area };
        self.grid().pull_back(&self.map, bar, &mut sums);
        let by_stop = self.map.pull_back(sequence, &mut sums, gradient);
        (sums.origin, by_stop)
    }

    /// Changes of [`Shown`] along changes of the lens, of the logarithm of the stop radius and of the position of the chief ray, mm: the
    /// transpose of [`WaveChannel::pull_back`].
    pub fn push_forward(
        &self,
        sequence: &Sequence,
        grid: ImageGrid,
        change: &LensGradient,
        stop_growth: f64,
        chief_mm: [f64; 2],
    ) -> Shown {
        let moved = self.map.push_forward(sequence, change, stop_growth, chief_mm);
        let NodeWave { wave, energy, .. } = self.grid().wave(&self.map);
        let by = self.grid().push_forward(&self.map, &moved);
        // The transform is linear.
        let per_pixel = self.samples_per_pixel(grid);
        let transform = self.transform(grid, per_pixel);
        let field = transform.field(&wave, self.columns());
        let mut field_change = transform.field(&by.wave, self.columns());
        let area = self.cell() * self.cell();
        let unit = self.energy_per_sample(grid, per_pixel) * area / energy;
        let mut growth = -by.energy / energy;
        // The index behind the lens enters the phases k n' x.d and the energy of a sample. It is constant if the medium is air.
        if (self.map.n_image.abs() - 1.0).abs() > 1e-9 {
            let by_index = self.field_by_index(&wave, &transform, grid.pitch_mm / per_pixel as f64);
            field_change = Complex::add(&field_change, &by_index.scaled(moved.n_image));
            growth += 2.0 * moved.n_image / self.map.n_image;
        }
        // Differentiate |E|^2, and the energy of all nodes by which it is divided.
        let mut values = vec![0.0; grid.cells * grid.cells];
        for y in 0..grid.cells * per_pixel {
            for x in 0..grid.cells * per_pixel {
                let (re, im) = (field.re[(x, y)], field.im[(x, y)]);
                let by = 2.0 * (re * field_change.re[(x, y)] + im * field_change.im[(x, y)]);
                values[y / per_pixel * grid.cells + x / per_pixel] +=
                    unit * (by + growth * (re * re + im * im));
            }
        }
        Shown { values, density: by.light * area }
    }

    /// Derivative of a loss by the index behind the lens, through the phases from nodes to points of the image `step_mm` apart.
    fn by_index(&self, wave: &Complex, transform: &Transform, field_bar: &Complex, step_mm: f64) -> f64 {
        let by_index = self.field_by_index(wave, transform, step_mm);
        field_bar.re.dot(&by_index.re) + field_bar.im.dot(&by_index.im)
    }

    /// Derivative of the field by the index behind the lens, at the points of [`WaveChannel::by_index`].
    fn field_by_index(&self, wave: &Complex, transform: &Transform, step_mm: f64) -> Complex {
        // d/dn' of sum A exp(i k n' (x l + y m)), l and m minus their middles. The wave times l is odd where the wave is even.
        let (grid, first) = (self.grid(), self.grid().columns(self.map.samples.sides).start);
        let tilted = |axis: usize| {
            Complex::from_rows(wave, wave.re.nrows(), |of, c, j| {
                let node = if axis == 0 { first + c } else { j };
                of[(c, j)] * self.map.scale[axis] * grid.q(node)
            })
        };
        let (by_l, by_m) = match self.columns() {
            Columns::All => (Columns::All, Columns::All),
            Columns::Even | Columns::Odd => (Columns::Odd, Columns::Even),
        };
        let by_x = transform.field(&tilted(0), by_l);
        let by_y = transform.field(&tilted(1), by_m);
        let places = by_x.re.nrows();
        let place = |g: usize| (g as f64 - 0.5 * (places as f64 - 1.0)) * step_mm * self.wavenumber;
        // Multiply by i (x l + y m).
        let along = |x: &DMatrix<f64>, y: &DMatrix<f64>| {
            DMatrix::from_fn(places, places, |g, h| place(g) * x[(g, h)] + place(h) * y[(g, h)])
        };
        Complex { re: along(&by_x.re, &by_y.re), im: along(&by_x.im, &by_y.im) }.times_i()
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
