//! The window of a source on the sensor, and the colours of its pixels.

use petzval_camera::develop::demosaic_bilinear;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{CfaPattern, Colour, SensorError};

/// Light beyond this distance from the source is background, px.
pub(super) const BACKGROUND_PX: f64 = 16.0;

/// Least side of a frame: the background's circle fits with a border of two pixels.
pub const LEAST_SIDE: usize = 2 * BACKGROUND_PX as usize + 4;

/// Where a mosaic lies on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Sensor position of its first pixel.
    pub placement: Placement,
    /// Colours of the sensor.
    pub cfa: CfaPattern,
}

impl Frame {
    pub(super) fn colour(&self, pixel: usize) -> Colour {
        let (row, col) = (pixel / self.width, pixel % self.width);
        self.cfa.colour(self.placement.row + row, self.placement.col + col)
    }

    /// The channel of a pixel; for a monochrome sensor it is green.
    pub(super) fn channel(&self, pixel: usize) -> usize {
        self.colour(pixel).plane().unwrap_or(1)
    }

    /// Whether there is only one channel, which then stands for all three.
    pub fn is_mono(&self) -> bool {
        self.cfa == CfaPattern::MONO
    }

    /// The mosaic of light that is given in every channel at every pixel.
    pub fn mosaic(&self, light: &[Vec<f64>; CHANNELS]) -> Vec<f64> {
        (0..self.height * self.width).map(|i| light[self.channel(i)][i]).collect()
    }

    /// Pixels of one channel: those of its colour, or all of a monochrome sensor.
    pub fn is_colour(&self, pixel: usize, channel: usize) -> bool {
        self.colour(pixel).plane().is_none_or(|plane| plane == channel)
    }

    pub(super) fn demosaic(&self, mosaic: &[f64]) -> Result<LinearImage, SensorError> {
        let mosaic: Vec<f32> = mosaic.iter().map(|v| *v as f32).collect();
        demosaic_bilinear(&mosaic, self.height, self.width, self.cfa, self.placement)
    }

    /// Distance of a pixel from a place (row, column), px.
    pub(super) fn distance(&self, pixel: usize, centre: [f64; 2]) -> f64 {
        ((pixel / self.width) as f64 - centre[0]).hypot((pixel % self.width) as f64 - centre[1])
    }

    /// Mean of each colour far from the source, values beyond 4 standard deviations left out.
    pub(super) fn background(&self, mosaic: &[f64], variance: &[f64], centre: [f64; 2]) -> [f64; CHANNELS] {
        let far: Vec<usize> =
            (0..mosaic.len()).filter(|i| self.distance(*i, centre) > BACKGROUND_PX).collect();
        std::array::from_fn(|channel| {
            let here: Vec<usize> = far.iter().copied().filter(|i| self.is_colour(*i, channel)).collect();
            let mut values: Vec<f64> = here.iter().map(|i| mosaic[*i]).collect();
            values.sort_by(f64::total_cmp);
            let median = values.get(values.len() / 2).copied().unwrap_or(0.0);
            let (mut sum, mut count) = (0.0, 0.0);
            for i in here {
                if (mosaic[i] - median).abs() <= 4.0 * variance[i].sqrt() {
                    (sum, count) = (sum + mosaic[i], count + 1.0);
                }
            }
            if count > 0.0 { sum / count } else { median }
        })
    }

    /// A mosaic less the background of each colour.
    pub(super) fn without(&self, mosaic: &[f64], background: [f64; CHANNELS]) -> Vec<f64> {
        mosaic.iter().enumerate().map(|(i, v)| v - background[self.channel(i)]).collect()
    }
}
