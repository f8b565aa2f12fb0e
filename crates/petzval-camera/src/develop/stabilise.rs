//! Variance stabilisation: a square root, after which noise is about equal at every level of light.
//!
//! A pixel of light x (1 = white) that collects n electrons of white, in the dark d of them and with the noise sigma of the readout, has
//! the variance `(n x + d + sigma^2) / n^2`. After `sqrt(x + (d + sigma^2 + 3/8) / n)` it is about `1 / (4 n)` at any x: the generalised
//! transform of Anscombe. n is that of the pixel's colour: colours to which the sensor answers weakly are noisier, at every level alike.
//! The square takes the picture back, exactly where nothing was changed in between.

use super::noise_level::Electrons;
use crate::sensor::{Exposure, SensorModel};

/// The square root of light plus an offset, 1 = white.
///
/// Near and below zero, where the root is too steep, it goes on as a straight line, so that every value has an image and comes back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stabiliser {
    /// Offset, in units of white; positive.
    offset: f32,
}

impl Stabiliser {
    /// The stabiliser of an offset in units of white, which is at least 1e-6.
    pub fn new(offset: f32) -> Self {
        Self { offset: if offset > 1e-6 { offset } else { 1e-6 } }
    }

    /// The stabiliser of a sensor at an exposure: the mean offset of the colours of its array.
    pub fn of_sensor(sensor: &SensorModel, exposure: &Exposure) -> Self {
        let electrons = Electrons::of_sensor(sensor, exposure);
        let mean = electrons.mean(|white_e| (electrons.dark + 0.375) / white_e);
        Self::new(mean as f32)
    }

    /// Offset, in units of white.
    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    pub(crate) fn offset(self) -> f32 {
        self.offset
    }

    /// Light plus offset below which the root is replaced by its tangent.
    fn least(self) -> f32 {
        0.25 * self.offset
    }

    /// The stabilised value of light.
    pub fn forward(self, light: f32) -> f32 {
        let (sum, least) = (light + self.offset, self.least());
        if sum >= least { sum.sqrt() } else { least.sqrt() + (sum - least) / (2.0 * least.sqrt()) }
    }

    /// The light of a stabilised value.
    pub fn inverse(self, value: f32) -> f32 {
        let (root, least) = (self.least().sqrt(), self.least());
        let sum = if value >= root { value * value } else { least + 2.0 * root * (value - root) };
        sum - self.offset
    }

    /// The derivative of [`Stabiliser::forward`] by the light.
    pub fn slope(self, light: f32) -> f32 {
        0.5 / (light + self.offset).max(self.least()).sqrt()
    }

    /// The derivative of [`Stabiliser::inverse`] by the value.
    pub fn inverse_slope(self, value: f32) -> f32 {
        2.0 * value.max(self.least().sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::LinearImage;
    use crate::render::Placement;
    use crate::sensor::{Capture, CfaPattern, Colour, Noise, NoiseMode, expose};

    fn sensor() -> SensorModel {
        let sensor: SensorModel =
            toml::from_str(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml")).unwrap();
        SensorModel { cfa: CfaPattern::RGGB, ..sensor }
    }

    #[test]
    fn the_square_takes_every_value_back_and_slopes_are_those_of_differences() {
        for offset in [1e-5, 1e-3, 0.1] {
            let s = Stabiliser::new(offset);
            for light in [-0.3, -0.01, -1e-4, 0.0, 1e-6, 1e-3, 0.5, 1.0, 40.0] {
                let value = s.forward(light);
                assert!((s.inverse(value) - light).abs() < 1e-5 * light.abs().max(0.1), "{offset} {light}");
                assert!((s.slope(light) * s.inverse_slope(value) - 1.0).abs() < 1e-4);
                let step = 1e-3 * light.abs().max(offset);
                let difference =
                    f64::from(s.forward(light + step) - s.forward(light - step)) / f64::from(2.0 * step);
                let slope = f64::from(s.slope(light));
                assert!((difference - slope).abs() < 2e-2 * slope, "{offset} {light}: {difference} {slope}");
            }
        }
    }

    #[test]
    fn noise_is_equal_after_it() {
        let sensor = sensor();
        for white_e in [800.0, 16_000.0] {
            let exposure = Exposure { white_e, time_s: 0.01, linear_gain: 1.0 };
            let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 };
            let stabiliser = Stabiliser::of_sensor(&sensor, &exposure);
            let spread_at = |light: f32, is_stable: bool, colour: Colour| {
                let (height, width) = (120, 120);
                let scene =
                    LinearImage::from_data(3, height, width, vec![light; 3 * height * width]).unwrap();
                let raw =
                    expose(&scene, &sensor, &capture, &Noise { mode: NoiseMode::Exact, seed: 3 }).unwrap();
                let dark = crate::develop::dark_mean_dn(&sensor, &exposure);
                let scale = 1.0 / (sensor.gain_dn_per_e * f64::from(white_e));
                let response: f64 = sensor.response(colour).iter().sum();
                let values: Vec<f64> = (0..height * width)
                    .filter(|i| sensor.cfa.colour(i / width, i % width) == colour)
                    .map(|i| {
                        let light = (f64::from(raw.dn[i]) - dark) * scale / response;
                        if is_stable { f64::from(stabiliser.forward(light as f32)) } else { light }
                    })
                    .collect();
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
            };
            for colour in [Colour::Red, Colour::Green, Colour::Blue] {
                let response: f64 = sensor.response(colour).iter().sum();
                let wanted = 0.5 / (f64::from(white_e) * response).sqrt();
                for light in [0.0, 0.01, 0.05, 0.3, 0.8] {
                    let ratio = spread_at(light, true, colour) / wanted;
                    assert!((0.75..1.25).contains(&ratio), "{white_e} e-, {colour:?}, {light}: {ratio}");
                }
            }
            // Without it the noise of the light is several times that of the dark.
            let [dark, bright] = [0.0, 0.8].map(|light| spread_at(light, false, Colour::Green));
            assert!(bright > 3.0 * dark, "{white_e} e-: {dark} {bright}");
        }
    }
}
