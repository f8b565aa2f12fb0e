//! EMVA 1288 figures that follow from the numbers of a sensor file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rounding::QUANTISATION_DN2;
use petzval_camera::sensor::{Electronics, SensorModel};

/// Figures of a sensor at one linear gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Derived {
    /// Linear gain g.
    pub linear_gain: f64,
    /// System gain K g, DN/e-.
    pub gain_dn_per_e: f64,
    /// Temporal dark noise at an exposure time of zero, DN: `sqrt((K g sigma_r)^2 + sigma_el^2 + 1/12)`; electronics noise
    /// after the converter is rounded a second time and adds another 1/12.
    pub dark_noise_dn: f64,
    /// The same in electrons, with the noise of the converter.
    pub dark_noise_e: f64,
    /// Absolute sensitivity threshold, e-: a signal-to-noise ratio of one, `dark_noise_e + 1/2`.
    pub threshold_e: f64,
    /// Saturation capacity, e-: the full well or the end of the converter's range, whichever comes first.
    pub saturation_e: f64,
    /// Whether the converter reaches its end before the full well.
    pub converter_limits: bool,
    /// Largest signal-to-noise ratio, `sqrt(saturation)`.
    pub snr_max: f64,
    /// The same in decibels.
    pub snr_max_db: f64,
    /// Dynamic range, saturation over threshold.
    pub dynamic_range: f64,
    /// The same in decibels.
    pub dynamic_range_db: f64,
    /// Mean of a dark frame at an exposure time of zero, DN.
    pub dark_mean_dn: f64,
}

/// Figures of a sensor at a linear gain.
pub fn derived(sensor: &SensorModel, linear_gain: f64) -> Derived {
    let k = sensor.gain_dn_per_e * linear_gain;
    let dark_mean_dn = k * sensor.read_noise_mean_e + sensor.black_level_dn + sensor.electronics_mean_dn;
    let roundings = match sensor.electronics {
        Electronics::BeforeAdc => 1.0,
        Electronics::AfterAdc => 2.0,
    };
    let dark_noise_dn = ((k * sensor.read_noise_e).powi(2)
        + sensor.electronics_noise_dn.powi(2)
        + roundings * QUANTISATION_DN2)
        .sqrt();
    let converter_e = ((sensor.max_dn() - dark_mean_dn) / k).max(0.0);
    let saturation_e = converter_e.min(sensor.full_well_e);
    let threshold_e = dark_noise_dn / k + 0.5;
    let (snr_max, dynamic_range) = (saturation_e.sqrt(), saturation_e / threshold_e);
    Derived {
        linear_gain,
        gain_dn_per_e: k,
        dark_noise_dn,
        dark_noise_e: dark_noise_dn / k,
        threshold_e,
        saturation_e,
        converter_limits: converter_e < sensor.full_well_e,
        snr_max,
        snr_max_db: 20.0 * snr_max.log10(),
        dynamic_range,
        dynamic_range_db: 20.0 * dynamic_range.log10(),
        dark_mean_dn,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_converter_limits_the_papers_sensor() {
        let sensor = petzval_files::parse_sensor(include_str!(
            "../../../petzval-data/data/sensors/imx249-fitted.toml"
        ))
        .unwrap();
        let found = derived(&sensor, 1.0);
        // sqrt(16 + (0.92^2 + 1/12) / 0.14^2) = 7.9646 e-; (4095 - 120.605) / 0.14 = 28388.5 e- < 33723 e-.
        assert!((found.dark_noise_e - 7.9646).abs() < 1e-4, "{found:?}");
        assert!((found.saturation_e - 28_388.5).abs() < 0.1 && found.converter_limits, "{found:?}");
        assert!((found.snr_max_db - 44.53).abs() < 0.01, "{found:?}");
        // Rounded twice: sqrt(0.56^2 + 0.92^2 + 2/12) = 1.15181 DN.
        let twice = derived(&SensorModel { electronics: Electronics::AfterAdc, ..sensor }, 1.0);
        assert!((twice.dark_noise_dn - 1.151_81).abs() < 1e-5, "{twice:?}");
    }
}
