//! Frames of a simulated source, through the same sensor model as every other picture.

use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{Capture, Exposure, Noise, Raw, SensorError, SensorModel, expose};

/// Light on a window of the sensor, before exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowLight {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Sensor position of the first pixel.
    pub placement: Placement,
    /// Electrons per second that each channel's pixels would collect, `[channel][row * width + col]`.
    pub rate_e_per_s: [Vec<f64>; CHANNELS],
}

/// Takes frame number `frame` of the window; frames of one seed have independent noise.
pub fn take_frame(
    light: &WindowLight,
    sensor: &SensorModel,
    time_s: f64,
    linear_gain: f64,
    noise: &Noise,
    frame: u64,
) -> Result<Raw, SensorError> {
    // The sensor takes light relative to white; let white be the brightest pixel.
    let brightest = light.rate_e_per_s.iter().flatten().fold(0.0f64, |a, b| a.max(*b)).max(1e-6);
    let mut irradiance = LinearImage::zeros(CHANNELS, light.height, light.width);
    for (c, rate) in light.rate_e_per_s.iter().enumerate() {
        for (v, rate) in irradiance.plane_mut(c).iter_mut().zip(rate) {
            *v = (rate / (brightest * sensor.relative_qe[c])) as f32;
        }
    }
    let exposure = Exposure {
        white_e: (brightest * time_s) as f32,
        time_s: time_s as f32,
        linear_gain: linear_gain as f32,
    };
    expose(&irradiance, sensor, &Capture { exposure, placement: light.placement, frame }, noise)
}
