//! Gauss and Newton's method for a loss that is no sum of squares: the loss is lifted to the rays.
//!
//! Image formation, sensor and network depend on the lens only through where its rays land. Let e be the landing points, J their
//! derivatives by the numbers of the lens, and g those of a loss L > 0 by e. The residuals `r = sqrt(w) (e - e')` with
//! `e' = e_0 - 2 L g / |g|^2` and `w = |g|^2 / (4 L)` reproduce the loss at e_0: the sum of their squares is L, and its gradient is g. The
//! loss is replaced by a paraboloid over the rays that has the same slope and whose minimum is zero (Côté, Tseng and Heide, 2026, with
//! their factor 1/2 left out). Its curvature by the numbers of the lens is `w J' J`: it knows how a sphere and an aspheric term couple, and
//! needs no second derivative of the loss.
//!
//! e is the whole vector by which a loss sees a lens: where the rays of each field land, and the light of each field. A change of the light of a
//! field by a share counts as a motion of its rays by that share of the RMS spot: both change a PSF of that size by that share. A loss that
//! compares pictures with a scene sees where the rays land about their chief ray, and where the chief rays land. One that does not depend on
//! the place of a picture sees them about their centroid. Nothing is clipped.
//!
//! Here g is the smallest vector that explains the gradient by the numbers: of the rest of g no change of these numbers knows. The
//! rays stand for the beams, so they need not be those of the loss.

use nalgebra::{DMatrix, DVector};

use super::{Lost, SpotResiduals};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};

/// Directions in which the mean squared motion of rays is less than this share of the most are not followed.
const LEAST_SHARE: f64 = 1e-12;

/// By what a loss sees a lens.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The rays that stand for the beams.
    pub rays: &'a SpotResiduals,
    /// Whether it matters where on the image the light of a field lands.
    pub places: bool,
    /// Derivatives of the light of each field, relative to the light of the axis, each of the same weight.
    pub light: &'a [LensGradient],
}

/// The normal equations of the lifted residuals of a loss, laid out as in [`Merit::normal_equations`](super::Merit::normal_equations): the squares of the residuals add up
/// to `loss`, and half of the derivatives of that sum are half of `gradient`. Lost rays are left out. `None` if most rays of a field are lost, or
/// nothing moves.
pub fn lifted_normal_equations(
    Seen { rays, places, light }: Seen,
    lens: &Lens,
    numbers: &[(usize, Number)],
    loss: f64,
    gradient: &LensGradient,
) -> Option<DMatrix<f64>> {
    let count = numbers.len();
    let mut motion = rays.motion(lens, numbers, places)?;
    let share = rays.size_um(lens, Lost::LeftOut)?.powi(2) / light.len().max(1) as f64;
    for of_field in light {
        let by = DVector::from_fn(count + 1, |i, _| numbers.get(i).map_or(0.0, |n| of_field[*n]));
        motion.ger(share, &by, &by, 1.0);
    }
    // As the numbers change, the stop follows: its radius keeps the entrance pupil.
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let mut by_stop = LensGradient::zero(lens.surfaces.len());
    let per_log = FirstOrderCotangent { stop_radius: 1.0 / stop_radius_mm, ..Default::default() };
    pull_back_first_order(&reference, per_log, &mut by_stop);
    let follow = DMatrix::from_fn(count + 1, count, |row, column| {
        if row == count { by_stop[numbers[column]] } else { f64::from(u8::from(row == column)) }
    });
    let moved = follow.transpose() * &motion * &follow;
    let half = DVector::from_fn(count, |i, _| 0.5 * gradient[numbers[i]]);
    // |g|^2 of the smallest g with J' g = gradient, in units in which every number moves the rays alike.
    let scale =
        DVector::from_fn(count, |i, _| if moved[(i, i)] > 0.0 { moved[(i, i)].sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_fn(count, count, |r, c| moved[(r, c)] * scale[r] * scale[c]);
    let eigen = scaled.symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let along = eigen.eigenvectors.transpose() * half.component_mul(&scale);
    let parts = along.iter().zip(eigen.eigenvalues.iter());
    let square: f64 = parts.filter(|(_, e)| **e > LEAST_SHARE * most).map(|(a, e)| a * a / e).sum();
    let weight = square / loss;
    if !(weight.is_finite() && weight > 0.0) {
        return None;
    }
    let mut all = DMatrix::zeros(count + 2, count + 2);
    all.view_mut((0, 0), (count + 1, count + 1)).copy_from(&(motion * weight));
    all.view_mut((0, count + 1), (count, 1)).copy_from(&half);
    all.view_mut((count + 1, 0), (1, count)).copy_from(&half.transpose());
    all[(count + 1, count + 1)] = loss;
    Some(all)
}
