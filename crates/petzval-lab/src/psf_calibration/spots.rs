//! Bright spots of a mosaic: finds the source, and other sources.
//!
//! Spots are maxima of the light of a Bayer tile around each pixel: 3x3 pixels with the weights of bilinear interpolation,
//!
//! ```text
//!     | 1 2 1 |
//! 1/4 | 2 4 2 |     red 1, green 2, blue 1, whatever colour is in the middle
//!     | 1 2 1 |
//! ```
//!
//! With even weights the colours would be 4:4:1, 2:5:2 or 1:4:4 in turn, and a spot of one colour would have holes.
//!
//! Light of the source's own PSF (a tail, a ring or a caustic) is connected to its peak. Some path to the peak never falls far below the
//! light of its starting point. A maximum is *apart* if every path to the peak s(0) has a gap (the key saddle of topographic prominence),
//!
//! ```text
//! max over paths (min along the path s) < min(s(x) / 2, s(x) - 8 sigma(x))
//! ```
//!
//! Lateral colour separates the colours of one source, so that blue may be a maximum of its own with a gap before it.
//! But this maximum has only one colour. A second source has all colours, separated like those of the first: with s_c
//! the light of colour c and p_c its peak at the source,
//!
//! ```text
//! s_c(p_c + x) / s_c(p_c) > 1/4 s(x) / s(0)     in each colour
//! ```
//!
//! where 1/4 allows for the uneven sampling of spots as small as a pixel by the red and blue pixels. Beyond the extent
//! of a PSF, any maximum is another source.

use super::PsfCalibrationError;
use super::frame::{BACKGROUND_PX, Frame};
use petzval_camera::image::CHANNELS;

/// Least height of a source above the noise, standard deviations.
pub(super) const DETECTION_SIGMAS: f64 = 8.0;

/// Least peak of a reported second source, relative to the first one's.
pub(super) const SECOND_SOURCE: f64 = 0.1;

/// Distance within which two maxima belong to one PSF, and within which the peaks of all colours of a source lie, px.
const NEAR_PX: f64 = 4.0;

/// Share of a spot's light below which the light must fall before a spot that is apart.
const GAP: f64 = 0.5;

/// Share of each colour in a second spot, over the share of all light: at least this.
const COLOUR_SHARE: f64 = 0.25;

/// The light of a Bayer tile around every pixel that has all its neighbours, and 0 along the border.
struct Tiles {
    height: usize,
    width: usize,
    /// Light of each colour; of all pixels in each where the sensor has no filters.
    colours: [Vec<f64>; CHANNELS],
    /// Light of all colours.
    light: Vec<f64>,
    /// Standard deviation of `light`.
    sigma: Vec<f64>,
}

impl Tiles {
    fn new(mosaic: &[f64], variance: &[f64], frame: &Frame) -> Self {
        let zeros = || vec![0.0; mosaic.len()];
        let (height, width) = (frame.height, frame.width);
        let mut tiles =
            Self { height, width, colours: [zeros(), zeros(), zeros()], light: zeros(), sigma: zeros() };
        let inner: Vec<usize> = tiles.inner().collect();
        for i in inner {
            let mut square = 0.0;
            for near in 0..9 {
                let (down, right) = (near / 3, near % 3);
                let pixel = i + down * width + right - width - 1;
                let weight = [0.5, 1.0, 0.5][down] * [0.5, 1.0, 0.5][right];
                for c in (0..CHANNELS).filter(|c| frame.is_colour(pixel, *c)) {
                    tiles.colours[c][i] += weight * mosaic[pixel];
                }
                tiles.light[i] += weight * mosaic[pixel];
                square += weight * weight * variance[pixel];
            }
            tiles.sigma[i] = square.sqrt();
        }
        tiles
    }

    fn is_inner(&self, row: usize, col: usize) -> bool {
        (1..self.height - 1).contains(&row) && (1..self.width - 1).contains(&col)
    }

    /// Pixels that have all their neighbours.
    fn inner(&self) -> impl Iterator<Item = usize> + use<> {
        let (height, width) = (self.height, self.width);
        (1..height - 1).flat_map(move |row| (1..width - 1).map(move |col| row * width + col))
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        let (rows, cols) =
            ((a / self.width).abs_diff(b / self.width), (a % self.width).abs_diff(b % self.width));
        (rows as f64).hypot(cols as f64)
    }

