//! The wave on the nodes of a pupil grid, several nodes at a time, and the transpose. [`WaveMap::point`] and
//! [`WaveMap::pull_back_point`] are the readable reference, for one node.

use std::f64::consts::TAU;

use petzval_base::simd::dispatch;
use pulp::{Simd, WithSimd};

use super::map::{WaveCotangent, WaveMap, WaveRow, WaveTangent};
use super::matrix::Complex;
use super::phase::sin_cos;
use crate::lanes::{Lanes, MAX_LANES, width};
use crate::pupil::Sides;
use crate::trace::{SOFT_EDGE_MM, SoftEdge, soft_edge};

/// A square grid of nodes over `q`, -1 to 1 on both axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeGrid {
    /// Nodes a side, an even number.
    pub nodes: usize,
    /// Half-width of the soft rim of the stop, as a share of its radius.
    pub soft: f64,
    /// 2 pi over the wavelength, 1/mm.
    pub wavenumber: f64,
}

/// The wave of a beam on the nodes.
pub(super) struct NodeWave {
    /// `[column, row]`; of a mirror-symmetric beam the columns `q_x > 0` alone.
    pub wave: Complex,
    /// Sum of the light over all nodes of the whole beam.
    pub light: f64,
    /// Sum of the energy, see [`WavePoint`](super::map::WavePoint).
    pub energy: f64,
}

/// Cotangents of [`NodeWave`].
pub(super) struct NodeWaveBar<'a> {
    /// By the wave; of a mirror-symmetric beam the sum over a column and its mirror image.
    pub wave: &'a Complex,
    /// By the sum of the light.
    pub light: f64,
    /// By the sum of the energy.
    pub energy: f64,
}

impl NodeGrid {
    /// Coordinate of a node.
    pub fn q(&self, i: usize) -> f64 {
        (2.0 * i as f64 + 1.0) / self.nodes as f64 - 1.0
    }

    /// Columns to evaluate; in a mirror-symmetric beam the others are their mirror images.
    pub fn columns(&self, sides: Sides) -> std::ops::Range<usize> {
        match sides {
            Sides::Mirrored => self.nodes / 2..self.nodes,
            Sides::Both => 0..self.nodes,
        }
    }

    /// The wave on the nodes.
    pub fn wave(&self, map: &WaveMap) -> NodeWave {
        let columns = self.columns(map.samples.sides);
        let mut out = NodeWave { wave: Complex::zeros(columns.len(), self.nodes), light: 0.0, energy: 0.0 };
        dispatch(Forward { grid: *self, map, columns, out: &mut out });
        let images = images(map.samples.sides);
        out.light *= images;
        out.energy *= images;
        out
    }

    /// The transpose of [`NodeGrid::wave`]: adds to the cotangents of the map's coefficients.
    pub fn pull_back(&self, map: &WaveMap, bar: NodeWaveBar, sums: &mut WaveCotangent) {
        let columns = self.columns(map.samples.sides);
        let images = images(map.samples.sides);
        let bar = NodeWaveBar { light: images * bar.light, energy: images * bar.energy, ..bar };
        dispatch(Backward { grid: *self, map, columns, bar, sums });
    }

    /// The change of [`NodeGrid::wave`], from those of the map's coefficients: the transpose of [`NodeGrid::pull_back`].
    pub fn push_forward(&self, map: &WaveMap, change: &WaveTangent) -> NodeWave {
        let columns = self.columns(map.samples.sides);
        let mut out = NodeWave { wave: Complex::zeros(columns.len(), self.nodes), light: 0.0, energy: 0.0 };
        dispatch(Move { grid: *self, map, columns, change, out: &mut out });
        let images = images(map.samples.sides);
        out.light *= images;
        out.energy *= images;
        out
    }

    /// Coordinates of columns, padded with zeros, and 1 for each that is no padding.
    fn padded(&self, columns: &std::ops::Range<usize>) -> (Vec<f64>, Vec<f64>) {
        let length = columns.len().next_multiple_of(MAX_LANES);
        let of = |node: &dyn Fn(usize) -> f64| {
            let mut all: Vec<f64> = columns.clone().map(node).collect();
            all.resize(length, 0.0);
            all
        };
        (of(&|i| self.q(i)), of(&|_| 1.0))
    }
}

/// Nodes of the whole beam that one node stands for.
fn images(sides: Sides) -> f64 {
    match sides {
        Sides::Mirrored => 2.0,
        Sides::Both => 1.0,
    }
}

/// Powers of `q_x` in the polynomials of a row: all of them, or those of one parity.
#[derive(Clone, Copy)]
struct Powers {
    first: usize,
    step: usize,
}

impl Powers {
    fn of(sides: Sides, is_odd: bool) -> Self {
        match sides {
            Sides::Mirrored => Self { first: usize::from(is_odd), step: 2 },
            Sides::Both => Self { first: 0, step: 1 },
        }
    }

