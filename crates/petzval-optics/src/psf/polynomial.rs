//! PSFs from pupil polynomials: evaluates them densely, and splats the points.

use pulp::{Simd, WithSimd};

use super::grid::{LightChange, LightCotangent, PsfMethod, PsfOptions, with_mirror_image};
use crate::gradient::LensGradient;
use crate::lanes::{Lanes, MAX_LANES, width};
use crate::pupil::{
    DenseCotangent, DenseMap, DenseTangent, Points, PointsCotangent, PupilBasis, PupilMap, PupilSamples,
    Quadrature, Sides,
};
use crate::trace::Sequence;
use petzval_base::simd::dispatch;

/// Degrees of the polynomials, in the order of trial.
const DEGREES: [usize; 4] = [8, 12, 16, 20];

/// Largest distance of the polynomials from traced rays, um.
const TOLERANCE_UM: f64 = 0.01;

/// Cells around the grid, so that light at its edge needs no test per cell; the fourth cell of a row of weights is zero.
const MARGIN: usize = 3;

pub(super) struct PolynomialChannel {
    map: PupilMap,
    residual_um: f64,
}

/// A grid with a margin.
struct Padded {
    stride: usize,
    values: Vec<f64>,
}

impl Padded {
    fn from_grid(grid: &[f64], cells: usize) -> Self {
        let stride = cells + 2 * MARGIN;
        let mut padded = Self { stride, values: vec![0.0; stride * stride] };
        for (row, from) in grid.chunks_exact(cells).enumerate() {
            padded.values[(row + MARGIN) * padded.stride + MARGIN..][..cells].copy_from_slice(from);
        }
        padded
    }
}

/// A grid with a margin, in overlapping blocks of four cells of a row that begin at every other cell.
///
/// Any three neighbours lie in one block, so adding light to them reads and writes whole blocks. A processor forwards a
/// value that it has just written to a read of the same address, but stalls on a read that overlaps it.
pub(super) struct Blocks {
    cells: usize,
    /// Blocks of a row.
    stride: usize,
    values: Vec<[f64; 4]>,
}

impl Blocks {
    pub fn zero(cells: usize) -> Self {
        let padded = cells + 2 * MARGIN;
        let stride = padded / 2 + 1;
        Self { cells, stride, values: vec![[0.0; 4]; stride * padded] }
    }

    /// The grid without its margin; with `add_mirror_image`, its mirror image in x is added.
    fn to_grid(&self, add_mirror_image: bool) -> Vec<f64> {
        let mut both = vec![0.0; self.cells * self.cells];
        let mut row = vec![0.0; 2 * self.stride + 2];
        let rows = self.values.chunks_exact(self.stride).skip(MARGIN);
        for (blocks, out) in rows.zip(both.chunks_exact_mut(self.cells)) {
            row.fill(0.0);
            for (i, block) in blocks.iter().enumerate() {
                for (to, value) in row[2 * i..2 * i + 4].iter_mut().zip(block) {
                    *to += value;
                }
            }
            let row = &row[MARGIN..MARGIN + self.cells];
            if !add_mirror_image {
                out.copy_from_slice(row);
                continue;
            }
            for (out, (a, b)) in out.iter_mut().zip(row.iter().zip(row.iter().rev())) {
                *out = a + b;
            }
        }
        both
    }
}

/// A polynomial of degree two in each of four cells, at an offset d.
#[inline(always)]
fn quadratic(constant: [f64; 4], linear: [f64; 4], square: [f64; 4], d: f64) -> [f64; 4] {
    let mut out = [0.0; 4];
    for i in 0..4 {
        out[i] = constant[i] + d * (linear[i] + d * square[i]);
    }
    out
}

/// Weights of the quadratic B-spline around the nearest cell; see [`splat`](super::splat).
#[inline(always)]
fn weights(d: f64) -> [f64; 4] {
    quadratic([0.125, 0.75, 0.125, 0.0], [-0.5, 0.0, 0.5, 0.0], [0.5, -1.0, 0.5, 0.0], d)
}

