//! Bilinear interpolation of values at nodes to pixels, along one axis at a time.

use std::ops::Range;

use burn::prelude::*;

use super::tape_grid::constant;

/// Bits behind the point of a place between two nodes.
const PLACE_BITS: u32 = 12;

/// Where the pixels of an axis lie between nodes.
pub struct Axis {
    /// The node before each pixel.
    before: Vec<usize>,
    /// The share of the way from it to the next, 12 bits.
    shares: Vec<i32>,
    nodes: usize,
    /// The pixels behind each node, for the nodes that have any.
    runs: Vec<(usize, Range<usize>)>,
}

impl Axis {
    /// An axis whose outermost nodes lie on the outermost of `len` pixels.
    pub fn corners(len: usize, nodes: usize) -> Self {
        let step = (nodes - 1) as f64 / (len.max(2) - 1) as f64;
        Self::new(len, nodes, |i| i as f64 * step)
    }

    /// An axis whose nodes lie in the middles of cells of `cell` pixels; beyond the outermost nodes their values are repeated.
    pub fn cells(len: usize, cell: usize) -> Self {
        Self::new(len, len.div_ceil(cell), |i| (i as f64 + 0.5) / cell as f64 - 0.5)
    }

    fn new(len: usize, nodes: usize, place: impl Fn(usize) -> f64) -> Self {
        let last = nodes.max(2) - 2;
        let of = |i| {
            let x = place(i).clamp(0.0, (nodes - 1) as f64);
            let node = (x as usize).min(last);
            (node, ((x - node as f64) * f64::from(1 << PLACE_BITS)).round() as i32)
        };
        let (before, shares): (Vec<usize>, Vec<i32>) = (0..len).map(of).unzip();
        let mut runs: Vec<(usize, Range<usize>)> = Vec::new();
        for (pixel, node) in before.iter().enumerate() {
            match runs.last_mut() {
                Some((last, pixels)) if last == node => pixels.end = pixel + 1,
                _ => runs.push((*node, pixel..pixel + 1)),
            }
        }
        Self { before, shares, nodes, runs }
    }

    /// Whole numbers of the nodes of a row of pixels from those of all nodes, `nodes[row][col]`, along this axis of rows.
    #[inline(always)]
    pub fn row_of_nodes(&self, nodes: &[i32], pixel: usize) -> Vec<i32> {
        let per_row = nodes.len() / self.nodes;
        let low = self.before[pixel];
        let high = (low + 1).min(self.nodes - 1);
        let line = |node: usize| &nodes[node * per_row..][..per_row];
        line(low).iter().zip(line(high)).map(|(a, b)| between(*a, *b, self.shares[pixel])).collect()
    }

    /// Whole numbers of a row of pixels from those of its nodes.
    #[inline(always)]
    pub fn spread_row(&self, nodes: &[i32]) -> Vec<i32> {
        let mut out = vec![0; self.shares.len()];
        for (node, pixels) in &self.runs {
            let (low, high) = (nodes[*node], nodes[(node + 1).min(self.nodes - 1)]);
            let (out, shares) = (&mut out[pixels.clone()], &self.shares[pixels.clone()]);
            // A loop, because the closure of an iterator is compiled without the vector instructions.
            for i in 0..out.len().min(shares.len()) {
                out[i] = between(low, high, shares[i]);
            }
        }
        out
    }

    /// Nodes of the axis.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// The matrix `[pixels, nodes]` of the interpolation, of the same shares.
    fn matrix(&self, like: &Tensor<4>) -> Tensor<4> {
        let mut values = vec![0.0; self.shares.len() * self.nodes];
        let places = self.before.iter().zip(&self.shares);
        for (line, (node, share)) in values.chunks_exact_mut(self.nodes).zip(places) {
            let share = *share as f32 / (1 << PLACE_BITS) as f32;
            line[*node] += 1.0 - share;
            line[(node + 1).min(self.nodes - 1)] += share;
        }
        constant(values, [1, 1, self.shares.len(), self.nodes], like)
    }
}

/// The whole number at a share, 12 bits, of the way between two 16-bit numbers.
#[inline(always)]
fn between(low: i32, high: i32, share: i32) -> i32 {
    low + (((high - low) * share + (1 << (PLACE_BITS - 1))) >> PLACE_BITS)
}

/// Values at nodes `[1, 1, rows, cols]` spread over the pixels of two axes, on the tape.
pub fn spread(nodes: Tensor<4>, rows: &Axis, cols: &Axis) -> Tensor<4> {
    rows.matrix(&nodes).matmul(nodes.clone()).matmul(cols.matrix(&nodes).transpose())
}