    /// The variable of the polynomial: `q` or its square.
    #[inline(always)]
    fn variable<S: Simd>(self, q: Lanes<S>) -> Lanes<S> {
        if self.step == 2 { q * q } else { q }
    }

    /// The polynomial, by Horner's rule.
    #[inline(always)]
    fn at<S: Simd>(self, row: &[f64], q: Lanes<S>) -> Lanes<S> {
        let v = self.variable(q);
        let mut sum = q.constant(0.0);
        let mut k = self.first + row.len().saturating_sub(self.first + 1) / self.step * self.step;
        loop {
            sum = sum.mul_add(v, q.constant(row.get(k).copied().unwrap_or(0.0)));
            if k < self.first + self.step {
                break;
            }
            k -= self.step;
        }
        if self.first == 1 { sum * q } else { sum }
    }

    /// Adds `bar q^k` of every power to its sum.
    #[inline(always)]
    fn add<S: Simd>(self, moments: &mut [[f64; MAX_LANES]], bar: Lanes<S>, q: Lanes<S>) {
        let v = self.variable(q);
        let mut power = if self.first == 1 { bar * q } else { bar };
        for sum in moments.iter_mut().skip(self.first).step_by(self.step) {
            (Lanes::load(bar.simd(), sum) + power).store(sum);
            power = power * v;
        }
    }
}

/// What the wave of some nodes is made of.
struct Block<S: Simd> {
    q: Lanes<S>,
    stop: [Lanes<S>; 2],
    /// Softness of the rim; `None` well inside.
    rim: Option<SoftEdge<S>>,
    /// Transmission of the rim; 0 for padding.
    inside: Lanes<S>,
    /// Transmission of the apertures.
    through: Lanes<S>,
    density: Lanes<S>,
    /// 1 over the cosine to the axis.
    per_slant: Lanes<S>,
    sin: Lanes<S>,
    cos: Lanes<S>,
}

/// One row of nodes.
struct NodeRow<'a> {
    map: &'a WaveMap,
    row: WaveRow,
    even: Powers,
    odd: Powers,
    /// The squared direction cosine along y.
    m_square: f64,
    /// Scale of the radius at which a clear aperture is as soft as the rim.
    rim_scale: f64,
    turns_per_mm: f64,
}

impl<'a> NodeRow<'a> {
    fn new(grid: &NodeGrid, map: &'a WaveMap, q_y: f64) -> Self {
        let sides = map.samples.sides;
        Self {
            map,
            row: map.row(q_y),
            even: Powers::of(sides, false),
            odd: Powers::of(sides, true),
            m_square: (map.middle[1] + map.scale[1] * q_y).powi(2),
            rim_scale: SOFT_EDGE_MM / grid.soft,
            turns_per_mm: grid.wavenumber / TAU,
        }
    }

    /// Evaluates the polynomials at some nodes; `None` if none of them is inside the stop. Leaves the soft edges of the apertures in `edges`.
    #[inline(always)]
    fn block<S: Simd>(
        &self,
        q: Lanes<S>,
        is_node: Lanes<S>,
        edges: &mut Vec<Option<SoftEdge<S>>>,
    ) -> Option<Block<S>> {
        let (row, zero, one) = (&self.row, q.constant(0.0), q.constant(1.0));
        // The rim of the stop.
        let stop = [self.odd.at(&row.stop[0], q), self.even.at(&row.stop[1], q)];
        let radius_square = stop[0].mul_add(stop[0], stop[1] * stop[1]);
        let rim = soft_edge(radius_square * (self.rim_scale * self.rim_scale), self.rim_scale);
        let inside = match &rim {
            Some(edge) => edge.transmission * is_node,
            None => is_node,
        };
        if !zero.lt(inside).any() {
            return None;
        }
        // The clear apertures.
        edges.clear();
        let mut through = one;
        for (semi_mm, row) in self.map.semi_diameters_mm().zip(&row.heights) {
            let edge = soft_edge(self.even.at(row, q).max(zero), semi_mm);
            if let Some(edge) = &edge {
                through = through * edge.transmission;
            }
            edges.push(edge);
        }
        // The light, the slant of the wave and its phase.
        let density = self.even.at(&row.density, q).max(zero);
        let l = q * self.map.scale[0] + self.map.middle[0];
        let per_slant = one / (one - l * l - self.m_square).max(q.constant(1e-6)).sqrt();
        let [sin, cos] = sin_cos(self.even.at(&row.path, q) * self.turns_per_mm);
        Some(Block { q, stop, rim, inside, through, density, per_slant, sin, cos })
    }
}

