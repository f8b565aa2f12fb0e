//! Wavefronts: their errors, Zernike coefficients and Strehl ratios.

use nalgebra::{DMatrix, DVector};
use petzval_base::statistics::{maximum, minimum};
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::lens_at_field::LensAtField;
use crate::lens::Lens;
use crate::pupil::{PupilBasis, PupilSampling, Sides};
use crate::trace::Sequence;
use crate::wave::{PupilPlane, WaveChannel, opd};

/// Terms of the Zernike fit: the fringe (University of Arizona) set.
pub const ZERNIKE_TERMS: usize = 37;

/// Least ratio of the singular values of a valid fit; over the whole stop it is about 0.1.
const LEAST_CONDITION: f64 = 1e-2;

/// Points on the rim of the stop.
const RIM: usize = 64;

/// Wavefronts of a field, by wavelength.
///
/// Each is the optical path difference from the sphere about the image of its own chief ray, over the stop in units of
/// its radius, positive where the wavefront is ahead of the sphere. A system with thin lenses has no wavefronts,
/// because thin lenses have no optical paths: all values are NaN (in JSON null) or `None`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Wavefront {
    /// The field, degrees.
    pub field_deg: f64,
    /// `[wavelength]`: root mean square about the mean, waves.
    pub rms_waves: Vec<f64>,
    /// `[wavelength]`: root mean square about the best sphere centre beside the chief ray (mean and tilt removed), waves.
    pub rms_centroid_waves: Vec<f64>,
    /// `[wavelength]`: highest minus lowest value, waves.
    pub peak_to_valley_waves: Vec<f64>,
    /// `[wavelength]`: Strehl ratio, the peak of the PSF divided by that of the same beam without aberrations; `None`
    /// if the wavefront is too rough for its polynomials or rays through the stop are lost.
    pub strehl: Vec<Option<f64>>,
    /// `[wavelength][term]`: fringe Zernike coefficients, waves; `None` if so much of the stop is dark that the fit
    /// is not determined.
    pub zernike_waves: Vec<Option<Vec<f64>>>,
    /// `[wavelength]`: root mean square of the residual of the fit, waves.
    pub zernike_residual_waves: Vec<Option<f64>>,
}

/// The wavefronts of a field.
pub fn wavefront(lens: &Lens, field_deg: f64) -> Result<Wavefront, AnalysisError> {
    let field = LensAtField::new(lens, field_deg)?;
    let mut found = Wavefront {
        field_deg,
        rms_waves: Vec::new(),
        rms_centroid_waves: Vec::new(),
        peak_to_valley_waves: Vec::new(),
        strehl: Vec::new(),
        zernike_waves: Vec::new(),
        zernike_residual_waves: Vec::new(),
    };
    let mut like: Option<WaveChannel> = None;
    for colour in &field.colours {
        if !colour.has_optical_paths() {
            found.peak_to_valley_waves.push(f64::NAN);
            found.rms_waves.push(f64::NAN);
            found.rms_centroid_waves.push(f64::NAN);
            found.strehl.push(None);
            found.zernike_waves.push(None);
            found.zernike_residual_waves.push(None);
            continue;
        }
        let Samples { points, waves, shares } = samples(&field, colour)?;
        let lowest = waves.iter().copied().fold(f64::INFINITY, minimum);
        let highest = waves.iter().copied().fold(f64::NEG_INFINITY, maximum);
        found.peak_to_valley_waves.push(highest - lowest);
        found.rms_waves.push(rms(&residual(&points, &waves, &shares, 1).unwrap_or(waves.clone()), &shares));
        // The first three terms are piston and the two tilts.
        let without_tilt = residual(&points, &waves, &shares, 3);
        found.rms_centroid_waves.push(without_tilt.map_or(f64::NAN, |rest| rms(&rest, &shares)));
        let zernike = fit(&points, &waves, &shares, ZERNIKE_TERMS);
        let rest = zernike.as_ref().map(|c| rms(&left_over(&points, &waves, c), &shares));
        found.zernike_residual_waves.push(rest);
        found.zernike_waves.push(zernike);
        let channel = field.wave(colour, like.as_ref());
        found.strehl.push(channel.as_ref().map(WaveChannel::strehl));
        like = channel.or(like);
    }
    Ok(found)
}

