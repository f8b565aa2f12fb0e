//! The picture as light: channel planes of linear intensity, 1.0 = white.
//!
//! Every stage before the display works on [`LinearImage`]; only files and image-quality scores see sRGB-encoded values
//! ([`srgb_encode`], [`srgb_decode`]).

mod display;
mod place;
mod point_values;
mod srgb;

pub use display::{display_bytes, spread};
pub(crate) use srgb::SRGB_TOE;
pub use srgb::{srgb_decode, srgb_encode};

/// Colour planes of a camera image, in the order red, green, blue.
pub const CHANNELS: usize = 3;

/// Linear-light image, channel-major: element `(c, row, col)` is at `(c * height + row) * width + col`.
///
/// Values are relative intensities, 1.0 = white; they may exceed 1 (highlights) and, after filtering or noise, be
/// slightly negative.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearImage {
    /// Number of planes; 3 = red, green, blue.
    pub channels: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// `channels * height * width` values.
    pub data: Vec<f32>,
}

/// A buffer whose length is not channels x height x width, or a crop that leaves the image.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ShapeError {
    /// Buffer length and shape disagree.
    #[error(
        "an image of {channels}x{height}x{width} needs {} values, got {len}",
        channels * height * width
    )]
    Length {
        /// Requested planes.
        channels: usize,
        /// Requested rows.
        height: usize,
        /// Requested columns.
        width: usize,
        /// Values given.
        len: usize,
    },
    /// The crop window does not lie inside the image.
    #[error(
        "crop of {height}x{width} at row {row}, column {col} leaves the {image_height}x{image_width} image"
    )]
    Crop {
        /// First row of the window.
        row: usize,
        /// First column of the window.
        col: usize,
        /// Rows of the window.
        height: usize,
        /// Columns of the window.
        width: usize,
        /// Rows of the image.
        image_height: usize,
        /// Columns of the image.
        image_width: usize,
    },
}

impl LinearImage {
    /// A black image.
    pub fn zeros(channels: usize, height: usize, width: usize) -> Self {
        Self::filled(channels, height, width, 0.0)
    }

    /// An image of one value.
    pub fn filled(channels: usize, height: usize, width: usize, value: f32) -> Self {
        Self { channels, height, width, data: vec![value; channels * height * width] }
    }

    /// Wraps channel-major values; the length must be `channels * height * width`.
    pub fn from_data(
        channels: usize,
        height: usize,
        width: usize,
        data: Vec<f32>,
    ) -> Result<Self, ShapeError> {
        if data.len() != channels * height * width {
            return Err(ShapeError::Length { channels, height, width, len: data.len() });
        }
        Ok(Self { channels, height, width, data })
    }

    /// Value at `(channel, row, col)`; the indices must be inside the image.
    pub fn get(&self, channel: usize, row: usize, col: usize) -> f32 {
        self.data[(channel * self.height + row) * self.width + col]
    }

    /// Sets the value at `(channel, row, col)`; the indices must be inside the image.
    pub fn set(&mut self, channel: usize, row: usize, col: usize, value: f32) {
        self.data[(channel * self.height + row) * self.width + col] = value;
    }

    /// One colour plane, row by row.
    pub fn plane(&self, channel: usize) -> &[f32] {
        let n = self.height * self.width;
        &self.data[channel * n..(channel + 1) * n]
    }

    /// One colour plane, row by row, mutable.
    pub fn plane_mut(&mut self, channel: usize) -> &mut [f32] {
        let n = self.height * self.width;
        &mut self.data[channel * n..(channel + 1) * n]
    }

    /// Transpose of [`LinearImage::pad_replicate`]: adds what a cotangent has in the border to the pixels that it repeats.
    pub fn pad_replicate_adjoint(&self, border: usize) -> Self {
        let size = |whole: usize| whole.saturating_sub(2 * border);
        let (height, width) = (size(self.height), size(self.width));
        let mut out = Self::zeros(self.channels, height, width);
        if out.data.is_empty() {
            return out;
        }
        for c in 0..self.channels {
            let target = out.plane_mut(c);
            for (r, line) in self.plane(c).chunks_exact(self.width).enumerate() {
                let row = r.saturating_sub(border).min(height - 1);
                let seen = &mut target[row * width..(row + 1) * width];
                seen.iter_mut().zip(&line[border..]).for_each(|(sum, v)| *sum += v);
                seen[0] += line[..border].iter().sum::<f32>();
                seen[width - 1] += line[border + width..].iter().sum::<f32>();
            }
        }
        out
    }

    /// The window of `height` x `width` pixels whose top-left pixel is `(row, col)`.
    pub fn crop(&self, row: usize, col: usize, height: usize, width: usize) -> Result<Self, ShapeError> {
        let fits =
            |start: usize, len: usize, size: usize| start.checked_add(len).is_some_and(|end| end <= size);
        if !fits(row, height, self.height) || !fits(col, width, self.width) {
            let (image_height, image_width) = (self.height, self.width);
            return Err(ShapeError::Crop { row, col, height, width, image_height, image_width });
        }
        let mut out = Self::zeros(self.channels, height, width);
        for c in 0..self.channels {
            let source = self.plane(c);
            for (r, line) in out.plane_mut(c).chunks_exact_mut(width.max(1)).enumerate() {
                let start = (row + r) * self.width + col;
                line.copy_from_slice(&source[start..start + width]);
            }
        }
        Ok(out)
    }

