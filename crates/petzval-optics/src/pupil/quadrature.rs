//! A deterministic quadrature of half of the unit disk: fields lie in the y-z plane, so a ray at (-x, y) of the pupil
//! is the mirror image of the ray at (x, y).

use super::dense::PupilRows;
use super::polynomial::Sides;

/// Sub-cells per side for the area of a cell at the rim.
const RIM_SUBDIVISION: usize = 16;

/// A quadrature that cannot be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a pupil grid needs an even number of cells from 12 to 4096 a side, got {0}")]
pub struct QuadratureError(pub usize);

/// Nodes of a square grid inside the half disk x > 0, each with the weight of itself and its mirror image.
#[derive(Clone, Debug)]
pub struct Quadrature {
    /// Nodes (p_x, p_y), p_x > 0, inside the unit disk.
    pub nodes: Vec<[f64; 2]>,
    /// Share of the disk's area of a node and its mirror image; the sum is 1.
    pub weights: Vec<f64>,
    /// Cells a side of the square around the disk.
    pub cells: usize,
    rows: PupilRows,
}

impl Quadrature {
    /// A grid of `cells` x `cells` over the disk's square: full cells by their centre, cells cut by
    /// the rim by the area and the centroid of the part inside.
    pub fn grid(cells: usize) -> Result<Self, QuadratureError> {
        if !(12..=4096).contains(&cells) || !cells.is_multiple_of(2) {
            return Err(QuadratureError(cells));
        }
        let side = 2.0 / cells as f64;
        let (mut nodes, mut weights) = (Vec::new(), Vec::new());
        for row in 0..cells {
            for column in cells / 2..cells {
                let corner = [-1.0 + side * column as f64, -1.0 + side * row as f64];
                if let Some((node, area)) = part_inside(corner, side) {
                    nodes.push(node);
                    weights.push(area);
                }
            }
        }
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= total);
        Ok(Self { nodes, weights, cells, rows: PupilRows::new(cells) })
    }

    /// Nodes and weights of the sampled halves of the disk.
    pub(crate) fn on(&self, sides: Sides) -> (Vec<[f64; 2]>, Vec<f64>) {
        (sides.points(&self.nodes), sides.weights(&self.weights))
    }

    /// Rows of the same density, for polynomials.
    pub(crate) fn rows(&self) -> &PupilRows {
        &self.rows
    }

    /// Number of traced rays.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }
}

/// Centroid and area of the part of a square cell inside the unit disk.
fn part_inside(corner: [f64; 2], side: f64) -> Option<([f64; 2], f64)> {
    let radii = [0.0, 1.0].map(|i| [0.0, 1.0].map(|j| (corner[0] + i * side).hypot(corner[1] + j * side)));
    let flat = radii.as_flattened();
    if flat.iter().all(|r| *r <= 1.0) {
        return Some(([corner[0] + 0.5 * side, corner[1] + 0.5 * side], side * side));
    }
    if flat.iter().all(|r| *r > 1.0 + side) {
        return None;
    }
    let step = side / RIM_SUBDIVISION as f64;
    let (mut count, mut sum) = (0usize, [0.0; 2]);
    for i in 0..RIM_SUBDIVISION {
        for j in 0..RIM_SUBDIVISION {
            let p = [corner[0] + (i as f64 + 0.5) * step, corner[1] + (j as f64 + 0.5) * step];
            if p[0] * p[0] + p[1] * p[1] <= 1.0 {
                count += 1;
                sum = [sum[0] + p[0], sum[1] + p[1]];
            }
        }
    }
    (count > 0).then(|| {
        let n = count as f64;
        ([sum[0] / n, sum[1] / n], n * step * step)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_the_disk_are_right() {
        let q = Quadrature::grid(64).unwrap();
        let moment = |f: &dyn Fn([f64; 2]) -> f64| -> f64 {
            q.nodes.iter().zip(&q.weights).map(|(p, w)| w * f(*p)).sum()
        };
        assert!((moment(&|_| 1.0) - 1.0).abs() < 1e-12);
        assert!(moment(&|p| p[1]).abs() < 1e-14);
        assert!((moment(&|p| p[0] * p[0]) - 0.25).abs() < 2e-4);
        assert!((moment(&|p| p[1] * p[1]) - 0.25).abs() < 2e-4);
        assert!((moment(&|p| p[1].powi(4)) - 0.125).abs() < 2e-4);
        assert!(q.nodes.iter().all(|p| p[0] > 0.0 && p[0].hypot(p[1]) < 1.0));
    }

    #[test]
    fn an_impossible_grid_is_refused() {
        assert_eq!(Quadrature::grid(7).unwrap_err(), QuadratureError(7));
        assert!(Quadrature::grid(0).is_err() && Quadrature::grid(10).is_err());
    }
}