    /// The pixel that lies from `middle` as `to` lies from `from`; `None` outside the frame.
    fn shifted(&self, middle: usize, from: usize, to: usize) -> Option<usize> {
        let row = (middle / self.width + to / self.width).checked_sub(from / self.width)?;
        let col = (middle % self.width + to % self.width).checked_sub(from % self.width)?;
        self.is_inner(row, col).then_some(row * self.width + col)
    }

    /// Whether a path leads from `start` to `goal` on which the light is at least `level` everywhere.
    fn are_joined(&self, start: usize, goal: usize, level: f64) -> bool {
        let mut seen = vec![false; self.light.len()];
        let mut open = vec![start];
        while let Some(i) = open.pop() {
            if i == goal {
                return true;
            }
            for near in 0..9 {
                let next = i + near / 3 * self.width + near % 3 - self.width - 1;
                let inner = self.is_inner(next / self.width, next % self.width);
                if inner && !seen[next] && self.light[next] >= level {
                    seen[next] = true;
                    open.push(next);
                }
            }
        }
        false
    }
}

/// The brightest spot, (row, column), if it stands out of the noise around it. `rate` may have a background.
pub(super) fn find_source(
    rate: &[f64],
    variance: &[f64],
    frame: &Frame,
    position: &str,
) -> Result<[usize; 2], PsfCalibrationError> {
    let tiles = Tiles::new(rate, variance, frame);
    let mut spots: Vec<usize> = tiles.inner().collect();
    spots.sort_by(|a, b| tiles.light[*a].total_cmp(&tiles.light[*b]));
    // Take the median as background, for light and for noise.
    let (median, brightest) = (spots[spots.len() / 2], spots[spots.len() - 1]);
    let sigmas = (tiles.light[brightest] - tiles.light[median]) / tiles.sigma[median];
    if sigmas < DETECTION_SIGMAS || !sigmas.is_finite() {
        return Err(PsfCalibrationError::NoSource { position: position.to_owned(), sigmas });
    }
    Ok([brightest / frame.width, brightest % frame.width])
}

