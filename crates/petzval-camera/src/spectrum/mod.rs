//! A curve over wavelength, and exact integrals of products of such curves.

pub(crate) mod bands;
mod photons;

pub use bands::{band_mean, bands_within, even_bands};
pub use photons::{LIGHT_M_PER_S, OpticsError, PLANCK_J_S, PixelOptics};

use std::ops::RangeInclusive;

use petzval_base::table::Interval;

/// A sampled curve: linear between its samples, zero outside them.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    wavelength_um: Vec<f64>,
    value: Vec<f64>,
}

/// Why samples do not make a curve.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// Fewer than two samples, or not one value per wavelength.
    #[error(
        "{wavelengths} wavelengths and {values} values; a curve needs at least two, and as many of one as of the other"
    )]
    Length {
        /// Wavelengths given.
        wavelengths: usize,
        /// Values given.
        values: usize,
    },
    /// A wavelength is out of range or does not ascend.
    #[error("wavelength number {index} is {wavelength_um} um; wavelengths ascend, within 0.01..100 um")]
    Wavelength {
        /// Index of the sample, from 0.
        index: usize,
        /// The wavelength.
        wavelength_um: f64,
    },
    /// A value is not a finite number.
    #[error("the value at {wavelength_um} um is {value}")]
    Value {
        /// Wavelength of the sample.
        wavelength_um: f64,
        /// The value.
        value: f64,
    },
}

/// Wavelengths that a curve may have, um: from the extreme ultraviolet to the thermal infrared.
const POSSIBLE_UM: RangeInclusive<f64> = 0.01..=100.0;

impl Spectrum {
    /// A curve through `(wavelength_um, value)`; at least two samples, wavelengths strictly ascending.
    pub fn new(wavelength_um: Vec<f64>, value: Vec<f64>) -> Result<Self, SpectrumError> {
        if wavelength_um.len() < 2 || wavelength_um.len() != value.len() {
            return Err(SpectrumError::Length { wavelengths: wavelength_um.len(), values: value.len() });
        }
        for (index, &at) in wavelength_um.iter().enumerate() {
            let ascends = index == 0 || wavelength_um[index - 1] < at;
            if !POSSIBLE_UM.contains(&at) || !ascends {
                return Err(SpectrumError::Wavelength { index, wavelength_um: at });
            }
        }
        if let Some(i) = value.iter().position(|v| !v.is_finite()) {
            return Err(SpectrumError::Value { wavelength_um: wavelength_um[i], value: value[i] });
        }
        Ok(Self { wavelength_um, value })
    }

    /// The curve `f` sampled every `step_um` over `range_um`, both ends included.
    pub fn sampled(
        range_um: RangeInclusive<f64>,
        step_um: f64,
        f: impl Fn(f64) -> f64,
    ) -> Result<Self, SpectrumError> {
        let (low, high) = range_um.into_inner();
        let steps = ((high - low) / step_um).round();
        // More than a million samples are a mistaken step: let `new` reject the single sample.
        let steps = if (1.0..=1e6).contains(&steps) { steps as usize } else { 0 };
        let at: Vec<f64> = (0..=steps).map(|i| low + (high - low) * i as f64 / steps.max(1) as f64).collect();
        let value = at.iter().map(|um| f(*um)).collect();
        Self::new(at, value)
    }

    /// Wavelengths of the samples, um, ascending.
    pub fn wavelength_um(&self) -> &[f64] {
        &self.wavelength_um
    }

    /// Values of the samples.
    pub fn value(&self) -> &[f64] {
        &self.value
    }

    /// First and last wavelength, um.
    pub fn range_um(&self) -> (f64, f64) {
        (self.wavelength_um[0], self.wavelength_um[self.wavelength_um.len() - 1])
    }

