//! Position of the source in each frame, and its movement.
//!
//! The centroid here is that of all light of the mosaic, without demosaicing,
//!
//! ```text
//! c = sum w (m - b) x / sum w (m - b),     var c = sum (w (x - c) / L)^2 var m,     L = sum w (m - b)
//! ```
//!
//! with the window `w` of [`super::measure`], which moves with the centroid. Hot and saturated pixels may be left out.
//! This centroid is not exact to a fraction of a pixel, because a mosaic's colours sample light unevenly. But it shows
//! whether the source moved between two frames: both have the same error if the same pixels are left out.

use super::measure::{Frame, window};
use petzval_base::statistics::median;

/// Least light for a centroid, standard deviations: propagation of errors holds only for small errors.
const LIGHT_SIGMAS: f64 = 10.0;

/// A place with its standard error, (row, column), px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centroid {
    /// Place in the window.
    pub px: [f64; 2],
    /// Standard error by propagation.
    pub error_px: [f64; 2],
    /// Light over its standard deviation.
    pub light_sigmas: f64,
}

/// Common properties of mosaics of one kind: window, variance, shared noise of rows and columns, and excluded pixels.
#[derive(Debug, Clone, Copy)]
pub struct Mosaics<'a> {
    /// Their window.
    pub frame: &'a Frame,
    /// Variance of each pixel, in the square of the mosaics' unit.
    pub variance: &'a [f64],
    /// Variance of the noise that a row shares, and of that which a column shares.
    pub shared: [f64; 2],
    /// Pixels left out.
    pub left_out: &'a [bool],
}

impl Mosaics<'_> {
    /// Centroid of one mosaic, iterated from `start`; `None` if it has too little light.
    pub fn centroid(&self, mosaic: &[f64], start: [f64; 2]) -> Option<Centroid> {
        const MOVES: usize = 50;
        let Frame { height, width, .. } = *self.frame;
        let background = self.frame.background(mosaic, self.variance, start);
        let light = self.frame.without(mosaic, background);
        let weight =
            |i: usize, px: [f64; 2]| if self.left_out[i] { 0.0 } else { window(self.frame.distance(i, px)) };
        let mut px = start;
        for _ in 0..MOVES {
            let mut sum = [0.0; 3];
            for (i, value) in light.iter().enumerate() {
                let weighted = weight(i, px) * value;
                sum[0] += weighted;
                sum[1] += weighted * (i / width) as f64;
                sum[2] += weighted * (i % width) as f64;
            }
            let next = [sum[1] / sum[0], sum[2] / sum[0]];
            let inside = (0.0..height as f64).contains(&next[0]) && (0.0..width as f64).contains(&next[1]);
            if !(sum[0] > 0.0 && inside) {
                return None;
            }
            let moved = (next[0] - px[0]).hypot(next[1] - px[1]);
            px = next;
            if moved < 1e-4 {
                break;
            }
        }

        // Propagate the noise of single pixels, rows and columns through the derivative of the centroid.
        let (mut total, mut total_variance) = (0.0, 0.0);
        let mut square = [0.0; 2];
        let mut by_line = [vec![[0.0; 2]; height], vec![[0.0; 2]; width]];
        for (i, value) in light.iter().enumerate() {
            let w = weight(i, px);
            total += w * value;
            total_variance += w * w * self.variance[i];
            let at = [i / width, i % width];
            for (axis, square) in square.iter_mut().enumerate() {
                let by = w * (at[axis] as f64 - px[axis]);
                *square += by * by * self.variance[i];
                by_line[0][at[0]][axis] += by;
                by_line[1][at[1]][axis] += by;
            }
        }
        for (lines, shared) in by_line.iter().zip(self.shared) {
            for by in lines {
                (0..2).for_each(|axis| square[axis] += shared * by[axis] * by[axis]);
            }
        }
        let light_sigmas = total / total_variance.sqrt();
        let error_px = square.map(|v| v.sqrt() / total);
        (light_sigmas >= LIGHT_SIGMAS).then_some(Centroid { px, error_px, light_sigmas })
    }
}

/// A frame's file and its centroid; `None` without enough light.
pub type Followed = (String, Option<Centroid>);

/// The frames of an exposure in the order in which they are listed.
pub type Track = Vec<Followed>;

/// Mean of the frames' centroids, and its standard error from their scatter (from propagation for a single one).
pub fn mean_centroid(track: &[Followed]) -> Option<([f64; 2], [f64; 2])> {
    let centroids: Vec<&Centroid> = track.iter().filter_map(|(_, c)| c.as_ref()).collect();
    let count = centroids.len() as f64;
    let first = centroids.first()?;
    if centroids.len() == 1 {
        return Some((first.px, first.error_px));
    }
    let mean = [0, 1].map(|axis| centroids.iter().map(|c| c.px[axis]).sum::<f64>() / count);
    let error = [0, 1].map(|axis| {
        let square: f64 = centroids.iter().map(|c| (c.px[axis] - mean[axis]).powi(2)).sum();
        (square / (count - 1.0) / count).sqrt()
    });
    Some((mean, error))
}

/// Least number of frames whose own scatter estimates the error better than propagation: with fewer, a steady drift of
/// any speed would count as scatter.
const FRAMES_FOR_SCATTER: usize = 8;

