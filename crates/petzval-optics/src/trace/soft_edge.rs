//! The soft edge of a clear aperture: one ray at a time, which is the reference, and several at a time.

use pulp::Simd;

use crate::lanes::Lanes;

/// Half-width of the soft edge of a clear aperture, mm: transmission falls smoothly from one to zero
/// between `semi - SOFT_EDGE_MM` and `semi + SOFT_EDGE_MM`, so that vignetting has a gradient.
pub const SOFT_EDGE_MM: f64 = 0.02;

/// Transmission of a clear aperture at `radius_mm`, and its derivative with respect to the radius.
///
/// A smooth step `T(s) = 1/2 - 3/4 s + 1/4 s^3` in `s = (radius - semi) / SOFT_EDGE_MM`, |s| <= 1.
#[inline]
pub fn aperture_transmission(radius_mm: f64, semi_diameter_mm: f64) -> (f64, f64) {
    let s = (radius_mm - semi_diameter_mm) / SOFT_EDGE_MM;
    if s <= -1.0 {
        (1.0, 0.0)
    } else if s >= 1.0 {
        (0.0, 0.0)
    } else {
        (0.5 - 0.75 * s + 0.25 * s * s * s, 0.75 * (s * s - 1.0) / SOFT_EDGE_MM)
    }
}

/// [`aperture_transmission`] of several rays.
pub(crate) struct SoftEdge<S: Simd> {
    /// Transmission.
    pub transmission: Lanes<S>,
    /// Its derivative by the radius, 1/mm; the derivative by the semi-diameter is the negative of it.
    pub by_radius: Lanes<S>,
    /// Radius, at least 1e-12 mm, mm.
    pub radius_mm: Lanes<S>,
}

/// The soft edge at squared radii `u`, mm^2; `None` where every ray passes well inside.
#[inline(always)]
pub(crate) fn soft_edge<S: Simd>(u: Lanes<S>, semi_diameter_mm: f64) -> Option<SoftEdge<S>> {
    let inside = (semi_diameter_mm - SOFT_EDGE_MM).max(0.0);
    if u.lt(u.constant(inside * inside)).all() {
        return None;
    }
    let one = u.constant(1.0);
    let radius_mm = u.max(u.constant(1e-24)).sqrt();
    let at = ((radius_mm - semi_diameter_mm) * (1.0 / SOFT_EDGE_MM)).max(-one).min(one);
    let square = at * at;
    let transmission = ((square * at) * 0.25 - at * 0.75 + 0.5).max(u.constant(0.0));
    Some(SoftEdge { transmission, by_radius: (square - one) * (0.75 / SOFT_EDGE_MM), radius_mm })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::MAX_LANES;
    use petzval_base::simd::dispatch;
    use pulp::WithSimd;

    #[test]
    fn soft_edge_is_smooth_and_monotonic() {
        let semi = 3.0;
        assert_eq!(aperture_transmission(semi - SOFT_EDGE_MM, semi).0, 1.0);
        assert_eq!(aperture_transmission(semi + SOFT_EDGE_MM, semi).0, 0.0);
        assert!((aperture_transmission(semi, semi).0 - 0.5).abs() < 1e-15);
        let h = 1e-6;
        for i in -9..=9 {
            let r = semi + 0.1 * f64::from(i) * SOFT_EDGE_MM;
            let numeric =
                (aperture_transmission(r + h, semi).0 - aperture_transmission(r - h, semi).0) / (2.0 * h);
            assert!((aperture_transmission(r, semi).1 - numeric).abs() < 1e-5);
        }
    }

    #[test]
    fn several_rays_are_softened_as_one() {
        let semi = 3.0;
        let radii: [f64; MAX_LANES] = std::array::from_fn(|i| semi + (i as f64 - 7.3) * 0.2 * SOFT_EDGE_MM);
        struct Check<'a>(&'a [f64; MAX_LANES], f64);
        impl WithSimd for Check<'_> {
            type Output = ();
            fn with_simd<S: Simd>(self, simd: S) {
                let u = Lanes::load(simd, &self.0.map(|r| r * r));
                let edge = soft_edge(u, self.1).unwrap();
                let [mut transmission, mut by_radius] = [[0.0; MAX_LANES]; 2];
                edge.transmission.store(&mut transmission);
                edge.by_radius.store(&mut by_radius);
                for (i, radius) in self.0.iter().enumerate().take(crate::lanes::width::<S>()) {
                    let (expected, slope) = aperture_transmission(*radius, self.1);
                    assert!((transmission[i] - expected).abs() < 1e-12, "{radius}");
                    assert!((by_radius[i] - slope).abs() < 1e-9, "{radius}");
                }
                assert!(soft_edge(u * 0.5, self.1).is_none());
            }
        }
        dispatch(Check(&radii, semi));
    }
}
