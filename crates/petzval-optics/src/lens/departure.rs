//! What a surface's shape has beyond a conic with an even polynomial.

use std::sync::OnceLock;

use crate::jet::Real;
use crate::number::DEPARTURE_NUMBERS;

/// Number of odd polynomial terms: b_1, b_3, ..., b_15.
pub const ODD_TERMS: usize = 8;

/// Highest total degree of an XY polynomial.
pub const XY_DEGREE: usize = 8;

/// Number of terms `x^i y^j` with `1 <= i + j <= XY_DEGREE`.
pub const XY_TERMS: usize = (XY_DEGREE + 1) * (XY_DEGREE + 2) / 2 - 1;

/// Number of Forbes polynomials, m = 0 ... 12.
pub const Q_TERMS: usize = 13;

// A departure has at most as many numbers as an XY polynomial.
const _: () =
    assert!(DEPARTURE_NUMBERS == XY_TERMS && ODD_TERMS <= DEPARTURE_NUMBERS && Q_TERMS <= DEPARTURE_NUMBERS);

/// The part of the sag that is added to a conic `c`, `k` with the even polynomial `a_2, a_4, ...`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "a shape is a plain value that kernels copy, not a tree of allocations"
)]
pub enum Departure {
    /// Nothing.
    #[default]
    None,
    /// `b_1 r + b_3 r^3 + ... + b_15 r^15`; coefficients in mm^(1-n). With b_1 the vertex is the tip of a cone.
    Odd([f64; ODD_TERMS]),
    /// `sum b_ij (x/h)^i (y/h)^j`, an extended polynomial.
    Xy {
        /// The normalisation radius h, mm.
        norm_radius_mm: f64,
        /// b_ij in the order of [`xy_powers`], mm.
        coefficients: [f64; XY_TERMS],
    },
    /// Forbes's slope-orthogonal asphere about the best-fit sphere c:
    /// `v (1 - v) / sqrt(1 - c^2 r^2) sum a_m Q_m^bfs(v)` with `v = (r/h)^2`.
    ///
    /// Source: G. W. Forbes, Opt. Express 15, 5218 (2007); recurrences: Opt. Express 18, 19700 (2010).
    Qbfs {
        /// The normalisation radius h, mm.
        norm_radius_mm: f64,
        /// a_0 ... a_12, mm.
        coefficients: [f64; Q_TERMS],
    },
    /// Forbes's strong asphere about a conic: `v^2 sum a_m Q_m^con(v)`, the Jacobi polynomials `P_m^(0,4)(2 v - 1)`.
    Qcon {
        /// The normalisation radius h, mm.
        norm_radius_mm: f64,
        /// a_0 ... a_12, mm.
        coefficients: [f64; Q_TERMS],
    },
    /// Another conic in the x-z section; curvature and conic constant of the shape are those of the y-z section:
    /// `(c_x x^2 + c y^2) / (1 + sqrt(1 - (1 + k_x) c_x^2 x^2 - (1 + k) c^2 y^2))`.
    Biconic {
        /// Curvature of the x-z section, 1/mm.
        curvature_x: f64,
        /// Conic constant of the x-z section.
        conic_x: f64,
    },
    /// The y-z section, `g(y)` with conic and even polynomial, turned about an axis along y at the distance `1 / c_x` from
    /// the vertex: `g + s x^2 / (1 + sqrt(1 - s^2 x^2))` with `s = c_x / (1 - c_x g)`. A cylinder where c_x is 0.
    Toroid {
        /// Curvature of the x-z section, 1/mm.
        curvature_x: f64,
    },
}

/// Powers (i, j) of x and y of the terms of an XY polynomial: by total degree, the highest power of x first.
pub fn xy_powers() -> impl Iterator<Item = (usize, usize)> {
    (1..=XY_DEGREE).flat_map(|degree| (0..=degree).map(move |j| (degree - j, j)))
}

/// Place of `x^i y^j` among the terms of an XY polynomial.
pub fn xy_index(i: usize, j: usize) -> usize {
    let degree = i + j;
    degree * (degree + 1) / 2 - 1 + j
}