/// Scatter of successive frames without a steady drift or single jumps in it: the median step, as a standard deviation.
pub fn scatter_px(track: &[Followed], axis: usize) -> f64 {
    let places: Vec<f64> = track.iter().filter_map(|(_, c)| c.map(|c| c.px[axis])).collect();
    if places.len() < FRAMES_FOR_SCATTER {
        return 0.0;
    }
    1.4826 * median(places.windows(2).map(|p| (p[1] - p[0]).abs())) / 2.0f64.sqrt()
}

/// A steady movement over all frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// From the first to the last frame by the line through all, (row, column), px.
    pub px: [f64; 2],
    /// Its standard error.
    pub error_px: [f64; 2],
}

/// Least-squares line through the places of the frames; `None` for fewer than two. `leave_out` says which frames do not
/// count. The error is that of propagation or, if that is larger, of the scatter between successive frames.
pub fn drift(track: &[Followed], leave_out: &[usize]) -> Option<Drift> {
    let kept = track.iter().enumerate().filter(|(n, _)| !leave_out.contains(n));
    let points: Vec<(f64, Centroid)> = kept.filter_map(|(n, (_, c))| c.map(|c| (n as f64, c))).collect();
    let (first, last) = (points.first()?.0, points.last()?.0);
    let middle = points.iter().map(|p| p.0).sum::<f64>() / points.len() as f64;
    let spread: f64 = points.iter().map(|p| (p.0 - middle).powi(2)).sum();
    if spread <= 0.0 {
        return None;
    }
    let span = (last - first) / spread;
    let px = [0, 1].map(|axis| span * points.iter().map(|(n, c)| (n - middle) * c.px[axis]).sum::<f64>());
    let error_px = [0, 1].map(|axis| {
        let square: f64 = points.iter().map(|(n, c)| ((n - middle) * c.error_px[axis]).powi(2)).sum();
        span * square.max(spread * scatter_px(track, axis).powi(2)).sqrt()
    });
    Some(Drift { px, error_px })
}

/// Frames whose source is away from its position in the others by more than half a pixel, `sigmas` standard errors of
/// one frame and `sigmas` times their scatter: number and distance, px.
pub fn strays(track: &[Followed], sigmas: f64) -> Vec<(usize, f64)> {
    let centroids: Vec<(usize, Centroid)> =
        track.iter().enumerate().filter_map(|(n, (_, c))| c.map(|c| (n, c))).collect();
    if centroids.len() < 3 {
        return Vec::new();
    }
    let middle = [0, 1].map(|axis| median(centroids.iter().map(|(_, c)| c.px[axis])));
    let spread =
        [0, 1].map(|axis| 1.4826 * median(centroids.iter().map(|(_, c)| (c.px[axis] - middle[axis]).abs())));
    let stray = |(n, c): &(usize, Centroid)| {
        let off = [0, 1].map(|axis| (c.px[axis] - middle[axis]).abs());
        let beyond = |axis: usize| off[axis] > sigmas * c.error_px[axis].hypot(spread[axis]);
        let distance = off[0].hypot(off[1]);
        (distance > 0.5 && (beyond(0) || beyond(1))).then_some((*n, distance))
    };
    centroids.iter().filter_map(stray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(places: &[f64]) -> Track {
        let at = |p: &f64| Centroid { px: [*p, 30.0], error_px: [0.01; 2], light_sigmas: 100.0 };
        places.iter().enumerate().map(|(n, p)| (n.to_string(), Some(at(p)))).collect()
    }

    #[test]
    fn the_drift_of_a_few_frames_has_the_right_length_and_error() {
        // Three frames, a tenth of a pixel from each to the next.
        let Drift { px, error_px } = drift(&track(&[20.0, 20.1, 20.2]), &[]).unwrap();
        assert!((px[0] - 0.2).abs() < 1e-12 && px[1].abs() < 1e-12, "{px:?}");
        // The line's slope has the error 0.01 / sqrt(2), its ends two frames apart twice that.
        assert!((error_px[0] - 0.02 / 2.0f64.sqrt()).abs() < 1e-12, "{error_px:?}");
        assert!(drift(&track(&[20.0]), &[]).is_none());
        assert!(drift(&track(&[20.0, 25.0]), &[1]).is_none());
    }

    #[test]
    fn the_scatter_of_many_frames_counts_without_jumps() {
        let shaking: Vec<f64> = (0..20).map(|n| 20.0 + if n % 2 == 0 { 0.1 } else { -0.1 }).collect();
        let Drift { px, error_px } = drift(&track(&shaking), &[]).unwrap();
        assert!(px[0].abs() < 5.0 * error_px[0] && error_px[0] > 0.05, "{px:?} {error_px:?}");
        let jumping: Vec<f64> = (0..20).map(|n| if n < 10 { 20.0 } else { 21.0 }).collect();
        let Drift { px, error_px } = drift(&track(&jumping), &[]).unwrap();
        assert!(px[0] > 1.0 && error_px[0] < 0.02, "{px:?} {error_px:?}");
    }

    #[test]
    fn one_frame_at_another_position_is_an_outlier_and_a_drift_has_none() {
        assert_eq!(strays(&track(&[20.0, 20.01, 23.0, 20.0, 19.99]), 5.0)[0].0, 2);
        let drifting: Vec<f64> = (0..10).map(|n| 20.0 + 0.3 * f64::from(n)).collect();
        assert!(strays(&track(&drifting), 5.0).is_empty());
    }
}
