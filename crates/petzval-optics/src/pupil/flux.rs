//! How much light each pupil node stands for.
//!
//! Equal areas of the stop are not equal areas of the incoming beam: real ray aiming bends the map
//! between them. The launch coordinates are a smooth function of the pupil, so a polynomial through
//! the aimed rays gives the Jacobian `det d(launch)/d(pupil)`, mm^2, and its gradient.

use nalgebra::{DMatrix, DVector};

/// Highest total degree of the polynomial; the residual for the triplets here is below 1e-6 mm.
const DEGREE: usize = 10;

/// The fixed linear maps from launch coordinates at the nodes to their pupil derivatives.
#[derive(Clone, Debug)]
pub(super) struct FluxFit {
    /// Launch x is odd in p_x, launch y is even.
    odd: ParityFit,
    even: ParityFit,
}

#[derive(Clone, Debug)]
struct ParityFit {
    /// Coefficients from nodal values: terms x nodes.
    solve: DMatrix<f64>,
    /// d/dp_x and d/dp_y at the nodes from coefficients: nodes x terms.
    derivative: [DMatrix<f64>; 2],
}

impl ParityFit {
    fn new(nodes: &[[f64; 2]], parity: usize) -> Self {
        let powers: Vec<(i32, i32)> = (0..=DEGREE)
            .flat_map(|total| (parity..=total).step_by(2).map(move |i| (i as i32, (total - i) as i32)))
            .collect();
        let matrix = |term: &dyn Fn([f64; 2], (i32, i32)) -> f64| {
            DMatrix::from_fn(nodes.len(), powers.len(), |r, c| term(nodes[r], powers[c]))
        };
        let value = matrix(&|p, (i, j)| p[0].powi(i) * p[1].powi(j));
        let monomial = |p: f64, i: i32| if i == 0 { 0.0 } else { f64::from(i) * p.powi(i - 1) };
        let by_x = matrix(&|p, (i, j)| monomial(p[0], i) * p[1].powi(j));
        let by_y = matrix(&|p, (i, j)| p[0].powi(i) * monomial(p[1], j));
        // Least squares by QR: coefficients = R^-1 Q^T values.
        let qr = value.qr();
        let q_t = qr.q().transpose();
        // Quadrature refuses grids too coarse for the degree, so the columns are independent.
        let solve = qr.r().solve_upper_triangular(&q_t).unwrap_or_else(|| unreachable!("full column rank"));
        Self { solve, derivative: [by_x, by_y] }
    }

    fn derivatives(&self, values: &[f64]) -> [DVector<f64>; 2] {
        let coefficients = &self.solve * DVector::from_column_slice(values);
        [&self.derivative[0] * &coefficients, &self.derivative[1] * &coefficients]
    }

    fn pull_back(&self, bars: [DVector<f64>; 2]) -> DVector<f64> {
        let [x, y] = bars;
        let coefficients = self.derivative[0].tr_mul(&x) + self.derivative[1].tr_mul(&y);
        self.solve.tr_mul(&coefficients)
    }
}

impl FluxFit {
    pub(super) fn new(nodes: &[[f64; 2]]) -> Self {
        Self { odd: ParityFit::new(nodes, 1), even: ParityFit::new(nodes, 0) }
    }

    /// Jacobian determinants at the nodes, mm^2 per unit of pupil area.
    pub(super) fn jacobian(&self, launch: &[[f64; 2]]) -> Vec<f64> {
        let ([xx, xy], [yx, yy]) = self.maps(launch);
        (0..launch.len()).map(|i| xx[i] * yy[i] - xy[i] * yx[i]).collect()
    }

    /// Cotangents of the launch coordinates from those of the determinants.
    pub(super) fn pull_back(&self, launch: &[[f64; 2]], bar: &[f64]) -> Vec<[f64; 2]> {
        let ([xx, xy], [yx, yy]) = self.maps(launch);
        let times = |v: &DVector<f64>, sign: f64| DVector::from_fn(bar.len(), |i, _| sign * bar[i] * v[i]);
        let x_bar = self.odd.pull_back([times(&yy, 1.0), times(&yx, -1.0)]);
        let y_bar = self.even.pull_back([times(&xy, -1.0), times(&xx, 1.0)]);
        x_bar.iter().zip(y_bar.iter()).map(|(x, y)| [*x, *y]).collect()
    }

    fn maps(&self, launch: &[[f64; 2]]) -> ([DVector<f64>; 2], [DVector<f64>; 2]) {
        let x: Vec<f64> = launch.iter().map(|p| p[0]).collect();
        let y: Vec<f64> = launch.iter().map(|p| p[1]).collect();
        (self.odd.derivatives(&x), self.even.derivatives(&y))
    }
}