struct Forward<'a> {
    grid: NodeGrid,
    map: &'a WaveMap,
    columns: std::ops::Range<usize>,
    out: &'a mut NodeWave,
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { grid, map, columns, out } = self;
        let (q, is_node) = grid.padded(&columns);
        let zero = Lanes::splat(simd, 0.0);
        let (mut light, mut energy) = (zero, zero);
        let mut edges = Vec::new();
        let [mut re, mut im] = [[0.0; MAX_LANES]; 2];
        for j in 0..grid.nodes {
            let row = NodeRow::new(&grid, map, grid.q(j));
            for start in (0..columns.len()).step_by(width::<S>()) {
                let (q, is_node) = (Lanes::load(simd, &q[start..]), Lanes::load(simd, &is_node[start..]));
                let Some(block) = row.block(q, is_node, &mut edges) else { continue };
                // The amplitude is the root of the light per area of the image; a soft edge halves the amplitude where it halves the light.
                let share = block.inside * block.through;
                let amplitude = (block.density * block.per_slant).sqrt() * share;
                let of_nodes = block.density * share;
                light += of_nodes;
                energy += of_nodes * block.per_slant;
                (amplitude * block.cos).store(&mut re);
                (amplitude * block.sin).store(&mut im);
                let end = (start + width::<S>()).min(columns.len());
                let place = j * columns.len() + start..j * columns.len() + end;
                out.wave.re.as_mut_slice()[place.clone()].copy_from_slice(&re[..end - start]);
                out.wave.im.as_mut_slice()[place].copy_from_slice(&im[..end - start]);
            }
        }
        (out.light, out.energy) = (light.sum(), energy.sum());
    }
}

struct Backward<'a> {
    grid: NodeGrid,
    map: &'a WaveMap,
    columns: std::ops::Range<usize>,
    bar: NodeWaveBar<'a>,
    sums: &'a mut WaveCotangent,
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { grid, map, columns, bar, sums } = self;
        let (q, is_node) = grid.padded(&columns);
        let mut edges = Vec::new();
        let [mut re, mut im] = [[0.0; MAX_LANES]; 2];
        let mut moments = Moments::zero(&map.row(0.0));
        for j in 0..grid.nodes {
            let row = NodeRow::new(&grid, map, grid.q(j));
            moments.clear();
            for start in (0..columns.len()).step_by(width::<S>()) {
                let (q, is_node) = (Lanes::load(simd, &q[start..]), Lanes::load(simd, &is_node[start..]));
                let Some(block) = row.block(q, is_node, &mut edges) else { continue };
                let end = (start + width::<S>()).min(columns.len());
                let place = j * columns.len() + start..j * columns.len() + end;
                re[..end - start].copy_from_slice(&bar.wave.re.as_slice()[place.clone()]);
                im[..end - start].copy_from_slice(&bar.wave.im.as_slice()[place]);
                let (re, im) = (Lanes::load(simd, &re), Lanes::load(simd, &im));
                // From the wave to its amplitude and its path.
                let root = block.density.max(re.constant(1e-300)).sqrt();
                let root_slant = block.per_slant.sqrt();
                let share = block.inside * block.through;
                let amplitude_bar = (re * block.cos + im * block.sin) * root_slant;
                let turned = (im * block.cos - re * block.sin) * (root * root_slant * share);
                row.even.add(&mut moments.path, turned * grid.wavenumber, block.q);
                // From amplitude, light and energy to the density and to the share that passes the edges.
                let light_bar = block.per_slant * bar.energy + bar.light;
                let density_bar = (amplitude_bar * 0.5 / root + light_bar) * share;
                row.even.add(&mut moments.density, density_bar, block.q);
                let share_bar = amplitude_bar * root + light_bar * (root * root);
                // Through the rim to the stop coordinates.
                if let Some(rim) = &block.rim {
                    let radius = rim.radius_mm * (1.0 / row.rim_scale);
                    let by_radius = rim.by_radius * row.rim_scale;
                    let real = re.constant(0.0).lt(block.inside).select(by_radius, re.constant(0.0));
                    let bar = share_bar * block.through * real / radius;
                    row.odd.add(&mut moments.stop[0], bar * block.stop[0], block.q);
                    row.even.add(&mut moments.stop[1], bar * block.stop[1], block.q);
                }
                // Through each aperture to the squared height there and to its semi-diameter.
                for (k, edge) in edges.iter().enumerate() {
                    let Some(edge) = edge else { continue };
                    let others = edges.iter().enumerate().filter(|(other, _)| *other != k);
                    let mut bar = share_bar * block.inside * edge.by_radius;
                    for (_, other) in others {
                        if let Some(other) = other {
                            bar = bar * other.transmission;
                        }
                    }
                    row.even.add(&mut moments.heights[k], bar * 0.5 / edge.radius_mm, block.q);
                    sums.add_semi_diameter(k, -bar.sum());
                }
            }
            map.pull_back_row(&moments.row(&row.row), grid.q(j), sums);
        }
    }
}