/// Spots of other sources than the one at the pixel `source`, (row, column), and their share of its peak; the brightest first
/// and each only once. `mosaic` has no background.
pub(super) fn other_sources(
    mosaic: &[f64],
    variance: &[f64],
    frame: &Frame,
    source: [usize; 2],
) -> Vec<([usize; 2], f64)> {
    let tiles = Tiles::new(mosaic, variance, frame);
    let source = source[0] * frame.width + source[1];
    let share = |i: usize| tiles.light[i] / tiles.light[source];
    let peaks: [usize; CHANNELS] = std::array::from_fn(|c| {
        let by_source = tiles.inner().filter(|i| tiles.distance(*i, source) < NEAR_PX);
        by_source.max_by(|a, b| tiles.colours[c][*a].total_cmp(&tiles.colours[c][*b])).unwrap_or(source)
    });
    let has_all_colours = |i: usize| {
        (0..CHANNELS).all(|c| {
            let colour = &tiles.colours[c];
            // A colour whose peak would lie outside the frame does not count against the source.
            let there = tiles.shifted(peaks[c], source, i);
            there.is_none_or(|there| colour[there] > COLOUR_SHARE * share(i) * colour[peaks[c]])
        })
    };
    let is_apart = |i: usize| {
        let level = (GAP * tiles.light[i]).min(tiles.light[i] - DETECTION_SIGMAS * tiles.sigma[i]);
        !tiles.are_joined(i, source, level)
    };

    let mut bright: Vec<usize> = tiles
        .inner()
        .filter(|i| tiles.distance(*i, source) >= NEAR_PX)
        .filter(|i| tiles.light[*i] > DETECTION_SIGMAS * tiles.sigma[*i] && share(*i) > SECOND_SOURCE)
        .collect();
    bright.sort_by(|a, b| tiles.light[*b].total_cmp(&tiles.light[*a]));
    let mut found: Vec<usize> = Vec::new();
    for i in bright {
        let is_new = found.iter().all(|f| tiles.distance(i, *f) > BACKGROUND_PX);
        let is_far = tiles.distance(i, source) > BACKGROUND_PX;
        if is_new && (is_far || (has_all_colours(i) && is_apart(i))) {
            found.push(i);
        }
    }
    found.into_iter().map(|i| ([i / frame.width, i % frame.width], share(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_camera::render::Placement;
    use petzval_camera::sensor::CfaPattern;

    const SIDE: usize = 64;

    fn frame(row: usize, col: usize) -> Frame {
        Frame { height: SIDE, width: SIDE, placement: Placement { row, col }, cfa: CfaPattern::RGGB }
    }

    /// Other sources beside the one at (30, 31), with light of each colour at (row, column) from there, and noise of a
    /// two-hundredth of its peak.
    fn others(frame: &Frame, light: impl Fn(usize, f64, f64) -> f64) -> Vec<([usize; 2], f64)> {
        let plane = |c: usize| {
            (0..SIDE * SIDE).map(|i| light(c, (i / SIDE) as f64 - 30.0, (i % SIDE) as f64 - 31.0)).collect()
        };
        let mosaic = frame.mosaic(&[plane(0), plane(1), plane(2)]);
        other_sources(&mosaic, &vec![25e-6; SIDE * SIDE], frame, [30, 31])
    }

    fn gauss(row: f64, col: f64, sigma: f64) -> f64 {
        (-0.5 * (row * row + col * col) / (sigma * sigma)).exp()
    }

    #[test]
    fn a_tile_has_all_colours_at_every_position() {
        let colours = [3.0, 5.0, 11.0];
        for phase in 0..4 {
            let frame = frame(phase / 2, phase % 2);
            let mosaic = frame.mosaic(&colours.map(|v| vec![v; SIDE * SIDE]));
            let tiles = Tiles::new(&mosaic, &vec![4.0; SIDE * SIDE], &frame);
            for i in tiles.inner() {
                let seen = [0, 1, 2].map(|c| tiles.colours[c][i]);
                assert_eq!((seen, tiles.light[i]), ([3.0, 10.0, 11.0], 24.0));
                // Weights of 1, 4 of 1/2, 4 of 1/4: the sum of their squares is 9/4.
                assert_eq!(tiles.sigma[i], 3.0);
            }
        }
    }

    #[test]
    fn one_source_of_any_shape_and_colour_is_one_source() {
        for phase in 0..4 {
            let frame = frame(800 + phase / 2, 1200 + phase % 2);
            // The shadow of a pupil with a hole, brightest where the ring is cut at the middle of the window; across, it is dark.
            let ring = |_: usize, row: f64, col: f64| {
                let radius = (row - 6.0).hypot(col);
                (-0.5 * ((radius - 6.0) / 1.5).powi(2)).exp() * (1.0 - 0.03 * row)
            };
            assert_eq!(others(&frame, ring), [], "ring, phase {phase}");
            // Lateral colour of 8 px with a gap: blue stands alone, and green's pixels see a part of it.
            let apart = |c: usize, row: f64, col: f64| {
                let blue = gauss(row - 4.0, col + 7.0, 1.2);
                [1.0, 1.0, 0.2][c] * gauss(row, col, 1.2) + [0.02, 0.2, 0.9][c] * blue
            };
            assert_eq!(others(&frame, apart), [], "lateral colour, phase {phase}");
        }
    }

    #[test]
    fn a_second_source_is_found_also_with_lateral_colour() {
        let spot = |c: usize, row: f64, col: f64| gauss(row - [0.0, 0.0, 2.5][c], col, 1.2);
        for phase in 0..4 {
            let frame = frame(800 + phase / 2, 1200 + phase % 2);
            for (down, right, share) in [(0.0, 7.0, 0.3), (-6.0, 4.0, 0.9), (9.0, -9.0, 0.2)] {
                let two = |c: usize, row: f64, col: f64| {
                    spot(c, row, col) + share * spot(c, row - down, col - right)
                };
                let found = others(&frame, two);
                assert_eq!(found.len(), 1, "{down} {right}, phase {phase}: {found:?}");
                let ([row, col], seen) = found[0];
                let off = (row as f64 - 30.0 - down).hypot(col as f64 - 31.0 - right);
                assert!(off < 1.5 && (seen / share - 1.0).abs() < 0.3, "{found:?} instead of {share}");
            }
            // Far away, light of one colour is another source too.
            let red = |c: usize, row: f64, col: f64| {
                spot(c, row, col) + if c == 0 { gauss(row - 15.0, col - 15.0, 1.2) } else { 0.0 }
            };
            assert_eq!(others(&frame, red).len(), 1);
        }
    }
}
