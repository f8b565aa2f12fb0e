//! Distortion: where on the image a point of a rectilinear picture lands.

use petzval_base::table::Interval;
use rayon::prelude::*;

use super::error::RenderError;
use super::geometry::Window;
use super::{RenderGeometry, limits::MAX_SIDE};
use crate::image::LinearImage;
use crate::psf::{PsfError, check_len, check_radii};

/// The chief-ray map of a rotationally symmetric lens: the ideal radius of each image radius.
///
/// The ideal radius is that of an image without distortion that has the same scale on the axis. Between the given radii the map is
/// a cubic through neighbouring values, with the slopes of parabolas through three of them; beyond the last radius it is straight.
#[derive(Debug, Clone, PartialEq)]
pub struct Distortion {
    image_mm: Vec<f64>,
    ideal_mm: Vec<f64>,
}

/// Intervals along the edge of a sensor in which its largest stretch is looked for.
const EDGE_POINTS: usize = 64;

/// Share of each table value in an interpolated one.
type Shares = [(usize, f64); 4];

impl Distortion {
    /// A map by at least two image radii, ascending from 0, and the ideal radius of each, ascending from 0, mm; also beyond the last the
    /// ideal radius has to grow.
    pub fn new(image_mm: Vec<f64>, ideal_mm: Vec<f64>) -> Result<Self, PsfError> {
        check_len("the distortion table", ideal_mm.len(), image_mm.len())?;
        if image_mm.len() < 2 {
            return Err(PsfError::NoField);
        }
        check_radii(&image_mm)?;
        check_radii(&ideal_mm)?;
        // Beyond its end the map goes on with its last slope, and must not fold back.
        let map = Self { image_mm, ideal_mm };
        let last = map.image_mm.len() - 1;
        let (end_mm, beyond_mm) = (map.image_mm[last], 1.01 * map.image_mm[last]);
        if map.ideal_mm(beyond_mm) <= map.ideal_mm(end_mm) {
            return Err(PsfError::Radius { index: last, radius_mm: map.ideal_mm[last] });
        }
        Ok(map)
    }

    /// The ideal radius of an image radius, mm.
    pub fn ideal_mm(&self, image_mm: f64) -> f64 {
        self.shares(image_mm).iter().map(|(i, share)| share * self.ideal_mm[*i]).sum()
    }

