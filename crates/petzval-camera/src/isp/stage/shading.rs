//! Lens shading: the light that the lens takes away off the axis is given back.
//!
//! At the nodes of the calibration's mesh the gain is `min(1 / illumination, cap)^strength`; between them it is bilinear. The cap keeps
//! corners that hold little but noise from being lifted further.

use burn::prelude::*;

use super::super::fixed::GAIN;
use super::super::mesh::{Axis, spread};
use super::super::tape_grid::{Theta, constant};
use crate::isp::Mesh;
use crate::sensor::{CfaPattern, Colour};

petzval_base::parameters! {
    /// Correction of lens shading.
    pub struct Shading {
        /// Share of the correction, as a power of the gain.
        strength: f64 = 1.0, "", 0.0..1.0, Linear, "1 corrects fully";
        /// Greatest gain.
        cap: f64 = 4.0, "", 1.0..8.0, Log, "4 lifts the corners by two stops at most";
    }
}

/// Least illumination that is divided by.
const DARKEST: f64 = 1e-3;

/// What a driver writes into the stage for a frame: gains at the nodes, [`GAIN`], and where pixels lie between them.
pub struct Registers {
    planes: [Vec<i32>; 3],
    rows: Axis,
    cols: Axis,
}

impl Shading {
    /// None if there is nothing to correct.
    pub fn registers(&self, mesh: Option<&Mesh>, (height, width): (usize, usize)) -> Option<Registers> {
        let mesh = mesh.filter(|_| self.strength > 0.0)?;
        let gain = |v: &f32| GAIN.of((1.0 / f64::from(*v).max(DARKEST)).min(self.cap).powf(self.strength));
        Some(Registers {
            planes: [0, 1, 2].map(|c| mesh.planes[c].iter().map(gain).collect()),
            rows: Axis::corners(height, mesh.rows),
            cols: Axis::corners(width, mesh.cols),
        })
    }

    /// The gain of every pixel of a mosaic on the tape.
    pub fn smooth(mesh: Option<&Mesh>, cfa: CfaPattern, like: &Tensor<4>, theta: &Theta) -> Tensor<4> {
        let Some(mesh) = mesh else { return like.clone() * 0.0 + 1.0 };
        let [_, _, height, width] = like.dims();
        let mut gain = like.clone() * 0.0;
        for (plane, colour) in [Colour::Red, Colour::Green, Colour::Blue].into_iter().enumerate() {
            let gains = mesh.planes[plane].iter().map(|v| 1.0 / f64::from(*v).max(DARKEST));
            let nodes = gains.map(|v| v as f32).collect();
            let nodes: Tensor<4> = constant(nodes, [1, 1, mesh.rows, mesh.cols], like);
            let capped = nodes.min_pair(theta.number("shading.cap").expand([1, 1, mesh.rows, mesh.cols]));
            let of_nodes = (capped.log() * theta.number("shading.strength")).exp();
            let (rows, cols) = (Axis::corners(height, mesh.rows), Axis::corners(width, mesh.cols));
            let mask = super::super::tape_grid::colour_mask(cfa, colour, like);
            gain = gain + spread(of_nodes, &rows, &cols) * mask;
        }
        gain
    }
}

impl Registers {
    /// The gains of a row of pixels of a colour, [`GAIN`].
    #[inline(always)]
    pub fn row(&self, plane: usize, row: usize) -> Vec<i32> {
        self.cols.spread_row(&self.rows.row_of_nodes(&self.planes[plane], row))
    }
}
