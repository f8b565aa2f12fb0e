//! The white diode behind the pinhole, and its spectrum weighted by the response of each colour of the sensor.

use petzval_camera::image::CHANNELS;
use petzval_camera::sensor::{CfaPattern, Colour, SensorModel};

/// Relative photon flux per wavelength of a white diode of about 4900 K.
///
/// A blue diode (Gaussian around 0.450 um, 22 nm full width at half maximum) pumps a phosphor (Gaussian around 0.575 um, 130 nm) whose
/// radiant peak is [`PHOSPHOR`] of the blue one. The sum is multiplied by the wavelength, because sensors count photons. A stand-in for a
/// data sheet: the correlated colour temperature is tested, the exact shape is not known.
pub fn white_led(wavelength_um: f64) -> f64 {
    let gauss = |centre: f64, width: f64| {
        (-4.0 * std::f64::consts::LN_2 * ((wavelength_um - centre) / width).powi(2)).exp()
    };
    (gauss(0.450, 0.022) + PHOSPHOR * gauss(0.575, 0.130)) * wavelength_um / 0.55
}

/// Height of the phosphor's peak over that of the blue diode, set for 4900 K.
pub const PHOSPHOR: f64 = 0.61;

/// Wavelengths of the simulated source, um: 0.41 to 0.69 in steps of 10 nm; an IR cut filter ends it.
pub fn led_wavelengths_um() -> Vec<f64> {
    (0..29).map(|i| 0.41 + 0.01 * i as f64).collect()
}

/// Weight of each wavelength in each channel, `[channel][wavelength]`, diode times quantum efficiency; green sums to 1
/// and the others to their signal relative to green. The three channels of a monochrome sensor are one.
///
/// The efficiency curves are those of the sensor, with their factors. A sensor without curves gets stated stand-ins: Gaussian colour
/// filters around 0.600, 0.535 and 0.460 um, of 80, 85 and 75 nm full width, scaled to the sensor's relative efficiencies. Clear pixels get
/// one efficiency at all wavelengths.
pub fn channel_weights(sensor: &SensorModel, wavelengths_um: &[f64]) -> [Vec<f64>; CHANNELS] {
    let is_mono = sensor.cfa == CfaPattern::MONO;
    let colours =
        if is_mono { [Colour::Clear; CHANNELS] } else { [Colour::Red, Colour::Green, Colour::Blue] };
    let known = sensor.quantum_efficiency.as_ref().and_then(|q| {
        let [first, second, third] = colours.map(|colour| q.curve(colour));
        Some([first?, second?, third?])
    });
    let efficiency = |channel: usize, um: f64| match &known {
        Some(curves) => curves[channel].at(um),
        None if is_mono => 1.0,
        None => {
            let (centre, width) = [(0.600, 0.080), (0.535, 0.085), (0.460, 0.075)][channel];
            let gauss = (-4.0 * std::f64::consts::LN_2 * ((um - centre) / width).powi(2)).exp();
            sensor.relative_qe[channel] * gauss
        }
    };
    let mut weights: [Vec<f64>; CHANNELS] = std::array::from_fn(|c| {
        wavelengths_um.iter().map(|um| white_led(*um) * efficiency(c, *um)).collect()
    });
    let green: f64 = weights[1].iter().sum();
    let scale = if green > 0.0 { 1.0 / green } else { 1.0 };
    weights.iter_mut().flatten().for_each(|w| *w *= scale);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor() -> SensorModel {
        petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
            .unwrap()
    }

    #[test]
    fn channel_weights_follow_curves_and_factors() {
        let text = include_str!("../../../petzval-data/data/quantum-efficiency/imx219.toml");
        let plain = petzval_files::parse_quantum_efficiency_toml(text).unwrap();
        let um = led_wavelengths_um();
        let light = |scale: f64, alpha: f64, beta: f64| {
            let quantum_efficiency =
                Some(petzval_camera::sensor::QuantumEfficiency { scale, alpha, beta, ..plain.clone() });
            let weights = channel_weights(&SensorModel { quantum_efficiency, ..sensor() }, &um);
            weights.map(|w| w.iter().sum::<f64>())
        };
        let (one, other) = (light(1.0, 1.0, 1.0), light(0.5, 0.82, 1.25));
        assert!((one[1] - 1.0).abs() < 1e-12 && (other[1] - 1.0).abs() < 1e-12);
        assert!((other[0] / one[0] - 0.82).abs() < 1e-12, "{one:?} {other:?}");
        assert!((other[2] / one[2] - 1.25).abs() < 1e-12, "{one:?} {other:?}");
    }

    #[test]
    fn the_channels_of_a_monochrome_sensor_are_equal() {
        let mono = SensorModel { cfa: CfaPattern::MONO, ..sensor() };
        let [red, green, blue] = channel_weights(&mono, &led_wavelengths_um());
        assert!(red == green && green == blue);
        let all: f64 = led_wavelengths_um().into_iter().map(white_led).sum();
        assert!((green[5] - white_led(led_wavelengths_um()[5]) / all).abs() < 1e-15);
    }

    /// The diode's colour temperature by McCamy's formula, with the colour matching functions as Wyman, Sloan & Shirley
    /// (2013) fitted them.
    #[test]
    fn the_diode_has_4900_kelvin() {
        let lobe = |um: f64, height: f64, centre: f64, low: f64, high: f64| {
            let nm = 1e3 * um;
            let width = if nm < centre { low } else { high };
            height * (-0.5 * ((nm - centre) / width).powi(2)).exp()
        };
        let mut xyz = [0.0f64; 3];
        for i in 0..=350 {
            let um = 0.38 + 0.001 * i as f64;
            let power = white_led(um) / um;
            xyz[0] += power
                * (lobe(um, 1.056, 599.8, 37.9, 31.0)
                    + lobe(um, 0.362, 442.0, 16.0, 26.7)
                    + lobe(um, -0.065, 501.1, 20.4, 26.2));
            xyz[1] += power * (lobe(um, 0.821, 568.8, 46.9, 40.5) + lobe(um, 0.286, 530.9, 16.3, 31.1));
            xyz[2] += power * (lobe(um, 1.217, 437.0, 11.8, 36.0) + lobe(um, 0.681, 459.0, 26.0, 13.8));
        }
        let sum: f64 = xyz.iter().sum();
        let n = (xyz[0] / sum - 0.3320) / (0.1858 - xyz[1] / sum);
        let kelvin = 449.0 * n.powi(3) + 3525.0 * n * n + 6823.3 * n + 5520.33;
        assert!((kelvin - 4900.0).abs() < 100.0, "{kelvin} K");
    }
}
