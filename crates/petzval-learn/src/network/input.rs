//! What a camera knows about a picture when its network finishes it.

use std::ops::Range;

use burn::prelude::*;

/// Developed pictures and what is known about them, `[batch, channels, height, width]` of one size.
#[derive(Clone)]
pub struct NetworkInput {
    /// The developed pictures with the blur of the lens, sRGB-encoded, 3 channels.
    pub developed: Tensor<4>,
    /// The developed pictures without the blur, sRGB-encoded, 3 channels; none where the camera does not restore.
    pub restored: Option<Tensor<4>>,
    /// Distance from the optical axis: 0 on it, 1 in the corner of the sensor; 1 channel.
    pub field: Tensor<4>,
    /// Standard deviation of the noise in the square root of light, in roots of white; 1 channel.
    pub noise: Tensor<4>,
}

impl NetworkInput {
    /// The same of some rows and columns.
    pub fn window(&self, rows: &Range<usize>, columns: &Range<usize>) -> Self {
        let cut = |all: &Tensor<4>| {
            let [batch, channels, ..] = all.dims();
            all.clone().slice([0..batch, 0..channels, rows.clone(), columns.clone()])
        };
        Self {
            developed: cut(&self.developed),
            restored: self.restored.as_ref().map(cut),
            field: cut(&self.field),
            noise: cut(&self.noise),
        }
    }

    /// The pictures as far as the camera takes them without a network.
    pub fn picture(&self) -> Tensor<4> {
        self.restored.as_ref().unwrap_or(&self.developed).clone()
    }
}
