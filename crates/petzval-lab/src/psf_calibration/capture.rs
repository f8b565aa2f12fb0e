//! Frames of a simulated source, exposed by the same sensor model as every other picture.

use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, CfaPattern, Exposure, Noise, Raw, SensorError, SensorModel, expose};

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

impl WindowLight {
    /// Rate of the brightest pixel behind its own filter, electrons/s; the other colours at its place have no pixel.
    /// Clear pixels of a monochrome sensor use the values of green.
    pub fn brightest_e_per_s(&self, cfa: &CfaPattern) -> f64 {
        let seen = |i: usize| {
            let Placement { row, col } = self.placement;
            let plane = cfa.colour(row + i / self.width, col + i % self.width).plane();
            self.rate_e_per_s[plane.unwrap_or(1)][i]
        };
        (0..self.height * self.width).map(seen).fold(0.0, f64::max)
    }
}

/// Takes frame number `frame` of the window; frames of one seed have independent noise. The three
/// channels of a monochrome sensor are equal, and its clear pixels respond to their mixture.
pub fn take_frame(
    light: &WindowLight,
    sensor: &SensorModel,
    time_s: f64,
    linear_gain: f64,
    noise: &Noise,
    frame: u64,
) -> Result<Raw, SensorError> {
    // Set white to the brightest pixel, because the sensor takes light relative to white.
    let brightest = light.rate_e_per_s.iter().flatten().fold(0.0f64, |a, b| a.max(*b)).max(1e-6);
    let mut irradiance = LinearImage::zeros(CHANNELS, light.height, light.width);
    let answers = if sensor.cfa == CfaPattern::MONO {
        [sensor.clear_response.iter().sum(); CHANNELS]
    } else {
        sensor.relative_qe
    };
    for (c, rate) in light.rate_e_per_s.iter().enumerate() {
        for (v, rate) in irradiance.plane_mut(c).iter_mut().zip(rate) {
            *v = (rate / (brightest * answers[c])) as f32;
        }
    }
    let exposure = Exposure {
        white_e: (brightest * time_s) as f32,
        time_s: time_s as f32,
        linear_gain: linear_gain as f32,
    };
    expose(&irradiance, sensor, &Capture { exposure, placement: light.placement, frame }, noise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brightest_pixel_has_the_colour_of_the_light() {
        // From sensor row 3, column 2, an RGGB mosaic shows green, blue; a GRBG mosaic blue, green.
        let placement = Placement { row: 3, col: 2 };
        let mut light = WindowLight {
            height: 1,
            width: 2,
            placement,
            rate_e_per_s: [vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]],
        };
        // Red light on a green and a blue pixel, green light on the blue one: all unseen.
        light.rate_e_per_s[0] = vec![9.0, 9.0];
        light.rate_e_per_s[1] = vec![2.0, 7.0];
        light.rate_e_per_s[2] = vec![8.0, 3.0];
        assert_eq!(light.brightest_e_per_s(&CfaPattern::RGGB), 3.0);
        assert_eq!(light.brightest_e_per_s(&CfaPattern::GRBG), 8.0);
    }
}
