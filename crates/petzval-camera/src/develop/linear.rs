//! The linear ISP: what every simulated picture goes through, on the tape and off it.

use serde::{Deserialize, Serialize};

use super::Interpolation;
use crate::develop::{clip_highlights, correct_shading, develop_by, white_capacity_e};
use crate::image::{CHANNELS, LinearImage};
use crate::sensor::{Exposure, Raw, SensorError, SensorModel};
use crate::spectral::{Matrix3, apply};

/// Relative illumination below which shading is not corrected further: below it there is little but noise.
pub const SHADING_FLOOR: f32 = 0.05;

/// Development without a network.
///
/// ```text
/// raw -> clip highlights to neutral white -> dark level, white balance -> demosaic
///     -> / max(illumination, floor) -> end of the highlights -> colour matrix -> linear sRGB
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinearIsp {
    /// Relative illumination, in (0, 1], below which shading is not corrected further.
    pub shading_floor: f32,
    /// How the colours of the mosaic are interpolated.
    pub interpolation: Interpolation,
    /// Linear sRGB from white-balanced camera colours; none leaves the camera's own colours.
    pub colour_matrix: Option<Matrix3>,
}

impl Default for LinearIsp {
    fn default() -> Self {
        Self { shading_floor: SHADING_FLOOR, interpolation: Interpolation::default(), colour_matrix: None }
    }
}

impl LinearIsp {
    /// Develops a raw frame to linear light, 1 = white, three planes. `illumination` is the lens's relative illumination of the
    /// frame's pixels, of the same shape as the result.
    ///
    /// This is the readable reference of [`linear_isp_op`](crate::tape::linear_isp_op).
    pub fn develop(
        &self,
        raw: &Raw,
        illumination: &LinearImage,
        sensor: &SensorModel,
    ) -> Result<LinearImage, SensorError> {
        // Where one colour saturates, the others end at the level of white too, so that highlights stay neutral.
        let clipped = clip_highlights(raw, sensor)?;
        let balanced = develop_by(&clipped, &self.interpolation, sensor)?;
        let mut picture = correct_shading(&balanced, illumination, self.shading_floor)?;
        // The shading gain must not lift the clipped level in the corners above that on the axis.
        let highest = highest_light(sensor, &raw.capture.exposure)?;
        picture.data.iter_mut().for_each(|value| *value = value.min(highest));
        if let Some(matrix) = &self.colour_matrix {
            let n = picture.height * picture.width;
            for i in 0..n {
                let camera = [0, 1, 2].map(|c| f64::from(picture.data[c * n + i]));
                for (c, value) in apply(matrix, camera).into_iter().enumerate().take(CHANNELS) {
                    picture.data[c * n + i] = value as f32;
                }
            }
        }
        Ok(picture)
    }
}

/// Linear light at which highlights end, 1 = white: where white light saturates the first colour.
pub(crate) fn highest_light(sensor: &SensorModel, exposure: &Exposure) -> Result<f32, SensorError> {
    let capacity_e = white_capacity_e(sensor, exposure.time_s.into(), exposure.linear_gain.into())?;
    Ok((capacity_e / f64::from(exposure.white_e)) as f32)
}