/// A wavefront on points of the stop, with their shares of its light.
struct Samples {
    points: Vec<[f64; 2]>,
    waves: Vec<f64>,
    shares: Vec<f64>,
}

fn samples(field: &LensAtField, colour: &Sequence) -> Result<Samples, AnalysisError> {
    // Take Gaussian points, which integrate a wavefront over the whole disk, up to its rim.
    let basis = PupilBasis::of(PupilSampling::Fine);
    let (mut points, mut areas) = (Sides::Both.points(&basis.samples), Sides::Both.weights(&basis.weights));
    // Add the middle and points on the rim without weight: they count for the highest and the lowest value only.
    points.push([0.0; 2]);
    areas.push(0.0);
    for k in 0..RIM {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / RIM as f64).sin_cos();
        points.push([sin, cos]);
        areas.push(0.0);
    }
    let found = opd(colour, field.field_rad, field.stop_radius_mm, &points, PupilPlane::Stop);
    let lost = AnalysisError::NoChiefRay { field_deg: field.field_deg, wavelength_um: colour.wavelength_um };
    let found = found.ok_or(lost)?;
    let mut kept = Samples { points: Vec::new(), waves: Vec::new(), shares: Vec::new() };
    for (i, wave) in found.waves.iter().enumerate() {
        if let (Some(wave), true) = (wave, found.transmission[i] > 0.0) {
            kept.points.push(points[i]);
            kept.waves.push(*wave);
            kept.shares.push(areas[i] * found.transmission[i]);
        }
    }
    let all: f64 = kept.shares.iter().sum();
    if all <= 0.0 || all.is_nan() {
        return Err(AnalysisError::NoLight { field_deg: field.field_deg });
    }
    kept.shares.iter_mut().for_each(|s| *s /= all);
    Ok(kept)
}

fn rms(values: &[f64], shares: &[f64]) -> f64 {
    values.iter().zip(shares).map(|(v, s)| s * v * v).sum::<f64>().sqrt()
}

/// Residual of a wavefront after a fit of the first terms; `None` if the points do not determine the fit.
fn residual(points: &[[f64; 2]], waves: &[f64], shares: &[f64], terms: usize) -> Option<Vec<f64>> {
    Some(left_over(points, waves, &fit(points, waves, shares, terms)?))
}

fn left_over(points: &[[f64; 2]], waves: &[f64], coefficients: &[f64]) -> Vec<f64> {
    let sum =
        |p: [f64; 2]| -> f64 { coefficients.iter().enumerate().map(|(k, c)| c * fringe_zernike(k, p)).sum() };
    points.iter().zip(waves).map(|(p, w)| w - sum(*p)).collect()
}

/// Coefficients of the first fringe terms, by least squares weighted by light.
fn fit(points: &[[f64; 2]], waves: &[f64], shares: &[f64], terms: usize) -> Option<Vec<f64>> {
    if shares.iter().filter(|s| **s > 0.0).count() < 2 * terms {
        return None;
    }
    let root: Vec<f64> = shares.iter().map(|s| s.sqrt()).collect();
    let matrix = DMatrix::from_fn(points.len(), terms, |i, k| root[i] * fringe_zernike(k, points[i]));
    let wanted = DVector::from_iterator(points.len(), waves.iter().zip(&root).map(|(w, r)| w * r));
    let qr = matrix.qr();
    let r = qr.r();
    // Reject a fit over a small part of the stop: the terms are similar there, and large coefficients cancel.
    let singular = r.singular_values();
    if singular.min() < LEAST_CONDITION * singular.max() {
        return None;
    }
    let found = r.solve_upper_triangular(&(qr.q().transpose() * wanted))?;
    Some(found.iter().copied().collect())
}

