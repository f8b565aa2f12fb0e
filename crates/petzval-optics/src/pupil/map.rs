//! The pupil polynomial: the properties of a beam as polynomials through one to four hundred traced rays.
//!
//! Transverse aberration is a smooth function of the pupil. For one field and one wavelength a [`PupilMap`] holds
//! polynomials in the stop coordinates: the position of the ray on the image plane, its light, and its height at the
//! clear apertures that may cut it. The residual is the distance of the polynomials from traced rays to which they were
//! not fitted.

use super::basis::PupilBasis;
use super::launch::{launch_area, projections};
use super::polynomial::{PupilPolynomial, Symmetry};
use super::samples::{PupilSamples, SamplesCotangent};
use crate::gradient::LensGradient;
use crate::number::Number;
use crate::trace::{SOFT_EDGE_MM, Sequence, SquaredHeights};

/// A quantity over the pupil at a clear aperture: the squared height of rays there.
#[derive(Debug)]
pub(crate) struct Height {
    pub surface: usize,
    pub semi_diameter_mm: f64,
    /// In mm^2.
    pub polynomial: PupilPolynomial,
}

/// Polynomials of one field at one wavelength.
#[derive(Debug)]
pub(crate) struct PupilMap {
    pub samples: PupilSamples,
    /// x and y on the image plane, mm.
    pub image: [PupilPolynomial; 2],
    /// Light per share of the stop's area.
    pub light: PupilPolynomial,
    /// Clear apertures that may cut the beam.
    pub heights: Vec<Height>,
}

/// Largest distances of polynomials from traced rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Residual {
    /// On the image plane, mm.
    pub image_mm: f64,
    /// Of the light, relative.
    pub light: f64,
    /// Of the radius at clear apertures, mm.
    pub aperture_mm: f64,
}

impl Residual {
    /// Whether positions on the image agree to `image_mm`, light to a thousandth, and heights at apertures to a tenth
    /// of their soft edge.
    pub fn within(&self, image_mm: f64) -> bool {
        self.image_mm < image_mm && self.light < 1e-3 && self.aperture_mm < 0.1 * SOFT_EDGE_MM
    }
}

/// Cotangents of the coefficients of a map.
#[derive(Clone, Debug)]
pub(crate) struct MapCotangent {
    pub image: [PupilPolynomial; 2],
    pub light: PupilPolynomial,
    pub heights: Vec<PupilPolynomial>,
    /// By the clear semi-diameters of the heights, 1/mm.
    pub semi_diameters: Vec<f64>,
}

/// Changes of the coefficients and of the semi-diameters (mm), laid out as their cotangents.
pub(crate) type MapTangent = MapCotangent;

impl MapCotangent {
    pub fn zero(map: &PupilMap) -> Self {
        Self {
            image: map.image.each_ref().map(PupilPolynomial::zero_like),
            light: PupilPolynomial::zero_like(&map.light),
            heights: map.heights.iter().map(|h| PupilPolynomial::zero_like(&h.polynomial)).collect(),
            semi_diameters: vec![0.0; map.heights.len()],
        }
    }
}

impl PupilMap {
    /// The polynomials through the samples of a beam.
    pub fn new(sequence: &Sequence, samples: PupilSamples) -> Self {
        let fit = |values: &[f64], symmetry| samples.basis.fit(values, samples.sides, symmetry);
        let height = |h: &SquaredHeights| Height {
            surface: h.surface,
            semi_diameter_mm: sequence.surfaces[h.surface].semi_diameter_mm,
            polynomial: fit(&h.values, Symmetry::Even),
        };
        Self {
            image: [fit(&samples.x, Symmetry::Odd), fit(&samples.y, Symmetry::Even)],
            light: fit(&samples.light, Symmetry::Even),
            heights: samples.heights.iter().map(height).collect(),
            samples,
        }
    }

