//! Illuminants: those of the CIE, daylight and black bodies of any temperature.

use std::sync::LazyLock;

use super::observer::luminous;
use super::table::SpectrumTable;
use crate::spectrum::Spectrum;

/// An illuminant and its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Illuminant {
    /// The name that was requested.
    pub name: String,
    /// Relative power per nm.
    pub power: Spectrum,
}

/// Why an illuminant cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IlluminantError {
    /// The name is not known.
    #[error("no illuminant called `{name}`; there are {}, daylight:KELVIN and blackbody:KELVIN", illuminant_names().join(", "))]
    Unknown {
        /// The name given.
        name: String,
    },
    /// The temperature is outside the range of the formula.
    #[error("{kind} of {kelvin} K: not within {low}..{high} K")]
    Temperature {
        /// Which formula.
        kind: &'static str,
        /// Temperature given.
        kelvin: f64,
        /// Least temperature.
        low: f64,
        /// Largest temperature.
        high: f64,
    },
    /// The spectrum has no visible light, or negative power.
    #[error("the illuminant `{name}` has {problem}")]
    Dark {
        /// Its name.
        name: String,
        /// What is wrong.
        problem: &'static str,
    },
}

fn tabulated() -> &'static SpectrumTable {
    static TABLE: LazyLock<SpectrumTable> =
        LazyLock::new(|| SpectrumTable::built_in(petzval_data::spectra::ILLUMINANTS));
    &TABLE
}

/// Names of the tabulated illuminants.
pub fn illuminant_names() -> Vec<&'static str> {
    tabulated().curves.iter().map(|(name, _)| name.as_str()).collect()
}

impl Illuminant {
    /// A light by name: a CIE illuminant (`D65`, `A`, `FL11`, ...), `daylight:KELVIN` or `blackbody:KELVIN`.
    pub fn named(name: &str) -> Result<Self, IlluminantError> {
        let unknown = || IlluminantError::Unknown { name: name.chars().take(80).collect() };
        let power = match name.split_once(':') {
            None => tabulated().get(name.trim()).cloned().ok_or_else(unknown)?,
            Some((kind, kelvin)) => {
                let kelvin: f64 =
                    kelvin.trim().trim_end_matches(['K', 'k']).parse().map_err(|_| unknown())?;
                match kind.trim().to_ascii_lowercase().as_str() {
                    "daylight" => daylight(kelvin)?,
                    "blackbody" => blackbody(kelvin)?,
                    _ => return Err(unknown()),
                }
            }
        };
        Ok(Self { name: name.to_owned(), power })
    }

    /// An illuminant from a spectrum. Fails if the spectrum has no visible light or negative power.
    pub fn from_spectrum(name: &str, power: Spectrum) -> Result<Self, IlluminantError> {
        let dark = |problem| Err(IlluminantError::Dark { name: name.to_owned(), problem });
        if power.value().iter().any(|v| *v < 0.0) {
            return dark("negative power");
        }
        if luminous(&power) <= 0.0 {
            return dark("no light in the visible");
        }
        Ok(Self { name: name.to_owned(), power })
    }

    /// Irradiance in W m-2 nm-1 with an illuminance of `lux`.
    pub fn irradiance(&self, lux: f64) -> Spectrum {
        self.power.scaled(lux / luminous(&self.power))
    }

    /// Radiance in W m-2 sr-1 nm-1 of the perfect diffuser under an illuminance of `lux`: `L = E / pi`.
    pub fn white_radiance(&self, lux: f64) -> Spectrum {
        self.irradiance(lux / std::f64::consts::PI)
    }
}