struct Move<'a> {
    grid: NodeGrid,
    map: &'a WaveMap,
    columns: std::ops::Range<usize>,
    change: &'a WaveTangent,
    out: &'a mut NodeWave,
}

impl WithSimd for Move<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { grid, map, columns, change, out } = self;
        let (q, is_node) = grid.padded(&columns);
        let zero = Lanes::splat(simd, 0.0);
        let (mut light, mut energy) = (zero, zero);
        let mut edges = Vec::new();
        let [mut re, mut im] = [[0.0; MAX_LANES]; 2];
        for j in 0..grid.nodes {
            let row = NodeRow::new(&grid, map, grid.q(j));
            let moved = map.push_forward_row(change, grid.q(j));
            for start in (0..columns.len()).step_by(width::<S>()) {
                let (q, is_node) = (Lanes::load(simd, &q[start..]), Lanes::load(simd, &is_node[start..]));
                let Some(block) = row.block(q, is_node, &mut edges) else { continue };
                // The share that passes the rim and the apertures changes with stop coordinates, heights and semi-diameters.
                let mut inside = zero;
                if let Some(rim) = &block.rim {
                    let outward = block.stop[0] * row.odd.at(&moved.stop[0], q)
                        + block.stop[1] * row.even.at(&moved.stop[1], q);
                    let by = rim.by_radius * (row.rim_scale * row.rim_scale) * outward / rim.radius_mm;
                    inside = zero.lt(block.inside).select(by, zero);
                }
                let mut share_change = inside * block.through;
                for (k, edge) in edges.iter().enumerate() {
                    let Some(edge) = edge else { continue };
                    let radius = row.even.at(&moved.heights[k], q) * 0.5 / edge.radius_mm;
                    let mut by = block.inside * edge.by_radius * (radius - change.semi_diameters()[k]);
                    for (_, other) in edges.iter().enumerate().filter(|(other, _)| *other != k) {
                        if let Some(other) = other {
                            by = by * other.transmission;
                        }
                    }
                    share_change += by;
                }
                // Then amplitude, light and energy change, and the phase with the path.
                let root = block.density.max(zero.constant(1e-300)).sqrt();
                let root_slant = block.per_slant.sqrt();
                let share = block.inside * block.through;
                let density = row.even.at(&moved.density, q) * share;
                let amplitude = (density * 0.5 / root + root * share_change) * root_slant;
                let of_nodes = density + root * root * share_change;
                light += of_nodes;
                energy += of_nodes * block.per_slant;
                let phase = row.even.at(&moved.path, q) * grid.wavenumber * (root * root_slant * share);
                (amplitude * block.cos - phase * block.sin).store(&mut re);
                (amplitude * block.sin + phase * block.cos).store(&mut im);
                let end = (start + width::<S>()).min(columns.len());
                let place = j * columns.len() + start..j * columns.len() + end;
                out.wave.re.as_mut_slice()[place.clone()].copy_from_slice(&re[..end - start]);
                out.wave.im.as_mut_slice()[place].copy_from_slice(&im[..end - start]);
            }
        }
        (out.light, out.energy) = (light.sum(), energy.sum());
    }
}

/// Sums over a row of cotangents times powers of `q_x`, a sum a lane.
struct Moments {
    path: Vec<[f64; MAX_LANES]>,
    density: Vec<[f64; MAX_LANES]>,
    stop: [Vec<[f64; MAX_LANES]>; 2],
    heights: Vec<Vec<[f64; MAX_LANES]>>,
}

impl Moments {
    fn zero(like: &WaveRow) -> Self {
        let zero = |row: &Vec<f64>| vec![[0.0; MAX_LANES]; row.len()];
        Self {
            path: zero(&like.path),
            density: zero(&like.density),
            stop: like.stop.each_ref().map(zero),
            heights: like.heights.iter().map(zero).collect(),
        }
    }

    fn clear(&mut self) {
        let all =
            [&mut self.path, &mut self.density].into_iter().chain(&mut self.stop).chain(&mut self.heights);
        all.for_each(|sums| sums.fill([0.0; MAX_LANES]));
    }

    /// The cotangents of a row's coefficients.
    fn row(&self, like: &WaveRow) -> WaveRow {
        let sum = |sums: &Vec<[f64; MAX_LANES]>| sums.iter().map(|lanes| lanes.iter().sum()).collect();
        WaveRow {
            q_y: like.q_y,
            path: sum(&self.path),
            density: sum(&self.density),
            stop: self.stop.each_ref().map(sum),
            heights: self.heights.iter().map(sum).collect(),
        }
    }
}

#[cfg(test)]
mod tests;
