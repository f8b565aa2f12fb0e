//! Laying a photograph on the sensor.

use image::imageops::FilterType;
use image::{ImageBuffer, Rgb};

use super::{CHANNELS, LinearImage};

impl LinearImage {
    /// The photograph scaled, in linear light, to cover `height` x `width` pixels, the rest cut off evenly.
    ///
    /// Shrinking averages (triangle filter over the shrunken pixel), enlarging interpolates linearly. Three planes.
    pub fn cover(&self, height: usize, width: usize) -> Self {
        let scale = (height as f64 / self.height as f64).max(width as f64 / self.width as f64);
        let scaled_height = ((self.height as f64 * scale).round() as usize).max(height);
        let scaled_width = ((self.width as f64 * scale).round() as usize).max(width);
        self.resized(scaled_height, scaled_width).centred(height, width)
    }

    /// The middle of the photograph, one pixel to one, on `height` x `width` pixels; where it does not reach, its
    /// border is repeated.
    pub fn centred(&self, height: usize, width: usize) -> Self {
        let source = |i: usize, size: usize, whole: usize| {
            let from = i as i64 + (whole as i64 - size as i64).div_euclid(2);
            from.clamp(0, whole as i64 - 1) as usize
        };
        let mut out = Self::zeros(self.channels, height, width);
        for c in 0..self.channels {
            for row in 0..height {
                let from = source(row, height, self.height);
                for col in 0..width {
                    out.set(c, row, col, self.get(c, from, source(col, width, self.width)));
                }
            }
        }
        out
    }

    fn resized(&self, height: usize, width: usize) -> Self {
        let interleaved: Vec<f32> = (0..self.height * self.width)
            .flat_map(|i| (0..CHANNELS).map(move |c| (c, i)))
            .map(|(c, i)| self.plane(c.min(self.channels - 1))[i])
            .collect();
        let Some(buffer) =
            ImageBuffer::<Rgb<f32>, _>::from_raw(self.width as u32, self.height as u32, interleaved)
        else {
            return Self::zeros(CHANNELS, height, width);
        };
        let resized = image::imageops::resize(&buffer, width as u32, height as u32, FilterType::Triangle);
        let mut out = Self::zeros(CHANNELS, height, width);
        for (i, pixel) in resized.pixels().enumerate() {
            for c in 0..CHANNELS {
                out.plane_mut(c)[i] = pixel.0[c];
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(height: usize, width: usize) -> LinearImage {
        let mut image = LinearImage::zeros(CHANNELS, height, width);
        let n = height * width;
        for (i, v) in image.data.iter_mut().enumerate() {
            *v = (i % n % width) as f32 / width as f32;
        }
        image
    }

    #[test]
    fn covering_keeps_the_mean_of_a_flat_picture_and_the_size_asked_for() {
        let flat = LinearImage::filled(CHANNELS, 37, 50, 0.25);
        for (height, width) in [(20, 20), (100, 90), (37, 50)] {
            let out = flat.cover(height, width);
            assert_eq!((out.height, out.width), (height, width));
            assert!(out.data.iter().all(|v| (v - 0.25).abs() < 1e-6));
        }
        let doubled = ramp(20, 30).cover(40, 60);
        assert!((doubled.get(0, 20, 30) - 0.5).abs() < 0.02);
    }

    #[test]
    fn the_middle_stays_the_middle() {
        let image = ramp(21, 31);
        let cut = image.centred(11, 11);
        assert_eq!(cut.get(0, 5, 5), image.get(0, 10, 15));
        let wider = image.centred(25, 41);
        assert_eq!(wider.get(1, 12, 20), image.get(1, 10, 15));
        assert_eq!(wider.get(1, 0, 0), image.get(1, 0, 0));
    }
}
