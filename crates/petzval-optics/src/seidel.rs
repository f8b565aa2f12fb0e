//! Third-order (Seidel) aberration sums, by surface.
//!
//! With `A = n (u + y c)` of the marginal ray, `Abar` of the chief ray, `H = n (u ybar - ubar y)`:
//! `S_I = -A^2 y D(u/n)`, `S_II = -A Abar y D(u/n)`, `S_III = -Abar^2 y D(u/n)`,
//! `S_IV = -H^2 c D(1/n)`, `S_V = -Abar (Abar^2 D(1/n^2) y - (Abar y - H) ybar c D(1/n))`.
//! A departure from the paraxial sphere by `b r^4` adds `a = 8 b (n' - n) y^4` times 1, q, q^2, 0, q^3
//! with `q = ybar / y`. Between two colours, with `dn` the difference of their indices, `C_I = A y D(dn/n)` and
//! `C_II = Abar y D(dn/n)`. Source: Welford, Aberrations of Optical Systems, chapters 8 and 10.

use crate::lens::ObjectDistance;
use crate::paraxial::{ParaxialRay, first_order, paraxial_ray, rectilinear_tangent};
use crate::trace::{Bending, Sequence};

/// Seidel coefficients S_I ... S_V, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seidel {
    /// Spherical aberration, coma, astigmatism, Petzval curvature, distortion.
    pub s: [f64; 5],
}

/// Whether the formulas hold for a surface: not for a thin lens, nor for a diffractive structure with power.
fn is_covered(bending: &Bending) -> bool {
    match bending {
        Bending::Snell => true,
        Bending::ThinLens { .. } => false,
        Bending::Path { radial, .. } => radial[0] == 0.0,
    }
}

/// The sums of a lens: one entry per surface; add them for the whole. `None` if one of the surfaces is a thin lens, or a
/// diffractive structure with power, and for fields of 90 degrees and more, which have no paraxial chief ray.
///
/// Surfaces are taken in their y-z section, without shifts and turns. Odd powers of r, odd powers of y of an XY
/// polynomial and straight gratings are ignored.
pub fn seidel(sequence: &Sequence, field_rad: f64) -> Option<Vec<Seidel>> {
    if !sequence.surfaces.iter().all(|s| is_covered(&s.bending))
        || !rectilinear_tangent(field_rad).is_finite()
    {
        return None;
    }
    let (marginal, chief) = marginal_and_chief(sequence, field_rad);
    let invariant = marginal.w[0] * chief.y[0] - chief.w[0] * marginal.y[0];

    let sums = sequence.surfaces.iter().enumerate().map(|(i, s)| {
        let (n, n_next) = (s.n_before, s.n_after);
        let c = s.shape.paraxial_curvature();
        let (y, y_chief) = (marginal.y[i], chief.y[i]);
        let a = marginal.w[i] + n * y * c;
        let a_chief = chief.w[i] + n * y_chief * c;
        let d_slope = marginal.w[i + 1] / (n_next * n_next) - marginal.w[i] / (n * n);
        let d_index = 1.0 / n_next - 1.0 / n;
        let d_index2 = 1.0 / (n_next * n_next) - 1.0 / (n * n);
        let mut sums = [
            -a * a * y * d_slope,
            -a * a_chief * y * d_slope,
            -a_chief * a_chief * y * d_slope,
            -invariant * invariant * c * d_index,
            -a_chief * (a_chief * a_chief * d_index2 * y - (a_chief * y - invariant) * y_chief * c * d_index),
        ];
        // The r^4 term of the surface minus that of the sphere with the paraxial curvature.
        let quartic = s.shape.quartic() - c.powi(3) / 8.0;
        let structure = match &s.bending {
            Bending::Path { radial, .. } => radial[1],
            _ => 0.0,
        };
        let aspheric = 8.0 * (quartic * (n_next - n) - structure) * y.powi(4);
        if aspheric != 0.0 {
            let q = y_chief / y;
            for (sum, factor) in sums.iter_mut().zip([1.0, q, q * q, 0.0, q * q * q]) {
                *sum += aspheric * factor;
            }
        }
        Seidel { s: sums }
    });
    let sums = sums.collect();
    Some(sums)
}

/// The paraxial rays from the object's axis point to the rim of the entrance pupil, and from the field's point to its middle.
pub(crate) fn marginal_and_chief(sequence: &Sequence, field_rad: f64) -> (ParaxialRay, ParaxialRay) {
    let order = first_order(sequence);
    let (y1, u1) = match sequence.object {
        ObjectDistance::Infinity => (0.5 * sequence.entrance_pupil_mm, 0.0),
        ObjectDistance::Finite(distance) => {
            let u = 0.5 * sequence.entrance_pupil_mm / (distance + order.entrance_pupil_at_mm);
            (u * distance, u)
        }
    };
    let chief_slope = match sequence.object {
        ObjectDistance::Infinity => rectilinear_tangent(field_rad),
        ObjectDistance::Finite(d) => field_rad.tan() * d / (d + order.entrance_pupil_at_mm),
    };
    let marginal = paraxial_ray(sequence, y1, u1);
    let chief = paraxial_ray(sequence, -chief_slope * order.entrance_pupil_at_mm, chief_slope);
    (marginal, chief)
}

/// Chromatic sums C_I (axial colour) and C_II (lateral colour) by surface, mm, between two colours (the shorter wavelength
/// first) of the lens whose rays are those of `sequence`.
pub fn chromatic(
    sequence: &Sequence,
    shorter: &Sequence,
    longer: &Sequence,
    field_rad: f64,
) -> Vec<[f64; 2]> {
    let (marginal, chief) = marginal_and_chief(sequence, field_rad);
    let parts = sequence.surfaces.iter().enumerate().map(|(i, s)| {
        let c = s.shape.paraxial_curvature();
        let (a, a_chief) =
            (marginal.w[i] + s.n_before * marginal.y[i] * c, chief.w[i] + s.n_before * chief.y[i] * c);
        let (short, long) = (&shorter.surfaces[i], &longer.surfaces[i]);
        let before = (short.n_before - long.n_before) / s.n_before;
        let behind = (short.n_after - long.n_after) / s.n_after;
        [a, a_chief].map(|a| a * marginal.y[i] * (behind - before))
    });
    parts.collect()
}

/// The sums over all surfaces; `None` if [`seidel`] returns none.
pub fn seidel_total(sequence: &Sequence, field_rad: f64) -> Option<Seidel> {
    let mut total = Seidel::default();
    for surface in seidel(sequence, field_rad)? {
        for (t, s) in total.s.iter_mut().zip(surface.s) {
            *t += s;
        }
    }
    Some(total)
}