/// Black body: `S(l) ~ l^-5 / (exp(c2 / (l T)) - 1)`, 1 at 560 nm, every 5 nm over 300..1100 nm.
///
/// `kelvin` is 1000..1e6. c2 = 1.438776877e-2 m K follows from CODATA 2018 (exact SI constants). Linear interpolation over
/// 5 nm has an error below 1e-3 above 1500 K.
pub fn blackbody(kelvin: f64) -> Result<Spectrum, IlluminantError> {
    const C2_UM_K: f64 = 14_387.768_77;
    let (low, high) = (1000.0, 1e6);
    if !(low..=high).contains(&kelvin) {
        return Err(IlluminantError::Temperature { kind: "a black body", kelvin, low, high });
    }
    // exp(a) - exp(b) cannot overflow: the exponent is at most c2 / (0.3 * 1000) = 48.
    let planck = |um: f64| um.powi(-5) / (C2_UM_K / (um * kelvin)).exp_m1();
    let at_560 = planck(0.56);
    match Spectrum::sampled(0.3..=1.1, 0.005, |um| planck(um) / at_560) {
        Ok(curve) => Ok(curve),
        Err(error) => unreachable!("Planck's law is finite here: {error}"),
    }
}

/// Chromaticity of daylight of a correlated colour temperature T, 4000..25000 K (CIE 15):
/// `x = a/T^3 + b/T^2 + c/T + d`, `y = -3 x^2 + 2.87 x - 0.275`.
pub fn daylight_chromaticity(kelvin: f64) -> Result<(f64, f64), IlluminantError> {
    let (low, high) = (4000.0, 25_000.0);
    if !(low..=high).contains(&kelvin) {
        return Err(IlluminantError::Temperature { kind: "daylight", kelvin, low, high });
    }
    let t = 1000.0 / kelvin;
    let x = if kelvin <= 7000.0 {
        ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
    } else {
        ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040
    };
    Ok((x, (-3.0 * x + 2.870) * x - 0.275))
}

/// Daylight of a correlated colour temperature of 4000..25000 K.
///
/// CIE 15 defines daylight as a sum of three components, `S = S0 + M1 S1 + M2 S2`, with M1 and M2 from the chromaticity. D50,
/// D55 and D75 are three of these sums, so every other daylight is a combination of them: `S = sum_k w_k D_k` with
/// `sum w_k (1, M1_k, M2_k) = (1, M1, M2)`. Temperatures refer to the revised radiation constant: D65 is 6504 K.
pub fn daylight(kelvin: f64) -> Result<Spectrum, IlluminantError> {
    let target = components(daylight_chromaticity(kelvin)?);
    // Convert the nominal temperatures from c2 = 1.438e-2 to 1.4388e-2 m K.
    let known = ["D50", "D55", "D75"];
    let mut rows = [[0.0; 4]; 3];
    for (column, nominal) in [5000.0, 5500.0, 7500.0].into_iter().enumerate() {
        let at = components(daylight_chromaticity(nominal * 1.4388 / 1.438)?);
        for row in 0..3 {
            rows[row][column] = [1.0, at.0, at.1][row];
        }
    }
    for row in 0..3 {
        rows[row][3] = [1.0, target.0, target.1][row];
    }
    let weights = cramer(rows);
    let curves = known.map(|name| tabulated().get(name));
    let [Some(d50), Some(d55), Some(d75)] = curves else { unreachable!("the table holds D50, D55 and D75") };
    let value = (0..d50.value().len())
        .map(|i| weights[0] * d50.value()[i] + weights[1] * d55.value()[i] + weights[2] * d75.value()[i])
        .map(|v| v.max(0.0))
        .collect();
    match Spectrum::new(d50.wavelength_um().to_vec(), value) {
        Ok(curve) => Ok(curve),
        Err(error) => unreachable!("a sum of tables is finite: {error}"),
    }
}

/// Weights M1 and M2 of the second and third component of daylight, rounded to three decimals as in CIE 15.
fn components((x, y): (f64, f64)) -> (f64, f64) {
    let denominator = 0.0241 + 0.2562 * x - 0.7341 * y;
    let round = |v: f64| (v * 1000.0).round() / 1000.0;
    (
        round((-1.3515 - 1.7703 * x + 5.9114 * y) / denominator),
        round((0.0300 - 31.4424 * x + 30.0717 * y) / denominator),
    )
}

