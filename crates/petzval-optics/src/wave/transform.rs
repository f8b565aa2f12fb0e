//! The Fourier transform from the nodes of the pupil to the points of the image, and its transpose.
//!
//! The field at a point of the image is `F(x, y) = sum_ij W_ij exp(i k n' (x l_i + y m_j))`, with W the wave at the direction
//! cosines l and m. It is two matrix products, one an axis, and needs no interpolation (Soummer et al., Opt. Express 15, 15935
//! (2007)). Nodes and points lie symmetrically about zero. So `exp(i x l)` splits into cosines for the even part of the wave
//! and sines for its odd part: products of real matrices with half of the rows and half of the columns.

use nalgebra::DMatrix;

use super::matrix::Complex;

/// Which columns of a wave are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Columns {
    /// All.
    All,
    /// Those with `l > 0`, of a wave with `W(-l) = W(l)`.
    Even,
    /// Those with `l > 0`, of a wave with `W(-l) = -W(l)`.
    Odd,
}

/// The phases between the nodes of a pupil and the points of an image.
pub(super) struct Transform {
    x: Axis,
    y: Axis,
}

/// Cosines and sines of `x l` along one axis: `[point, node]`, both of the positive half.
struct Axis {
    cos: DMatrix<f64>,
    sin: DMatrix<f64>,
    points: usize,
    nodes: usize,
}

/// Points after which phases are computed anew, so that the rounding of their recurrence does not add up.
const RESTART: usize = 16;

impl Transform {
    /// `points` a side, `step_mm` apart, about the origin; `nodes` a side, an even number, over direction cosines from `-span` to
    /// `span` about the middle of the beam; `wavenumber` behind the lens, rad/mm.
    pub fn new(points: usize, step_mm: f64, nodes: usize, span: [f64; 2], wavenumber: f64) -> Self {
        let [x, y] = span.map(|span| Axis::new(points, step_mm * wavenumber, nodes, span));
        Self { x, y }
    }

    /// The field: from `[column, row]` of nodes to `[x, y]` of points.
    pub fn field(&self, wave: &Complex, columns: Columns) -> Complex {
        // Along x: of a wave of known parity, the points of the positive half are enough.
        let along_x = match columns {
            Columns::All => self.x.forward(wave),
            Columns::Even => wave.times_left(&self.x.cos).scaled(2.0),
            Columns::Odd => wave.times_left(&self.x.sin).scaled(2.0).times_i(),
        };
        let field = self.y.forward(&along_x.transpose()).transpose();
        match columns {
            Columns::All => field,
            Columns::Even => self.x.unfold_points(&field, 1.0),
            Columns::Odd => self.x.unfold_points(&field, -1.0),
        }
    }

    /// The transpose of [`Transform::field`]: cotangents of the wave on all nodes, from those of the field.
    pub fn pull_back(&self, field_bar: &Complex) -> Complex {
        let along_x = self.y.backward(&field_bar.transpose()).transpose();
        self.x.backward(&along_x)
    }

    /// The same for an even wave: the sums of the cotangents of each column `l > 0` and of its mirror image.
    pub fn pull_back_even(&self, field_bar: &Complex) -> Complex {
        let folded = self.x.fold_points(field_bar, 1.0);
        let along_x = self.y.backward(&folded.transpose()).transpose();
        along_x.times_left(&self.x.cos.transpose()).scaled(2.0)
    }
}

impl Axis {
    /// `points` points `step` apart; `x l` is a phase, rad.
    fn new(points: usize, step: f64, nodes: usize, span: f64) -> Self {
        let (half_points, half_nodes) = (points.div_ceil(2), nodes / 2);
        let mut cos = DMatrix::zeros(half_points, half_nodes);
        let mut sin = DMatrix::zeros(half_points, half_nodes);
        // The first point is the middle, or half a step from it.
        let first = if points.is_multiple_of(2) { 0.5 } else { 0.0 };
        for i in 0..half_nodes {
            let turn = step * span * (2 * i + 1) as f64 / nodes as f64;
            let (turn_sin, turn_cos) = turn.sin_cos();
            let (mut s, mut c) = (0.0, 1.0);
            for g in 0..half_points {
                if g % RESTART == 0 {
                    (s, c) = ((g as f64 + first) * turn).sin_cos();
                }
                (sin[(g, i)], cos[(g, i)]) = (s, c);
                (s, c) = (s * turn_cos + c * turn_sin, c * turn_cos - s * turn_sin);
            }
        }
        Self { cos, sin, points, nodes }
    }