impl Departure {
    /// Its numbers: coefficients, or curvature and conic constant of the x-z section.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::None => Vec::new(),
            Self::Odd(b) => b.to_vec(),
            Self::Xy { coefficients, .. } => coefficients.to_vec(),
            Self::Qbfs { coefficients, .. } | Self::Qcon { coefficients, .. } => coefficients.to_vec(),
            Self::Biconic { curvature_x, conic_x } => vec![*curvature_x, *conic_x],
            Self::Toroid { curvature_x } => vec![*curvature_x],
        }
    }

    /// Number `index` of [`Departure::numbers`], to be changed; `None` if there is no such number.
    pub fn number_mut(&mut self, index: usize) -> Option<&mut f64> {
        match self {
            Self::None => None,
            Self::Odd(b) => b.get_mut(index),
            Self::Xy { coefficients, .. } => coefficients.get_mut(index),
            Self::Qbfs { coefficients, .. } | Self::Qcon { coefficients, .. } => coefficients.get_mut(index),
            Self::Biconic { curvature_x, conic_x } => match index {
                0 => Some(curvature_x),
                1 => Some(conic_x),
                _ => None,
            },
            Self::Toroid { curvature_x } => (index == 0).then_some(curvature_x),
        }
    }

    /// Whether number `index` shapes the surface alike on both sides of the y-z plane.
    pub fn is_mirror_symmetric_in(&self, index: usize) -> bool {
        match self {
            Self::Xy { .. } => xy_powers().nth(index).is_none_or(|(i, _)| i % 2 == 0),
            _ => true,
        }
    }

    /// The normalisation radius, mm, where there is one.
    pub fn norm_radius_mm(&self) -> Option<f64> {
        match self {
            Self::Xy { norm_radius_mm, .. }
            | Self::Qbfs { norm_radius_mm, .. }
            | Self::Qcon { norm_radius_mm, .. } => Some(*norm_radius_mm),
            _ => None,
        }
    }
}

/// `sum b_i r^(2i + 1)`.
#[inline(always)]
pub(super) fn odd<R: Real>(b: &[f64; ODD_TERMS], u: R) -> R {
    radius(u) * polynomial(b, u)
}

/// `r = sqrt(u)`, with the tip of the cone rounded off over 1e-12 mm, so that it has derivatives.
#[inline(always)]
pub(super) fn radius<R: Real>(u: R) -> R {
    (u + 1e-24).sqrt()
}

/// `a_0 + a_1 u + a_2 u^2 + ...` by Horner's rule.
#[inline(always)]
pub(super) fn polynomial<R: Real>(a: &[f64], u: R) -> R {
    let mut sum = u.constant(0.0);
    for a in a.iter().rev() {
        sum = sum * u + *a;
    }
    sum
}

/// `sum b_ij x^i y^j`, x and y over the normalisation radius.
#[inline(always)]
pub(super) fn xy<R: Real>(coefficients: &[f64; XY_TERMS], x: R, y: R) -> R {
    let mut sum = x.constant(0.0);
    for i in (0..=XY_DEGREE).rev() {
        let mut row = x.constant(0.0);
        for j in (0..=XY_DEGREE - i).rev() {
            row = row * y + if i + j == 0 { 0.0 } else { coefficients[xy_index(i, j)] };
        }
        sum = sum * x + row;
    }
    sum
}

/// The terms `x^i y^j`, in order.
#[inline(always)]
pub(super) fn xy_terms<R: Real>(x: R, y: R, out: &mut Vec<R>) {
    let one = x.constant(1.0);
    let mut powers = [[one; XY_DEGREE + 1]; 2];
    for n in 1..=XY_DEGREE {
        powers[0][n] = powers[0][n - 1] * x;
        powers[1][n] = powers[1][n - 1] * y;
    }
    for degree in 1..=XY_DEGREE {
        for j in 0..=degree {
            out.push(powers[0][degree - j] * powers[1][j]);
        }
    }
}

/// Factors of the recurrence for Q_m^bfs: `Q_m = (P_m - g_(m-1) Q_(m-1) - h_(m-2) Q_(m-2)) / f_m`.
struct BfsFactors {
    f: [f64; Q_TERMS],
    g: [f64; Q_TERMS],
    h: [f64; Q_TERMS],
}

/// Source: Forbes 2010, equations A.14 to A.16.
fn bfs_factors() -> &'static BfsFactors {
    static MADE: OnceLock<BfsFactors> = OnceLock::new();
    MADE.get_or_init(make_bfs_factors)
}

fn make_bfs_factors() -> BfsFactors {
    let mut all = BfsFactors { f: [0.0; Q_TERMS], g: [0.0; Q_TERMS], h: [0.0; Q_TERMS] };
    all.f[0] = 2.0;
    all.f[1] = 19.0_f64.sqrt() / 2.0;
    all.g[0] = -0.5;
    for m in 2..Q_TERMS {
        let n = m as f64;
        all.h[m - 2] = -n * (n - 1.0) / (2.0 * all.f[m - 2]);
        all.g[m - 1] = -(1.0 + all.g[m - 2] * all.h[m - 2]) / all.f[m - 1];
        all.f[m] = (n * (n + 1.0) + 3.0 - all.g[m - 1].powi(2) - all.h[m - 2].powi(2)).sqrt();
    }
    all
}