/// Solution of three linear equations, coefficients and right-hand side in each row.
fn cramer(rows: [[f64; 4]; 3]) -> [f64; 3] {
    let determinant = |c: [usize; 3]| {
        let m = |r: usize, k: usize| rows[r][c[k]];
        m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) - m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0))
            + m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0))
    };
    let whole = determinant([0, 1, 2]);
    [determinant([3, 1, 2]) / whole, determinant([0, 3, 2]) / whole, determinant([0, 1, 3]) / whole]
}

#[cfg(test)]
mod tests {
    use super::super::observer::{chromaticity, xyz};
    use super::*;

    #[test]
    fn white_points_match_the_cie() {
        // CIE 15, 2 degree observer. Ours are integrals of the interpolated tables; the published values are sums.
        for (name, x, y) in [
            ("A", 0.44758, 0.40745),
            ("D50", 0.34567, 0.35851),
            ("D55", 0.33243, 0.34744),
            ("D65", 0.31272, 0.32903),
            ("D75", 0.29903, 0.31488),
            ("E", 0.33333, 0.33333),
            ("FL2", 0.3721, 0.3751),
            ("FL11", 0.3805, 0.3769),
            ("LED-B1", 0.4560, 0.4078),
            ("LED-B3", 0.3756, 0.3723),
            ("LED-B5", 0.3118, 0.3236),
        ] {
            let got = chromaticity(xyz(&Illuminant::named(name).unwrap().power));
            // Values of the lamps are published to four decimals.
            let tolerance = if name.starts_with("FL") || name.starts_with("LED") { 3e-4 } else { 6e-5 };
            assert!((got.0 - x).abs() < tolerance && (got.1 - y).abs() < tolerance, "{name}: {got:?}");
        }
    }

    #[test]
    fn daylight_of_6504_k_is_d65() {
        let (ours, table) = (daylight(6504.0).unwrap(), Illuminant::named("D65").unwrap().power);
        let worst =
            table.wavelength_um().iter().map(|um| (ours.at(*um) - table.at(*um)).abs()).fold(0.0, f64::max);
        assert!(worst < 0.05, "{worst}");
        for kelvin in [4000.0, 5000.0, 8000.0, 20_000.0] {
            let (x, y) = daylight_chromaticity(kelvin).unwrap();
            let got = chromaticity(xyz(&daylight(kelvin).unwrap()));
            assert!((got.0 - x).abs() < 3e-4 && (got.1 - y).abs() < 3e-4, "{kelvin}: {got:?} {x} {y}");
        }
    }

    #[test]
    fn a_black_body_of_2856_k_is_illuminant_a() {
        let (ours, a) = (blackbody(2855.5).unwrap(), Illuminant::named("A").unwrap().power);
        for um in [0.4, 0.5, 0.6, 0.7] {
            assert!(
                (ours.at(um) * 100.0 / a.at(um) - 1.0).abs() < 1e-3,
                "{um}: {} {}",
                ours.at(um),
                a.at(um)
            );
        }
    }

    #[test]
    fn irradiance_has_the_requested_illuminance() {
        for name in illuminant_names() {
            let light = Illuminant::named(name).unwrap();
            assert!((luminous(&light.irradiance(500.0)) - 500.0).abs() < 1e-9, "{name}");
        }
    }

    #[test]
    fn unknown_lights_are_refused() {
        for (name, needle) in [
            ("D66", "D65"),
            ("daylight:100", "4000"),
            ("blackbody:nan", "1000"),
            ("blackbody:", "blackbody:KELVIN"),
            ("sun:5000", "no illuminant"),
        ] {
            let error = Illuminant::named(name).unwrap_err().to_string();
            assert!(error.contains(needle), "{error}");
        }
        let infrared = Spectrum::new(vec![0.9, 1.0], vec![1.0, 1.0]).unwrap();
        assert!(Illuminant::from_spectrum("lamp", infrared).is_err());
    }
}
