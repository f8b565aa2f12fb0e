//! Quantum efficiency over the spectrum: mean electrons per photon.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cfa::Colour;
use super::error::OutOfRange;
use crate::spectrum::{PixelOptics, Spectrum};

/// Quantum efficiency curves, 0..1, on common wavelengths; linear between samples, zero outside.
///
/// A pixel of colour c has the efficiency `scale s_c Q_c(l)`, with `s_R = alpha`, `s_G = 1`, `s_B = beta`, `s_clear = 1`:
/// N photons give `sum_l Q_c(l) s_c N(l)` electrons. `alpha` and `beta` correct the published curves so that the ratios of
/// red to green and of blue to green signal match those of a real camera (Tseng et al. 2021, supplement section 2.4.1; 0.82
/// and 1.25 for their camera). [`matched`](Self::matched) finds them from measured ratios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuantumEfficiency {
    /// Wavelengths, um, ascending.
    pub wavelength_um: Vec<f64>,
    /// Red pixels; empty if the sensor has none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub red: Vec<f64>,
    /// Green pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub green: Vec<f64>,
    /// Blue pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blue: Vec<f64>,
    /// Pixels without a colour filter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clear: Vec<f64>,
    /// Factor on all curves, for curves that are known only relative to their peak.
    #[serde(default = "one")]
    pub scale: f64,
    /// Factor on the red curve.
    #[serde(default = "one")]
    pub alpha: f64,
    /// Factor on the blue curve.
    #[serde(default = "one")]
    pub beta: f64,
}

impl Default for QuantumEfficiency {
    fn default() -> Self {
        let (wavelength_um, red, green, blue, clear) = Default::default();
        Self { wavelength_um, red, green, blue, clear, scale: 1.0, alpha: 1.0, beta: 1.0 }
    }
}

fn one() -> f64 {
    1.0
}