    /// Value at a wavelength, um: linear between samples, zero outside.
    pub fn at(&self, um: f64) -> f64 {
        let (low, high) = self.range_um();
        if !(low..=high).contains(&um) {
            return 0.0;
        }
        Interval::in_slice(um, &self.wavelength_um).map_or(0.0, |interval| interval.mean(|i| self.value[i]))
    }

    /// The curve times a number.
    pub fn scaled(&self, factor: f64) -> Self {
        let value = self.value.iter().map(|v| v * factor).collect();
        Self { wavelength_um: self.wavelength_um.clone(), value }
    }

    /// The part of the curve between two wavelengths, um; `None` if the curve does not overlap that range.
    pub fn within(&self, (low_um, high_um): (f64, f64)) -> Option<Self> {
        let (first, last) = self.range_um();
        let (low, high) = (low_um.max(first), high_um.min(last));
        let inner = self.wavelength_um.iter().copied().filter(|um| low < *um && *um < high);
        let knots: Vec<f64> = [low].into_iter().chain(inner).chain([high]).collect();
        let value = knots.iter().map(|um| self.at(*um)).collect();
        Self::new(knots, value).ok()
    }

    /// The curve extended to these wavelengths, um, with its first and last value held constant.
    pub fn held(&self, (low_um, high_um): (f64, f64)) -> Self {
        let mut held = self.clone();
        let (first, last) = self.range_um();
        if POSSIBLE_UM.contains(&low_um) && low_um < first {
            held.wavelength_um.insert(0, low_um);
            held.value.insert(0, self.value[0]);
        }
        if POSSIBLE_UM.contains(&high_um) && high_um > last {
            held.wavelength_um.push(high_um);
            held.value.push(self.value[self.value.len() - 1]);
        }
        held
    }

    /// Shortest and longest wavelength, um, outside of which the curve is zero; `None` if it is zero everywhere.
    pub fn support_um(&self) -> Option<(f64, f64)> {
        let first = self.value.iter().position(|v| *v != 0.0)?;
        let last = self.value.iter().rposition(|v| *v != 0.0)?;
        let end = (last + 1).min(self.value.len() - 1);
        Some((self.wavelength_um[first.saturating_sub(1)], self.wavelength_um[end]))
    }

    /// The product with another curve, sampled at the wavelengths of both within their common range, linear in between.
    ///
    /// `None` if fewer than two wavelengths lie in the common range. For an exact integral of the product use [`integral`].
    pub fn times(&self, other: &Self) -> Option<Self> {
        let knots = common_knots(&[self, other]);
        let value = knots.iter().map(|um| self.at(*um) * other.at(*um)).collect();
        Self::new(knots, value).ok()
    }
}

/// Integral over the wavelength, in um, of the product of up to five curves:
/// `int f_1(l) f_2(l) ... dl`, exact for piecewise linear curves.
///
/// Between two neighbouring samples of any curve the product is a polynomial of at most fifth degree. The Gauss-Legendre
/// rule of three points integrates it without error. The result is zero if the curves have no wavelength in common.
pub fn integral(factors: &[&Spectrum]) -> f64 {
    debug_assert!(factors.len() <= 5, "the quadrature is exact for up to five factors");
    let reach = 0.6f64.sqrt();
    common_knots(factors)
        .windows(2)
        .map(|interval| {
            let (centre, half) = (0.5 * (interval[0] + interval[1]), 0.5 * (interval[1] - interval[0]));
            let product = |um: f64| factors.iter().map(|f| f.at(um)).product::<f64>();
            let ends = product(centre - reach * half) + product(centre + reach * half);
            half * (5.0 * ends + 8.0 * product(centre)) / 9.0
        })
        .sum()
}

