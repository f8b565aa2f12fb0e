//! Picture planes with a border of zeros, the layout of the convolution kernels.

use rayon::prelude::*;

/// Columns are stored in whole groups of this size, so that a vector load stays within its row.
const COLUMN_GROUP: usize = 16;

/// Height, width and storage of zero-bordered planes.
///
/// A plane holds rows `-border..height + border` (one more if the height is odd) and columns `-border..width + border`, where
/// the width is rounded up to whole groups. All values outside the picture are 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneShape {
    pub height: usize,
    pub width: usize,
    pub border: usize,
}

impl PlaneShape {
    /// Values from one stored row to the next.
    pub fn stride(self) -> usize {
        self.width.next_multiple_of(COLUMN_GROUP) + 2 * self.border
    }

    /// Values of one stored plane, with spare values at the end so that vectors may extend past the last row.
    pub fn stored(self) -> usize {
        (self.height.next_multiple_of(2) + 2 * self.border) * self.stride() + 2 * COLUMN_GROUP
    }

    /// Pixels of one picture plane.
    pub fn pixels(self) -> usize {
        self.height * self.width
    }

    /// Index of the top left pixel in a stored plane.
    pub fn first(self) -> usize {
        self.border * (self.stride() + 1)
    }
}

/// Zeros, written by all threads: on one they take a twentieth of the time of a training step.
pub(crate) fn zeros(count: usize) -> Vec<f32> {
    rayon::iter::repeat_n(0.0, count).collect()
}

/// Zero-bordered planes `[batch, planes, stored rows, stored columns]`.
pub(crate) struct Planes {
    pub shape: PlaneShape,
    /// Planes of one picture.
    pub count: usize,
    pub data: Vec<f32>,
}

impl Planes {
    /// Copies `values` of shape `[batch, channels, height, width]` through `map(value, index into values)`. Each picture has
    /// `stored_channels` planes, at least `channels`; the additional planes are 0.
    pub fn copy(
        values: &[f32],
        channels: usize,
        stored_channels: usize,
        shape: PlaneShape,
        map: impl Fn(f32, usize) -> f32 + Sync,
    ) -> Self {
        let batch = values.len() / (channels * shape.pixels());
        let mut data = zeros(batch * stored_channels * shape.stored());
        data.par_chunks_mut(shape.stored()).enumerate().for_each(|(plane, to)| {
            let (item, channel) = (plane / stored_channels, plane % stored_channels);
            if channel < channels {
                let start = (item * channels + channel) * shape.pixels();
                for row in 0..shape.height {
                    let first = start + row * shape.width;
                    let from = &values[first..first + shape.width];
                    let line = &mut to[shape.first() + row * shape.stride()..][..shape.width];
                    for (column, (t, f)) in line.iter_mut().zip(from).enumerate() {
                        *t = map(*f, first + column);
                    }
                }
            }
        });
        Self { shape, count: stored_channels, data }
    }

    /// Copies every second pixel of `values`, `[batch, channels, height, width]`, into four planes per channel: plane
    /// `2 i + j` holds the pixels `(2 r + i - border, 2 c + j - border)` at its stored row `r` and column `c`. `shape` is the
    /// shape of a plane, half the picture.
    pub fn quarters(values: &[f32], channels: usize, [height, width]: [usize; 2], shape: PlaneShape) -> Self {
        let batch = values.len() / (channels * height * width);
        let mut data = zeros(batch * channels * 4 * shape.stored());
        data.par_chunks_mut(shape.stored()).enumerate().for_each(|(plane, to)| {
            let picture = &values[plane / 4 * height * width..][..height * width];
            let (i, j) = (plane % 4 / 2, plane % 2);
            // The first stored row and column whose pixel is inside the picture.
            let [top, left] = [i, j].map(|parity| shape.border.saturating_sub(parity).div_ceil(2));
            let rows = (2 * top + i - shape.border..height).step_by(2);
            for (row, line) in rows.zip(to.chunks_exact_mut(shape.stride()).skip(top)) {
                let from = &picture[row * width..][..width];
                let columns = (2 * left + j - shape.border..width).step_by(2);
                for (column, t) in columns.zip(&mut line[left..]) {
                    *t = from[column];
                }
            }
        });
        Self { shape, count: channels * 4, data }
    }

    /// Pictures of the batch.
    pub fn batch(&self) -> usize {
        self.data.len() / (self.count * self.shape.stored())
    }

    /// All planes of one picture of the batch.
    pub fn item(&self, item: usize) -> &[f32] {
        let length = self.count * self.shape.stored();
        &self.data[item * length..][..length]
    }
}
