//! The numbers of a sensor, as in its data sheet.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::cfa::{CfaPattern, Colour};
use super::error::{OutOfRange, SensorError};
use super::nonuniformity::NonUniformity;
use super::quantum_efficiency::QuantumEfficiency;
use crate::image::CHANNELS;

/// The place in the signal chain where the electronics noise enters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Electronics {
    /// Before the converter, as in a sensor with column converters.
    #[default]
    BeforeAdc,
    /// After the converter, followed by a second rounding to whole digital numbers: adds another 1/12 DN^2.
    AfterAdc,
}

/// EMVA 1288 description of a sensor at unit gain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorModel {
    /// Name of the sensor.
    pub name: String,
    /// Source of the numbers; empty if it is not stated.
    #[serde(default)]
    pub source: String,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// Bits of the converter.
    pub bits: u32,
    /// Black level BL, DN.
    pub black_level_dn: f64,
    /// System gain K at linear gain 1, DN per electron.
    pub gain_dn_per_e: f64,
    /// Full well capacity FWC, electrons.
    pub full_well_e: f64,
    /// Dark current mu_I, electrons per pixel and second.
    pub dark_current_e_per_s: f64,
    /// Mean of the read noise mu_r, electrons.
    pub read_noise_mean_e: f64,
    /// Standard deviation of the read noise sigma_r, electrons.
    pub read_noise_e: f64,
    /// Mean of the electronics noise mu_el, DN.
    pub electronics_mean_dn: f64,
    /// Standard deviation of the electronics noise sigma_el, DN.
    pub electronics_noise_dn: f64,
    /// Quantum efficiency of red, green, blue relative to green.
    #[serde(deserialize_with = "relative_to_green")]
    pub relative_qe: [f64; CHANNELS],
    /// Colour filter array.
    pub cfa: CfaPattern,
    /// Where the electronics noise enters; before the converter if it is left out. After it, a second rounding adds 1/12 DN^2.
    #[serde(default)]
    pub electronics: Electronics,
    /// Electrons of a clear (unfiltered) pixel per unit of red, green and blue light, where a green pixel has 1 for white.
    #[serde(default = "even_response")]
    pub clear_response: [f64; CHANNELS],
    /// Linear gains that the sensor offers; empty if every gain can be set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gain_steps: Vec<f64>,
    /// Differences between its pixels: DSNU, PRNU, hot pixels, row and column noise.
    #[serde(default)]
    pub nonuniformity: NonUniformity,
    /// Quantum efficiency over the spectrum, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantum_efficiency: Option<QuantumEfficiency>,
}

/// Least and largest relative efficiency.
const RELATIVE_QE: [f64; 2] = [1e-3, 1e3];

/// Reads efficiencies in any unit and divides them by that of green. An impossible green divides nothing, so that
/// [`SensorModel::validate`] can name it.
fn relative_to_green<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; CHANNELS], D::Error> {
    let efficiencies = <[f64; CHANNELS]>::deserialize(from)?;
    let [_, green, _] = efficiencies;
    let [low, high] = RELATIVE_QE;
    Ok(if (low..=high).contains(&green) { efficiencies.map(|value| value / green) } else { efficiencies })
}

fn even_response() -> [f64; CHANNELS] {
    [1.0 / 3.0; CHANNELS]
}

impl SensorModel {
    /// Largest digital number, `2^bits - 1`.
    pub fn max_dn(&self) -> f64 {
        (2.0f64).powi(self.bits as i32) - 1.0
    }

    /// Electrons of a pixel of `colour` per unit of red, green and blue light, where a green pixel has 1 for white.
    pub fn response(&self, colour: Colour) -> [f64; CHANNELS] {
        let mut response = [0.0; CHANNELS];
        match colour.plane() {
            Some(plane) => response[plane] = self.relative_qe[plane],
            None => response = self.clear_response,
        }
        response
    }

    /// The sensor's gain step nearest to `linear_gain`, in stops. Without steps the result is `linear_gain`.
    pub fn nearest_gain(&self, linear_gain: f64) -> f64 {
        let stops_off = |step: f64| (step / linear_gain).log2().abs();
        let steps = self.gain_steps.iter().copied();
        steps.min_by(|a, b| stops_off(*a).total_cmp(&stops_off(*b))).unwrap_or(linear_gain)
    }

    /// Checks that the sensor offers a linear gain, to one part in 10,000.
    pub fn check_gain(&self, linear_gain: f32) -> Result<(), SensorError> {
        let nearest = self.nearest_gain(linear_gain as f64);
        if (nearest / linear_gain as f64 - 1.0).abs() <= 1e-4 {
            return Ok(());
        }
        Err(SensorError::GainStep { value: linear_gain, nearest })
    }

    /// Checks that every number is finite and in its physical range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let [red, green, blue] = self.relative_qe;
        let [least, most] = RELATIVE_QE;
        let max = self.max_dn();
        let checks = [
            ("height", self.height as f64, 2.0, 65536.0, "the number of rows"),
            ("width", self.width as f64, 2.0, 65536.0, "the number of columns"),
            ("pixel_um", self.pixel_um, 0.1, 1000.0, "the pixel pitch in um"),
            ("bits", self.bits as f64, 1.0, 16.0, "the bits of the converter"),
            ("black_level_dn", self.black_level_dn, 0.0, max, "the black level in DN"),
            ("gain_dn_per_e", self.gain_dn_per_e, 1e-6, 1e4, "the system gain K in DN per electron"),
            ("full_well_e", self.full_well_e, 1.0, 1e9, "the full well capacity in electrons"),
            (
                "dark_current_e_per_s",
                self.dark_current_e_per_s,
                0.0,
                1e9,
                "the dark current in electrons per second",
            ),
            (
                "read_noise_mean_e",
                self.read_noise_mean_e,
                -1e6,
                1e6,
                "the mean of the read noise in electrons",
            ),
            (
                "read_noise_e",
                self.read_noise_e,
                0.0,
                1e6,
                "the standard deviation of the read noise in electrons",
            ),
            (
                "electronics_mean_dn",
                self.electronics_mean_dn,
                -max,
                max,
                "the mean of the electronics noise in DN",
            ),
            (
                "electronics_noise_dn",
                self.electronics_noise_dn,
                0.0,
                max,
                "the spread of the electronics noise in DN",
            ),
            ("relative_qe", red, least, most, "the efficiency of red relative to green"),
            ("relative_qe", green, least, most, "the efficiency of green, usually 1"),
            ("relative_qe", blue, least, most, "the efficiency of blue relative to green"),
        ];
        let of_clear = "the electrons of a clear pixel per unit of red, green and blue light";
        let clear = self.clear_response.map(|value| ("clear_response", value, 0.0, 1e3, of_clear));
        let sum = [("clear_response", self.clear_response.iter().sum(), 1e-3, 3e3, of_clear)];
        let of_step = "the linear gains that the sensor offers, 1 = system gain K";
        let steps = self.gain_steps.iter().map(|&value| ("gain_steps", value, 1e-3, 1e6, of_step));
        for (key, value, low, high, meaning) in checks.into_iter().chain(clear).chain(sum).chain(steps) {
            if !(low..=high).contains(&value) {
                return Err(OutOfRange { key, value, low, high, meaning });
            }
        }
        self.nonuniformity.validate()?;
        self.quantum_efficiency.as_ref().map_or(Ok(()), QuantumEfficiency::validate)
    }
}