    /// The image radius of an ideal radius, mm: where a label of the scene lands.
    pub fn image_mm(&self, ideal_mm: f64) -> f64 {
        // Both radii ascend: halve the interval until it is as small as rounding.
        let mut high = 1.0_f64;
        while self.ideal_mm(high) < ideal_mm && high < 1e9 {
            high *= 2.0;
        }
        let mut low = 0.0;
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if self.ideal_mm(middle) < ideal_mm { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// The interpolated value at a radius as shares of the table's values.
    fn shares(&self, radius_mm: f64) -> Shares {
        let (r, last) = (&self.image_mm, self.image_mm.len() - 1);
        let Some(Interval { lower: lo, share: t }) = Interval::in_slice(radius_mm, r) else {
            return [(0, 0.0); 4];
        };
        let width = r[lo + 1] - r[lo];
        // Slope by neighbours: the map is odd, so the value left of the axis is minus the first one.
        let slope = |i: usize| -> [(usize, f64); 3] {
            if i == 0 || last == 1 {
                return [(1, 1.0 / r[1]), (0, 0.0), (0, 0.0)];
            }
            if i == last {
                // The parabola through the last three values, at its end.
                let (before, width) = (r[last - 1] - r[last - 2], r[last] - r[last - 1]);
                let sum = before + width;
                return [
                    (last - 2, width / (before * sum)),
                    (last - 1, -sum / (before * width)),
                    (last, (before + 2.0 * width) / (width * sum)),
                ];
            }
            let (below, above) = (r[i] - r[i - 1], r[i + 1] - r[i]);
            let sum = below + above;
            [
                (i - 1, -above / (below * sum)),
                (i, (above - below) / (below * above)),
                (i + 1, below / (above * sum)),
            ]
        };
        let mut of_table = [0.0; 4];
        let first = lo.saturating_sub(1);
        if t > 1.0 {
            // Beyond the last radius: a straight line.
            of_table[last - first] += 1.0;
            for (i, share) in slope(last).into_iter().filter(|(_, share)| *share != 0.0) {
                of_table[i - first] += share * (t - 1.0) * width;
            }
        } else {
            // Cubic Hermite interpolation.
            let (a, b) = (t * t * (3.0 - 2.0 * t), t * (1.0 - t));
            of_table[lo - first] += 1.0 - a;
            of_table[lo + 1 - first] += a;
            for (end, weight) in [(lo, b * (1.0 - t)), (lo + 1, -b * t)] {
                for (i, share) in slope(end).into_iter().filter(|(_, share)| *share != 0.0) {
                    of_table[i - first] += share * weight * width;
                }
            }
        }
        std::array::from_fn(|k| ((first + k).min(last), of_table[k]))
    }

    /// Rows and columns of a rectilinear picture, in pixels of the sensor, that covers everything the sensor sees. The optical axis
    /// is in its middle; it is as much larger than the sensor on one side as on the other.
    pub fn ideal_frame(&self, geometry: &RenderGeometry) -> Result<(usize, usize), RenderError> {
        geometry.validate()?;
        let corner_mm = geometry.radius_mm(0, 0);
        let side = |pixels: usize| {
            let edge_mm = 0.5e-3 * geometry.pixel_um * pixels as f64;
            // The largest stretch along the edge of the sensor, from its middle to the corner.
            let along = (0..=EDGE_POINTS).map(|k| {
                let radius_mm = edge_mm + (corner_mm - edge_mm).max(0.0) * k as f64 / EDGE_POINTS as f64;
                self.ideal_mm(radius_mm) / radius_mm
            });
            let stretch = along.fold(0.0_f64, f64::max);
            let beyond = edge_mm * (stretch - 1.0) * 1e3 / geometry.pixel_um;
            (pixels as f64 + 2.0 * beyond.ceil()).clamp(1.0, MAX_SIDE as f64) as usize
        };
        Ok((side(geometry.sensor_height), side(geometry.sensor_width)))
    }

    /// The light of a rectilinear `picture` as the lens projects it onto a window and `border` pixels around it, three planes.
    ///
    /// The optical axis meets the middle of the picture, whose pixels are those of the sensor. Radiance is resampled, by cubic
    /// convolution (Keys 1981, a = -1/2), and light below zero is cut off; where light lands on more or less area counts in the relative
    /// illumination. Outside the picture its edge is repeated.
    pub fn project(
        &self,
        geometry: &RenderGeometry,
        picture: &LinearImage,
        window: &Window,
        border: usize,
    ) -> Result<LinearImage, RenderError> {
        geometry.validate()?;
        if picture.height == 0 || picture.width == 0 {
            return Err(RenderError::SceneTooSmall { height: picture.height, width: picture.width, border });
        }
        let (height, width) = (window.height + 2 * border, window.width + 2 * border);
        let mut out = LinearImage::zeros(picture.channels, height, width);
        let places: Vec<Place> = (0..height * width)
            .into_par_iter()
            .map(|i| {
                let row = (window.placement.row + i / width) as f64 - border as f64;
                let col = (window.placement.col + i % width) as f64 - border as f64;
                self.source(&Sensed::new(geometry, row, col), picture)
            })
            .collect();
        for c in 0..picture.channels {
            let plane = picture.plane(c);
            (out.plane_mut(c), &places[..]).into_par_iter().for_each(|(value, place)| {
                *value = place.sample(plane, picture.height, picture.width).max(0.0)
            });
        }
        Ok(out)
    }

    /// Where in a picture the light of a sensor position comes from.
    fn source(&self, at: &Sensed, picture: &LinearImage) -> Place {
        let stretch = if at.radius_mm > 0.0 { self.ideal_mm(at.radius_mm) / at.radius_mm } else { 1.0 };
        Place {
            row: at.y * stretch + 0.5 * (picture.height as f64 - 1.0),
            col: at.x * stretch + 0.5 * (picture.width as f64 - 1.0),
        }
    }
}

/// A position of the sensor: pixels from the optical axis.
struct Sensed {
    y: f64,
    x: f64,
    radius_mm: f64,
}

impl Sensed {
    fn new(geometry: &RenderGeometry, row: f64, col: f64) -> Self {
        let y = row - 0.5 * (geometry.sensor_height as f64 - 1.0);
        let x = col - 0.5 * (geometry.sensor_width as f64 - 1.0);
        Self { y, x, radius_mm: x.hypot(y) * geometry.pixel_um * 1e-3 }
    }
}

/// A position between pixels.
struct Place {
    row: f64,
    col: f64,
}

/// The four taps of cubic convolution around a position: the first pixel, and the weights.
fn taps(at: f64) -> (isize, [f32; 4]) {
    let floor = at.floor();
    let t = (at - floor) as f32;
    let (t2, t3) = (t * t, t * t * t);
    let weights = [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ];
    (floor as isize - 1, weights)
}

impl Place {
    /// The value of a plane there: the 4 x 4 pixels around, weighted by their rows and columns.
    fn sample(&self, plane: &[f32], height: usize, width: usize) -> f32 {
        let ((row, by_row), (col, by_col)) = (taps(self.row), taps(self.col));
        let inside = |at: isize, size: usize| at.clamp(0, size as isize - 1) as usize;
        let columns: [usize; 4] = std::array::from_fn(|k| inside(col + k as isize, width));
        let mut sum = 0.0;
        for (k, weight) in by_row.into_iter().enumerate() {
            let line = &plane[inside(row + k as isize, height) * width..][..width];
            sum += weight * (0..4).map(|k| by_col[k] * line[columns[k]]).sum::<f32>();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::CHANNELS;
    use crate::render::Placement;

    const GEOMETRY: RenderGeometry =
        RenderGeometry { sensor_height: 240, sensor_width: 320, pixel_um: 10.0, patches: (1, 1) };

    /// `ideal = r (1 + k r^2)`, barrel distortion for positive k, at radii up to the corner of the sensor (2 mm).
    fn barrel(k: f64) -> Distortion {
        let image_mm: Vec<f64> = (0..13).map(|i| f64::from(i) / 6.0).collect();
        let ideal_mm = image_mm.iter().map(|r| r * (1.0 + k * r * r)).collect();
        Distortion::new(image_mm, ideal_mm).unwrap()
    }

    #[test]
    fn the_map_is_smooth_and_its_inverse_undoes_it() {
        for k in [0.03, -0.02, 0.0] {
            let map = barrel(k);
            for i in 0..220 {
                let r = f64::from(i) * 0.01;
                // A cubic with slopes of parabolas: for intervals d the slopes are off by k d^2, at the last radius by 2 k d^2,
                // which makes 0.39 k d^3 at most. Beyond it the straight line leaves the curve.
                let ideal = r * (1.0 + k * r * r);
                let tolerance = if r <= 2.0 { 1.8e-3 * k.abs() + 1e-12 } else { 0.3 * k.abs() + 1e-12 };
                assert!((map.ideal_mm(r) - ideal).abs() <= tolerance, "{k} {r}: {}", map.ideal_mm(r) - ideal);
                assert!((map.image_mm(map.ideal_mm(r)) - r).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn tables_that_are_no_map_are_refused() {
        let map = |a: &[f64], b: &[f64]| Distortion::new(a.to_vec(), b.to_vec());
        assert!(map(&[0.0, 1.0], &[0.0]).is_err());
        assert!(map(&[0.1, 1.0], &[0.0, 1.0]).is_err());
        assert!(map(&[0.0, 1.0, 1.5], &[0.0, 1.0, 0.9]).is_err());
        assert!(map(&[0.0, f64::NAN], &[0.0, 1.0]).is_err());
        assert!(map(&[], &[]).is_err() && map(&[0.0], &[0.0]).is_err());
        // The parabola through the last radii falls at its end: the map would fold back.
        assert!(map(&[0.0, 1.0, 2.0], &[0.0, 1.0, 1.1]).is_err());
    }

    #[test]
    fn a_point_lands_where_its_chief_ray_does_and_the_frame_holds_all_that_is_seen() {
        let map = barrel(0.03);
        let (height, width) = map.ideal_frame(&GEOMETRY).unwrap();
        // 2 mm x (1 + 0.03 x 4) at the corner: 12 % more on both axes.
        assert_eq!((height, width), (240 + 2 * 15, 320 + 2 * 20));
        let window = Window { placement: Placement::default(), height: 240, width: 320 };
        for (row, col) in [(20, 30), (200, 300), (135, 180)] {
            // A round spot, wide enough for its samples to hold its centroid.
            let mut picture = LinearImage::zeros(CHANNELS, height, width);
            for c in 0..CHANNELS {
                for (r, s) in (row - 8..=row + 8).flat_map(|r| (col - 8..=col + 8).map(move |s| (r, s))) {
                    let square = (r as f32 - row as f32).powi(2) + (s as f32 - col as f32).powi(2);
                    picture.set(c, r, s, (-0.25 * square).exp());
                }
            }
            let seen = map.project(&GEOMETRY, &picture, &window, 0).unwrap();
            // The centroid of the light is the image of the point.
            let mut sums = [0.0; 3];
            for r in 0..240 {
                for c in 0..320 {
                    let v = f64::from(seen.get(1, r, c));
                    sums = [sums[0] + v, sums[1] + v * r as f64, sums[2] + v * c as f64];
                }
            }
            let y = row as f64 - 0.5 * (height as f64 - 1.0);
            let x = col as f64 - 0.5 * (width as f64 - 1.0);
            let ideal_mm = x.hypot(y) * 0.01;
            let shrink = map.image_mm(ideal_mm) / ideal_mm;
            let wanted = [y * shrink + 119.5, x * shrink + 159.5];
            assert!((sums[1] / sums[0] - wanted[0]).abs() < 0.1, "{} {wanted:?}", sums[1] / sums[0]);
            assert!((sums[2] / sums[0] - wanted[1]).abs() < 0.1, "{} {wanted:?}", sums[2] / sums[0]);
        }
    }

    #[test]
    fn a_lens_without_distortion_leaves_the_picture_and_windows_are_parts_of_the_whole() {
        let picture = LinearImage {
            data: (0..CHANNELS * 240 * 320).map(|i| ((i * 7919) % 1000) as f32 * 1e-3).collect(),
            ..LinearImage::zeros(CHANNELS, 240, 320)
        };
        let whole = Window { placement: Placement::default(), height: 240, width: 320 };
        let same = barrel(0.0).project(&GEOMETRY, &picture, &whole, 0).unwrap();
        assert!(same.data.iter().zip(&picture.data).all(|(a, b)| (a - b).abs() < 1e-5));
        let map = barrel(0.03);
        let all = map.project(&GEOMETRY, &picture, &whole, 0).unwrap();
        let part = Window { placement: Placement { row: 50, col: 60 }, height: 40, width: 30 };
        let window = map.project(&GEOMETRY, &picture, &part, 8).unwrap();
        assert_eq!(window, all.crop(42, 52, 56, 46).unwrap());
    }
}
