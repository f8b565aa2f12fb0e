//! The transfer function at one frequency as the overlap of two shifted copies of a wave, with its gradient.
//!
//! A grating of f cycles per mm on the image plane turns a direction cosine by `f wavelength / n'`. With this shift s along x for sagittal
//! structures, or along y for tangential ones, `O(f) = sum u(q + s / 2) conj(u(q - s / 2)) / E` with the energy E. One number needs far
//! fewer nodes than a PSF, and no transform. The soft rim of the stop removes light from `sum |u|^2` that a hard edge would diffract far
//! away. The contrast of that light fades over a shift of the width of the rim.

use petzval_fourier::Complex64;

use super::map::{WaveMap, WavePointBar, WaveRow};
use crate::gradient::LensGradient;
use crate::pupil::Sides;
use crate::trace::Sequence;

/// Least and greatest number of nodes a side. Between them the soft rim of the stop is no wider than a third of the shift, as far as that is possible.
const NODES: [usize; 2] = [64, 256];

/// Least number of nodes for every period of the structure over which the light of the beam spreads: its phase turns by less than half a cycle
/// between two nodes.
const NODES_A_PERIOD: f64 = 2.5;

/// Half-width of the soft rim, in nodes.
const SOFT_NODES: f64 = 0.7;

/// One field at one wavelength, at one frequency.
pub(crate) struct Overlap {
    map: WaveMap,
    /// 2 pi over the wavelength, 1/mm.
    wavenumber: f64,
    /// Nodes a side.
    nodes: usize,
    /// Half of the shift along x and along y, in units of q.
    half_shift: [f64; 2],
    /// Sum of `|u|^2` over the nodes, and of the energy.
    light: f64,
    energy: f64,
    /// Sums of the overlaps.
    sums: [Complex64; 2],
    /// Contrast of the light that a hard edge diffracts far away.
    far_contrast: [f64; 2],
    /// The transfer function for sagittal and for tangential structures.
    pub transfer: [Complex64; 2],
}

/// The rows that hold a node and its copies along y.
struct Rows {
    here: WaveRow,
    /// At plus and at minus half of the shift.
    shifted: [WaveRow; 2],
}

impl Overlap {
    /// The wave of a field about a point of the image plane; `None` where [`WaveMap::new`] has none, no light arrives, or the light spreads
    /// over more periods than the nodes can follow. `further_mm`: additional spread by a shift of the image plane. `like` is the same field
    /// at another wavelength.
    pub fn new(
        sequence: &Sequence,
        field_rad: f64,
        stop_radius_mm: f64,
        centre_mm: [f64; 2],
        (frequency_per_mm, further_mm): (f64, f64),
        like: Option<&Self>,
    ) -> Option<Self> {
        let like = like.map(|overlap| &overlap.map);
        let map = WaveMap::new(sequence, field_rad, stop_radius_mm, centre_mm, like)?;
        let wavelength_mm = 1e-3 * sequence.wavelength_um;
        let turn = frequency_per_mm * wavelength_mm / map.n_image;
        let shift = map.scale.map(|scale| (turn / scale).abs());
        // The range of q is 2 wide.
        let for_rim = (3.0 * 2.0 * SOFT_NODES / shift[0].min(shift[1])).min(NODES[1] as f64);
        let spread_mm = [(&map.samples.x, centre_mm[0]), (&map.samples.y, centre_mm[1])]
            .map(|(at, centre)| at.iter().map(|v| (v - centre).abs()).fold(0.0, f64::max));
        let periods = 2.0 * frequency_per_mm * (spread_mm[0].max(spread_mm[1]) + further_mm);
        let for_spread = NODES_A_PERIOD * periods;
        if for_spread > NODES[1] as f64 {
            return None;
        }
        let nodes = (for_rim.max(for_spread) as usize).next_multiple_of(16).clamp(NODES[0], NODES[1]);
        let soft = 2.0 * SOFT_NODES / nodes as f64;
        let mut overlap = Self {
            wavenumber: std::f64::consts::TAU / wavelength_mm,
            half_shift: map.scale.map(|scale| 0.5 * turn / scale),
            light: 0.0,
            energy: 0.0,
            sums: [Complex64::ZERO; 2],
            far_contrast: shift.map(|shift| (1.0 - shift / (2.0 * soft)).max(0.0)),
            nodes,
            transfer: [Complex64::ZERO; 2],
            map,
        };
        for j in 0..nodes {
            let rows = overlap.rows(j, 1.0);
            for i in overlap.columns() {
                let point = overlap.map.point(&rows.here, overlap.coordinate(i), overlap.soft());
                overlap.light += point.amplitude * point.amplitude;
                overlap.energy += point.energy;
                for (k, [plus, minus]) in overlap.pairs(&rows, i, 1.0).into_iter().enumerate() {
                    overlap.sums[k] += plus.wave * minus.wave.conj();
                }
            }
        }
        if overlap.energy.is_nan() || overlap.energy <= 0.0 {
            return None;
        }
        if overlap.is_half() {
            // The other half adds the conjugate for shifts across the line of symmetry.
            overlap.sums[0].im = 0.0;
        }
        let beyond = 1.0 - overlap.light / overlap.energy;
        overlap.transfer =
            [0, 1].map(|k| overlap.sums[k] / overlap.energy + beyond * overlap.far_contrast[k]);
        Some(overlap)
    }