    /// From rows of nodes to rows of points: `cos (W(l) + W(-l)) +- i sin (W(l) - W(-l))` at `+-x`.
    fn forward(&self, nodes: &Complex) -> Complex {
        let half = self.nodes / 2;
        let part = |sign: f64| {
            Complex::from_rows(nodes, half, |of, i, c| of[(half + i, c)] + sign * of[(half - 1 - i, c)])
        };
        let even = part(1.0).times_left(&self.cos);
        let odd = part(-1.0).times_left(&self.sin).times_i();
        Complex::add(&self.unfold_points(&even, 1.0), &self.unfold_points(&odd, -1.0))
    }

    /// The transpose: from rows of points to rows of nodes.
    fn backward(&self, points: &Complex) -> Complex {
        let half = self.nodes / 2;
        let even = self.fold_points(points, 1.0).times_left(&self.cos.transpose());
        let odd = self.fold_points(points, -1.0).times_left(&self.sin.transpose()).times_minus_i();
        let at = |even: &DMatrix<f64>, odd: &DMatrix<f64>| {
            DMatrix::from_fn(self.nodes, even.ncols(), |i, c| {
                if i >= half {
                    even[(i - half, c)] + odd[(i - half, c)]
                } else {
                    even[(half - 1 - i, c)] - odd[(half - 1 - i, c)]
                }
            })
        };
        Complex { re: at(&even.re, &odd.re), im: at(&even.im, &odd.im) }
    }

    /// All points, from those of the positive half and the sign of their mirror images.
    fn unfold_points(&self, half: &Complex, sign: f64) -> Complex {
        let (middle, from) = (self.points / 2, (self.points - 1) / 2);
        Complex::from_rows(half, self.points, |of, g, c| {
            if g >= middle { of[(g - middle, c)] } else { sign * of[(from - g, c)] }
        })
    }

    /// The transpose of [`Axis::unfold_points`].
    fn fold_points(&self, all: &Complex, sign: f64) -> Complex {
        let (middle, from) = (self.points / 2, (self.points - 1) / 2);
        Complex::from_rows(all, self.points - middle, |of, g, c| {
            let here = of[(middle + g, c)];
            // The middle of an odd number of points is its own mirror image, and counts once.
            if middle + g == from - g { here } else { here + sign * of[(from - g, c)] }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number between -1 and 1 that looks random.
    fn scattered(i: usize, j: usize, salt: f64) -> f64 {
        2.0 * ((i as f64 * 0.754_877_666 + j as f64 * 0.569_840_291 + salt).fract()) - 1.0
    }

    fn wave(rows: usize, columns: usize) -> Complex {
        Complex {
            re: DMatrix::from_fn(rows, columns, |i, j| scattered(i, j, 0.1)),
            im: DMatrix::from_fn(rows, columns, |i, j| scattered(i, j, 0.6)),
        }
    }

    /// The phases written out: `[point, node]`.
    fn phases(points: usize, nodes: usize, span: f64) -> Complex {
        let place: Vec<f64> =
            (0..points).map(|g| (g as f64 - 0.5 * (points as f64 - 1.0)) * STEP * WAVENUMBER).collect();
        let cosine: Vec<f64> = (0..nodes).map(|i| span * ((2 * i + 1) as f64 / nodes as f64 - 1.0)).collect();
        Complex::phases(&place, &cosine)
    }

    const STEP: f64 = 1e-3;
    const WAVENUMBER: f64 = 1.1e4;
    const SPAN: [f64; 2] = [0.12, 0.1];

    #[test]
    fn halves_transform_as_the_sum_over_all_nodes_and_back() {
        for points in [40, 41] {
            let nodes = 16;
            let transform = Transform::new(points, STEP, nodes, SPAN, WAVENUMBER);
            let [x, y] = SPAN.map(|span| phases(points, nodes, span));
            let full = |half: &Complex, sign: f64| {
                Complex::from_rows(half, nodes, |of, i, c| {
                    if i >= nodes / 2 { of[(i - nodes / 2, c)] } else { sign * of[(nodes / 2 - 1 - i, c)] }
                })
            };
            let bar = wave(points, points);
            let by_all = x.conjugate().transpose().times(&bar).times(&y.conjugate());
            for (columns, given, sign) in [
                (Columns::All, wave(nodes, nodes), 0.0),
                (Columns::Even, wave(nodes / 2, nodes), 1.0),
                (Columns::Odd, wave(nodes / 2, nodes), -1.0),
            ] {
                let all = if columns == Columns::All { given.clone() } else { full(&given, sign) };
                let reference = x.times(&all).times(&y.transpose());
                let found = transform.field(&given, columns);
                assert!(found.distance(&reference) < 1e-11, "{columns:?} {points}");
            }
            assert!(transform.pull_back(&bar).distance(&by_all) < 1e-11);
            let both = Complex::from_rows(&by_all, nodes / 2, |of, i, c| {
                of[(nodes / 2 + i, c)] + of[(nodes / 2 - 1 - i, c)]
            });
            assert!(transform.pull_back_even(&bar).distance(&both) < 1e-11);
        }
    }
}