impl QuantumEfficiency {
    /// Checks lengths and ranges. Keys of errors begin with `quantum_efficiency.`, as in a sensor file.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let wrong = |key, value, low, high, meaning| Err(OutOfRange { key, value, low, high, meaning });
        let n = self.wavelength_um.len();
        let wavelengths = "quantum_efficiency.wavelength_um";
        if n < 2 {
            let meaning = "at least two wavelengths (the value is how many there are)";
            return wrong(wavelengths, n as f64, 2.0, 1e6, meaning);
        }
        for (i, &um) in self.wavelength_um.iter().enumerate() {
            let low = if i == 0 { 0.01 } else { self.wavelength_um[i - 1] };
            if !(low..=100.0).contains(&um) || (i > 0 && um == low) {
                let meaning = "wavelengths in um, each larger than the one before";
                return wrong(wavelengths, um, low, 100.0, meaning);
            }
        }
        for (key, curve) in [
            ("quantum_efficiency.red", &self.red),
            ("quantum_efficiency.green", &self.green),
            ("quantum_efficiency.blue", &self.blue),
            ("quantum_efficiency.clear", &self.clear),
        ] {
            if !curve.is_empty() && curve.len() != n {
                let meaning = "one efficiency per wavelength (the value is how many there are)";
                return wrong(key, curve.len() as f64, n as f64, n as f64, meaning);
            }
            if let Some(value) = curve.iter().find(|v| !(0.0..=1.0).contains(*v)) {
                return wrong(key, *value, 0.0, 1.0, "efficiencies in electrons per photon, not in percent");
            }
        }
        if Colour::ALL.into_iter().all(|c| self.samples(c).is_empty()) {
            let meaning = "the curve of at least one colour";
            return wrong("quantum_efficiency.green", 0.0, n as f64, n as f64, meaning);
        }
        for (key, value) in [
            ("quantum_efficiency.scale", self.scale),
            ("quantum_efficiency.alpha", self.alpha),
            ("quantum_efficiency.beta", self.beta),
        ] {
            if !(1e-3..=1e3).contains(&value) {
                return wrong(key, value, 1e-3, 1e3, "a factor; 1 leaves the curve as it is");
            }
        }
        self.validate_products()
    }

    /// Checks that the factors leave every efficiency at 1 or below: a photon of visible light frees one electron at most.
    fn validate_products(&self) -> Result<(), OutOfRange> {
        for (colour, key, factor) in [
            (Colour::Green, "quantum_efficiency.scale", 1.0),
            (Colour::Clear, "quantum_efficiency.scale", 1.0),
            (Colour::Red, "quantum_efficiency.alpha", self.alpha),
            (Colour::Blue, "quantum_efficiency.beta", self.beta),
        ] {
            let peak = self.samples(colour).iter().copied().fold(0.0, f64::max);
            // Computed factors may exceed 1 by rounding.
            if peak * factor * self.scale > 1.0 + 1e-9 {
                // Report the larger of the two factors.
                let (key, value, other) = if self.scale >= factor {
                    ("quantum_efficiency.scale", self.scale, factor)
                } else {
                    (key, factor, self.scale)
                };
                let meaning = "a factor with which no pixel gives more than one electron per photon \
                               (curves relative to their peak need a smaller `scale`)";
                return Err(OutOfRange { key, value, low: 1e-3, high: 1.0 / (peak * other), meaning });
            }
        }
        Ok(())
    }

    /// One efficiency at all wavelengths of silicon, 0.3..1.1 um, for every colour. It stands in for unpublished curves.
    /// `None` unless `efficiency` is above 0 and at most 1.
    pub fn flat(efficiency: f64) -> Option<Self> {
        let curve = || vec![efficiency; 2];
        let (red, green, blue, clear) = (curve(), curve(), curve(), curve());
        let flat = Self { wavelength_um: vec![0.3, 1.1], red, green, blue, clear, ..Self::default() };
        (efficiency > 0.0 && flat.validate().is_ok()).then_some(flat)
    }

    /// Efficiency of the pixels of a colour, factors included; `None` if it has no curve or the curves are not valid.
    pub fn curve(&self, colour: Colour) -> Option<Spectrum> {
        let factor = match colour {
            Colour::Red => self.alpha,
            Colour::Blue => self.beta,
            Colour::Green | Colour::Clear => 1.0,
        };
        let samples = self.samples(colour);
        Spectrum::new(self.wavelength_um.clone(), samples.iter().map(|v| v * factor * self.scale).collect())
            .ok()
    }

    /// Wavelength (um) and value of the highest efficiency of a colour, factors included; of equal peaks the one at the shortest
    /// wavelength. `None` if the colour has no curve.
    pub fn peak(&self, colour: Colour) -> Option<(f64, f64)> {
        let curve = self.curve(colour)?;
        let samples = curve.wavelength_um().iter().copied().zip(curve.value().iter().copied());
        samples.reduce(|best, next| if next.1 > best.1 { next } else { best })
    }

    /// The same curves with `alpha` and `beta` matched to a real camera: under `radiance` (W m-2 sr-1 nm-1) from a white
    /// surface, the ratios of red and blue to green signal are `red_over_green` and `blue_over_green`.
    ///
    /// `None` if a curve is missing or gives no signal, or if a pixel would give more than one electron per photon.
    pub fn matched(
        &self,
        optics: &PixelOptics,
        radiance: &Spectrum,
        red_over_green: f64,
        blue_over_green: f64,
    ) -> Option<Self> {
        let plain = Self { alpha: 1.0, beta: 1.0, ..self.clone() };
        let signal = |colour| Some(optics.electrons(radiance, &plain.curve(colour)?));
        let (red, green, blue) = (signal(Colour::Red)?, signal(Colour::Green)?, signal(Colour::Blue)?);
        let matched =
            Self { alpha: red_over_green * green / red, beta: blue_over_green * green / blue, ..plain };
        matched.validate().is_ok().then_some(matched)
    }

    fn samples(&self, colour: Colour) -> &[f64] {
        match colour {
            Colour::Red => &self.red,
            Colour::Green => &self.green,
            Colour::Blue => &self.blue,
            Colour::Clear => &self.clear,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::spectral::Illuminant;

    const CURVES: &str = include_str!("../../../petzval-data/data/quantum-efficiency/imx219.toml");

    #[test]
    fn matched_factors_give_the_measured_ratios() {
        let curves = QuantumEfficiency { scale: 0.5, ..toml::from_str::<QuantumEfficiency>(CURVES).unwrap() };
        let optics = PixelOptics { pixel_um: 5.86, f_number: 2.8, time_s: 0.01, transmission: None };
        let white = Illuminant::named("D65").unwrap().white_radiance(500.0);
        let matched = curves.matched(&optics, &white, 0.82, 1.25).unwrap();
        let signal = |colour| optics.electrons(&white, &matched.curve(colour).unwrap());
        assert!((signal(Colour::Red) / signal(Colour::Green) - 0.82).abs() < 1e-12);
        assert!((signal(Colour::Blue) / signal(Colour::Green) - 1.25).abs() < 1e-12);
        // Twenty times as much blue as green is more than one electron per photon.
        assert_eq!(curves.matched(&optics, &white, 0.82, 20.0), None);
    }

    #[test]
    fn a_flat_curve_holds_for_every_colour() {
        let flat = QuantumEfficiency::flat(0.6).unwrap();
        assert!(Colour::ALL.into_iter().all(|c| (flat.curve(c).unwrap().at(0.9) - 0.6).abs() < 1e-12));
        for wrong in [0.0, -0.1, 1.01, f64::NAN, f64::INFINITY] {
            assert_eq!(QuantumEfficiency::flat(wrong), None);
        }
    }
}