    /// Coordinate q of a node, -1 to 1.
    fn coordinate(&self, i: usize) -> f64 {
        (2.0 * i as f64 + 1.0) / self.nodes as f64 - 1.0
    }

    /// Half-width of the soft rim of the stop, as a share of its radius.
    fn soft(&self) -> f64 {
        2.0 * SOFT_NODES / self.nodes as f64
    }

    fn is_half(&self) -> bool {
        self.map.samples.sides == Sides::Mirrored
    }

    /// Columns to evaluate: half of them in a mirror-symmetric beam.
    fn columns(&self) -> std::ops::Range<usize> {
        if self.is_half() { self.nodes / 2..self.nodes } else { 0..self.nodes }
    }

    /// The rows of a node, with the shift times `growth`.
    fn rows(&self, j: usize, growth: f64) -> Rows {
        let (q_y, half) = (self.coordinate(j), growth * self.half_shift[1]);
        Rows { here: self.map.row(q_y), shifted: [q_y + half, q_y - half].map(|q_y| self.map.row(q_y)) }
    }

    fn wave(&self, row: &WaveRow, q_x: f64) -> Complex64 {
        // A copy reaches beyond the polynomials, where there is no light.
        if q_x.abs().max(row.q_y.abs()) > 1.0 {
            return Complex64::ZERO;
        }
        let point = self.map.point(row, q_x, self.soft());
        Complex64::from_polar(point.amplitude, self.wavenumber * point.path_mm)
    }

