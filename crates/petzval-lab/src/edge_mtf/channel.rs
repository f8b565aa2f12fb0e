//! The planes of a frame: values on a grid of every pixel, or of every second pixel of a mosaic.

use petzval_camera::image::LinearImage;
use petzval_camera::render::{Placement, Window};
use petzval_camera::sensor::{CfaPattern, Colour};

use super::Region;
use crate::sfr::Plane;

/// Shares of red, green and blue in luminance, ITU-R BT.709.
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// A colour of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of the colour, or `luminance`.
    pub name: String,
    /// Pixels of the frame from one value of a plane to the next.
    pub pitch: usize,
    /// Its planes: two for the green of a Bayer mosaic.
    pub planes: Vec<SampledPlane>,
}

impl Channel {
    /// Shares of the pixels of a region at or below the least value, and at or above the largest; 0 where that is not known.
    pub fn shares_at(&self, region: &Region, ends: [Option<f64>; 2]) -> [f64; 2] {
        let mut counts = [0_usize; 3];
        for plane in &self.planes {
            let window = plane.window(region, self.pitch);
            for row in window.placement.row..window.placement.row + window.height {
                let start = row * plane.width + window.placement.col;
                for value in plane.values.get(start..start + window.width).unwrap_or_default() {
                    let value = f64::from(*value);
                    counts[0] += usize::from(ends[0].is_some_and(|least| value <= least));
                    counts[1] += usize::from(ends[1].is_some_and(|largest| value >= largest));
                    counts[2] += 1;
                }
            }
        }
        [counts[0], counts[1]].map(|count| count as f64 / counts[2].max(1) as f64)
    }
}

/// Values at every `pitch`-th pixel of every `pitch`-th row of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledPlane {
    /// Row and column of the first value in the frame.
    start: [usize; 2],
    values: Vec<f32>,
    height: usize,
    width: usize,
}

impl SampledPlane {
    /// The plane of a frame of `frame_width` columns that starts at a pixel.
    fn of(values: &[f32], frame_width: usize, start: [usize; 2], pitch: usize) -> Self {
        let rows = || values.chunks_exact(frame_width).skip(start[0]).step_by(pitch);
        Self {
            start,
            height: rows().len(),
            width: frame_width.saturating_sub(start[1]).div_ceil(pitch),
            values: rows().flat_map(|row| row.iter().skip(start[1]).step_by(pitch)).copied().collect(),
        }
    }

    /// The values, row by row.
    pub fn as_plane(&self) -> Plane<'_> {
        Plane { values: &self.values, width: self.width }
    }

    /// Size: rows and columns.
    pub fn size(&self) -> [usize; 2] {
        [self.height, self.width]
    }

    /// The values that lie in a region of the frame.
    pub fn window(&self, region: &Region, pitch: usize) -> Window {
        // The first value at or behind the beginning, and the first at or behind the end.
        let at = |pixel: usize, start: usize| pixel.saturating_sub(start).div_ceil(pitch);
        let (row, col) = (at(region.row, self.start[0]), at(region.col, self.start[1]));
        Window {
            placement: Placement { row, col },
            height: at(region.row + region.height, self.start[0]) - row,
            width: at(region.col + region.width, self.start[1]) - col,
        }
    }

    /// A place of the plane, row and column in its pixels from the upper left corner, in those of the frame.
    pub fn in_frame(&self, place: [f64; 2], pitch: usize) -> [f64; 2] {
        [0, 1].map(|k| self.start[k] as f64 + 0.5 + pitch as f64 * (place[k] - 0.5))
    }

    /// The region of the frame around a window of the plane.
    pub fn region(&self, window: &Window, pitch: usize) -> Region {
        Region {
            row: self.start[0] + pitch * window.placement.row,
            col: self.start[1] + pitch * window.placement.col,
            height: pitch * (window.height - 1) + 1,
            width: pitch * (window.width - 1) + 1,
        }
    }
}

/// The colours of a raw frame of `width` columns whose filters are arranged in squares of 1 or 2 pixels a side; none for other arrays.
pub fn raw_channels(values: &[f32], width: usize, cfa: CfaPattern) -> Option<Vec<Channel>> {
    let pitch = cfa.rows();
    if pitch != cfa.cols() || pitch > 2 {
        return None;
    }
    let places = || (0..pitch * pitch).map(|i| [i / pitch, i % pitch]);
    let channel = |colour: Colour| Channel {
        name: colour.name().to_owned(),
        pitch,
        planes: places()
            .filter(|at| cfa.colour(at[0], at[1]) == colour)
            .map(|at| SampledPlane::of(values, width, at, pitch))
            .collect(),
    };
    Some(cfa.colours().into_iter().map(channel).collect())
}

/// The channels of a picture in linear light: luminance, red, green and blue; luminance alone where the three are equal.
pub fn picture_channels(light: &LinearImage) -> Vec<Channel> {
    let channel = |name: &str, values: &[f32]| Channel {
        name: name.to_owned(),
        pitch: 1,
        planes: vec![SampledPlane::of(values, light.width, [0, 0], 1)],
    };
    let [red, green, blue] = [0, 1, 2].map(|c| light.plane(c));
    let luminance: Vec<f32> = (0..red.len())
        .map(|i| LUMINANCE[0] * red[i] + LUMINANCE[1] * green[i] + LUMINANCE[2] * blue[i])
        .collect();
    let mut channels = vec![channel("luminance", &luminance)];
    if red != green || green != blue {
        channels.extend([("red", red), ("green", green), ("blue", blue)].map(|(name, of)| channel(name, of)));
    }
    channels
}
