//! A mesh of few nodes made finer: smooth curves through its nodes.
//!
//! Bilinear interpolation of a curve f between nodes h apart errs by `h^2 f'' / 8`. A polynomial of third degree through the four nearest nodes
//! of each axis errs by the fourth derivative alone. It runs through the logarithms, because relative illumination is a product.

use super::Mesh;

/// Least value whose logarithm is taken.
const LEAST: f32 = 1e-3;

impl Mesh {
    /// The mesh with every interval divided until both axes have so many nodes or more, and how far the new values differ from bilinear ones
    /// at most, as a share. Values are positive; the old nodes keep theirs.
    pub fn refined(&self, least_nodes: usize) -> (Self, f64) {
        let parts = |nodes: usize| (least_nodes.saturating_sub(1)).div_ceil(nodes.max(2) - 1).max(1);
        let (down, across) = (parts(self.rows), parts(self.cols));
        let (rows, cols) = ((self.rows - 1) * down + 1, (self.cols - 1) * across + 1);
        let mut difference = 0.0_f64;
        let planes = self.planes.iter().map(|plane| {
            let logs: Vec<f64> = plane.iter().map(|v| f64::from(v.max(LEAST)).ln()).collect();
            (0..rows * cols)
                .map(|i| {
                    let places = [(i / cols, down, self.rows), (i % cols, across, self.cols)];
                    if let [(r, down, _), (c, across, _)] = places
                        && r % down == 0
                        && c % across == 0
                    {
                        return plane[r / down * self.cols + c / across];
                    }
                    let value = |taps: [Taps; 2]| {
                        let [rows, cols] = taps;
                        let sum = rows.iter().flat_map(|(r, a)| cols.iter().map(move |(c, b)| (r, c, a * b)));
                        sum.map(|(r, c, share)| share * logs[r * self.cols + c]).sum::<f64>().exp()
                    };
                    let smooth = value(places.map(|(at, parts, nodes)| taps(at, parts, nodes, 4)));
                    let straight = value(places.map(|(at, parts, nodes)| taps(at, parts, nodes, 2)));
                    difference = difference.max((smooth / straight - 1.0).abs());
                    smooth as f32
                })
                .collect()
        });
        let planes = planes.collect();
        (Self { rows, cols, planes }, difference)
    }
}

/// Nodes and their shares.
type Taps = Vec<(usize, f64)>;

/// Lagrange's polynomial through the `count` nodes nearest to a place, or all there are.
fn taps(at: usize, parts: usize, nodes: usize, count: usize) -> Taps {
    let place = at as f64 / parts as f64;
    let count = count.min(nodes);
    let interval = (at / parts).min(nodes - 2);
    let first = (interval + 1).saturating_sub(count / 2).min(nodes - count);
    let share = |k: usize| {
        let others = (first..first + count).filter(|j| *j != k);
        others.map(|j| (place - j as f64) / (k as f64 - j as f64)).product()
    };
    (first..first + count).map(|k| (k, share(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cosine to the fourth of a wide-angle lens, 0.41 in the corners.
    fn illumination(row: f64, col: f64) -> f64 {
        (1.0 + 0.5 * ((2.0 * row - 1.0).powi(2) * 0.36 + (2.0 * col - 1.0).powi(2) * 0.76)).powi(-2)
    }

    fn mesh(rows: usize, cols: usize) -> Mesh {
        let node = |i: usize| {
            illumination((i / cols) as f64 / (rows - 1) as f64, (i % cols) as f64 / (cols - 1) as f64) as f32
        };
        Mesh { rows, cols, planes: vec![(0..rows * cols).map(node).collect(); 3] }
    }

    fn error_of(mesh: &Mesh) -> f64 {
        let size = (201, 301);
        let at = |(row, col): (usize, usize)| {
            f64::from(mesh.at(1, (row, col), size)) / illumination(row as f64 / 200.0, col as f64 / 300.0)
                - 1.0
        };
        (0..201)
            .flat_map(|r| (0..301).map(move |c| (r, c)))
            .map(at)
            .fold(0.0, |most, e: f64| most.max(e.abs()))
    }

    #[test]
    fn a_coarse_mesh_of_a_smooth_fall_is_as_good_as_a_fine_one() {
        for (rows, cols, limit) in [(3, 3, 0.035), (4, 5, 0.01), (5, 7, 0.005)] {
            let coarse = mesh(rows, cols);
            let (fine, difference) = coarse.refined(33);
            assert!(fine.rows >= 33 && fine.cols >= 33 && fine.is_whole(3));
            let (before, after) = (error_of(&coarse), error_of(&fine));
            assert!(after < limit && after < 0.5 * before, "{rows} x {cols}: {before} {after}");
            assert!(difference > 0.3 * before, "{difference} {before}");
            for i in 0..rows * cols {
                let (r, c) =
                    (i / cols * (fine.rows - 1) / (rows - 1), i % cols * (fine.cols - 1) / (cols - 1));
                assert_eq!(fine.planes[0][r * fine.cols + c], coarse.planes[0][i]);
            }
        }
        let two = mesh(2, 2);
        assert!(two.refined(33).1 < 1e-6);
    }
}
