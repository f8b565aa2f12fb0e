//! Fitting a photograph to the pixels of the sensor.

use std::ops::Range;

use super::{CHANNELS, LinearImage};

impl LinearImage {
    /// Scales the photograph, in linear light, to cover `height` x `width` pixels and crops the overhang evenly.
    ///
    /// Shrinking averages (triangle filter as wide as an output pixel to either side); enlarging interpolates linearly. The
    /// result has three planes. Only pixels that are kept are computed, so a long thin photograph costs no more than a square
    /// one.
    pub fn cover(&self, height: usize, width: usize) -> Self {
        let mut out = Self::zeros(CHANNELS, height, width);
        if self.data.is_empty() || out.data.is_empty() {
            return out;
        }
        let scale = (height as f64 / self.height as f64).max(width as f64 / self.width as f64);
        let rows = weights(self.height, height, scale);
        let columns = weights(self.width, width, scale);
        let first = columns.iter().map(|c| c.from).min().unwrap_or(0);
        let end = columns.iter().map(|c| c.range().end).max().unwrap_or(0);
        let mut line = vec![0.0f32; end - first];
        for c in 0..CHANNELS {
            let source = self.plane(c.min(self.channels - 1));
            for (row, out) in rows.iter().zip(out.plane_mut(c).chunks_exact_mut(width)) {
                // Filter down the columns that are kept, then along the row.
                line.fill(0.0);
                for (weight, from) in row.weights.iter().zip(row.range()) {
                    let seen = &source[from * self.width..][first..end];
                    line.iter_mut().zip(seen).for_each(|(sum, v)| *sum += weight * v);
                }
                for (column, out) in columns.iter().zip(out) {
                    let seen = &line[column.from - first..][..column.weights.len()];
                    *out = column.weights.iter().zip(seen).map(|(weight, v)| weight * v).sum();
                }
            }
        }
        out
    }

    /// The middle `height` x `width` pixels of the photograph, unscaled. Outside the photograph its edge is repeated.
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
}

/// The taps of a pixel in a row or a column of the photograph: consecutive pixels from `from` on, and their shares.
struct Taps {
    from: usize,
    weights: Vec<f32>,
}

impl Taps {
    fn range(&self) -> Range<usize> {
        self.from..self.from + self.weights.len()
    }
}

/// Triangle-filter taps of the middle `size` pixels of a photograph of `whole` pixels scaled by `scale`. A neighbour at a
/// distance of d pixels has the share `1 - d / s`, with s the larger of 1 and `1 / scale`, before normalisation.
fn weights(whole: usize, size: usize, scale: f64) -> Vec<Taps> {
    let scaled = (whole as f64 * scale).round().max(size as f64);
    let pitch = whole as f64 / scaled;
    let reach = pitch.max(1.0);
    let first = ((scaled - size as f64) / 2.0).floor();
    let tap = |i: usize| {
        let middle = (first + i as f64 + 0.5) * pitch;
        let from = ((middle - reach).floor().max(0.0) as usize).min(whole - 1);
        let end = ((middle + reach).ceil() as usize).clamp(from + 1, whole);
        let share = |j: usize| (1.0 - (j as f64 + 0.5 - middle).abs() / reach).max(0.0);
        let sum: f64 = (from..end).map(share).sum();
        Taps { from, weights: (from..end).map(|j| (share(j) / sum) as f32).collect() }
    };
    (0..size).map(tap).collect()
}

#[cfg(test)]
mod tests {
    use image::imageops::FilterType;
    use image::{ImageBuffer, Luma};

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
    fn covering_keeps_a_flat_picture_and_gives_the_requested_size() {
        let flat = LinearImage::filled(CHANNELS, 37, 50, 0.25);
        for (height, width) in [(20, 20), (100, 90), (37, 50)] {
            let out = flat.cover(height, width);
            assert_eq!((out.height, out.width), (height, width));
            assert!(out.data.iter().all(|v| (v - 0.25).abs() < 1e-6));
        }
        let doubled = ramp(20, 30).cover(40, 60);
        assert!((doubled.get(0, 20, 30) - 0.5).abs() < 0.02);
    }

    /// The whole photograph scaled by the image library, then cropped.
    fn scaled_whole(image: &LinearImage, height: usize, width: usize) -> LinearImage {
        let scale = (height as f64 / image.height as f64).max(width as f64 / image.width as f64);
        let scaled = |size: usize, least: usize| ((size as f64 * scale).round() as usize).max(least);
        let (tall, wide) = (scaled(image.height, height), scaled(image.width, width));
        let mut out = LinearImage::zeros(CHANNELS, tall, wide);
        for c in 0..CHANNELS {
            let (h, w) = (image.height as u32, image.width as u32);
            let plane = ImageBuffer::<Luma<f32>, _>::from_raw(w, h, image.plane(c).to_vec()).unwrap();
            let resized = image::imageops::resize(&plane, wide as u32, tall as u32, FilterType::Triangle);
            out.plane_mut(c).copy_from_slice(&resized);
        }
        out.centred(height, width)
    }

    #[test]
    fn covering_equals_scaling_the_whole_and_cropping() {
        // Enlarged and shrunken, too tall and too wide, even and odd.
        for (tall, wide, height, width) in [
            (37, 50, 20, 20),
            (37, 50, 101, 90),
            (40, 60, 40, 60),
            (90, 11, 24, 31),
            (13, 200, 50, 40),
            (5, 5, 64, 7),
        ] {
            let mut image = LinearImage::zeros(CHANNELS, tall, wide);
            for (i, v) in image.data.iter_mut().enumerate() {
                *v = (i * 2654435761 % 1000) as f32 / 1000.0;
            }
            let (fast, plain) = (image.cover(height, width), scaled_whole(&image, height, width));
            for (a, b) in fast.data.iter().zip(&plain.data) {
                assert!((a - b).abs() < 5e-5, "{tall}x{wide} to {height}x{width}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_long_thin_photograph_costs_no_more_than_a_square_one() {
        // Scaled as a whole these photographs would have 2.9 and 7.4 billion pixels.
        for (tall, wide) in [(2, 100_000), (100_000, 2)] {
            let out = ramp(tall, wide).cover(240, 384);
            assert_eq!((out.height, out.width), (240, 384));
            // The crop shows the middle of the wide ramp, and the whole width of the narrow one.
            let (low, high) = if wide > 2 { (0.4999, 0.5001) } else { (0.0, 0.5) };
            assert!(out.data.iter().all(|v| (low..=high).contains(v)));
        }
        assert!(LinearImage::zeros(CHANNELS, 0, 4).cover(3, 3).data.iter().all(|v| *v == 0.0));
    }

    #[test]
    fn centring_keeps_the_middle_pixel_in_the_middle() {
        let image = ramp(21, 31);
        let cut = image.centred(11, 11);
        assert_eq!(cut.get(0, 5, 5), image.get(0, 10, 15));
        let wider = image.centred(25, 41);
        assert_eq!(wider.get(1, 12, 20), image.get(1, 10, 15));
        assert_eq!(wider.get(1, 0, 0), image.get(1, 0, 0));
    }
}