    /// The basis of the polynomials.
    pub fn basis(&self) -> &'static PupilBasis {
        self.samples.basis
    }

    /// Distance of the polynomials from rays through other points of the stop; `None` if one of these rays is lost.
    pub fn residual(&self, sequence: &Sequence) -> Option<Residual> {
        let samples = &self.samples;
        let (basis, sides) = (samples.basis, samples.sides);
        let at_checks = |polynomial: &PupilPolynomial| basis.at_checks(polynomial, sides);
        let (field, radius) = (samples.field_rad, samples.stop_radius_mm);
        let traced = samples.trace_checks(sequence, self.heights.iter().map(|h| h.surface))?;
        let points = traced.rays.len();
        let [x, y] = traced.rays.image_xy();
        let (fit_x, fit_y) = (at_checks(&self.image[0]), at_checks(&self.image[1]));
        let fit_light = at_checks(&self.light);
        let area = launch_area(sequence, radius);
        // Reject fits that are not finite: `max` below would ignore NaN.
        if !fit_x.iter().chain(&fit_y).chain(&fit_light).all(|v| v.is_finite()) {
            return None;
        }
        let mut worst = Residual::default();
        for (i, (projection, _)) in projections(sequence, field, &traced.aimed, points).enumerate() {
            worst.image_mm = worst.image_mm.max((x[i] - fit_x[i]).hypot(y[i] - fit_y[i]));
            // Compare with the light of the ray by its exact derivatives.
            let light = radius * radius * traced.aimed.launch_per_stop_area(i).abs() / area * projection;
            worst.light = worst.light.max((fit_light[i] / light - 1.0).abs());
        }
        for (h, traced) in self.heights.iter().zip(&traced.heights) {
            for (fit, traced) in at_checks(&h.polynomial).iter().zip(&traced.values) {
                let (r, traced) = (fit.max(0.0).sqrt(), traced.sqrt());
                // Errors far from the edge of an aperture count a tenth.
                let near = (traced - h.semi_diameter_mm).abs() < 0.1 * h.semi_diameter_mm;
                let off = (r - traced).abs();
                worst.aperture_mm = worst.aperture_mm.max(if near { off } else { 0.1 * off });
            }
        }
        Some(worst)
    }

    /// Adds the gradient of a loss to `gradient` and returns its derivative by the stop radius.
    pub fn pull_back(&self, sequence: &Sequence, map_bar: &MapCotangent, gradient: &mut LensGradient) -> f64 {
        let (basis, sides) = (self.basis(), self.samples.sides);
        let mut at_samples = SamplesCotangent::zero(&self.samples);
        basis.pull_back_fit(&map_bar.image[0], sides, &mut at_samples.seeds.image_x);
        basis.pull_back_fit(&map_bar.image[1], sides, &mut at_samples.seeds.image_y);
        basis.pull_back_fit(&map_bar.light, sides, &mut at_samples.light);
        for ((h, bar), semi_bar) in self.heights.iter().zip(&map_bar.heights).zip(&map_bar.semi_diameters) {
            gradient[(h.surface, Number::SemiDiameter)] += semi_bar;
            if !bar.is_zero() {
                let mut height = SquaredHeights::zero(h.surface, self.samples.x.len());
                basis.pull_back_fit(bar, sides, &mut height.values);
                at_samples.seeds.heights.push(height);
            }
        }
        self.samples.pull_back(sequence, &at_samples, gradient)
    }

    /// The change of the map along a change of the lens and of the logarithm of the stop radius: the transpose of
    /// [`PupilMap::pull_back`].
    pub fn push_forward(&self, sequence: &Sequence, change: &LensGradient, stop_growth: f64) -> MapTangent {
        let moved = self.samples.push_forward(sequence, change, stop_growth);
        let fit = |values: &[f64], symmetry| self.basis().fit(values, self.samples.sides, symmetry);
        let heights = moved.rays.heights.iter();
        MapTangent {
            image: [fit(&moved.rays.image_x, Symmetry::Odd), fit(&moved.rays.image_y, Symmetry::Even)],
            light: fit(&moved.light, Symmetry::Even),
            heights: heights.map(|h| fit(&h.values, Symmetry::Even)).collect(),
            semi_diameters: self.heights.iter().map(|h| change[(h.surface, Number::SemiDiameter)]).collect(),
        }
    }
}