/// [`weights`] in a block whose first cell is that of the first weight (0) or the one before (1).
#[inline(always)]
fn weights_in_block(d: f64, behind: usize) -> [f64; 4] {
    const CONSTANT: [[f64; 4]; 2] = [[0.125, 0.75, 0.125, 0.0], [0.0, 0.125, 0.75, 0.125]];
    const LINEAR: [[f64; 4]; 2] = [[-0.5, 0.0, 0.5, 0.0], [0.0, -0.5, 0.0, 0.5]];
    const SQUARE: [[f64; 4]; 2] = [[0.5, -1.0, 0.5, 0.0], [0.0, 0.5, -1.0, 0.5]];
    let behind = behind & 1;
    quadratic(CONSTANT[behind], LINEAR[behind], SQUARE[behind], d)
}

/// Derivatives of [`weights`].
#[inline(always)]
fn slopes(d: f64) -> [f64; 4] {
    quadratic([-0.5, 0.0, 0.5, 0.0], [1.0, -2.0, 1.0, 0.0], [0.0; 4], d)
}

/// Positions of points on a padded grid.
struct Landing<S: Simd> {
    /// Column and row of the first of 3 x 3 cells around a point; 0 off the grid.
    column: [usize; MAX_LANES],
    row: [usize; MAX_LANES],
    /// Offset from the middle of the nearest cell.
    du: [f64; MAX_LANES],
    dv: [f64; MAX_LANES],
    /// 1 on the grid, 0 off it.
    inside: Lanes<S>,
}

/// Adding this number rounds to an integer, whose bits are then the lowest bits of the sum.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// Finds the nearest cell of each point, and the offset from its middle.
#[inline(always)]
fn land<S: Simd>(points: &Points<S>, options: &PsfOptions, chief_mm: [f64; 2]) -> Landing<S> {
    let (per_mm, centre) = options.scale();
    let zero = points.x.constant(0.0);
    // Compute cell coordinates on the padded grid; points off the grid go to a corner, with weight 0.
    let first = centre + MARGIN as f64;
    let [chief_x, chief_y] = chief_mm;
    let (u, v) = ((points.x - chief_x) * per_mm + first, (points.y - chief_y) * per_mm + first);
    let (low, high) = (zero.constant(1.5), zero.constant((options.grid + 2 * MARGIN) as f64 - 2.5));
    let inside = low.lt(u).and(u.lt(high)).and(low.lt(v)).and(v.lt(high));
    let (u, v) = (inside.select(u, zero.constant(1.0)), inside.select(v, zero.constant(1.0)));
    // Round to the nearest cell, and read its index from the bits.
    let (near_u, near_v) = ((u + ROUNDING) - ROUNDING, (v + ROUNDING) - ROUNDING);
    let mut landing = Landing {
        column: [0; MAX_LANES],
        row: [0; MAX_LANES],
        du: [0.0; MAX_LANES],
        dv: [0.0; MAX_LANES],
        inside: inside.select(zero.constant(1.0), zero),
    };
    let mut bits = [0.0; MAX_LANES];
    for (near, to) in [(near_u, &mut landing.column), (near_v, &mut landing.row)] {
        (near + (ROUNDING - 1.0)).store(&mut bits);
        for (to, bits) in to.iter_mut().zip(bits) {
            *to = bits.to_bits() as u32 as usize;
        }
    }
    (u - near_u).store(&mut landing.du);
    (v - near_v).store(&mut landing.dv);
    landing
}

struct Splat<'a> {
    dense: &'a DenseMap<'a>,
    options: &'a PsfOptions,
    chief_mm: [f64; 2],
    grid: &'a mut Blocks,
}

