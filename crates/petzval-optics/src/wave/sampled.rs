//! A wavefront on a grid of directions: its variance over the light, and the cotangents of that.

use super::map::{WaveMap, WavePointBar};
use crate::gradient::LensGradient;
use crate::pupil::Sides;
use crate::trace::Sequence;

/// Nodes a side of the grid.
const NODES: usize = 64;

/// Half-width of the soft rim of the stop, as a share of the radius: 0.7 nodes.
const SOFT: f64 = 0.7 * 2.0 / NODES as f64;

/// One field at one wavelength.
pub(crate) struct SampledWave {
    map: WaveMap,
    /// Waves per mm of optical path.
    waves_per_mm: f64,
    /// Nodes inside the beam; of a mirror-symmetric beam those of one half.
    nodes: Vec<Node>,
    /// Light of all nodes.
    light: f64,
}

struct Node {
    /// Column and row.
    place: [usize; 2],
    /// Optical path less its mean, waves.
    waves: f64,
    light: f64,
    /// Waves that the path gains if the centre of the reference sphere moves by 1 mm along x and y, less their means.
    tilt: [f64; 2],
}

/// Second moments of a wavefront and of its tilts, divided by the light.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WaveMoments {
    /// Variance of the wavefront, waves^2.
    pub variance: f64,
    /// Covariances with the tilts, waves^2 per mm.
    pub with_tilt: [f64; 2],
    /// Covariances of the tilts xx, xy, yy, waves^2 per mm^2.
    pub of_tilts: [f64; 3],
}

impl SampledWave {
    /// The wave of a field about a point of the image plane. `None` where [`WaveMap::new`] has none or no light arrives.
    pub fn new(
        sequence: &Sequence,
        field_rad: f64,
        stop_radius_mm: f64,
        centre_mm: [f64; 2],
    ) -> Option<Self> {
        let map = WaveMap::new(sequence, field_rad, stop_radius_mm, centre_mm, None)?;
        let waves_per_mm = 1e3 / sequence.wavelength_um;
        let columns = if map.samples.sides == Sides::Mirrored { NODES / 2..NODES } else { 0..NODES };
        let mut nodes = Vec::new();
        for j in 0..NODES {
            let row = map.row(coordinate(j));
            for i in columns.clone() {
                let point = map.point(&row, coordinate(i), SOFT);
                if point.light > 0.0 {
                    let [x, y] = [(0, i), (1, j)].map(|(axis, k)| map.scale[axis] * coordinate(k));
                    nodes.push(Node {
                        place: [i, j],
                        waves: waves_per_mm * point.path_mm,
                        light: point.light,
                        tilt: [x, y].map(|cosine| waves_per_mm * map.n_image * cosine),
                    });
                }
            }
        }
        let light: f64 = nodes.iter().map(|n| n.light).sum();
        if light.is_nan() || light <= 0.0 {
            return None;
        }
        let mean = |of: &dyn Fn(&Node) -> f64| nodes.iter().map(|n| n.light * of(n)).sum::<f64>() / light;
        let (waves, x, y) = (mean(&|n| n.waves), mean(&|n| n.tilt[0]), mean(&|n| n.tilt[1]));
        for node in &mut nodes {
            node.waves -= waves;
            node.tilt = [node.tilt[0] - x, node.tilt[1] - y];
        }
        Some(Self { map, waves_per_mm, nodes, light })
    }

    /// True if the nodes cover one half of a mirror-symmetric beam. Such nodes cannot give a tilt along x.
    pub fn is_half(&self) -> bool {
        self.map.samples.sides == Sides::Mirrored
    }

    pub fn moments(&self) -> WaveMoments {
        let mut sums = WaveMoments::default();
        for Node { waves, light, tilt: [x, y], .. } in &self.nodes {
            let share = light / self.light;
            sums.variance += share * waves * waves;
            sums.with_tilt[0] += share * waves * x;
            sums.with_tilt[1] += share * waves * y;
            for (sum, product) in sums.of_tilts.iter_mut().zip([x * x, x * y, y * y]) {
                *sum += share * product;
            }
        }
        sums
    }

    /// Adds `bar` times the gradient of the variance about the centre moved by `shift_mm`, for a shift that makes a sum of such variances least:
    /// its own change then has no effect. Returns the derivatives by the centre and by the stop radius, per mm.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        shift_mm: [f64; 2],
        bar: f64,
        gradient: &mut LensGradient,
    ) -> ([f64; 2], f64) {
        let residual = |n: &Node| n.waves - shift_mm[0] * n.tilt[0] - shift_mm[1] * n.tilt[1];
        let variance = self.nodes.iter().map(|n| n.light * residual(n).powi(2)).sum::<f64>() / self.light;
        let mut sums = self.map.zero_cotangent();
        for of_row in self.nodes.chunk_by(|a, b| a.place[1] == b.place[1]) {
            let q_y = coordinate(of_row[0].place[1]);
            let row = self.map.row(q_y);
            let mut row_bar = self.map.zero_row(&row);
            for node in of_row {
                let r = residual(node);
                let per_light = bar / self.light;
                let point = WavePointBar {
                    path: 2.0 * per_light * node.light * r * self.waves_per_mm,
                    light: per_light * (r * r - variance),
                    ..WavePointBar::default()
                };
                let q_x = coordinate(node.place[0]);
                self.map.pull_back_point(&row, q_x, SOFT, point, &mut row_bar, &mut sums);
            }
            self.map.pull_back_row(&row_bar, q_y, &mut sums);
        }
        let by_stop = self.map.pull_back(sequence, &mut sums, gradient);
        (sums.origin, by_stop)
    }
}

/// Coordinate q of a node, -1 to 1.
fn coordinate(i: usize) -> f64 {
    (2.0 * i as f64 + 1.0) / NODES as f64 - 1.0
}
