//! Bilinear interpolation of values at nodes to pixels, along one axis at a time.

use burn::prelude::*;

use super::tape_grid::constant;

/// Bits behind the point of a place between two nodes.
const PLACE_BITS: u32 = 12;

/// Where the pixels of an axis lie between nodes.
pub struct Axis {
    /// The node before each pixel, and the share of the way to the next, 12 bits.
    places: Vec<(usize, i32)>,
    nodes: usize,
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
        Self { places: (0..len).map(of).collect(), nodes }
    }

    /// The whole number of a pixel from those of the nodes.
    #[inline(always)]
    pub fn between(&self, pixel: usize, value: impl Fn(usize) -> i32) -> i32 {
        let (node, share) = self.places[pixel];
        let low = value(node);
        let high = value((node + 1).min(self.nodes - 1));
        // 16-bit values times a 12-bit share.
        low + (((high - low) * share + (1 << (PLACE_BITS - 1))) >> PLACE_BITS)
    }

    /// Nodes of the axis.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// The matrix `[pixels, nodes]` of the interpolation, of the same shares.
    fn matrix(&self, like: &Tensor<4>) -> Tensor<4> {
        let mut values = vec![0.0; self.places.len() * self.nodes];
        for (line, (node, share)) in values.chunks_exact_mut(self.nodes).zip(&self.places) {
            let share = *share as f32 / (1 << PLACE_BITS) as f32;
            line[*node] += 1.0 - share;
            line[(node + 1).min(self.nodes - 1)] += share;
        }
        constant(values, [1, 1, self.places.len(), self.nodes], like)
    }
}

/// Values at nodes `[1, 1, rows, cols]` spread over the pixels of two axes, on the tape.
pub fn spread(nodes: Tensor<4>, rows: &Axis, cols: &Axis) -> Tensor<4> {
    rows.matrix(&nodes).matmul(nodes.clone()).matmul(cols.matrix(&nodes).transpose())
}