impl WithSimd for Splat<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { dense, options, chief_mm, grid } = self;
        let sides = dense.sides();
        let mut light = Lanes::splat(simd, 0.0);
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) * sides.len() {
                // Evaluate the polynomials at some points of a row: positions on the image and light.
                let points = dense.points(simd, row, turn / sides.len(), sides[turn % sides.len()]);
                light += points.weight;
                let landing = land(&points, options, chief_mm);
                let mut weight = [0.0; MAX_LANES];
                (points.weight * landing.inside).store(&mut weight);
                // Share the light of each point among the 3 x 3 cells around it, by the weights of the quadratic B-spline.
                for k in 0..width::<S>() {
                    let (column, row) = (landing.column[k], landing.row[k]);
                    let a = weights_in_block(landing.du[k], column);
                    let b = weights(landing.dv[k]);
                    for j in 0..3 {
                        let block = &mut grid.values[(row + j) * grid.stride + column / 2];
                        let share = weight[k] * b[j];
                        for i in 0..4 {
                            block[i] += share * a[i];
                        }
                    }
                }
            }
        }
        light.sum()
    }
}

struct Gather<'a> {
    dense: &'a DenseMap<'a>,
    bar: &'a LightCotangent<'a>,
    grid: &'a Padded,
    sums: &'a mut DenseCotangent,
}

impl WithSimd for Gather<'_> {
    /// Cotangents of the chief ray's x and y.
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; 2] {
        let Self { dense, bar, grid, sums } = self;
        let (per_mm, _) = bar.options.scale();
        let sides = dense.sides();
        let zero = Lanes::splat(simd, 0.0);
        let mut chief_bar = [zero; 2];
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) * sides.len() {
                // Evaluate the polynomials again at some points of a row.
                let points = dense.points(simd, row, turn / sides.len(), sides[turn % sides.len()]);
                let landing = land(&points, bar.options, bar.chief_mm);
                let [mut by_u, mut by_v, mut by_light] = [[0.0; MAX_LANES]; 3];
                // Gather the cotangents of the 3 x 3 cells around each point: by its position and by its light.
                for k in 0..width::<S>() {
                    let (du, dv) = (landing.du[k], landing.dv[k]);
                    let ((a, b), (da, db)) = ((weights(du), weights(dv)), (slopes(du), slopes(dv)));
                    let (mut along, mut turned) = ([0.0; 4], [0.0; 4]);
                    for j in 0..3 {
                        let at = (landing.row[k] + j) * grid.stride + landing.column[k];
                        let cells = &grid.values[at..][..4];
                        for i in 0..4 {
                            along[i] += b[j] * cells[i];
                            turned[i] += db[j] * cells[i];
                        }
                    }
                    for i in 0..4 {
                        by_u[k] += da[i] * along[i];
                        by_v[k] += a[i] * turned[i];
                        by_light[k] += a[i] * along[i];
                    }
                }
                // Pass them on to the coefficients of the polynomials. The chief ray moves the grid, not the points.
                let weight = points.weight * landing.inside * per_mm;
                let bar = PointsCotangent {
                    x: weight * Lanes::load(simd, &by_u),
                    y: weight * Lanes::load(simd, &by_v),
                    weight: Lanes::load(simd, &by_light) * landing.inside + bar.density,
                };
                chief_bar[0] -= bar.x;
                chief_bar[1] -= bar.y;
                dense.pull_back_points(row, &points, bar, sums);
            }
        }
        [chief_bar[0].sum(), chief_bar[1].sum()]
    }
}

struct Move<'a> {
    dense: &'a DenseMap<'a>,
    moved: &'a DenseTangent,
    change: &'a LightChange<'a>,
    cells: &'a mut [f64],
}

