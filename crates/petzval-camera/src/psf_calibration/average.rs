//! Repeated frames: their mean and variance, pixel by pixel, without holding them.

/// Mean, sample variance and clipping of frames that show the same thing (Welford's update: one pass, no cancellation).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Average {
    /// Frames taken in.
    pub frames: usize,
    /// Mean of each pixel, DN.
    pub mean_dn: Vec<f64>,
    /// Sum of squared distances from the mean, DN^2.
    square_dn2: Vec<f64>,
    /// Pixels that met the end of the converter in any frame.
    pub clipped: Vec<bool>,
}

impl Average {
    /// Takes a frame in; `max_dn` is the end of the converter. All frames have the same number of pixels.
    pub fn add(&mut self, dn: impl ExactSizeIterator<Item = f64>, max_dn: f64) {
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
            self.clipped[i] |= value >= max_dn;
        }
    }

    /// Sample variance of a pixel over the frames, DN^2; `None` for fewer than two frames.
    pub fn variance_dn2(&self, pixel: usize) -> Option<f64> {
        (self.frames > 1).then(|| self.square_dn2[pixel] / (self.frames - 1) as f64)
    }
}

/// The signal without light, to be taken off every pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Dark {
    /// Mean of each pixel, DN.
    pub mean_dn: Vec<f64>,
    /// Variance of that mean, DN^2: the frames' mean variance over their number, one figure for all pixels.
    pub variance_dn2: f64,
}

impl Dark {
    /// The mean that the sensor model predicts, known without error.
    pub fn modelled(mean_dn: f64, pixels: usize) -> Self {
        Self { mean_dn: vec![mean_dn; pixels], variance_dn2: 0.0 }
    }

    /// From dark frames; `single_dn2` is the modelled variance of one frame, used where there is only one.
    pub fn measured(average: &Average, single_dn2: f64) -> Self {
        let pixels = average.mean_dn.len();
        let of_frames: Option<f64> = (0..pixels).map(|i| average.variance_dn2(i)).sum();
        let variance = of_frames.map_or(single_dn2, |sum| sum / pixels.max(1) as f64);
        Self { mean_dn: average.mean_dn.clone(), variance_dn2: variance / average.frames.max(1) as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_are_those_of_the_textbook() {
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
}