/// Q_0^bfs(v) ... Q_12^bfs(v).
#[inline(always)]
pub(super) fn q_bfs<R: Real>(v: R) -> [R; Q_TERMS] {
    let factors = bfs_factors();
    let BfsFactors { f, g, h } = factors;
    // P_0 = 2, P_1 = 6 - 8 v, P_(m+1) = (2 - 4 v) P_m - P_(m-1).
    let (mut p_before, mut p) = (v.constant(2.0), v * -8.0 + 6.0);
    let mut q = [v.constant(1.0); Q_TERMS];
    q[1] = (p - q[0] * g[0]) * (1.0 / f[1]);
    for m in 2..Q_TERMS {
        let next = (v * -4.0 + 2.0) * p - p_before;
        (p_before, p) = (p, next);
        q[m] = (p - q[m - 1] * g[m - 1] - q[m - 2] * h[m - 2]) * (1.0 / f[m]);
    }
    q
}

/// Q_0^con(v) ... Q_12^con(v), by the three-term recurrence of Jacobi polynomials with alpha = 0, beta = 4 (Abramowitz and
/// Stegun 22.7.1).
#[inline(always)]
pub(super) fn q_con<R: Real>(v: R) -> [R; Q_TERMS] {
    let t = v * 2.0 - 1.0;
    let mut q = [v.constant(1.0); Q_TERMS];
    q[1] = v * 6.0 - 5.0;
    for m in 2..Q_TERMS {
        let n = m as f64;
        let s = 2.0 * n + 4.0;
        let lead = 2.0 * n * (n + 4.0) * (s - 2.0);
        let along = (s - 1.0) * s * (s - 2.0) / lead;
        let shift = -16.0 * (s - 1.0) / lead;
        let behind = 2.0 * (n - 1.0) * (n + 3.0) * s / lead;
        q[m] = (t * along + shift) * q[m - 1] - q[m - 2] * behind;
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Slopes of `u^2 (1 - u^2) Q_m(u^2)` are orthonormal under `(2/pi) / sqrt(1 - u^2)`: Forbes's definition.
    #[test]
    fn bfs_slopes_are_orthonormal() {
        let steps = 4096;
        let mut products = [[0.0; Q_TERMS]; Q_TERMS];
        for i in 0..steps {
            // u = sin(theta) makes the weight uniform.
            let u = (0.5 * PI * (f64::from(i) + 0.5) / f64::from(steps)).sin();
            let slope = |m: usize| {
                let lift = crate::jet::Dual::variable(u);
                let v = lift * lift;
                (v * (-v + 1.0) * q_bfs(v)[m]).by
            };
            let slopes: Vec<f64> = (0..Q_TERMS).map(slope).collect();
            for a in 0..Q_TERMS {
                for b in 0..Q_TERMS {
                    products[a][b] += slopes[a] * slopes[b] / f64::from(steps);
                }
            }
        }
        for (a, row) in products.iter().enumerate() {
            for (b, product) in row.iter().enumerate() {
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-9, "{a} {b}: {product}");
            }
        }
    }

    /// `u^4 Q_m(u^2)` are orthogonal over the disk, and every Q_m is 1 at the edge.
    #[test]
    fn con_polynomials_are_orthogonal_and_one_at_the_edge() {
        let steps = 20_000;
        let mut products = [[0.0; Q_TERMS]; Q_TERMS];
        for i in 0..steps {
            let v = (f64::from(i) + 0.5) / f64::from(steps);
            let q = q_con(v);
            for a in 0..Q_TERMS {
                for b in 0..a {
                    products[a][b] += v.powi(4) * q[a] * q[b] / f64::from(steps);
                }
            }
        }
        assert!(products.iter().flatten().all(|p| p.abs() < 1e-5), "{products:?}");
        assert!(q_con(1.0).iter().all(|q| (q - 1.0).abs() < 1e-12));
        // Printed by Forbes 2007: Q_2^con = 15 - 14 x (3 - 2 x).
        let x = 0.37;
        assert!((q_con(x)[2] - (15.0 - 14.0 * x * (3.0 - 2.0 * x))).abs() < 1e-14);
        // And Q_1^bfs = (13 - 16 x) / sqrt(19).
        assert!((q_bfs(x)[1] - (13.0 - 16.0 * x) / 19.0_f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn xy_terms_are_where_their_index_says() {
        let powers: Vec<(usize, usize)> = xy_powers().collect();
        assert_eq!(powers.len(), XY_TERMS);
        for (k, (i, j)) in powers.iter().enumerate() {
            assert_eq!(xy_index(*i, *j), k);
            let mut coefficients = [0.0; XY_TERMS];
            coefficients[k] = 2.0;
            let (x, y) = (0.7_f64, -0.3_f64);
            let expected = 2.0 * x.powi(*i as i32) * y.powi(*j as i32);
            assert!((xy(&coefficients, x, y) - expected).abs() < 1e-15);
            let mut terms = Vec::new();
            xy_terms(x, y, &mut terms);
            assert!((2.0 * terms[k] - expected).abs() < 1e-15);
        }
    }
}
