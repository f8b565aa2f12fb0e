//! Quantum efficiency over the spectrum: how many electrons a photon gives.

use petzval_optics::format::FileError;
use serde::{Deserialize, Serialize};

use super::cfa::Colour;
use super::model::OutOfRange;
use crate::spectral::{PixelOptics, Spectrum, SpectrumTable};

/// Quantum efficiency curves, 0..1, on common wavelengths; between samples linear, outside zero.
///
/// A pixel of colour c has the efficiency `scale s_c Q_c(l)`, with `s_R = alpha`, `s_G = 1`, `s_B = beta`, `s_clear = 1`:
/// the electrons are `sum_l Q_c(l) s_c N(l)` of N photons. `alpha` and `beta` correct the published curves so that the ratio
/// of red to green and of blue to green signal matches what a camera gives (Tseng et al. 2021, supplement section 2.4.1;
/// 0.82 and 1.25 for their camera); [`matched`](Self::matched) finds them from measured ratios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Reads and checks a file of curves: the keys of a sensor file's `[quantum_efficiency]`, at the top level.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let curves: Self = toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))?;
        curves.validate().map_err(|wrong| {
            let key = wrong.key.rsplit('.').next().unwrap_or(wrong.key);
            FileError::at_key(text, &[key], wrong.to_string()).hint(format!("give {}", wrong.meaning))
        })?;
        Ok(curves)
    }

    /// Reads and checks a file of curves of either kind: TOML ([`from_toml`](Self::from_toml)) or a table
    /// ([`from_csv`](Self::from_csv)), told by the `=` or `[` of the first line that is no comment.
    pub fn from_text(text: &str) -> Result<Self, FileError> {
        let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
        match lines.next() {
            Some(line) if !line.contains('=') && !line.starts_with('[') => Self::from_csv(text),
            _ => Self::from_toml(text),
        }
    }

    /// Reads and checks comma-separated values: a head line `wavelength_nm,red,green,blue`, `wavelength_nm,clear` or any of
    /// these columns, then one line per wavelength, in nm, with efficiencies in electrons per photon.
    pub fn from_csv(text: &str) -> Result<Self, FileError> {
        const HINT: &str = "give a head line such as `wavelength_nm,red,green,blue` or `wavelength_nm,clear`, then wavelengths in nm, \
                            ascending, with efficiencies of 0 to 1";
        let table = SpectrumTable::parse(text)?;
        let is_said = |line: &&(u32, &str)| !line.1.is_empty() && !line.1.starts_with('#');
        let lines: Vec<(u32, &str)> = (1..).zip(text.lines().map(str::trim)).collect();
        let mut lines = lines.iter().filter(is_said).copied();
        let (head_line, head) = lines.next().unwrap_or((0, ""));
        let wrong = |(line, text): (u32, &str), message: String| {
            Err(FileError::at_line(line, text, message).hint(HINT))
        };
        let mut curves = Self::default();
        for (name, curve) in &table.curves {
            let samples = match name.to_ascii_lowercase().as_str() {
                "red" => &mut curves.red,
                "green" => &mut curves.green,
                "blue" => &mut curves.blue,
                "clear" => &mut curves.clear,
                _ => {
                    let message = format!("column `{name}`: not one of red, green, blue, clear");
                    return wrong((head_line, head), message);
                }
            };
            if !samples.is_empty() {
                return wrong((head_line, head), format!("column `{name}` is there twice"));
            }
            *samples = curve.value().to_vec();
        }
        for (number, line) in lines {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            if let Some(empty) = cells.iter().position(|cell| cell.is_empty()) {
                let name = table.curves.get(empty.wrapping_sub(1)).map_or("wavelength", |(name, _)| name);
                return wrong((number, line), format!("column `{name}` has no value here"));
            }
            let mut efficiencies = cells.iter().skip(1).filter_map(|cell| cell.parse::<f64>().ok());
            if let Some(value) = efficiencies.find(|v| !(0.0..=1.0).contains(v)) {
                let message =
                    format!("{value} is no efficiency of 0 to 1 electrons per photon; is it in percent?");
                return wrong((number, line), message);
            }
        }
        // Without empty cells all columns have the wavelengths of the first.
        curves.wavelength_um =
            table.curves.first().map_or_else(Vec::new, |(_, c)| c.wavelength_um().to_vec());
        curves
            .validate()
            .map_err(|wrong| FileError::at_line(head_line, head, wrong.to_string()).hint(HINT))?;
        Ok(curves)
    }

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
                return wrong(
                    wavelengths,
                    um,
                    low,
                    100.0,
                    "wavelengths in um, each larger than the one before",
                );
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
            return wrong(
                "quantum_efficiency.green",
                0.0,
                n as f64,
                n as f64,
                "the curve of at least one colour",
            );
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
            // Factors that were computed reach 1 but for rounding.
            if peak * factor * self.scale > 1.0 + 1e-9 {
                // The larger of the two factors is the one to look at.
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

    /// The same efficiency at all wavelengths of silicon, 0.3..1.1 um, for every colour: for a sensor whose curves nobody
    /// has published. `None` unless it lies above 0 and at most at 1.
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

    /// Wavelength (um) and value of the highest efficiency of a colour, factors included; of several alike the shortest.
    pub fn peak(&self, colour: Colour) -> Option<(f64, f64)> {
        let curve = self.curve(colour)?;
        let samples = curve.wavelength_um().iter().copied().zip(curve.value().iter().copied());
        samples.reduce(|best, next| if next.1 > best.1 { next } else { best })
    }

    /// The same curves with the `alpha` and `beta` for which red over green and blue over green signal under `radiance`
    /// (W m-2 sr-1 nm-1) are `red_over_green` and `blue_over_green`, as measured on a white surface.
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
    use super::super::model::SensorModel;
    use super::*;

    #[test]
    fn a_table_reads_as_the_file_of_the_same_curves() {
        let table = "# mine\nwavelength_nm, Red, green\n400, 0.1, 0\n550, 0.2, 0.6\n700, 0.5, 0.1\n";
        let toml = "wavelength_um = [0.4, 0.55, 0.7]\nred = [0.1, 0.2, 0.5]\ngreen = [0, 0.6, 0.1]\n";
        let read = QuantumEfficiency::from_text(table).unwrap();
        assert_eq!(read, QuantumEfficiency::from_text(toml).unwrap());
        assert_eq!(read.curve(Colour::Clear), None);
        let clear = QuantumEfficiency::from_text("wavelength_nm,clear\n400,0.3\n700,0.2\n").unwrap();
        assert!((clear.curve(Colour::Clear).unwrap().at(0.55) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn errors_in_a_table_name_the_line() {
        for (text, line, needle) in [
            ("wavelength_nm,qe\n400,0.3\n700,0.2\n", 1, "`qe`: not one of red"),
            ("wavelength_nm,red,red\n400,0,0\n700,0,0\n", 1, "`red` is there twice"),
            ("wavelength_nm,clear\n400,0.3\n550,70\n700,20\n", 3, "percent"),
            ("wavelength_nm,red,green\n400,0.3,0\n\n550,,0.1\n700,0.2,0\n", 4, "`red` has no value"),
            ("wavelength_nm,clear\n400,0.3\n350,0.2\n", 3, "ascend"),
            ("wavelength_um,clear\n0.4,0.3\n0.7,0.2\n", 2, "within 0.01..100 um"),
            ("wavelength_nm,clear\n400,0.3\n700,x\n", 3, "`x`"),
            ("", 1, "wavelength_um"),
        ] {
            let error = QuantumEfficiency::from_text(text).unwrap_err();
            assert_eq!(error.line, Some(line), "{error}");
            assert!(error.to_string().contains(needle) && error.hint.is_some(), "{error}");
        }
    }
    use crate::spectral::Illuminant;

    const SENSOR: &str = include_str!("../../../../data/sensors/imx249-fitted.toml");
    const CURVES: &str = include_str!("../../../../data/quantum-efficiency/imx219.toml");

    #[test]
    fn the_shipped_curves_read() {
        for text in [CURVES, include_str!("../../../../data/quantum-efficiency/ov5647.toml")] {
            let curves = QuantumEfficiency::from_toml(text).unwrap();
            assert!(curves.curve(Colour::Clear).is_none() && curves.peak(Colour::Clear).is_none());
            let (um, efficiency) = curves.peak(Colour::Green).unwrap();
            let green = curves.curve(Colour::Green).unwrap();
            assert!((0.5..0.56).contains(&um) && green.value().iter().all(|q| *q <= efficiency));
            let [red, green, blue] =
                [Colour::Red, Colour::Green, Colour::Blue].map(|c| curves.curve(c).unwrap());
            assert!(
                red.at(0.62) > green.at(0.62)
                    && green.at(0.53) > blue.at(0.53)
                    && blue.at(0.45) > red.at(0.45)
            );
        }
    }

    #[test]
    fn the_shipped_monochrome_sensors_give_the_figures_that_they_cite() {
        for (text, snr_db, range_db) in [
            (include_str!("../../../../data/sensors/imx250-mono.toml"), 40.3, 71.2),
            (include_str!("../../../../data/sensors/imx273-mono.toml"), 40.2, 71.4),
            (include_str!("../../../../data/sensors/imx535-mono.toml"), 39.7, 69.8),
            (include_str!("../../../../data/sensors/mt9m034-mono.toml"), 37.7, 63.4),
        ] {
            let sensor = SensorModel::from_toml(text).unwrap();
            assert!(sensor.quantum_efficiency.is_none() && sensor.source.starts_with("https://"));
            // SNR_max = sqrt(u_e.sat), DR = u_e.sat / u_e.min, u_e.min = s_y.dark / K + 1/2.
            let dark_dn = ((sensor.gain_dn_per_e * sensor.read_noise_e).powi(2) + 1.0 / 12.0).sqrt();
            let least_e = dark_dn / sensor.gain_dn_per_e + 0.5;
            assert!((10.0 * sensor.full_well_e.log10() - snr_db).abs() < 0.005, "{}", sensor.name);
            assert!(
                (20.0 * (sensor.full_well_e / least_e).log10() - range_db).abs() < 0.02,
                "{}",
                sensor.name
            );
        }
    }

    #[test]
    fn the_sensor_with_a_whole_sheet_gives_the_figures_that_it_cites() {
        for (text, qe, snr_db, range_db, least_e) in [
            (include_str!("../../../../data/sensors/imx900-mono.toml"), 0.9125, 39.76, 63.8, 6.106),
            (include_str!("../../../../data/sensors/imx900-mono-high-gain.toml"), 0.8847, 33.39, 59.0, 2.461),
        ] {
            let sensor = SensorModel::from_toml(text).unwrap();
            let curve = sensor.quantum_efficiency.as_ref().unwrap().curve(Colour::Clear).unwrap();
            assert!((curve.at(0.536) - qe).abs() < 2e-4, "{}: {}", sensor.name, curve.at(0.536));
            let dark_dn = ((sensor.gain_dn_per_e * sensor.read_noise_e).powi(2) + 1.0 / 12.0).sqrt();
            let least = dark_dn / sensor.gain_dn_per_e + 0.5;
            assert!((least - least_e).abs() < 0.005, "{}: {least}", sensor.name);
            assert!((10.0 * sensor.full_well_e.log10() - snr_db).abs() < 0.005, "{}", sensor.name);
            assert!((20.0 * (sensor.full_well_e / least).log10() - range_db).abs() < 0.05, "{}", sensor.name);
        }
    }

    #[test]
    fn a_sensor_file_may_hold_curves_and_names_what_is_wrong_with_them() {
        let with = |table: &str| SensorModel::from_toml(&format!("{SENSOR}\n[quantum_efficiency]\n{table}"));
        let good = with("wavelength_um = [0.4, 0.7]\ngreen = [0.5, 0.6]\nalpha = 0.82\n").unwrap();
        let curves = good.quantum_efficiency.clone().unwrap();
        assert_eq!((curves.alpha, curves.beta, curves.scale), (0.82, 1.0, 1.0));
        assert_eq!(SensorModel::from_toml(&toml::to_string(&good).unwrap()).unwrap(), good);

        let lines = SENSOR.lines().count() as u32;
        for (table, key, line, needle) in [
            ("wavelength_um = [0.4]\ngreen = [0.5]\n", "wavelength_um", 2, "two wavelengths"),
            (
                "wavelength_um = [0.7, 0.4]\ngreen = [0.5, 0.5]\n",
                "wavelength_um",
                2,
                "larger than the one before",
            ),
            ("wavelength_um = [400, 700]\ngreen = [0.5, 0.5]\n", "wavelength_um", 2, "in um"),
            ("wavelength_um = [0.4, 0.7]\ngreen = [50, 60]\n", "green", 3, "not in percent"),
            ("wavelength_um = [0.4, 0.7]\ngreen = [0.5]\n", "green", 3, "one efficiency per wavelength"),
            ("wavelength_um = [0.4, 0.7]\ngreen = [0.5, 0.5]\nbeta = -1\n", "beta", 4, "a factor"),
            (
                "wavelength_um = [0.4, 0.7]\ngreen = [0.5, 0.8]\nscale = 900\n",
                "scale",
                4,
                "outside 0.001..1.25",
            ),
            (
                "wavelength_um = [0.4, 0.7]\nblue = [0.5, 0.5]\nscale = 0.8\nbeta = 4\n",
                "beta",
                5,
                "0.001..2.5",
            ),
            (
                "wavelength_um = [0.4, 0.7]\nred = [0.5, 1.0]\nalpha = 1.1\n",
                "alpha",
                4,
                "one electron per photon",
            ),
        ] {
            let error = with(table).unwrap_err();
            assert_eq!((error.key.as_str(), error.line), (key, Some(lines + line + 1)), "{error}");
            assert!(error.to_string().contains(needle), "{error}");
        }
        assert!(with("wavelength_um = [0.4, 0.7]\n").is_err());
    }

    #[test]
    fn matched_factors_give_the_measured_ratios() {
        let curves = QuantumEfficiency { scale: 0.5, ..QuantumEfficiency::from_toml(CURVES).unwrap() };
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
    fn a_flat_curve_is_one_of_every_colour() {
        let flat = QuantumEfficiency::flat(0.6).unwrap();
        assert!(Colour::ALL.into_iter().all(|c| (flat.curve(c).unwrap().at(0.9) - 0.6).abs() < 1e-12));
        for wrong in [0.0, -0.1, 1.01, f64::NAN, f64::INFINITY] {
            assert_eq!(QuantumEfficiency::flat(wrong), None);
        }
    }
}