/// Term k (from 0: piston, x tilt, y tilt, defocus, ... to 36) of the fringe Zernike polynomials at a point of the unit
/// disk, each with maximum 1: `R_n^m(r) cos(m t)` and `R_n^m(r) sin(m t)`, t from the x axis.
///
/// The terms are in the order of n + |m|, then of descending |m|, cosine before sine; the last is the twelfth-order
/// spherical term. Source: Wyant and Creath, Applied Optics and Optical Engineering XI, chapter 1.
pub fn fringe_zernike(k: usize, [x, y]: [f64; 2]) -> f64 {
    let (n, m, is_sine) = fringe_indices(k);
    let (r, t) = (x.hypot(y), y.atan2(x));
    let radial: f64 = (0..=(n - m) / 2)
        .map(|s| {
            let sign = if s % 2 == 0 { 1.0 } else { -1.0 };
            let over = factorial(s) * factorial((n + m) / 2 - s) * factorial((n - m) / 2 - s);
            sign * factorial(n - s) / over * r.powi((n - 2 * s) as i32)
        })
        .sum();
    match (m, is_sine) {
        (0, _) => radial,
        (m, false) => radial * (m as f64 * t).cos(),
        (m, true) => radial * (m as f64 * t).sin(),
    }
}

/// Radial order, azimuthal order, and whether the term is a sine.
fn fringe_indices(k: usize) -> (usize, usize, bool) {
    if k + 1 == ZERNIKE_TERMS {
        return (12, 0, false);
    }
    // Group g holds n + m = 2 g: 2 g + 1 terms, m from g to 0.
    let (mut g, mut first) = (0, 0);
    while k > first + 2 * g {
        first += 2 * g + 1;
        g += 1;
    }
    let within = k - first;
    let m = g - within / 2;
    (2 * g - m, m, within % 2 == 1 && m > 0)
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fringe_terms_are_those_of_the_table() {
        // Defocus, astigmatism, coma, spherical aberration, trefoil, and the 37th.
        let (x, y): (f64, f64) = (0.3, -0.5);
        let r2 = x * x + y * y;
        let wanted = [
            (0, 1.0),
            (1, x),
            (2, y),
            (3, 2.0 * r2 - 1.0),
            (4, x * x - y * y),
            (5, 2.0 * x * y),
            (6, (3.0 * r2 - 2.0) * x),
            (7, (3.0 * r2 - 2.0) * y),
            (8, 6.0 * r2 * r2 - 6.0 * r2 + 1.0),
            (9, x.powi(3) - 3.0 * x * y * y),
            (10, 3.0 * x * x * y - y.powi(3)),
            (15, 20.0 * r2.powi(3) - 30.0 * r2 * r2 + 12.0 * r2 - 1.0),
            (
                36,
                924.0 * r2.powi(6) - 2772.0 * r2.powi(5) + 3150.0 * r2.powi(4) - 1680.0 * r2.powi(3)
                    + 420.0 * r2 * r2
                    - 42.0 * r2
                    + 1.0,
            ),
        ];
        for (k, value) in wanted {
            assert!((fringe_zernike(k, [x, y]) - value).abs() < 1e-12, "term {k}");
        }
    }

    #[test]
    fn a_sum_of_terms_is_found_again() {
        let basis = PupilBasis::of(PupilSampling::Fine);
        let (points, shares) = (Sides::Both.points(&basis.samples), Sides::Both.weights(&basis.weights));
        let wanted: Vec<f64> = (0..ZERNIKE_TERMS).map(|k| (k as f64 * 1.3).sin()).collect();
        let waves: Vec<f64> = points
            .iter()
            .map(|p| wanted.iter().enumerate().map(|(k, c)| c * fringe_zernike(k, *p)).sum())
            .collect();
        let found = fit(&points, &waves, &shares, ZERNIKE_TERMS).unwrap();
        assert!(found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-10));
        assert!(rms(&left_over(&points, &waves, &found), &shares) < 1e-10);
    }
}