    /// Halves the resolution: each output pixel is the mean of a 2x2 block, as a sensor with pixels of twice the pitch
    /// would collect it. An odd last row or column is dropped.
    pub fn box_half(&self) -> Self {
        self.box_mean(2)
    }

    /// Each output pixel is the mean of a block of `side` x `side` pixels. Rows and columns that fill no block are dropped.
    pub fn box_mean(&self, side: usize) -> Self {
        let (height, width) = (self.height / side, self.width / side);
        let mut out = Self::zeros(self.channels, height, width);
        let share = 1.0 / (side * side) as f32;
        for c in 0..self.channels {
            let source = self.plane(c);
            for (r, line) in out.plane_mut(c).chunks_exact_mut(width.max(1)).enumerate() {
                for row in (r * side..(r + 1) * side).map(|row| &source[row * self.width..]) {
                    for (value, block) in line.iter_mut().zip(row.chunks_exact(side)) {
                        *value += block.iter().sum::<f32>();
                    }
                }
                line.iter_mut().for_each(|value| *value *= share);
            }
        }
        out
    }

    /// Surrounds the image with `border` pixels that repeat its edge: a lens brings in light from outside the frame.
    pub fn pad_replicate(&self, border: usize) -> Self {
        let start = -(border as isize);
        self.window_replicate(start, start, self.height + 2 * border, self.width + 2 * border)
    }

    /// The window of `height` x `width` pixels whose top-left pixel is `(row, col)`. Outside the image the edge is repeated.
    pub fn window_replicate(&self, row: isize, col: isize, height: usize, width: usize) -> Self {
        let mut out = Self::zeros(self.channels, height, width);
        if self.height == 0 || self.width == 0 {
            return out;
        }
        // Count the columns left of the image, and the columns inside it.
        let before = (-col).clamp(0, width as isize) as usize;
        let first = (col.max(0) as usize).min(self.width);
        let inside = (self.width - first).min(width - before);
        for c in 0..self.channels {
            let source = self.plane(c);
            for (r, line) in out.plane_mut(c).chunks_exact_mut(width.max(1)).enumerate() {
                let from = (row + r as isize).clamp(0, self.height as isize - 1) as usize;
                let seen = &source[from * self.width..(from + 1) * self.width];
                line[..before].fill(seen[0]);
                line[before..before + inside].copy_from_slice(&seen[first..first + inside]);
                line[before + inside..].fill(seen[self.width - 1]);
            }
        }
        out
    }

    /// The image as a display expects it: clipped to [0, 1] and sRGB-encoded, channel-major.
    pub fn to_srgb(&self) -> Vec<f32> {
        self.data.iter().map(|&v| srgb_encode(v.clamp(0.0, 1.0))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_and_its_transpose_have_one_dot_product() {
        let value = |i: usize| ((i * 37 + 11) % 101) as f32;
        let image = LinearImage::from_data(2, 3, 4, (0..24).map(value).collect()).unwrap();
        let padded = image.pad_replicate(5);
        let bar = LinearImage { data: (7..7 + padded.data.len()).map(value).collect(), ..padded.clone() };
        let back = bar.pad_replicate_adjoint(5);
        let dot = |a: &LinearImage, b: &LinearImage| {
            a.data.iter().zip(&b.data).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>()
        };
        assert_eq!((back.height, back.width), (3, 4));
        assert_eq!(dot(&padded, &bar), dot(&image, &back));
    }

    fn ramp() -> LinearImage {
        LinearImage::from_data(1, 3, 4, (0..12).map(|v| v as f32).collect()).unwrap()
    }

    #[test]
    fn crop_keeps_the_window_and_refuses_to_leave_the_image() {
        assert_eq!(ramp().crop(1, 2, 2, 2).unwrap().data, vec![6.0, 7.0, 10.0, 11.0]);
        assert!(matches!(ramp().crop(2, 0, 2, 1), Err(ShapeError::Crop { .. })));
        assert!(ramp().crop(usize::MAX, 0, 2, 1).is_err());
    }

    #[test]
    fn a_window_beyond_the_image_repeats_its_edge() {
        for (row, col) in [(-5, -5), (-3, 2), (0, 0), (1, 3), (-4, 1), (3, -2)] {
            let window = ramp().window_replicate(row, col, 5, 4);
            for (r, c) in (0..5).flat_map(|r| (0..4).map(move |c| (r, c))) {
                let nearest = ramp().get(0, (row + r).clamp(0, 2) as usize, (col + c).clamp(0, 3) as usize);
                assert_eq!(window.get(0, r as usize, c as usize), nearest, "{row} {col}");
            }
        }
        assert_eq!(ramp().window_replicate(0, 9, 1, 2).data, vec![3.0, 3.0]);
        assert_eq!(ramp().window_replicate(1, -9, 1, 2).data, vec![4.0, 4.0]);
    }

    #[test]
    fn box_half_averages_blocks_and_drops_the_odd_row() {
        assert_eq!(ramp().box_half().data, vec![2.5, 4.5]);
    }

    #[test]
    fn pad_replicate_repeats_the_edge() {
        let padded = ramp().pad_replicate(1);
        assert_eq!((padded.height, padded.width), (5, 6));
        assert_eq!(&padded.data[..6], &[0.0, 0.0, 1.0, 2.0, 3.0, 3.0]);
        assert_eq!(padded.get(0, 4, 5), 11.0);
    }

    #[test]
    fn wrong_length_is_an_error() {
        assert!(LinearImage::from_data(3, 2, 2, vec![0.0; 11]).is_err());
    }
}
