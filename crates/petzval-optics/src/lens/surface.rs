//! One surface: its shape, the medium behind it, and how far it is to the next.

use std::sync::Arc;

use crate::glass::Glass;

/// Number of even polynomial terms: a_2, a_4, ... a_16.
pub const ASPHERE_TERMS: usize = 8;

/// A rotationally symmetric shape: a conic plus an even polynomial,
///
/// `z(u) = c u / (1 + sqrt(1 - (1+k) c^2 u)) + a_2 u + a_4 u^2 + ... + a_16 u^8`, with `u = r^2`.
///
/// Source: ISO 10110-12; the r^2 term counts in first-order optics, `c_eff = c + 2 a_2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceShape {
    /// Vertex curvature c of the conic, 1/mm.
    pub curvature: f64,
    /// Conic constant k.
    pub conic: f64,
    /// Coefficients a_2, a_4, ..., a_16, mm^(1-n).
    pub asphere: [f64; ASPHERE_TERMS],
}

/// Sag and its first two derivatives with respect to `u = r^2`.
#[derive(Clone, Copy, Debug)]
pub struct SagJet {
    /// z(u), mm.
    pub sag: f64,
    /// dz/du, 1/mm.
    pub first: f64,
    /// d^2z/du^2, 1/mm^3.
    pub second: f64,
}

impl SurfaceShape {
    /// A flat surface.
    pub const PLANE: Self = Self { curvature: 0.0, conic: 0.0, asphere: [0.0; ASPHERE_TERMS] };

    /// Whether the polynomial part vanishes, so that a ray meets the surface in closed form.
    pub fn is_conic(&self) -> bool {
        self.asphere.iter().all(|a| *a == 0.0)
    }

    /// The curvature that first-order optics sees, `c + 2 a_2`.
    pub fn paraxial_curvature(&self) -> f64 {
        self.curvature + 2.0 * self.asphere[0]
    }

    /// Sag and its derivatives at `u = r^2`; `None` where the conic does not reach that far.
    #[inline]
    pub fn jet(&self, u: f64) -> Option<SagJet> {
        let (c, k1) = (self.curvature, 1.0 + self.conic);
        let w2 = 1.0 - k1 * c * c * u;
        if w2 <= 0.0 {
            return None;
        }
        // The conic: z = c u / (1 + w), z' = c / (2 w), z'' = (1+k) c^3 / (4 w^3).
        let w = w2.sqrt();
        let mut jet =
            SagJet { sag: c * u / (1.0 + w), first: 0.5 * c / w, second: 0.25 * k1 * c * c * c / (w2 * w) };
        // The polynomial by Horner's rule, with its derivatives.
        let (mut p, mut d, mut dd) = (0.0, 0.0, 0.0);
        for a in self.asphere.iter().rev() {
            dd = dd * u + 2.0 * d;
            d = d * u + p;
            p = p * u + a;
        }
        // p is the polynomial divided by u: z = u p, z' = p + u p', z'' = 2 p' + u p''.
        jet.sag += u * p;
        jet.first += p + u * d;
        jet.second += 2.0 * d + u * dd;
        Some(jet)
    }

    /// Sag at radius r, mm; `None` beyond the conic's reach.
    pub fn sag_mm(&self, r_mm: f64) -> Option<f64> {
        self.jet(r_mm * r_mm).map(|j| j.sag)
    }

    /// Derivatives of `(z, dz/du)` with respect to curvature and conic constant at `u`:
    /// `((z_c, z_k), (z'_c, z'_k))`. Those of the polynomial are `u^i` and `i u^(i-1)`.
    #[inline]
    pub fn conic_sensitivity(&self, u: f64) -> ((f64, f64), (f64, f64)) {
        let (c, k1) = (self.curvature, 1.0 + self.conic);
        let w2 = (1.0 - k1 * c * c * u).max(1e-300);
        let w = w2.sqrt();
        // With z (1 + w) = c u and w' = -k1 c u / w (by c), -c^2 u / (2 w) (by k).
        let z_c = u / ((1.0 + w) * w);
        let z_k = c * c * c * u * u / (2.0 * w * (1.0 + w) * (1.0 + w));
        let first_c = 0.5 / (w2 * w);
        let first_k = 0.25 * c * c * c * u / (w2 * w);
        ((z_c, z_k), (first_c, first_k))
    }
}

/// A surface in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// What it is called in tables, may be empty.
    pub label: String,
    /// Shape.
    pub shape: SurfaceShape,
    /// Vertex-to-vertex distance to the next surface (the last: to the image plane), mm.
    pub thickness_mm: f64,
    /// The medium behind the surface.
    pub glass: Arc<Glass>,
    /// Clear semi-diameter, mm: light beyond it is lost.
    pub semi_diameter_mm: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asphere() -> SurfaceShape {
        let mut asphere = [0.0; ASPHERE_TERMS];
        asphere[..5].copy_from_slice(&[1e-3, -2.07e-4, -4.4e-7, 4.42e-7, -2.23e-8]);
        SurfaceShape { curvature: 1.0 / 15.38, conic: 0.37, asphere }
    }

    #[test]
    fn sag_is_the_published_formula() {
        let s = asphere();
        let (c, r) = (s.curvature, 2.7_f64);
        let expected = c * r * r / (1.0 + (1.0 - 1.37 * c * c * r * r).sqrt()) + 1e-3 * r.powi(2)
            - 2.07e-4 * r.powi(4)
            - 4.4e-7 * r.powi(6)
            + 4.42e-7 * r.powi(8)
            - 2.23e-8 * r.powi(10);
        assert!((s.sag_mm(r).unwrap() - expected).abs() < 1e-15);
    }

    #[test]
    fn derivatives_match_central_differences() {
        let (s, u, h) = (asphere(), 6.25, 1e-4);
        let at = |u: f64| s.jet(u).unwrap();
        let j = at(u);
        assert!((j.first - (at(u + h).sag - at(u - h).sag) / (2.0 * h)).abs() < 1e-9);
        assert!((j.second - (at(u + h).first - at(u - h).first) / (2.0 * h)).abs() < 1e-9);
        let ((z_c, z_k), (d_c, d_k)) = s.conic_sensitivity(u);
        let with = |c: f64, k: f64| {
            let mut shifted = s;
            shifted.curvature += c;
            shifted.conic += k;
            shifted.jet(u).unwrap()
        };
        let h = 1e-6;
        for (analytic, plus, minus) in [
            (z_c, with(h, 0.0).sag, with(-h, 0.0).sag),
            (z_k, with(0.0, h).sag, with(0.0, -h).sag),
            (d_c, with(h, 0.0).first, with(-h, 0.0).first),
            (d_k, with(0.0, h).first, with(0.0, -h).first),
        ] {
            assert!((analytic - (plus - minus) / (2.0 * h)).abs() < 1e-8 * (1.0 + analytic.abs()));
        }
    }

    #[test]
    fn a_conic_that_ends_has_no_sag_beyond() {
        let sphere = SurfaceShape { curvature: 0.1, ..SurfaceShape::PLANE };
        assert!(sphere.sag_mm(9.99).is_some());
        assert!(sphere.sag_mm(10.01).is_none());
    }
}