/// Wavelengths of all curves within their common range, ascending.
fn common_knots(curves: &[&Spectrum]) -> Vec<f64> {
    let low = curves.iter().map(|c| c.range_um().0).fold(f64::NEG_INFINITY, f64::max);
    let high = curves.iter().map(|c| c.range_um().1).fold(f64::INFINITY, f64::min);
    let mut knots: Vec<f64> = curves.iter().flat_map(|c| c.wavelength_um.iter().copied()).collect();
    knots.retain(|um| (low..=high).contains(um));
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    knots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn within_held_and_support_of_a_curve() {
        let tent = curve(&[(0.4, 0.0), (0.5, 0.0), (0.6, 2.0), (0.7, 0.0), (0.8, 0.0)]);
        assert_eq!(tent.support_um(), Some((0.5, 0.7)));
        assert_eq!(tent.scaled(0.0).support_um(), None);
        let part = tent.within((0.55, 0.9)).unwrap();
        assert_eq!(part.range_um(), (0.55, 0.8));
        assert!((integral(&[&part]) - 0.175).abs() < 1e-12);
        assert_eq!(tent.within((0.9, 1.0)), None);
        let slope = curve(&[(0.5, 1.0), (0.6, 3.0)]);
        let held = slope.held((0.4, 0.7));
        for (um, value) in [(0.45, 1.0), (0.55, 2.0), (0.65, 3.0)] {
            assert!((held.at(um) - value).abs() < 1e-12);
        }
        assert_eq!(slope.held((0.52, 0.58)), slope);
    }

    fn curve(samples: &[(f64, f64)]) -> Spectrum {
        Spectrum::new(samples.iter().map(|s| s.0).collect(), samples.iter().map(|s| s.1).collect()).unwrap()
    }

    #[test]
    fn a_curve_is_linear_between_samples_and_zero_outside() {
        let c = curve(&[(0.4, 1.0), (0.5, 3.0), (0.7, 0.0)]);
        let expected =
            [(0.39, 0.0), (0.4, 1.0), (0.45, 2.0), (0.5, 3.0), (0.6, 1.5), (0.7, 0.0), (0.71, 0.0)];
        for (um, value) in expected {
            assert!((c.at(um) - value).abs() < 1e-12, "{um}");
        }
    }

    #[test]
    fn products_are_integrated_exactly() {
        // Over 0..1 shifted by 1: int x^n = 1/(n+1), and a kink at 1.5 in one of the factors.
        let ramp = curve(&[(1.0, 0.0), (2.0, 1.0)]);
        for n in 1..=5 {
            let factors = vec![&ramp; n];
            assert!((integral(&factors) - 1.0 / (n as f64 + 1.0)).abs() < 1e-14, "{n}");
        }
        let tent = curve(&[(1.0, 0.0), (1.5, 1.0), (2.0, 0.0)]);
        // int x t(x) = 1/2 * area (symmetric about 1/2) = 1/4.
        assert!((integral(&[&ramp, &tent]) - 0.25).abs() < 1e-14);
        let half = curve(&[(1.5, 1.0), (3.0, 1.0)]);
        assert!((integral(&[&ramp, &half]) - 0.375).abs() < 1e-14);
        assert_eq!(integral(&[&tent, &curve(&[(5.0, 1.0), (6.0, 1.0)])]), 0.0);
    }

    #[test]
    fn malformed_curves_are_refused() {
        let new = |w: &[f64], v: &[f64]| Spectrum::new(w.to_vec(), v.to_vec());
        assert!(matches!(new(&[0.5], &[1.0]), Err(SpectrumError::Length { .. })));
        assert!(matches!(new(&[0.5, 0.6], &[1.0]), Err(SpectrumError::Length { .. })));
        assert!(matches!(new(&[0.6, 0.5], &[1.0, 1.0]), Err(SpectrumError::Wavelength { index: 1, .. })));
        assert!(matches!(new(&[400.0, 500.0], &[1.0, 1.0]), Err(SpectrumError::Wavelength { index: 0, .. })));
        assert!(matches!(new(&[0.5, 0.6], &[1.0, f64::NAN]), Err(SpectrumError::Value { .. })));
        assert!(Spectrum::sampled(0.4..=0.7, 0.0, |_| 1.0).is_err());
    }
}
