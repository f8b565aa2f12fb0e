//! From the mean over each sample of a drawn scene to the light at its middle.

use rayon::prelude::*;

use super::LinearImage;

/// Weights of a sample and of its neighbours at distance 1 and 2: `1 - d2 / 24 + 3 d4 / 640` with the second and fourth difference.
/// It inverts the mean over a sample for every polynomial up to degree 5 (Taylor series of `x / sin x` in `sin x`).
const WEIGHTS: [f32; 3] = [1.0 + 2.0 / 24.0 + 18.0 / 640.0, -1.0 / 24.0 - 12.0 / 640.0, 3.0 / 640.0];

impl LinearImage {
    /// The light at the middle of every sample of a picture whose samples are means over their squares, as coverage of drawn edges is. Beyond the
    /// border its edge repeats.
    ///
    /// A renderer takes samples for points of light and integrates over pixels. Means would be integrated a second time: their edges
    /// are softer by the width of a sample. The transfer of the mean over a sample, `sin(pi f) / (pi f)` at `f` cycles a sample, becomes 1
    /// within 0.1 % up to 1/8 and within 1 % up to 1/4. Values beside an edge may exceed its two sides, by up to 6 % of the step.
    pub fn point_values(&self) -> Self {
        let Self { channels, height, width, .. } = *self;
        let mut out = self.clone();
        if height == 0 || width == 0 {
            return out;
        }
        out.data.par_chunks_exact_mut(width).for_each(|row| {
            let means = row.to_vec();
            for (i, value) in row.iter_mut().enumerate() {
                *value = weighted(|by| means[i.saturating_add_signed(by).min(width - 1)]);
            }
        });
        let means = out.data.clone();
        let plane = height * width;
        (0..channels).for_each(|c| {
            let means = &means[c * plane..(c + 1) * plane];
            let values = &mut out.data[c * plane..(c + 1) * plane];
            values.par_chunks_exact_mut(width).enumerate().for_each(|(i, row)| {
                for (j, value) in row.iter_mut().enumerate() {
                    *value = weighted(|by| means[i.saturating_add_signed(by).min(height - 1) * width + j]);
                }
            });
        });
        out
    }
}

/// The weighted sum of a sample and its neighbours by their distance.
fn weighted(at: impl Fn(isize) -> f32) -> f32 {
    let [middle, near, far] = WEIGHTS;
    middle * at(0) + near * (at(-1) + at(1)) + far * (at(-2) + at(2))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn the_middle_of_a_polynomial_follows_from_its_means() {
        // The mean of x^5 and of y^4 over unit squares, by their integrals.
        let mean = |at: usize, power: i32| {
            let x = at as f64 / 16.0;
            let integral = |x: f64| x.powi(power + 1) / f64::from(power + 1);
            16.0 * (integral(x + 1.0 / 32.0) - integral(x - 1.0 / 32.0))
        };
        let side = 16;
        let means = (0..side * side).map(|i| (mean(i % side, 5) + mean(i / side, 4)) as f32).collect();
        let points = LinearImage::from_data(1, side, side, means).unwrap().point_values();
        for (row, column) in (2..14).flat_map(|row| (2..14).map(move |column| (row, column))) {
            let wanted = (column as f64 / 16.0).powi(5) + (row as f64 / 16.0).powi(4);
            assert!((f64::from(points.get(0, row, column)) - wanted).abs() < 1e-6, "{row} {column}");
        }
    }

    #[test]
    fn the_transfer_of_a_mean_becomes_one() {
        for (cycles, error) in [(0.125, 1e-3), (0.25, 1e-2)] {
            let mean = (PI * cycles).sin() / (PI * cycles);
            let wave = |i: usize| (2.0 * PI * cycles * i as f64).cos();
            let means = LinearImage::from_data(1, 1, 64, (0..64).map(|i| (mean * wave(i)) as f32).collect());
            let points = means.unwrap().point_values();
            let largest =
                (2..62).map(|i| (f64::from(points.get(0, 0, i)) - wave(i)).abs()).fold(0.0, f64::max);
            assert!(largest < error, "{cycles}: {largest}");
        }
    }

    #[test]
    fn an_even_picture_stays() {
        let even = LinearImage::filled(3, 1, 3, 0.25);
        assert!(even.point_values().data.iter().all(|value| (value - 0.25).abs() < 1e-7));
    }
}