    /// The two copies of the wave at a node, for sagittal and for tangential structures, with the shift times `growth`.
    fn pairs<'a>(&self, rows: &'a Rows, i: usize, growth: f64) -> [[Shifted<'a>; 2]; 2] {
        let (q_x, half) = (self.coordinate(i), growth * self.half_shift[0]);
        let copy = |row: &'a WaveRow, q_x: f64| Shifted { row, q_x, wave: self.wave(row, q_x) };
        [
            [copy(&rows.here, q_x + half), copy(&rows.here, q_x - half)],
            [copy(&rows.shifted[0], q_x), copy(&rows.shifted[1], q_x)],
        ]
    }

    /// The transfer functions on image planes that are shifted along z.
    ///
    /// The path of every wavelet from the reference sphere grows, and so does the shift of the copies. Over the range of the planes that
    /// shift changes by less than a hundredth. So overlaps are computed at both ends of its range and interpolated.
    pub fn over_focus(&self, defocus_mm: &[f64]) -> Vec<[Complex64; 2]> {
        let growth = |dz: f64| self.map.sphere.further(self.map.slant(0.0, 0.0), dz).1;
        let all = defocus_mm.iter().map(|dz| growth(*dz));
        let (least, most) = all.fold((1.0_f64, 1.0_f64), |(a, b), g| (a.min(g), b.max(g)));
        let ends = [least, most].map(|growth| self.products(growth));
        let per_mm = self.wavenumber * self.map.n_image;
        let beyond = 1.0 - self.light / self.energy;
        let at = |dz: &f64| {
            let towards = if most > least { (growth(*dz) - least) / (most - least) } else { 0.0 };
            [0, 1].map(|k| {
                let turn = |cosine: f64| per_mm * self.map.sphere.further(cosine, *dz).0;
                let sum_of = |pairs: &Vec<Product>| -> Complex64 {
                    let waves =
                        pairs.iter().map(|p| p.value * Complex64::cis(turn(p.cosine[0]) - turn(p.cosine[1])));
                    waves.sum()
                };
                let mut sum = (1.0 - towards) * sum_of(&ends[0][k]) + towards * sum_of(&ends[1][k]);
                if k == 0 && self.is_half() {
                    sum.im = 0.0;
                }
                sum / self.energy + beyond * self.far_contrast[k]
            })
        };
        defocus_mm.iter().map(at).collect()
    }

    /// The products of the two shifted copies of the wave at every node, for sagittal and for tangential structures. The shift is
    /// multiplied by `growth`.
    fn products(&self, growth: f64) -> [Vec<Product>; 2] {
        let mut products: [Vec<Product>; 2] = Default::default();
        for j in 0..self.nodes {
            let rows = self.rows(j, growth);
            for i in self.columns() {
                for (list, [plus, minus]) in products.iter_mut().zip(self.pairs(&rows, i, growth)) {
                    let value = plus.wave * minus.wave.conj();
                    if value != Complex64::ZERO {
                        let cosine = [plus, minus].map(|copy| self.map.slant(copy.row.q_y, copy.q_x));
                        list.push(Product { value, cosine });
                    }
                }
            }
        }
        products
    }

    /// Adds the gradient of a loss whose derivatives by the real and the imaginary parts of both transfer functions are `bars`; returns the
    /// derivatives by the centre and by the stop radius, per mm.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        mut bars: [Complex64; 2],
        gradient: &mut LensGradient,
    ) -> ([f64; 2], f64) {
        if self.is_half() {
            bars[0].im = 0.0;
        }
        // A cotangent w of u means that the loss changes by the real part of conj(w) du. From O = X / E + (1 - L / E) c, X = sum u_plus conj(u_minus):
        let by_sum = bars.map(|bar| bar / self.energy);
        let (mut by_light, mut by_energy) = (0.0, 0.0);
        for ((bar, sum), contrast) in by_sum.iter().zip(self.sums).zip(self.far_contrast) {
            by_light -= bar.re * contrast;
            by_energy += (bar.re * contrast * self.light - (bar.conj() * sum).re) / self.energy;
        }
        let mut sums = self.map.zero_cotangent();
        for j in 0..self.nodes {
            let rows = self.rows(j, 1.0);
            let mut here_bar = self.map.zero_row(&rows.here);
            let mut shifted_bar = rows.shifted.each_ref().map(|row| self.map.zero_row(row));
            for i in self.columns() {
                let mut pull = |copy: &Shifted, wave_bar: Complex64, row_bar: &mut WaveRow| {
                    // u = A exp(i phi): the cotangent along u is that of A, the one across it that of A phi.
                    let size = copy.wave.norm();
                    if size == 0.0 {
                        return;
                    }
                    let along = wave_bar * copy.wave.conj() / size;
                    let path = self.wavenumber * size * along.im;
                    let bar = WavePointBar { amplitude: along.re, path, ..WavePointBar::default() };
                    self.map.pull_back_point(copy.row, copy.q_x, self.soft(), bar, row_bar, &mut sums);
                };
                let [sagittal, tangential] = self.pairs(&rows, i, 1.0);
                let wave_bars =
                    |[plus, minus]: &[Shifted; 2], bar: Complex64| [bar * minus.wave, bar.conj() * plus.wave];
                for (copy, bar) in sagittal.iter().zip(wave_bars(&sagittal, by_sum[0])) {
                    pull(copy, bar, &mut here_bar);
                }
                let tangential_bars = wave_bars(&tangential, by_sum[1]);
                for ((copy, bar), row_bar) in tangential.iter().zip(tangential_bars).zip(&mut shifted_bar) {
                    pull(copy, bar, row_bar);
                }
            }
            for i in self.columns() {
                let q_x = self.coordinate(i);
                let amplitude = 2.0 * by_light * self.map.point(&rows.here, q_x, self.soft()).amplitude;
                let bar = WavePointBar { amplitude, energy: by_energy, ..WavePointBar::default() };
                self.map.pull_back_point(&rows.here, q_x, self.soft(), bar, &mut here_bar, &mut sums);
            }
            self.map.pull_back_row(&here_bar, self.coordinate(j), &mut sums);
            for (row_bar, shift) in shifted_bar.iter().zip([self.half_shift[1], -self.half_shift[1]]) {
                self.map.pull_back_row(row_bar, self.coordinate(j) + shift, &mut sums);
            }
        }
        let by_stop = self.map.pull_back(sequence, &mut sums, gradient);
        (sums.origin, by_stop)
    }
}

/// The product of one copy with the conjugate of the other, and the cosines of both to the axis.
struct Product {
    value: Complex64,
    cosine: [f64; 2],
}

/// A copy of the wave at a node.
struct Shifted<'a> {
    row: &'a WaveRow,
    q_x: f64,
    wave: Complex64,
}
