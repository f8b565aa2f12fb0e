//! Files of quantum efficiency curves: TOML or comma-separated values.

use petzval_base::FileError;
use petzval_camera::sensor::QuantumEfficiency;
use petzval_camera::spectral::SpectrumTable;

/// Reads and checks a file of curves: the keys of a sensor file's `[quantum_efficiency]`, at the top level.
pub fn parse_quantum_efficiency_toml(text: &str) -> Result<QuantumEfficiency, FileError> {
    let curves: QuantumEfficiency = FileError::read_toml(text)?;
    curves.validate().map_err(|wrong| {
        let key = wrong.key.rsplit('.').next().unwrap_or(wrong.key);
        FileError::at_key(text, &[key], wrong.to_string()).hint(format!("give {}", wrong.meaning))
    })?;
    Ok(curves)
}

/// Reads and checks a file of curves of either kind. If the first line that is not a comment has an `=` or starts with `[`,
/// the file is TOML ([`parse_quantum_efficiency_toml`]); else it is a table (`wavelength_nm,red,green,blue`).
pub fn parse_quantum_efficiency(text: &str) -> Result<QuantumEfficiency, FileError> {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    match lines.next() {
        Some(line) if !line.contains('=') && !line.starts_with('[') => from_csv(text),
        _ => parse_quantum_efficiency_toml(text),
    }
}

/// Reads and checks comma-separated values: a head line `wavelength_nm,red,green,blue`, `wavelength_nm,clear` or any of
/// these columns, then one line per wavelength with efficiencies in electrons per photon. Wavelengths are in nm, or in um below
/// `wavelength_um`.
fn from_csv(text: &str) -> Result<QuantumEfficiency, FileError> {
    const HINT: &str = "give a head line such as `wavelength_nm,red,green,blue` or `wavelength_nm,clear`, or with `wavelength_um`, then \
                        wavelengths in this unit, ascending, with efficiencies of 0 to 1";
    let table = SpectrumTable::parse(text)?;
    let is_said = |line: &&(u32, &str)| !line.1.is_empty() && !line.1.starts_with('#');
    let lines: Vec<(u32, &str)> = (1..).zip(text.lines().map(str::trim)).collect();
    let mut lines = lines.iter().filter(is_said).copied();
    let (head_line, head) = lines.next().unwrap_or((0, ""));
    let wrong =
        |(line, text): (u32, &str), message: String| Err(FileError::at_line(line, text, message).hint(HINT));
    // Assign every column to its colour.
    let mut curves = QuantumEfficiency::default();
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
            return wrong((head_line, head), format!("column `{name}` appears twice"));
        }
        *samples = curve.value().to_vec();
    }
    // Check every cell, so that errors name the line.
    for (number, line) in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if let Some(empty) = cells.iter().position(|cell| cell.is_empty()) {
            let name = table.curves.get(empty.wrapping_sub(1)).map_or("wavelength", |(name, _)| name);
            return wrong((number, line), format!("column `{name}` has no value here"));
        }
        let mut efficiencies = cells.iter().skip(1).filter_map(|cell| cell.parse::<f64>().ok());
        if let Some(value) = efficiencies.find(|v| !(0.0..=1.0).contains(v)) {
            let doubt = if value > 1.0 { "; is it in percent?" } else { "" };
            let message = format!("{value} is not an efficiency of 0 to 1 electrons per photon{doubt}");
            return wrong((number, line), message);
        }
    }
    // Without empty cells all columns have the wavelengths of the first.
    curves.wavelength_um = table.curves.first().map_or_else(Vec::new, |(_, c)| c.wavelength_um().to_vec());
    curves.validate().map_err(|wrong| FileError::at_line(head_line, head, wrong.to_string()).hint(HINT))?;
    Ok(curves)
}

#[cfg(test)]
mod tests {
    use petzval_camera::sensor::Colour;

    use super::*;
    use crate::parse_sensor;

    const SENSOR: &str = include_str!("../../petzval-data/data/sensors/imx249-fitted.toml");
    const CURVES: &str = include_str!("../../petzval-data/data/quantum-efficiency/imx219.toml");

