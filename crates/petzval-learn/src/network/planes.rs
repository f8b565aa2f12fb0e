//! Picture planes with a border of zeros, the layout of the convolution kernels.

use rayon::prelude::*;

/// Columns are stored in whole groups of this size, so that a vector load stays within its row.
const COLUMN_GROUP: usize = 16;

/// Height, width and storage of zero-bordered planes.
///
/// A plane holds rows -1..=height (one more if the height is odd) and columns -1..=width, where the width is rounded up to
/// whole groups. All values outside the picture are 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneShape {
    pub height: usize,
    pub width: usize,
}

impl PlaneShape {
    /// Values from one stored row to the next.
    pub fn stride(self) -> usize {
        self.width.next_multiple_of(COLUMN_GROUP) + 2
    }

    /// Values of one stored plane, with spare values at the end so that vectors may extend past the last row.
    pub fn stored(self) -> usize {
        (self.height.next_multiple_of(2) + 2) * self.stride() + 2 * COLUMN_GROUP
    }

    /// Pixels of one picture plane.
    pub fn pixels(self) -> usize {
        self.height * self.width
    }
}

/// Zero-bordered planes `[batch, channels, stored rows, stored columns]`.
pub(crate) struct Planes {
    pub shape: PlaneShape,
    pub channels: usize,
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
        let stride = shape.stride();
        let mut data = vec![0.0; batch * stored_channels * shape.stored()];
        data.par_chunks_mut(shape.stored()).enumerate().for_each(|(plane, to)| {
            let (item, channel) = (plane / stored_channels, plane % stored_channels);
            if channel < channels {
                let start = (item * channels + channel) * shape.pixels();
                for row in 0..shape.height {
                    let first = start + row * shape.width;
                    let from = &values[first..first + shape.width];
                    let line = &mut to[(row + 1) * stride + 1..][..shape.width];
                    for (column, (t, f)) in line.iter_mut().zip(from).enumerate() {
                        *t = map(*f, first + column);
                    }
                }
            }
        });
        Self { shape, channels: stored_channels, data }
    }

    /// All planes of one picture of the batch.
    pub fn item(&self, item: usize) -> &[f32] {
        let length = self.channels * self.shape.stored();
        &self.data[item * length..][..length]
    }
}
