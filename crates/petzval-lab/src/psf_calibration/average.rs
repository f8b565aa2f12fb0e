//! Mean and variance of repeated frames, pixel by pixel, without keeping the frames.

use petzval_base::statistics::median;

/// Mean, sample variance and clipping of repeated frames (Welford's update: one pass, no cancellation).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Average {
    /// Number of frames.
    pub frames: usize,
    /// Mean of each pixel, DN.
    pub mean_dn: Vec<f64>,
    /// Sum of squared distances from the mean, DN^2.
    square_dn2: Vec<f64>,
    /// Pixels that were saturated in any frame.
    pub clipped: Vec<bool>,
}

impl Average {
    /// Adds a frame. Pixels saturate at `saturation_dn`: at the end of the converter, or below it at the full well. All
    /// frames have the same number of pixels.
    pub fn add(&mut self, dn: impl ExactSizeIterator<Item = f64>, saturation_dn: f64) {
        if self.frames == 0 {
            self.mean_dn = vec![0.0; dn.len()];
            self.square_dn2 = vec![0.0; dn.len()];
            self.clipped = vec![false; dn.len()];
        }
        assert_eq!(dn.len(), self.mean_dn.len(), "frames of one size");
        self.frames += 1;
        for (i, value) in dn.enumerate() {
            let before = value - self.mean_dn[i];
            self.mean_dn[i] += before / self.frames as f64;
            self.square_dn2[i] += before * (value - self.mean_dn[i]);
            self.clipped[i] |= value >= saturation_dn;
        }
    }

    /// Sample variance of a pixel over the frames, DN^2; `None` for fewer than two frames.
    pub fn variance_dn2(&self, pixel: usize) -> Option<f64> {
        (self.frames > 1).then(|| self.square_dn2[pixel] / (self.frames - 1) as f64)
    }
}

/// The signal without light, which is subtracted from every pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Dark {
    /// Dark frames averaged; 0 if the mean is the sensor model's.
    pub frames: usize,
    /// Mean of each pixel, DN.
    pub mean_dn: Vec<f64>,
    /// Variance of that mean, DN^2: the mean variance of the frames divided by their number, the same for all pixels
    /// except hot ones.
    pub variance_dn2: f64,
    /// Excess of hot pixels over the others, DN; 0 for the others. These electrons have additional shot noise.
    pub hot_dn: Vec<f64>,
    /// Pixels that saturate without light.
    pub clipped: Vec<bool>,
}

/// Standard deviations of the other pixels above the median from which a dark pixel is hot.
const HOT_SIGMAS: f64 = 6.0;

impl Dark {
    /// The mean that the sensor model predicts, known without error.
    pub fn modelled(mean_dn: f64, pixels: usize) -> Self {
        Self {
            frames: 0,
            mean_dn: vec![mean_dn; pixels],
            variance_dn2: 0.0,
            hot_dn: vec![0.0; pixels],
            clipped: vec![false; pixels],
        }
    }

    /// From dark frames; `single_dn2` is the modelled variance of one frame, used where there is only one.
    pub fn measured(average: &Average, single_dn2: f64) -> Self {
        // Estimate the spread by the median distance from the median, which hot pixels do not affect.
        let mean_dn = average.mean_dn.clone();
        let middle = median(mean_dn.iter().copied());
        let spread = 1.4826 * median(mean_dn.iter().map(|v| (v - middle).abs()));
        let of = |pixels: &[usize]| -> Option<f64> {
            let sum: Option<f64> = pixels.iter().map(|i| average.variance_dn2(*i)).sum();
            sum.map(|sum| sum / pixels.len().max(1) as f64)
        };
        let frames = average.frames.max(1) as f64;
        let all: Vec<usize> = (0..mean_dn.len()).collect();
        let noise = (of(&all).unwrap_or(single_dn2) / frames).sqrt();
        let limit = HOT_SIGMAS * spread.max(noise);
        let hot_dn: Vec<f64> =
            mean_dn.iter().map(|v| if v - middle > limit { v - middle } else { 0.0 }).collect();
        let calm: Vec<usize> = all.into_iter().filter(|i| hot_dn[*i] == 0.0).collect();
        let variance_dn2 = of(&calm).unwrap_or(single_dn2) / frames;
        Self { frames: average.frames, mean_dn, variance_dn2, hot_dn, clipped: average.clipped.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_equal_the_textbook() {
        let mut average = Average::default();
        for frame in [[1.0, 100.0], [2.0, 100.0], [6.0, 400.0]] {
            average.add(frame.into_iter(), 400.0);
        }
        assert_eq!(average.mean_dn, [3.0, 200.0]);
        // (4 + 1 + 9) / 2 and (2 * 100^2 + 200^2) / 2.
        assert!((average.variance_dn2(0).unwrap() - 7.0).abs() < 1e-12);
        assert!((average.variance_dn2(1).unwrap() - 30_000.0).abs() < 1e-9);
        assert_eq!(average.clipped, [false, true]);
        let dark = Dark::measured(&average, 0.0);
        assert!((dark.variance_dn2 - (7.0 + 30_000.0) / 2.0 / 3.0).abs() < 1e-9);
    }
    #[test]
    fn hot_pixels_of_dark_frames_are_found_and_do_not_count_as_noise() {
        let mut average = Average::default();
        // 100 pixels between 99 and 101 DN; pixel 40 is 300 DN above them and scatters.
        for frame in 0..8u32 {
            let pixel = |i: u32| 100.0 + f64::from((i * 7 + frame * 3) % 5) * 0.5 - 1.0;
            let hot = 300.0 + 20.0 * f64::from(frame % 2);
            let values: Vec<f64> = (0..100).map(|i| pixel(i) + if i == 40 { hot } else { 0.0 }).collect();
            average.add(values.into_iter(), 4095.0);
        }
        let dark = Dark::measured(&average, 0.0);
        assert!((dark.hot_dn[40] - 310.0).abs() < 3.0, "{}", dark.hot_dn[40]);
        assert_eq!(dark.hot_dn.iter().filter(|v| **v > 0.0).count(), 1);
        // Five values half a DN apart have a variance of 1/2 DN^2.
        assert!((0.4..0.75).contains(&(8.0 * dark.variance_dn2)), "{}", 8.0 * dark.variance_dn2);
    }
}