    #[test]
    fn a_table_and_a_toml_file_of_the_same_curves_are_equal() {
        let table = "# mine\nwavelength_nm, Red, green\n400, 0.1, 0\n550, 0.2, 0.6\n700, 0.5, 0.1\n";
        let toml = "wavelength_um = [0.4, 0.55, 0.7]\nred = [0.1, 0.2, 0.5]\ngreen = [0, 0.6, 0.1]\n";
        let read = parse_quantum_efficiency(table).unwrap();
        assert_eq!(read, parse_quantum_efficiency(toml).unwrap());
        assert_eq!(read.curve(Colour::Clear), None);
        let in_um = "wavelength_um,red,green\n0.4,0.1,0\n0.55,0.2,0.6\n0.7,0.5,0.1\n";
        assert_eq!(parse_quantum_efficiency(in_um).unwrap(), read);
        let clear = parse_quantum_efficiency("wavelength_nm,clear\n400,0.3\n700,0.2\n").unwrap();
        assert!((clear.curve(Colour::Clear).unwrap().at(0.55) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn errors_in_a_table_name_the_line() {
        for (text, line, needle) in [
            ("wavelength_nm,qe\n400,0.3\n700,0.2\n", 1, "`qe`: not one of red"),
            ("wavelength_nm,red,red\n400,0,0\n700,0,0\n", 1, "`red` appears twice"),
            ("wavelength_nm,clear\n400,0.3\n550,70\n700,20\n", 3, "percent"),
            ("wavelength_nm,red,green\n400,0.3,0\n\n550,,0.1\n700,0.2,0\n", 4, "`red` has no value"),
            ("wavelength_nm,clear\n400,0.3\n350,0.2\n", 3, "ascend"),
            ("wavelength_um,clear\n400,0.3\n700,0.2\n", 2, "within 0.01..100 um"),
            ("wavelength_nm,clear\n0.4,0.3\n0.7,0.2\n", 2, "within 0.01..100 um"),
            ("wavelength_nm,clear\n400,0.3\n700,x\n", 3, "`x`"),
            ("", 1, "wavelength_um"),
        ] {
            let error = parse_quantum_efficiency(text).unwrap_err();
            assert_eq!(error.line, Some(line), "{error}");
            assert!(error.to_string().contains(needle) && error.hint.is_some(), "{error}");
        }
    }

    #[test]
    fn efficiencies_below_0_are_not_taken_for_percentages() {
        for (value, is_percent) in [("-0.6", false), ("60", true)] {
            let error = parse_quantum_efficiency(&format!("wavelength_nm,clear\n400,0.3\n500,{value}\n"));
            let error = error.unwrap_err().to_string();
            assert!(error.contains(&format!("{value} is not an efficiency of 0 to 1")), "{error}");
            assert_eq!(error.contains("percent"), is_percent, "{error}");
        }
    }

    #[test]
    fn a_sensor_file_may_hold_curves_and_names_what_is_wrong_with_them() {
        let with = |table: &str| parse_sensor(&format!("{SENSOR}\n[quantum_efficiency]\n{table}"));
        let good = with("wavelength_um = [0.4, 0.7]\ngreen = [0.5, 0.6]\nalpha = 0.82\n").unwrap();
        let curves = good.quantum_efficiency.clone().unwrap();
        assert_eq!((curves.alpha, curves.beta, curves.scale), (0.82, 1.0, 1.0));
        assert_eq!(parse_sensor(&toml::to_string(&good).unwrap()).unwrap(), good);

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
    fn the_shipped_curves_read() {
        for text in [CURVES, include_str!("../../petzval-data/data/quantum-efficiency/ov5647.toml")] {
            let curves = parse_quantum_efficiency_toml(text).unwrap();
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
    fn the_shipped_monochrome_sensors_have_the_snr_and_range_of_their_source() {
        for (text, snr_db, range_db) in [
            (include_str!("../../petzval-data/data/sensors/imx250-mono.toml"), 40.3, 71.2),
            (include_str!("../../petzval-data/data/sensors/imx273-mono.toml"), 40.2, 71.4),
            (include_str!("../../petzval-data/data/sensors/imx535-mono.toml"), 39.7, 69.8),
            (include_str!("../../petzval-data/data/sensors/mt9m034-mono.toml"), 37.7, 63.4),
        ] {
            let sensor = parse_sensor(text).unwrap();
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
    fn the_imx900_has_the_efficiency_snr_range_and_threshold_of_its_source() {
        for (text, qe, snr_db, range_db, least_e) in [
            (include_str!("../../petzval-data/data/sensors/imx900-mono.toml"), 0.9125, 39.76, 63.8, 6.106),
            (
                include_str!("../../petzval-data/data/sensors/imx900-mono-high-gain.toml"),
                0.8847,
                33.39,
                59.0,
                2.461,
            ),
        ] {
            let sensor = parse_sensor(text).unwrap();
            let curve = sensor.quantum_efficiency.as_ref().unwrap().curve(Colour::Clear).unwrap();
            assert!((curve.at(0.536) - qe).abs() < 2e-4, "{}: {}", sensor.name, curve.at(0.536));
            let dark_dn = ((sensor.gain_dn_per_e * sensor.read_noise_e).powi(2) + 1.0 / 12.0).sqrt();
            let least = dark_dn / sensor.gain_dn_per_e + 0.5;
            assert!((least - least_e).abs() < 0.005, "{}: {least}", sensor.name);
            assert!((10.0 * sensor.full_well_e.log10() - snr_db).abs() < 0.005, "{}", sensor.name);
            assert!((20.0 * (sensor.full_well_e / least).log10() - range_db).abs() < 0.05, "{}", sensor.name);
        }
    }
}