impl WithSimd for Move<'_> {
    /// Change of the light.
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { dense, moved, change, cells } = self;
        let sides = dense.sides();
        let mut light = Lanes::splat(simd, 0.0);
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) * sides.len() {
                // Evaluate the polynomials and their changes at some points of a row.
                let points = dense.points(simd, row, turn / sides.len(), sides[turn % sides.len()]);
                let by = dense.push_forward_points(row, &points, moved);
                light += by.weight;
                let mut all = [[0.0; MAX_LANES]; 6];
                for (lanes, to) in
                    [points.x, points.y, points.weight, by.x, by.y, by.weight].into_iter().zip(&mut all)
                {
                    lanes.store(to);
                }
                // Move the light of each point among the 3 x 3 cells around it.
                let [x, y, weight, by_x, by_y, by_weight] = all;
                for k in 0..width::<S>() {
                    change.add(cells, [x[k], y[k]], weight[k], [by_x[k], by_y[k]], by_weight[k]);
                }
            }
        }
        light.sum()
    }
}

impl PolynomialChannel {
    /// Polynomials of the least degree within the tolerance; `None` if no degree is.
    pub fn new(
        sequence: &Sequence,
        field_rad: f64,
        stop_radius_mm: f64,
        like: Option<&PupilMap>,
    ) -> Option<Self> {
        // Start with the degree that another wavelength needed.
        let least = like.map_or(0, |map| map.basis().degree);
        for degree in DEGREES.into_iter().filter(|d| *d >= least) {
            let like = like.map(|map| &map.samples);
            let samples =
                PupilSamples::new(sequence, field_rad, stop_radius_mm, PupilBasis::of_degree(degree), like)?;
            let map = PupilMap::new(sequence, samples);
            let residual = map.residual(sequence)?;
            if residual.within(1e-3 * TOLERANCE_UM) {
                return Some(Self { map, residual_um: 1e3 * residual.image_mm });
            }
        }
        None
    }

    pub fn map(&self) -> &PupilMap {
        &self.map
    }

    pub fn method(&self) -> PsfMethod {
        PsfMethod::Polynomial { degree: self.map.basis().degree, residual_um: self.residual_um }
    }

    /// The light on the grid and the light of the beam per ideal image area. On the grid it is that of half of the pupil with its mirror
    /// image (twice its weight), or that of both halves.
    ///
    /// `grid` is scratch space for the splat.
    pub fn splat(
        &self,
        quadrature: &Quadrature,
        options: &PsfOptions,
        chief_mm: [f64; 2],
        grid: &mut Blocks,
    ) -> (Vec<f64>, f64) {
        grid.values.fill([0.0; 4]);
        let dense = DenseMap::new(&self.map, quadrature.rows());
        let light = dispatch(Splat { dense: &dense, options, chief_mm, grid });
        (grid.to_grid(self.map.samples.sides == Sides::Mirrored), light)
    }

    /// Adds the gradient; returns the derivatives by the position of the chief ray and by the stop radius.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        quadrature: &Quadrature,
        bar: &LightCotangent,
        gradient: &mut LensGradient,
    ) -> ([f64; 2], f64) {
        let dense = DenseMap::new(&self.map, quadrature.rows());
        let grid = Padded::from_grid(&bar.grid, bar.options.grid);
        let mut sums = dense.zero_cotangent();
        let chief_bar = dispatch(Gather { dense: &dense, bar, grid: &grid, sums: &mut sums });
        (chief_bar, self.map.pull_back(sequence, &dense.pull_back(&sums), gradient))
    }

    /// The change of [`PolynomialChannel::splat`]: the transpose of [`PolynomialChannel::pull_back`].
    pub fn push_forward(
        &self,
        sequence: &Sequence,
        quadrature: &Quadrature,
        change: &LightChange,
    ) -> (Vec<f64>, f64) {
        let dense = DenseMap::new(&self.map, quadrature.rows());
        let moved = dense.push_forward(&self.map.push_forward(sequence, change.lens, change.stop_growth));
        let mut cells = vec![0.0; change.options.grid * change.options.grid];
        let light = dispatch(Move { dense: &dense, moved: &moved, change, cells: &mut cells });
        match self.map.samples.sides {
            Sides::Mirrored => (with_mirror_image(&cells, change.options.grid), light),
            Sides::Both => (cells, light),
        }
    }
}
